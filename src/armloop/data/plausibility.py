"""Plausibility of a recorded motion: range checks, spikes, and the consistency of v with dq/dt (analytical redundancy).

Pure arrays, no file and no arm: what is found carries the column and the row, and whoever read the arrays says where
they came from. Rates are compared over windows of 50 ms, ∫v dt against the change of q, so that neither rounding nor
jitter of the stamps matters; measured arms agree within 2 % while they move.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armloop.util.arrays import TINY, Array

# No joint of an arm turns beyond, moves faster, accelerates harder or bears more (rad, rad/s, rad/s², N·m or A).
_LARGEST = {"q": 1e4, "v": 1e3, "vdot": 1e6, "tau": 1e6}
# A joint that turns beyond the first at more than the second is not in rad and rad/s (m and m/s).
_LARGEST_Q, _LARGEST_V = 30.0, 20.0
# A spike is no longer than so many samples, and so many times as large as all else in so many samples at least.
_SPIKE_SAMPLES, _SPIKE_RATIO, _FEWEST = 3, 10.0, 20
_SPIKE_LEAST = {"q": 0.1, "v": 1.0, "vdot": 100.0, "tau": 1.0}
# A jump of q: rad or m beyond what the neighbouring rates explain, and so many times what is usual in the log.
_JUMP, _UNUSUAL = 0.1, 30.0
# Window of the comparison of rates, s, and the rate (rms, rad/s or m/s) from which a joint is judged.
_WINDOW, _MOVES = 0.05, 0.05
# Rate of v (rms, rad/s² or m/s²) from which vdot is judged by it.
_ACCELERATES = 0.5
# So long may one column stand still while the other moves, s.
_FROZEN = 0.2
# Windows that are compared at most, and rows that tell whether a log is a time series.
_WINDOWS, _SERIES_ROWS = 5_000, 20_000
# Lags that are tried, and the one from which on it is said, s.
_LAGS, _LAG = np.arange(-0.03, 0.0301, 0.001), 0.0035
# v that is proportional to the rate of q, at such a correlation, by a factor so far from one.
_ALIKE, _OFF = 0.998, 0.05
# Torque is cut off where so many of the rows hold its extreme, so many times as many as any of so many values beside it; a
# sensor that knows fewer values than the last rounds.
_CUT, _PILED, _BESIDE, _LEVELS = 0.01, 10, 5, 50


@dataclass(frozen=True)
class Finding:
    """What is wrong, or doubtful, with some columns of a log; a sentence with ``columns`` as its subject.

    Attributes:
        columns: such as ``"column v2"``.
        text: what is wrong and what would be right.
        row: index of the row from 0, or None where no single row is at fault.
    """

    columns: str
    text: str
    row: int | None = None


@dataclass(frozen=True, eq=False)
class Recorded:
    """A recorded motion of n joints at N instants in runs without gaps, and what the checks share.

    time (N,), q, v, tau (N, n), vdot (N, n) or None; ``derived``: v was differentiated from q.
    """

    time: Array
    q: Array
    v: Array
    tau: Array
    vdot: Array | None
    runs: Sequence[slice]
    derived: bool = False


def faults(log: Recorded) -> Iterator[Finding]:
    """Yield what no arm can have done, the plainest first; the arrays are finite and time rises."""
    yield from _out_of_range(log)
    yield from _spikes(log)
    yield from _degrees(log)
    if not is_time_series(log.q, log.runs):
        return  # independent samples of an inverse dynamics: no rates to compare
    windows = None if log.derived else _windows(log)
    if windows is not None:
        yield from _scale(windows)
        yield from _dead_columns(log, windows)
        yield from _frozen(log, windows.path)
    yield from _jumps(log)
    if windows is not None:
        yield from _unlike(windows)
    yield from _accelerations(log)


def doubts(log: Recorded) -> Iterator[Finding]:
    """Yield what may be right and should be known: a torque that is cut off, v that lags or disagrees, few samples."""
    yield from _saturated(log)
    if not is_time_series(log.q, log.runs):
        return
    if log.derived:
        yield Finding("columns v", "are missing; v is the derivative of q")
    else:
        yield from _disagreements(log)
    steps = np.diff(log.time)
    rate = 1 / float(np.median(steps))
    if rate < 50.0:
        yield Finding(
            "column time",
            f"has {rate:.3g} samples a second; accelerations and reversals of friction need 100 or more",
        )


def is_time_series(q: Array, runs: Sequence[slice]) -> bool:
    """Whether rows follow one another in time: von Neumann's ratio of the ranks (Bartels 1982) is far below 2.

    Samples drawn at random have a ratio of 2 ± 2/sqrt(N); ranks keep single spikes from deciding.
    """
    q = q[:_SERIES_ROWS]
    inside = np.concatenate([np.arange(run.start, min(run.stop, len(q)) - 1) for run in runs])
    if len(inside) == 0:
        return False
    ranks = np.argsort(np.argsort(q, axis=0, kind="stable"), axis=0, kind="stable").astype(float)
    steps = np.mean(np.square(ranks[inside + 1] - ranks[inside]), axis=0)
    ratio = steps / np.maximum(np.var(ranks, axis=0), TINY)
    return bool(ratio.min() < 2.0 - max(1.0, 8.0 / np.sqrt(len(inside))))


def _signals(log: Recorded) -> Iterator[tuple[str, int, Array]]:
    for kind, values in (("q", log.q), ("v", log.v), ("tau", log.tau), ("vdot", log.vdot)):
        if values is None or (kind == "v" and log.derived):
            continue
        for j in range(values.shape[1]):
            yield kind, j, values[:, j]


def _out_of_range(log: Recorded) -> Iterator[Finding]:
    for kind, j, x in _signals(log):
        row = int(np.argmax(np.abs(x)))
        if abs(x[row]) > _LARGEST[kind]:
            yield Finding(
                f"column {kind}{j + 1}",
                f"holds {x[row]:.6g}, more than any arm's joint can do (SI units); correct it or drop the row",
                row,
            )


def _spikes(log: Recorded) -> Iterator[Finding]:
    if len(log.time) < _FEWEST:
        return  # a few samples do not say what is usual
    for kind, j, x in _signals(log):
        if kind == "vdot":
            continue  # recorded accelerations are differences; their peaks say nothing
        away = np.abs(x - np.median(x))
        peak = float(away.max())
        if peak < _SPIKE_LEAST[kind]:
            continue
        high = np.flatnonzero(away > 0.5 * peak)
        # told apart by their ends alone: an array each would be one a sample where samples follow no path
        ends = np.append(np.flatnonzero(np.diff(high) > 1), len(high) - 1)
        if len(ends) > 5 or np.diff(ends, prepend=-1).max() > _SPIKE_SAMPLES:
            continue
        rest = np.delete(away, high)
        if len(rest) and peak > _SPIKE_RATIO * max(float(rest.max()), _SPIKE_LEAST[kind] / _SPIKE_RATIO):
            row = int(np.argmax(away))
            yield Finding(
                f"column {kind}{j + 1}",
                f"has a spike of {x[row]:.6g}, while all else lies within {rest.max():.3g} of the median; "
                "correct it or drop the row",
                row,
            )


def _degrees(log: Recorded) -> Iterator[Finding]:
    for j in range(log.q.shape[1]):
        farthest, fastest = np.abs(log.q[:, j]).max(), np.abs(log.v[:, j]).max()
        if farthest > _LARGEST_Q and fastest > _LARGEST_V:
            yield Finding(
                f"columns q{j + 1}, v{j + 1}",
                f"reach {farthest:.3g} and {fastest:.3g}, more than any arm's joint in rad (m) and rad/s (m/s); "
                "convert degrees (mm) to SI units",
            )


def _jumps(log: Recorded) -> Iterator[Finding]:
    """Steps of q that the rates before and after do not explain: wrapped angles, runs joined without a gap."""
    for run in log.runs:
        if run.stop - run.start < 5:
            continue
        q, dt = log.q[run], np.diff(log.time[run])[:, None]
        step = np.diff(q, axis=0)
        # the rate over both neighbours: of one whose stamps nearly coincide alone it would be without bound
        rate = (step[2:] + step[:-2]) / (dt[2:] + dt[:-2])
        jump = np.abs(step[1:-1] - dt[1:-1] * rate)
        for j in range(q.shape[1]):
            row = int(np.argmax(jump[:, j]))
            size, usual = float(jump[row, j]), float(np.quantile(jump[:, j], 0.95))
            fastest = 0.0 if log.derived else float(np.abs(log.v[run, j]).max() * dt[row + 1, 0])
            if size > max(_JUMP, _UNUSUAL * usual, 5 * fastest):
                change = float(step[row + 1, j])
                turns = abs(change) / (2 * np.pi)
                wrapped = round(turns) >= 1 and abs(turns - round(turns)) < 0.02
                yield Finding(
                    f"column q{j + 1}",
                    f"jumps by {change:.4g} from the row before"
                    + (
                        ", as where an angle wraps; unwrap it"
                        if wrapped
                        else "; leave a gap in time between runs"
                    ),
                    run.start + row + 2,
                )


@dataclass(frozen=True, eq=False)
class _Windows:
    """Changes of q (W, n) over windows and ∫v dt over the same windows.

    start, end: (W,) instants; ``path`` (N, n) is ∫v dt from the first sample, by the trapezoidal rule.
    """

    start: Array
    end: Array
    change: Array
    integral: Array
    path: Array

    def rates(self) -> tuple[Array, Array]:
        """(n,) rms of dq/dt and of v."""
        length = float(np.mean(self.end - self.start))
        change, integral = (np.sqrt(np.mean(np.square(x), axis=0)) for x in (self.change, self.integral))
        return change / length, integral / length

    def moving(self) -> list[int]:
        """The joints that move by q and by v."""
        of_q, of_v = self.rates()
        return [int(j) for j in np.flatnonzero((of_q > _MOVES) & (of_v > _MOVES))]

    def similarity(self) -> Array:
        """(n, n) correlation of the rate of each q with each v."""
        products = self.change.T @ self.integral
        sizes = np.outer(np.linalg.norm(self.change, axis=0), np.linalg.norm(self.integral, axis=0))
        return np.asarray(products / np.maximum(sizes, TINY))


def _windows(log: Recorded) -> _Windows | None:
    """None where no run is long enough for a few of them."""
    steps = 0.5 * (log.v[1:] + log.v[:-1]) * np.diff(log.time)[:, None]
    path = np.concatenate([np.zeros((1, log.v.shape[1])), np.cumsum(steps, axis=0)])
    width = max(1, round(_WINDOW / float(np.median(np.diff(log.time)))))
    first = np.concatenate([np.arange(run.start, max(run.start, run.stop - width)) for run in log.runs])
    first = first[:: max(1, len(first) // _WINDOWS)]
    if len(first) < 10:
        return None
    last = first + width
    return _Windows(
        log.time[first], log.time[last], log.q[last] - log.q[first], path[last] - path[first], path
    )


def _scale(windows: _Windows) -> Iterator[Finding]:
    """v that is proportional to the rate of q, by a factor that is not one."""
    similar = windows.similarity()
    of_q, of_v = windows.rates()
    for j in np.flatnonzero((np.maximum(of_q, of_v) > _MOVES) & (np.minimum(of_q, of_v) > 0)):
        factor = float(similar[j, j] * of_v[j] / of_q[j])
        if abs(similar[j, j]) > 0.9 and not 0.5 < factor < 2.0:
            yield Finding(
                f"column v{j + 1}",
                f"is {factor:.3g} times the rate of q{j + 1}, {_likely_cause(factor)}; "
                "time, q and v must be in s, rad (m) and rad/s (m/s)",
            )


def _accelerations(log: Recorded) -> Iterator[Finding]:
    """vdot that is proportional to the rate of v, by a factor that is not one, or that stands beside a v that changes."""
    if log.vdot is None:
        return
    windows = _windows(replace(log, q=log.v, v=log.vdot, vdot=None))
    if windows is None:
        return
    similar = windows.similarity()
    of_v, of_vdot = windows.rates()
    for j in np.flatnonzero(of_v > _ACCELERATES):
        factor = float(similar[j, j] * of_vdot[j] / of_v[j])
        if of_vdot[j] < 0.02 * of_v[j]:
            yield Finding(
                f"column vdot{j + 1}",
                f"is next to zero, while v{j + 1} changes; leave out all columns vdot to have v differentiated",
            )
        elif abs(similar[j, j]) > 0.9 and not 0.5 < factor < 2.0:
            yield Finding(
                f"column vdot{j + 1}",
                f"is {factor:.3g} times the rate of v{j + 1}; it must be in rad/s² (m/s²), or left out",
            )


def _dead_columns(log: Recorded, windows: _Windows) -> Iterator[Finding]:
    """One of q and v that does nothing while the other one moves."""
    for j, (of_q, of_v) in enumerate(zip(*windows.rates(), strict=True)):
        q, v = f"q{j + 1}", f"v{j + 1}"
        if of_q > _MOVES and of_v < 0.02 * of_q:
            yield Finding(
                f"column {v}",
                f"is {'' if not log.v[:, j].any() else 'next to '}zero throughout, while {q} moves by "
                f"{np.ptp(log.q[:, j]):.3g}; leave out all columns v to have q differentiated",
            )
        elif of_v > _MOVES and of_q < 0.02 * of_v:
            yield Finding(
                f"column {q}",
                f"stands still throughout, while {v} reaches {np.abs(log.v[:, j]).max():.3g}; "
                "record the position of the joint",
            )


def _unlike(windows: _Windows) -> Iterator[Finding]:
    """v that is the rate of another joint, or of none."""
    similar, moving = windows.similarity(), windows.moving()
    for j in moving:
        own = similar[j, j]
        twin = max((k for k in moving if k != j), key=lambda k: abs(similar[j, k]), default=j)
        if own >= 0.5:
            continue
        if abs(similar[j, twin]) > 0.95:
            yield Finding(
                f"column v{j + 1}",
                f"is not the rate of q{j + 1} (correlation {own:.2f}), v{twin + 1} is ({similar[j, twin]:.2f}); "
                "put the columns in the order of the joints",
            )
        else:
            yield Finding(
                f"column v{j + 1}",
                f"has little to do with the rate of q{j + 1} (correlation {own:.2f}); "
                "leave out all columns v to have q differentiated",
            )


def _frozen(log: Recorded, integral: Array) -> Iterator[Finding]:
    """Stretches in which a column stays the same to the last digit while the other one moves."""
    for run in log.runs:
        time, q, v, path = log.time[run], log.q[run], log.v[run], integral[run]
        for j in range(q.shape[1]):
            for kind, same, other in (
                ("q", np.diff(q[:, j]) == 0, path[:, j]),
                ("v", v[1:, j] == 0, q[:, j]),
            ):
                first, last = _stretches(same)
                length, travel = time[last] - time[first], other[last] - other[first]
                wrong = (last - first >= 5) & (length >= _FROZEN)
                wrong &= np.abs(travel) > np.maximum(_MOVES * length, 0.02)
                for k in np.flatnonzero(wrong)[:1]:
                    moves = f"v{j + 1} adds up to" if kind == "q" else f"q{j + 1} moves by"
                    yield Finding(
                        f"column {kind}{j + 1}",
                        f"{'stands still' if kind == 'q' else 'is zero'} for {length[k]:.3g} s from here on, "
                        f"while {moves} {travel[k]:.3g}; drop these rows",
                        run.start + int(first[k]),
                    )


def _stretches(same: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First and last sample of every stretch whose steps are all ``same``."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], same.astype(np.int8), [0]])))
    return edges[::2], edges[1::2]


def _disagreements(log: Recorded) -> Iterator[Finding]:
    """v that lags, or that is near the rate of q and not equal to it."""
    windows = _windows(log)
    inside = None if windows is None else _far_from_the_ends(log, windows)
    if windows is None or inside is None or inside.sum() < 10:
        return
    windows = replace(
        windows,
        **{key: getattr(windows, key)[inside] for key in ("start", "end", "change", "integral")},
    )
    lags = []
    of_q, of_v = windows.rates()
    for j in windows.moving():
        similar = float(windows.similarity()[j, j])
        factor = similar * float(of_v[j] / of_q[j])
        if similar > _ALIKE and abs(factor - 1) > _OFF:
            yield Finding(
                f"column v{j + 1}",
                f"is {factor:.3g} times the rate of q{j + 1}; leave out all columns v to have q differentiated",
            )
            continue
        size = float(np.mean(np.square(windows.change[:, j])))
        errors = [_error(log, windows, j, float(lag)) for lag in _LAGS]
        best = int(np.argmin(errors))
        # A steady speed says nothing of a lag: shifting v must explain a good part of what differs.
        if 0 < best < len(_LAGS) - 1:
            clear = errors[best] < 0.75 * errors[len(_LAGS) // 2]
            lags.append(_vertex(_LAGS, errors, best) if clear else 0.0)
        left = float(np.sqrt(errors[best] / size))
        if left > 0.2:
            yield Finding(
                f"column v{j + 1}",
                f"differs from the rate of q{j + 1} by {left:.0%}; leave out all columns v to have q differentiated",
            )
    lag = float(np.median(lags)) if lags else 0.0
    if abs(lag) > _LAG:
        yield Finding(
            "columns v",
            f"{'lag behind' if lag > 0 else 'lead'} dq/dt by {1e3 * abs(lag):.1f} ms; "
            "leave them out to have q differentiated",
        )


def _saturated(log: Recorded) -> Iterator[Finding]:
    """A torque that is cut off: while the arm moves, far more rows hold its extreme than any other value near it."""
    moves = np.append(False, (np.diff(log.q, axis=0) != 0).any(axis=1))
    for j, x in enumerate(log.tau[moves].T):
        values, counts = np.unique(x, return_counts=True)
        if len(values) < _LEVELS:
            continue  # a coarse sensor, or none
        for end, beside in ((0, slice(1, _BESIDE + 1)), (-1, slice(-1 - _BESIDE, -1))):
            share = counts[end] / len(x)
            if values[end] != 0 and share > _CUT and counts[end] > _PILED * counts[beside].max():
                yield Finding(
                    f"column tau{j + 1}",
                    f"is {values[end]:.6g} to the last digit in {share:.0%} of the rows, as where a sensor or a drive "
                    "saturates; leave out those parts",
                )


def _far_from_the_ends(log: Recorded, windows: _Windows) -> NDArray[np.bool_]:
    """(W,) windows that stay within their run at every lag that is tried."""
    first = np.array([log.time[run.start] for run in log.runs])
    last = np.array([log.time[run.stop - 1] for run in log.runs])
    run = np.searchsorted(first, windows.start, side="right") - 1
    return np.asarray((windows.start + _LAGS[0] >= first[run]) & (windows.end + _LAGS[-1] <= last[run]))


def _error(log: Recorded, windows: _Windows, j: int, lag: float) -> float:
    """Mean square of what q changes beyond ∫v dt recorded ``lag`` later."""
    later = (
        np.interp(instants + lag, log.time, windows.path[:, j]) for instants in (windows.end, windows.start)
    )
    return float(np.mean(np.square(windows.change[:, j] - next(later) + next(later))))


def _vertex(x: Array, y: Sequence[float], k: int) -> float:
    """Where the parabola through three neighbouring points is lowest."""
    before, here, after = y[k - 1], y[k], y[k + 1]
    bend = before - 2 * here + after
    return float(x[k] + 0.5 * (x[1] - x[0]) * (before - after) / bend) if bend > 0 else float(x[k])


def _likely_cause(ratio: float) -> str:
    causes = {
        180 / np.pi: "as if v were in deg/s",
        np.pi / 180: "as if q were in degrees",
        1e3: "as if time were in milliseconds or v in mm/s",
        1e-3: "as if q were in mm",
        30 / np.pi: "as if v were in revolutions per minute",
        1 / (2 * np.pi): "as if v were in revolutions per second",
        2 * np.pi: "as if q were in revolutions",
        1 / 60: "as if time were in minutes",
    }
    if ratio < 0:
        return "the opposite sign" if 0.8 < -ratio < 1.25 else "which is not one"
    factor = min(causes, key=lambda each: abs(np.log(ratio / each)))
    return causes[factor] if 0.8 < ratio / factor < 1.25 else "which is not one"
