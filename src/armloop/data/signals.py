"""Preprocessing of motion logs: resampling to one uniform grid, one low-pass filter (:mod:`armloop.data.filters`), one
differentiation.

Parallel filtering (Gautier 1997): a column is computed of the motion and passes the same zero-phase low-pass as the
torque (:func:`smooth`), so that both stay together in time and lose the same. The motion itself passes one of twice the
corner first, which keeps noise out of products and derivatives and takes next to nothing away below the torque's corner.
Runs are treated one by one, never across a gap.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from armloop.data.dropouts import later, repaired
from armloop.data.filters import INDEPENDENT, SMEAR, WIDER, LowPass, at_least, filter_reach
from armloop.data.log import FEWEST_SAMPLES, MotionLog
from armloop.data.motion import Motion, Samples
from armloop.data.rate_noise import central_differences
from armloop.data.recorded import Recorded
from armloop.util.arrays import PER_MEDIAN, Array, Mask
from armloop.util.errors import LogError

#: A run lasts at least so many times as long as the filter reaches; two of them are cut off at its ends.
_SHORTEST = 6
#: A lag that is a smaller part of a period of the corner is not felt below it.
FELT = 0.01
#: Periods that differ by less than this part are one.
_ALIKE = 0.01
#: The largest speed of a log is this quantile, and a joint gets somewhere in it that travels so far, rad or m.
_FASTEST, _TRAVELS = 0.995, 0.02
#: Hz; a filter of a lower corner would need hours of a log.
LOWEST_CORNER = 1e-3


@dataclass(frozen=True)
class Conditioning:
    """How a log is prepared; kept in the model file, so that later logs are prepared alike.

    Attributes:
        cutoff_hz: corner of the torque's :class:`armloop.data.filters.LowPass`; 0 leaves the samples as they are (for
            inverse-dynamics samples that are no time series).
        oversampling: samples kept per period of the corner frequency; where a direction reverses, friction
            steps, and on a coarse grid the step would lie up to half a sample off.
        dead_zone: a joint counts as moving above this many standard deviations of its velocity noise.
        smear: periods of the corner around a standstill in which a joint does not count as moving, because
            the filter smears the torque of the standstill that far.
        torque_lag: seconds by which the torque is recorded later than the motion (negative: earlier), a property of who
            records: it is moved back.

    Raises:
        ValueError: a setting is no number, or out of range.
    """

    cutoff_hz: float = 10.0
    oversampling: float = 25.0
    dead_zone: float = 4.0
    smear: float = SMEAR
    torque_lag: float = 0.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            size = abs(value) if name == "torque_lag" and isinstance(value, int | float) else value
            if not isinstance(value, int | float) or not 0 <= size < np.inf:
                raise ValueError(f"{name} must be a number of at least 0, not {value!r}")
        if 0 < self.cutoff_hz < LOWEST_CORNER:
            raise ValueError(
                f"cutoff_hz must be 0 for no filter, or at least {LOWEST_CORNER:g}, not {self.cutoff_hz!r}"
            )
        if self.oversampling == 0:
            raise ValueError("oversampling must be positive")

    @property
    def reach(self) -> float:
        """Seconds to either side over which the low-pass smears a step."""
        return filter_reach(self.cutoff_hz)

    @property
    def shortest(self) -> float:
        """Seconds that a run must last at least."""
        return _SHORTEST * self.reach


class ShortRunError(LogError):
    """No run of a log is long enough for the filter."""


@dataclass(frozen=True, eq=False)
class Speeds:
    """What logs show of the joints' speeds, (n,) each, rad/s (m/s).

    Attributes:
        noise: standard deviation of what a filter leaves of its noise (:func:`velocity_noise`).
        fastest: the largest; infinite for a joint that gets nowhere, which others may shake.
    """

    noise: Array
    fastest: Array

    @staticmethod
    def of(log: MotionLog, cutoff_hz: float) -> Speeds:
        """Those of one log."""
        log = log.of_least_noise
        fastest = np.quantile(np.abs(log.v), _FASTEST, axis=0)
        travels = np.ptp(log.q, axis=0) >= _TRAVELS
        return Speeds(velocity_noise(log, cutoff_hz), np.where(travels, fastest, np.inf))

    @staticmethod
    def of_all(logs: Sequence[MotionLog], cutoff_hz: float) -> Speeds:
        """Those of several logs."""
        return Speeds.joined(Speeds.of(log, cutoff_hz) for log in logs)

    @staticmethod
    def joined(each: Iterable[Speeds]) -> Speeds:
        """Those of the noisiest log, and of the one in which a joint goes fastest, joint by joint."""
        noises, speeds = zip(*((own.noise, own.fastest) for own in each), strict=True)
        known = np.where(np.isfinite(speeds), speeds, 0.0).max(axis=0)
        return Speeds(np.max(noises, axis=0), np.where(known > 0, known, np.inf))


def uniform_period(time: Array) -> float:
    """The mean sample period of a run of at least two samples, s.

    A median of the steps would carry their rounding, which counts where stamps are seconds since 1970.
    """
    return float(time[-1] - time[0]) / (len(time) - 1)


def derivative(x: Array, period: float) -> Array:
    """Central difference along the first axis (second order at the ends)."""
    return np.gradient(x, period, axis=0, edge_order=2)


def preprocess(
    logs: Sequence[MotionLog],
    how: Conditioning,
    speeds: Speeds | None = None,
    felt_hz: float | None = None,
) -> Samples:
    """Prepare logs for regression: resample, filter, differentiate, trim, decimate.

    Each run is put on a uniform grid (cubic splines where its stamps jitter), filtered, and thinned to
    ``oversampling`` samples per period of the corner, all to the rate of the slowest. Half a period of the corner is cut
    at both ends.
    ``vdot`` is the filtered log's own column, else the derivative of the filtered v.

    Args:
        speeds: what is known from more logs than these.
        felt_hz: corner below which a lag of v is felt, where several filters are to see the same v; the filter's by default.

    Returns:
        The samples of all runs, one after the other; ``moving`` is false within ``smear`` periods of
        the corner of any instant at which the joint is inside its dead zone, or its torque is no measurement
        (:mod:`armloop.data.dropouts`).

    Raises:
        ShortRunError: no run is long enough for the filter.
    """
    if how.cutoff_hz <= 0:
        return _as_they_are(logs)
    logs = [log.of_least_noise for log in logs]
    if speeds is None:
        speeds = Speeds.of_all(logs, how.cutoff_hz)
    parts, spans = [], []
    felt_hz = how.cutoff_hz if felt_hz is None else felt_hz
    for log in logs:
        lag = log.velocity_lag
        fresh = repaired(log.record, lag if lag * felt_hz >= FELT else 0.0)
        for run in log.runs():
            part = _condition_run(fresh, run, how, how.dead_zone * speeds.noise)
            if part is not None:
                parts.append(part)
                spans.append(log.time[[run.start, run.stop - 1]])
    if not parts:
        longest = max(float(np.ptp(log.time[run])) for log in logs for run in log.runs())
        raise ShortRunError(
            f"log {logs[0].name}: the longest run without a gap lasts {longest:.3g} s; with a filter of "
            f"{how.cutoff_hz:g} Hz a run must last at least {how.shortest:.3g} s"
        )
    # All at the period of the coarsest, on cubic splines: they have passed the filter, and even the coarsest keeps what has.
    coarsest = max(_period(part[0]) for part in parts)
    parts = [
        _thinned(part, coarsest) if _differ(_period(part[0]) or coarsest, coarsest) else part
        for part in parts
    ]
    starts = np.cumsum([0] + [len(part[0]) for part in parts[:-1]])
    time, q, v, vdot, tau, moving, lost = (np.concatenate(column) for column in zip(*parts, strict=True))
    period = _period(parts[0][0]) or 1.0
    motion = Motion(time, q, v, vdot, starts, np.array(spans)[:, 0])
    return Samples(
        motion,
        tau,
        moving & ~lost,
        period,
        how.cutoff_hz,
        np.array(spans),
        WIDER,
        lost if lost.any() else None,
        speeds.fastest,
        speeds.noise,
    )


def kept_instants(log: MotionLog, how: Conditioning) -> tuple[list[Array], Array]:
    """Instants, s, that :func:`preprocess` keeps of each run that is long enough, and (R, 2) those runs' first and last."""
    kept, spans = [], []
    for run in log.runs():
        time = log.time[run]
        grid, keep = _grid(time, how)
        if grid is not None:
            kept.append(time[0] + grid[keep])
            spans.append(time[[0, -1]])
    return kept, np.array(spans).reshape(-1, 2)


def too_short(log: MotionLog, how: Conditioning) -> int:
    """Samples in runs that are too short for the filter: :func:`preprocess` leaves them out."""
    if how.cutoff_hz <= 0:
        return 0
    return sum(run.stop - run.start for run in log.runs() if _grid(log.time[run], how)[0] is None)


def velocity_noise(log: MotionLog, cutoff_hz: float) -> Array:
    """(n,) standard deviation of the noise that a filter of this corner leaves in v.

    It is taken to be as strong below the corner as in the octave above it, where there is hardly any
    motion; the median keeps impacts and reversals out. Where v stands still to the last digit a stuck joint shows none
    of it, and that does not count. It is never less than what rounding the recorded v leaves. Of a log without a run
    long enough for a filter it is zero.
    """
    from scipy.ndimage import binary_dilation

    runs = [run for run in log.runs() if run.stop - run.start >= FEWEST_SAMPLES]
    if not runs:
        return np.zeros(log.joints)
    octaves, steps = [], []
    for run in runs:
        v, period = log.v[run], uniform_period(log.time[run])
        octave = np.abs(LowPass(2 * cutoff_hz, period)(v) - LowPass(cutoff_hz, period)(v))
        steps.append(np.abs(np.diff(v, axis=0)))
        changes = np.vstack([steps[-1], steps[-1][-1:]]) > 1e-12
        reach = at_least(0.5 / (cutoff_hz * period))
        octaves.append(np.where(binary_dilation(changes, np.ones((2 * reach + 1, 1))), octave, np.nan))
    moves = np.concatenate(octaves)
    moves[:, np.isnan(moves).all(axis=0)] = 0.0
    rough = PER_MEDIAN * np.nanmedian(moves, axis=0)
    every = np.concatenate(steps)
    resolution = np.min(np.where(every > 1e-12, every, np.inf), axis=0)
    rounding = np.where(np.isfinite(resolution), resolution, 0.0) / np.sqrt(12)
    period = uniform_period(log.time[max(runs, key=lambda run: run.stop - run.start)])
    return np.maximum(rough, rounding * np.sqrt(min(1.0, 2 * cutoff_hz * period)))


def smooth(samples: Samples, x: Array, runs: Sequence[slice] | None = None) -> Array:
    """Pass x (N, ...) through the filter that the samples' torque has passed, run by run.

    Whatever is computed of the motion must lose what the measured torque has lost before the two are compared.

    Args:
        runs: those of the samples' runs to treat; all by default.
    """
    for period, alike in _rates(samples, runs).items():
        x = LowPass(samples.cutoff_hz, period).each(x, alike)
    return x


def rate_along(samples: Samples, x: Array) -> Array:
    """(N, ...) rate of x (N, ...) along every run, per second; zero where samples are no time series."""
    return central_differences(samples.motion.time, x, samples.motion.runs() if samples.cutoff_hz > 0 else [])


def as_torque(samples: Samples) -> Samples:
    """The samples with the motion filtered like the torque.

    For columns that are too many, or no columns, to be filtered: sums of products of the motion's functions, motion regimes.
    Steps in them are not smeared.
    """
    if samples.cutoff_hz <= 0 or samples.wider <= 1:
        return samples
    motion = samples.motion
    together = smooth(samples, np.hstack([motion.q, motion.v, motion.vdot]))
    q, v, vdot = np.split(together, 3, axis=1)
    return replace(samples, motion=replace(motion, q=q, v=v, vdot=vdot), wider=1.0)


def independent_rows(samples: Samples) -> Mask:
    """(N,) every so many samples that :data:`INDEPENDENT` are left per period of the corner."""
    rows = np.zeros(samples.motion.samples, dtype=bool)
    for period, runs in _rates(samples).items():
        corner = samples.cutoff_hz * period
        stride = max(1, int(1 / INDEPENDENT / corner + 1e-6)) if corner > 0 else 1
        for run in runs:
            rows[run.start : run.stop : stride] = True
    return rows


def _rates(samples: Samples, runs: Sequence[slice] | None = None) -> dict[float, list[slice]]:
    """The runs by sample period, s: that of the samples for all that have it but for the rounding of their stamps."""
    rates: dict[float, list[slice]] = {}
    for run in samples.motion.runs() if runs is None else runs:
        own = _period(samples.motion.time[run])
        rates.setdefault(own if own and _differ(own, samples.period) else samples.period, []).append(run)
    return rates


def _period(time: Array) -> float:
    """The period of a run, s; 0 of a single sample."""
    return uniform_period(time) if len(time) > 1 else 0.0


def _differ(a: float, b: float) -> bool:
    return abs(a - b) > _ALIKE * b


def _thinned(part: tuple[Any, ...], period: float) -> tuple[Any, ...]:
    from scipy.interpolate import CubicSpline

    elapsed = part[0] - part[0][0]
    grid = np.arange(0.0, elapsed[-1], period)
    after = np.clip(np.searchsorted(elapsed, grid), 1, len(elapsed) - 1)
    values = (CubicSpline(elapsed, x)(grid) for x in part[1:5])
    moving, lost = part[5:]
    return part[0][0] + grid, *values, moving[after] & moving[after - 1], lost[after] | lost[after - 1]


def _condition_run(log: Recorded, run: slice, how: Conditioning, dead_zone: Array) -> tuple[Any, ...] | None:
    from scipy.interpolate import CubicSpline
    from scipy.ndimage import binary_dilation

    time = log.time[run]
    grid, keep = _grid(time, how)
    if grid is None:
        return None
    period = uniform_period(time)
    # From the run's start: what stamps far from zero lose to rounding must not grow along the run.
    elapsed = time - time[0]
    resolution = 2 * float(np.spacing(np.abs(time[[0, -1]]).max()))
    even = bool(np.abs(grid - elapsed).max() < 1e-3 * period + resolution)

    def on_grid(x: Array) -> Array:
        return x[run] if even else CubicSpline(elapsed, x[run])(grid)

    low_pass = LowPass(WIDER * how.cutoff_hz, period)
    q, v, tau = (on_grid(x) for x in (log.q, log.v, log.tau))
    slow, tau = np.split(LowPass(how.cutoff_hz, period)(np.hstack([v, tau])), 2, axis=1)
    tau = later(grid, tau, how.torque_lag) if how.torque_lag else tau
    q, v = np.split(low_pass(np.hstack([q, v])), 2, axis=1)
    vdot = derivative(v, period) if log.vdot is None else low_pass(on_grid(log.vdot))
    still = np.abs(slow) <= dead_zone
    turned = slow[1:] * slow[:-1] < 0  # between two samples, however fast
    still[1:] |= turned
    still[:-1] |= turned
    reach = at_least(how.smear / (how.cutoff_hz * period))
    around = np.ones((2 * reach + 1, 1))
    smeared = binary_dilation(still, around)
    lost = np.zeros_like(still)
    if log.lost is not None:
        nearest = np.clip(np.searchsorted(elapsed, grid + how.torque_lag - 0.5 * period), 0, len(grid) - 1)
        lost = binary_dilation(log.lost[run][nearest], around)
    return time[0] + grid[keep], q[keep], v[keep], vdot[keep], tau[keep], ~smeared[keep], lost[keep]


def _grid(time: Array, how: Conditioning) -> tuple[Any, slice]:
    """A run's uniform grid (N,), s from its start, and which of it is kept; None for a run too short for the filter."""
    if len(time) < FEWEST_SAMPLES:
        return None, slice(0)
    period = uniform_period(time)
    trim = at_least(how.reach / period)
    if len(time) < _SHORTEST * trim:
        return None, slice(0)
    # A whole ratio must not fall to the next by rounding: 500 Hz at 25 samples per period of 10 Hz is every second.
    stride = max(1, int(1 / (how.oversampling * how.cutoff_hz * period) + 1e-6))
    return period * np.arange(len(time)), slice(trim, len(time) - trim, stride)


def _as_they_are(logs: Sequence[MotionLog]) -> Samples:
    for log in logs:
        if log.vdot is None:
            raise LogError(
                f"log {log.name}: without a filter the log must bring its own columns vdot1..vdot{log.joints}"
            )
    q, v, vdot, tau = (
        np.concatenate([np.asarray(getattr(log, key)) for log in logs]) for key in ("q", "v", "vdot", "tau")
    )
    # Samples that are no time series are independent: a second apart, each is a block of its own to hold out.
    time = np.arange(float(len(q)))
    starts = np.cumsum([0] + [len(log.time) for log in logs[:-1]])
    return Samples(Motion(time, q, v, vdot, starts), tau, np.ones_like(q, dtype=bool), 1.0)
