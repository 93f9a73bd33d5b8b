"""Analytical redundancy of a record: v against dq/dt, how late it is, and vdot against dv/dt.

Rates are compared over windows of 50 ms, ∫v dt against the change of q, so that neither rounding nor jitter of the stamps
matters; measured arms agree within 2 % while they move.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from armloop.data.recorded import Finding, Recorded
from armloop.util.arrays import TINY, Array, stretches

# Window of the comparison of rates, s, and the rate (rms, rad/s or m/s) from which a joint is judged.
_WINDOW, _MOVES = 0.05, 0.05
# Rate of v (rms, rad/s² or m/s²) from which vdot is judged by it.
_ACCELERATES = 0.5
# So long may one column stand still while the other moves, s, and so many rows.
FROZEN, FEWEST_REPEATS = 0.2, 5
# Windows that are compared at most.
_WINDOWS = 5_000
# Lags that are tried, the one from which on it is said, s, and the standard errors from which on it is one.
_LAGS, _LAG, _SURE = np.linspace(-0.06, 0.06, 121), 0.0035, 5.0
# Mean square error at the largest lag of either sign over the least, from which on a joint's motion tells of a lag.
_PLAIN = 4.0
# Joints agree whose own lags are so near the common one, and most of them, this part, must.
_AGREE, _MOST = 0.25, 0.75
# v that is proportional to the rate of q, at such a correlation, by a factor so far from one.
_ALIKE, _OFF = 0.998, 0.05


@dataclass(frozen=True, eq=False)
class Windows:
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

    def scale(self, j: int) -> tuple[float, float]:
        """How nearly v is proportional to the rate of q at a joint, as its correlation with it, and by what factor."""
        similar, (of_q, of_v) = float(self.similarity()[j, j]), self.rates()
        return similar, similar * float(of_v[j] / of_q[j])


def windows_of(log: Recorded) -> Windows | None:
    """None where no run is long enough for a few of them."""
    if len(log.time) < 2:
        return None
    steps = 0.5 * (log.v[1:] + log.v[:-1]) * np.diff(log.time)[:, None]
    path = np.concatenate([np.zeros((1, log.v.shape[1])), np.cumsum(steps, axis=0)])
    width = max(1, round(_WINDOW / float(np.median(np.diff(log.time)))))
    first = np.concatenate([np.arange(run.start, max(run.start, run.stop - width)) for run in log.runs])
    first = first[:: max(1, len(first) // _WINDOWS)]
    if len(first) < 10:
        return None
    last = first + width
    return Windows(
        log.time[first], log.time[last], log.q[last] - log.q[first], path[last] - path[first], path
    )


def scale(windows: Windows) -> Iterator[Finding]:
    """v that is proportional to the rate of q, by a factor that is not one."""
    of_q, of_v = windows.rates()
    for j in np.flatnonzero((np.maximum(of_q, of_v) > _MOVES) & (np.minimum(of_q, of_v) > 0)):
        similar, factor = windows.scale(int(j))
        if abs(similar) > 0.9 and not 0.5 < factor < 2.0:
            yield Finding(
                f"column v{j + 1}",
                f"is {factor:.3g} times the rate of q{j + 1}, {_likely_cause(factor)}; "
                "time, q and v must be in s, rad (m) and rad/s (m/s); armloop convert --suggest asks for other units",
            )


def accelerations(log: Recorded) -> Iterator[Finding]:
    """vdot that is proportional to the rate of v, by a factor that is not one, or that stands beside a v that changes."""
    if log.vdot is None:
        return
    windows = windows_of(replace(log, q=log.v, v=log.vdot, vdot=None))
    if windows is None:
        return
    of_v, of_vdot = windows.rates()
    for j in np.flatnonzero(of_v > _ACCELERATES):
        similar, factor = windows.scale(int(j))
        if of_vdot[j] < 0.02 * of_v[j]:
            yield Finding(
                f"column vdot{j + 1}",
                f"is next to zero, while v{j + 1} changes; leave out all columns vdot to have v differentiated",
            )
        elif abs(similar) > 0.9 and not 0.5 < factor < 2.0:
            yield Finding(
                f"column vdot{j + 1}",
                f"is {factor:.3g} times the rate of v{j + 1}; it must be in rad/s² (m/s²), or left out",
            )


def dead_columns(log: Recorded, windows: Windows) -> Iterator[Finding]:
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


def unlike(windows: Windows) -> Iterator[Finding]:
    """v that is the rate of another joint, or of none."""
    similar, moving = windows.similarity(), windows.moving()
    for j in moving:
        own = similar[j, j]
        twin = max((k for k in moving if k != j), key=lambda k: abs(similar[j, k]), default=j)
        # joints that move much alike may be exchanged as well
        exchanged = min(abs(similar[j, twin]), abs(similar[twin, j])) > 0.95
        if own >= (0.9 if exchanged else 0.5):
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


def frozen(log: Recorded, integral: Array) -> Iterator[Finding]:
    """Stretches in which a column stays the same to the last digit while the other one moves."""
    for run in log.runs:
        time, q, v, path = log.time[run], log.q[run], log.v[run], integral[run]
        for j in range(q.shape[1]):
            for kind, same, other in (
                ("q", np.diff(q[:, j]) == 0, path[:, j]),
                ("v", v[1:, j] == 0, q[:, j]),
            ):
                first, last = stretches(same).T
                length, travel = time[last] - time[first], other[last] - other[first]
                wrong = (last - first >= FEWEST_REPEATS) & (length >= FROZEN)
                wrong &= np.abs(travel) > np.maximum(_MOVES * length, 0.02)
                for k in np.flatnonzero(wrong)[:1]:
                    moves = f"v{j + 1} adds up to" if kind == "q" else f"q{j + 1} moves by"
                    yield Finding(
                        f"column {kind}{j + 1}",
                        f"{'stands still' if kind == 'q' else 'is zero'} for {length[k]:.3g} s from here on, "
                        f"while {moves} {travel[k]:.3g}; drop these rows",
                        run.start + int(first[k]),
                    )


def disagreements(log: Recorded) -> Iterator[Finding]:
    """v that lags, or that is near the rate of q and not equal to it."""
    windows = _inner_windows(log)
    if windows is None:
        return
    every = _errors(log, windows)
    for j, errors in every.items():
        similar, factor = windows.scale(j)
        if similar > _ALIKE and abs(factor - 1) > _OFF:
            yield Finding(
                f"column v{j + 1}",
                f"is {factor:.3g} times the rate of q{j + 1}; leave out all columns v to have q differentiated",
            )
            continue
        left = float(np.sqrt(errors.min() / np.mean(np.square(windows.change[:, j]))))
        if left > 0.2:
            yield Finding(
                f"column v{j + 1}",
                f"differs from the rate of q{j + 1} by {left:.0%}; leave out all columns v to have q differentiated",
            )
    lag = _common_lag(log, every)
    if abs(lag) > _LAG:
        yield Finding(
            "columns v",
            f"{'lag behind' if lag > 0 else 'lead'} dq/dt by {1e3 * abs(lag):.1f} ms; "
            f"{'they are taken to be that late; ' if lag > 0 else ''}leave them out to have q differentiated",
        )


def velocity_lag(log: Recorded) -> float:
    """Group delay of v behind dq/dt, s: negative if it leads; 0 if it was differentiated, or neither is sure."""
    windows = None if log.derived else _inner_windows(log)
    return 0.0 if windows is None else _common_lag(log, _errors(log, windows))


def _inner_windows(log: Recorded) -> Windows | None:
    """Windows that stay within their run at every lag that is tried; None where they are too few."""
    windows = windows_of(log)
    if windows is None:
        return None
    first, last = log.time[[[run.start, run.stop - 1] for run in log.runs]].T
    run = np.searchsorted(first, windows.start, side="right") - 1
    inside = (windows.start + _LAGS[0] >= first[run]) & (windows.end + _LAGS[-1] <= last[run])
    if inside.sum() < 10:
        return None
    keys = ("start", "end", "change", "integral")
    return replace(windows, **{key: getattr(windows, key)[inside] for key in keys})


def _errors(log: Recorded, windows: Windows) -> dict[int, Array]:
    """By joint that moves, the mean square of what q changes beyond ∫v dt, for every lag that is tried."""
    return {j: np.array([_error(log, windows, j, float(lag)) for lag in _LAGS]) for j in windows.moving()}


def _common_lag(log: Recorded, errors: dict[int, Array]) -> float:
    """The lag of largest likelihood, s, one for all joints, for they share a controller; 0 if the gain may be chance.

    Errors are normal with a variance of each joint's own; each window's length is one observation. Only joints count at
    which a lag farthest from the best would be plain: a steady speed fits every lag, and what it errs by is no noise. Where
    the joints do not agree, it is no lag of theirs.
    """
    told = [e for e in errors.values() if max(e[0], e[-1]) > _PLAIN * e.min()]
    if not told:
        return 0.0
    seconds = sum(float(np.ptp(log.time[run])) for run in log.runs)
    size = np.sum([np.log(np.maximum(e, TINY)) for e in told], axis=0)
    likelihood = -0.5 * seconds / _WINDOW * size
    best, none = int(np.argmax(likelihood)), len(_LAGS) // 2
    if not 0 < best < len(_LAGS) - 1 or likelihood[best] - likelihood[none] < 0.5 * _SURE**2:
        return 0.0
    lag = _vertex(_LAGS, np.sum([e / max(e[best], TINY) for e in told], axis=0), best)
    inner = [int(np.clip(np.argmin(e), 1, len(_LAGS) - 2)) for e in told]
    own = np.array([_vertex(_LAGS, e, k) for e, k in zip(told, inner, strict=True)])
    return lag if np.mean(np.abs(own - lag) <= _AGREE * abs(lag)) >= _MOST else 0.0


def _error(log: Recorded, windows: Windows, j: int, lag: float) -> float:
    """Mean square of what q changes beyond ∫v dt recorded ``lag`` later."""
    later = (
        np.interp(instants + lag, log.time, windows.path[:, j]) for instants in (windows.end, windows.start)
    )
    return float(np.mean(np.square(windows.change[:, j] - next(later) + next(later))))


def _vertex(x: Array, y: Array, k: int) -> float:
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
