"""Plausibility of a recorded motion: range checks, spikes, jumps, saturation, and the redundancy of q, v and vdot.

Pure arrays, no file and no arm: what is found carries the column and the row, and whoever read the arrays says where
they came from.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from armloop.data.clock import LEAST_RATE, MOST_RATE, likely_unit, sample_rate
from armloop.data.dropouts import dropouts, mended
from armloop.data.recorded import Finding, Recorded
from armloop.data.redundancy import (
    FEWEST_REPEATS,
    FROZEN,
    accelerations,
    dead_columns,
    disagreements,
    frozen,
    scale,
    unlike,
    windows_of,
)
from armloop.data.slips import slips
from armloop.util.arrays import TINY, Array

# No joint of an arm turns beyond, moves faster, accelerates harder or bears more (rad, rad/s, rad/s², N·m or A).
_LARGEST = {"q": 1e4, "v": 1e3, "vdot": 1e6, "tau": 1e6}
# A joint that turns beyond the first at more than the second is not in rad and rad/s (m and m/s).
LARGEST_Q, _LARGEST_V = 30.0, 20.0
# A spike is no longer than so many samples, and so many times as large as all else in so many samples at least.
_SPIKE_SAMPLES, _SPIKE_RATIO, _FEWEST = 3, 10.0, 20
_SPIKE_LEAST = {"q": 0.1, "v": 1.0, "vdot": 100.0, "tau": 1.0}
# A jump of q: rad or m beyond what the neighbouring rates explain, and so many times what is usual in the log.
_JUMP, _UNUSUAL = 0.1, 30.0
# A joint that moves goes so far, rad or m.
_MOVES = 1e-2
# Samples a second that tell of accelerations and reversals, and that hardly any recorder takes.
_ENOUGH, _HARDLY = 50.0, 5000.0
# Rows that tell whether a log is a time series.
_SERIES_ROWS = 20_000


def faults(log: Recorded) -> Iterator[Finding]:
    """Yield what no arm can have done, the plainest first; the arrays are finite and time rises."""
    yield from _out_of_range(log)
    yield from _spikes(log)
    yield from _degrees(log)
    if not is_time_series(log.q, log.runs):
        return  # independent samples of an inverse dynamics: no rates to compare
    yield from _clock(log)  # before the rates that it would put off
    windows = None if log.derived else windows_of(log)
    if windows is not None:
        yield from scale(windows)
        yield from dead_columns(log, windows)
        yield from frozen(log, windows.path)
    yield from _jumps(log)
    if windows is not None:
        yield from unlike(windows)
    yield from accelerations(log)


def doubts(log: Recorded) -> Iterator[Finding]:
    """Yield what may be right and should be known: spikes, a torque that is stuck or constant, an encoder that slips, v that
    lags, few samples.
    """
    if not is_time_series(log.q, log.runs):
        return
    yield from dropouts(log)
    yield from _constant_torques(log)
    for slip in slips(log):
        words = f"{slip.words(float(log.time[slip.row]))}; from there on its angle may be wrong"
        yield Finding(f"column q{slip.joint + 1}", words, slip.row)
    if log.derived:
        yield Finding("columns v", "are missing; v is the derivative of q")
    else:
        yield from disagreements(mended(log))
    rate = sample_rate(log.time)
    if rate < _ENOUGH:
        yield Finding(
            "column time",
            f"has {rate:.3g} samples a second; accelerations and reversals of friction need {_ENOUGH:g} or more, better 100",
        )
    elif rate > _HARDLY:
        yield Finding(
            "column time",
            f"has {rate:.3g} samples a second, more than recorders of arms take; check that it is in s",
        )


def _constant_torques(log: Recorded) -> Iterator[Finding]:
    for j in np.flatnonzero((np.ptp(log.tau, axis=0) == 0) & (np.ptp(log.q, axis=0) > _MOVES)).tolist():
        value = log.tau[0, j] + 0.0  # no zero is negative
        yield Finding(
            f"column tau{j + 1}",
            f"is {value:g} throughout, though the joint moves; if its torque was not recorded, leave the log out",
        )


def is_time_series(q: Array, runs: Sequence[slice]) -> bool:
    """Whether rows follow one another in time: von Neumann's ratio of the ranks (Bartels 1982) is far below 2.

    Samples drawn at random have a ratio of 2 ± 2/sqrt(N); ranks keep single spikes from deciding.
    """
    q = q[:_SERIES_ROWS]
    inside = np.concatenate([np.arange(run.start, min(run.stop, len(q)) - 1) for run in runs])
    if len(inside) == 0:
        return False
    # what stands still throughout would look smooth
    q = q[:, np.ptp(q, axis=0) > 0]
    if not q.size:
        return True
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
        if high[0] == 0 or high[-1] == len(x) - 1:
            # what begins or ends a log may be a step of which the other side is missing: friction that turns
            peak, rest = float(np.abs(x[high]).max()), np.delete(np.abs(x), high)
        if len(rest) and peak > _SPIKE_RATIO * max(float(rest.max()), _SPIKE_LEAST[kind] / _SPIKE_RATIO):
            row = int(np.argmax(away))
            yield Finding(
                f"column {kind}{j + 1}",
                f"has a spike of {x[row]:.6g}, while all else lies within {np.delete(away, high).max():.3g} of the "
                "median; "
                "correct it or drop the row",
                row,
            )


def _degrees(log: Recorded) -> Iterator[Finding]:
    for j in range(log.q.shape[1]):
        farthest, fastest = np.abs(log.q[:, j]).max(), np.abs(log.v[:, j]).max()
        if farthest > LARGEST_Q and fastest > _LARGEST_V:
            yield Finding(
                f"columns q{j + 1}, v{j + 1}",
                f"reach {farthest:.3g} and {fastest:.3g}, more than any arm's joint in rad (m) and rad/s (m/s); "
                "convert degrees (mm) to SI units: armloop convert --angle-unit deg",
            )


def _clock(log: Recorded) -> Iterator[Finding]:
    """Times that are no seconds, or samples too few to be a motion."""
    rate = sample_rate(log.time)
    if (likely := likely_unit(rate)) is not None:
        unit, in_unit = likely
        yield Finding(
            "column time",
            f"has {rate:.3g} samples a second, as if it were in {unit} ({in_unit:.4g} Hz); time must be in s (armloop "
            f"convert --suggest asks for other units), and the motion of an arm takes {LEAST_RATE:g} samples a second or "
            f"more, {MOST_RATE:g} at most",
        )


def _stuck_before(time: Array, q: Array, row: int) -> tuple[int, float] | None:
    """The first row that a position (N,) repeats until it jumps at a row and moves on, and for how long, s; else None.

    A joint that rests, and whose encoder slips then, rests after it, too.
    """
    same = np.flatnonzero(q[:row] != q[row - 1])
    first = int(same[-1]) + 1 if len(same) else 0
    seconds = float(time[row - 1] - time[first])
    soon = (time >= time[row]) & (time <= time[row] + FROZEN)
    moves_on = len(np.unique(q[soon])) > 2
    return (first, seconds) if seconds >= FROZEN and row - first > FEWEST_REPEATS and moves_on else None


def _jumps(log: Recorded) -> Iterator[Finding]:
    """Steps of q that the rates before and after do not explain: wrapped angles, encoders that slip, runs joined."""
    slipped = {(slip.joint, slip.row): slip for slip in slips(log)}
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
                stuck = _stuck_before(log.time[run], q[:, j], row + 2)
                alone = not (np.delete(jump[row], j) > _JUMP).any()  # not where runs are joined
                if stuck is not None and alone and not wrapped:
                    first, seconds = stuck
                    yield Finding(
                        f"column q{j + 1}",
                        f"stands still to the last digit for {seconds:.3g} s from here on and then jumps by "
                        f"{change:.4g}, as of an encoder that is stuck; drop these rows",
                        run.start + first,
                    )
                    continue
                slip = slipped.get((j, run.start + row + 2))
                if slip is not None and not wrapped:
                    words = slip.words(float(log.time[slip.row]))
                    yield Finding(
                        f"column q{j + 1}",
                        f"{words}; correct q{j + 1} from there on, or cut the log there",
                        slip.row,
                    )
                    continue
                yield Finding(
                    f"column q{j + 1}",
                    f"jumps by {change:.4g} from the row before"
                    + (
                        ", as where an angle wraps; armloop convert unwraps it"
                        if wrapped
                        else "; leave a gap in time between runs"
                    ),
                    run.start + row + 2,
                )
