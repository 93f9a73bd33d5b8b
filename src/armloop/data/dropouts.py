"""Sensor faults of single samples: impulse noise, stuck values, repeated rows and saturation.

Spikes of one or two samples are replaced by what lies beside them (a median filter would touch every sample), and so are
rows that repeat the positions and speeds before them, as where a bus loses packets or a log is written faster than it is
measured. A v that is late, as a controller's own low-pass makes it, is moved to where it belongs. A torque that stands still
to the last digit, or is cut off, is left out: nothing is fitted to it, and nothing is judged by it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from armloop.data.recorded import Finding, Recorded, once
from armloop.data.stamps import NEARLY, bridged, coincident
from armloop.util.arrays import PER_MEDIAN, TINY, Array, Index, stretches

#: A spike leaves and comes back by so many deviations of the steps beside it, and ends this part of it from where it began.
_SPIKE, _BACK = 15.0, 0.3
#: Steps to either side that say what is usual there, and the part of a column's samples that spikes are at most.
_BESIDE, _RARE = 15, 0.01
#: Steps away that no spike at this one reaches, and the part of the usual step that samples are apart at least.
_AWAY, _NO_GAP = 3, 0.1
#: Spikes of a column from which on they are said, and of a speed (rad/s, m/s) that are none.
_SAID, _NO_SPEED = 3, 0.02
#: Chance of as many equal values in a row somewhere in a column, from which on they are none; and the fewest of them.
_CHANCE, _FEWEST = 1e-6, 5
#: Where a stuck value is let go it jumps by so many deviations of the usual step, if values are repeated more often than
#: this.
_JUMP, _NEVER = 5.0, 0.02
#: Position and speed of all joints may be repeated for so long, s.
_HELD = 0.1
#: Fewest samples of a run in which v is moved to where it belongs.
_FEWEST_TO_SHIFT = 4
#: Torque is cut off where so many of the rows hold its extreme, so many times as many as any of so many values beside it; a
#: sensor that knows fewer values than the last rounds.
_CUT, _PILED, _LEVELS_BESIDE, _LEVELS = 0.01, 10, 5, 50


def repaired(log: Recorded, lag: float = 0.0) -> Recorded:
    """The record without spikes, v moved to where q changes as it says, and which torques are none (``lost``).

    Args:
        lag: seconds by which v is late.
    """
    clean = mended(log)
    lost = np.zeros(log.tau.shape, dtype=bool)
    for j in range(log.tau.shape[1]):
        cut = cut_off(clean, j)
        for first, last in _stuck(clean, j, cut):
            lost[first : last + 1, j] = True
        for value, _ in cut:
            lost[:, j] |= clean.tau[:, j] == value
    return replace(clean, v=_in_time(clean, lag), lost=lost if lost.any() else None)


@once
def mended(log: Recorded) -> Recorded:
    """The record with what lies beside them in place of rows that coincide, repeated rows and spikes."""
    return _without_spikes(_moving_on(_at_their_instants(log)))


def mended_part(log: Recorded, rows: slice, runs: Sequence[slice]) -> Recorded:
    """Some rows of a record, in runs of their own, mended with the whole: the few say less of what lies far out."""
    whole = mended(log)
    vdot = None if whole.vdot is None else whole.vdot[rows]
    part = Recorded(
        whole.time[rows], whole.q[rows], whole.v[rows], whole.tau[rows], vdot, runs, whole.derived
    )
    part.keep("mended", part)
    return part


def _at_their_instants(log: Recorded) -> Recorded:
    """The record with lines through what lies beside rows whose stamps nearly coincide with another's."""
    rows = coincident(log.time, log.q, log.runs)
    if len(rows) == 0:
        return log
    q, v, tau = (bridged(x, rows, log.time) for x in (log.q, log.v, log.tau))
    return replace(
        log, q=q, v=v, tau=tau, vdot=None if log.vdot is None else bridged(log.vdot, rows, log.time)
    )


def _in_time(log: Recorded, lag: float) -> Array:
    """v (N, n) at the instants of q: a controller's own low-pass and differences make it late, and all joints alike.

    A v that leads is left: no filter does that, so it may be q that is late.
    """
    if lag <= 0:
        return log.v
    v = log.v.copy()
    for run in log.runs:
        if run.stop - run.start >= _FEWEST_TO_SHIFT:
            v[run] = later(log.time[run], log.v[run], lag)
    return v


def later(time: Array, x: Array, seconds: float) -> Array:
    """x (N, ...) of a run at instants so much later, before or after the run as at its ends."""
    # Here, for a fault of the input is to be told before this is imported.
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(time, x)(np.clip(time + seconds, time[0], time[-1])))


def dropouts(log: Recorded) -> Iterator[Finding]:
    """What is replaced or left out, a sentence for each column; of one or two spikes none."""
    close = coincident(log.time, log.q, log.runs)
    if len(close) >= _SAID:
        least = float(np.diff(log.time).min())
        yield Finding(
            "column time",
            f"has rows nearer to another than {NEARLY:.0%} of the usual step, {len(close)} in all, {least:.2g} s at the "
            "least, as where messages are stamped when they arrive; what lies beside them takes their place",
        )
    log = _at_their_instants(log)
    held = _held(log)
    if len(held):
        yield Finding(
            "columns q, v",
            f"repeat the row before in {len(held)} rows while the arm moves; what lies beside them takes their place",
        )
    log = _moving_on(log)
    for (kind, j), rows in spikes(log).items():
        if len(rows) >= _SAID:
            x = getattr(log, kind)[:, j]
            size = np.abs(x - bridged(x, rows, log.time)).max()
            yield Finding(
                f"column {kind}{j + 1}",
                f"has spikes of one or two samples, {len(rows)} in all, of up to {size:.3g}; what lies beside them takes "
                "their place",
            )
    for j in range(log.tau.shape[1]):
        cut = cut_off(log, j)
        stuck = _stuck(log, j, cut)
        if stuck:
            seconds = sum(float(log.time[last] - log.time[first]) for first, last in stuck)
            yield Finding(
                f"column tau{j + 1}",
                f"stands still to the last digit while the joint moves {len(stuck)} times, {seconds:.2g} s "
                "in all; these parts are left out",
            )
        for value, share in cut:
            yield Finding(
                f"column tau{j + 1}",
                f"is {value:.6g} to the last digit in {share:.0%} of the rows, as where a sensor or a drive saturates; "
                "these parts are left out",
            )


@once
def spikes(log: Recorded) -> dict[tuple[str, int], Index]:
    """Rows of the spikes of each column that has any, by kind and joint (0-based).

    Where single samples are many they are no faults but noise. What several speeds or torques do at once, and no position,
    is a jerk of the arm, as of brakes that fall in, and no fault; nor is what a speed does if its position moves as fast.
    """
    kinds = {"q": log.q, **({} if log.derived else {"v": log.v}), "tau": log.tau}
    columns = {(kind, j): x[:, j] for kind, x in kinds.items() for j in range(x.shape[1])}
    found = {place: _off_the_line(x, _spikes(x, log), log.time) for place, x in columns.items()}
    for j in range(0 if log.derived else log.v.shape[1]):
        rows, x = found["v", j], log.v[:, j]
        later, before = np.minimum(rows + 1, len(x) - 1), np.maximum(rows - 1, 0)
        rate = (log.q[later, j] - log.q[before, j]) / (log.time[later] - log.time[before])
        height = np.abs(x - bridged(x, rows, log.time))[rows]
        found["v", j] = rows[(np.abs(x[rows] - rate) > 0.5 * height) & (height > _NO_SPEED)]
    count = np.zeros(len(log.time), dtype=int)
    for (kind, _), rows in found.items():
        near = np.unique(np.clip(rows[:, None] + np.arange(-1, 2), 0, len(count) - 1))
        count[near] += -len(found) if kind == "q" else 1
    alone = {place: rows[count[rows] < 2] for place, rows in found.items()}
    return {place: rows for place, rows in alone.items() if len(rows)}


def _off_the_line(x: Array, rows: Index, time: Array) -> Index:
    """Those of some rows of a column that lie off the line through what is beside them; on it, as of rows that were one
    already, none is a spike."""
    return rows[np.abs(x - bridged(x, rows, time))[rows] > TINY]


def _without_spikes(log: Recorded) -> Recorded:
    columns = {"q": log.q, "v": log.v, "tau": log.tau}
    for (kind, j), rows in spikes(log).items():
        if columns[kind] is getattr(log, kind):
            columns[kind] = np.array(columns[kind])
        columns[kind][:, j] = bridged(columns[kind][:, j], rows, log.time)
    if log.derived and columns["q"] is not log.q:
        columns["v"] = np.concatenate([np.gradient(columns["q"][r], log.time[r], axis=0) for r in log.runs])
    return replace(log, q=columns["q"], v=columns["v"], tau=columns["tau"])


def _moving_on(log: Recorded) -> Recorded:
    """The record with lines through what lies beside rows that repeat the position and speed before them.

    So with a torque that is repeated as well, unless the rows are so many that it may be stuck.
    """
    rows = _held(log)
    if len(rows) == 0:
        return log
    stretches = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)
    short = [own for own in stretches if len(own) < _FEWEST and (log.tau[own] == log.tau[own - 1]).all()]
    repeated = np.concatenate([rows[:0], *short])
    q, v, tau = (bridged(x, own, log.time) for x, own in ((log.q, rows), (log.v, rows), (log.tau, repeated)))
    return replace(log, q=q, v=v, tau=tau)


def _held(log: Recorded) -> Index:
    """Rows in which all positions and speeds, which are not zero, are those of the row before, for a while."""
    if log.derived:
        return np.zeros(0, dtype=np.intp)
    same = (np.diff(log.q, axis=0) == 0).all(axis=1) & (np.diff(log.v, axis=0) == 0).all(axis=1)
    same &= np.abs(log.v[1:]).max(axis=1) > _NO_SPEED
    for run in log.runs[1:]:
        same[run.start - 1] = False
    for first, last in stretches(same).tolist():
        # what stands still to the end of a run, or too long, is another fault
        if log.time[last] - log.time[first] > _HELD or not _in_one_run(log, first, last + 1):
            same[first:last] = False
    return np.flatnonzero(same) + 1


def cut_off(log: Recorded, j: int) -> list[tuple[float, float]]:
    """Extremes at which a joint's torque is cut off, each with its part of the rows.

    While the arm moves, far more rows hold such a value than any other near it.
    """
    moves = np.append(False, (np.diff(log.q, axis=0) != 0).any(axis=1))
    x = log.tau[moves, j]
    values, counts = np.unique(x, return_counts=True)
    found: list[tuple[float, float]] = []
    if len(values) < _LEVELS:
        return found  # a coarse sensor, or none
    for end, beside in ((0, slice(1, _LEVELS_BESIDE + 1)), (-1, slice(-1 - _LEVELS_BESIDE, -1))):
        share = counts[end] / len(x)
        if values[end] != 0 and share > _CUT and counts[end] > _PILED * counts[beside].max():
            found.append((float(values[end]), float(share)))
    return found


def _spikes(x: Array, log: Recorded) -> Index:
    """Rows of the spikes of one column (N,): one or two samples far from both neighbours, which agree.

    Samples were taken at their stamps, or evenly where only the stamps jitter: as fewer steps are large.
    """
    none = np.zeros(0, dtype=np.intp)
    changes = np.diff(x)
    resolution = float(np.min(np.abs(changes)[changes != 0], initial=np.inf))
    if len(changes) < 2 * _BESIDE or not np.isfinite(resolution):
        return none  # it never changes, or there is too little of it
    stamps = np.diff(log.time)
    usual_gap = max(float(np.median(stamps)), TINY)
    clocks = [np.ones(len(changes)), np.maximum(stamps / usual_gap, _NO_GAP)]
    tried = ((each, *_large(changes / each, resolution)) for each in clocks)
    gaps, usual, large = min(tried, key=lambda found: (len(found[2]), found[1]))
    # a spike makes two large steps, and some three to either side
    if len(large) == 0 or len(large) > 8 * _RARE * len(x):
        return none
    steps = changes / gaps
    found: list[int] = []
    for width in (1, 2):
        # up at step k, down at step k + width: samples k + 1 … k + width
        for k in large[np.isin(large + width, large)].tolist():
            near = np.r_[steps[max(0, k - _BESIDE) : k], steps[k + width + 1 : k + width + 1 + _BESIDE]]
            slope = float(np.median(near))
            least = max(usual, PER_MEDIAN * float(np.median(np.abs(near - slope))))
            up, down = steps[k] - slope, steps[k + width] - slope
            height = min(abs(up), abs(down))
            away = abs(x[k + width + 1] - x[k] - slope * float(gaps[k : k + width + 1].sum()))
            back = up * down < 0 and away < _BACK * height
            if back and height > _SPIKE * least and _in_one_run(log, k, k + width + 1):
                found += range(k + 1, k + width + 1)
    return np.unique(np.array(found, dtype=np.intp))


def _large(steps: Array, resolution: float) -> tuple[float, Index]:
    """How far steps (N - 1,) usually are from those around them, and which are so far that they may be a spike's."""
    # what a step is beside the steps around it: a joint that moves fast makes large ones
    trend = np.concatenate([steps[:_AWAY], 0.5 * (steps[: -2 * _AWAY] + steps[2 * _AWAY :]), steps[-_AWAY:]])
    size = np.abs(steps - trend)
    usual = max(PER_MEDIAN * float(np.median(size)), 0.5 * resolution)
    return usual, np.flatnonzero(size > 0.5 * _SPIKE * usual)


def _in_one_run(log: Recorded, first: int, last: int) -> bool:
    return any(run.start <= first and last < run.stop for run in log.runs)


def _stuck(log: Recorded, j: int, cut: list[tuple[float, float]]) -> list[tuple[int, int]]:
    """First and last samples of stretches in which a joint's torque stands still by a fault, while the joint moves.

    Zero is no stuck value: a drive may be off.
    """
    x, v = log.tau[:, j], log.v[:, j]
    steps = np.diff(x)
    same = (steps == 0) & ~np.isin(x[1:], [value for value, _ in cut])
    for run in log.runs[1:]:
        same[run.start - 1] = False
    still = stretches(same)
    if len(still) == 0 or same.all() or len(np.unique(x)) < _LEVELS:
        return []
    # the chance that a value is followed by the same: of the values that end a stretch, how many begin another
    part = min(len(still) / float((~same).sum()), 1 - 1e-9)
    # so many equal steps one after the other come about by chance nowhere in the column
    fewest = max(_FEWEST, int(np.ceil(np.log(_CHANCE / len(x)) / np.log(part))))
    jump = 0.0 if part < _NEVER else _JUMP * PER_MEDIAN * float(np.median(np.abs(steps[~same])))
    found = []
    for first, last in still.tolist():
        if last - first < fewest:
            continue
        let_go = x[first] != 0 and last < len(steps) and abs(steps[last]) > max(jump, TINY)
        if let_go and np.ptp(v[first : last + 1]) > 0 and np.abs(v[first : last + 1]).min() > 0:
            found.append((first, last))
    return found
