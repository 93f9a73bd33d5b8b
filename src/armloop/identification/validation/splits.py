"""Train-test splits: which data are left out of a reconstruction, and which samples of them judge it.

Data are left out of the *raw* logs, before any filter: what is left of a log falls into runs, and filters never
reach across two runs. So no sample that is fitted contains anything of a torque that is left out. The other way
round, the filtered torque of a left-out sample contains its neighbours within about half a period of the corner;
samples that near a block that was fitted do not judge. The motion before a block is given to the prediction, as it
would be to a controller; its torque is not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import count

import numpy as np

from armloop.data.blocks import block_numbers
from armloop.data.log import GAP_PERIODS, MotionLog
from armloop.data.motion import Motion, Samples
from armloop.util.arrays import Array, Mask
from armloop.util.errors import InputError

#: Seconds since 1970 are known to 0.24 µs; no two samples are so near.
_ROUNDING = 1e-6


@dataclass(frozen=True, eq=False)
class Split:
    """What one reconstruction is given, and what judges it.

    Attributes:
        name: what is left out.
        training: logs, or what is left of them.
        left_out: for every log (by its place in the list of all) that judges: (R, 2) start and end in seconds of
            the blocks left out of it.
    """

    name: str
    training: list[MotionLog]
    left_out: dict[int, Array]


def told_apart(logs: Sequence[MotionLog]) -> list[MotionLog]:
    """The logs, those of a name that an earlier one has with a number behind it: files of two folders may share theirs."""
    names = {log.name for log in logs}
    found: list[MotionLog] = []
    for log in logs:
        if any(log.name == other.name for other in found):
            name = next(one for k in count(2) if (one := f"{log.name} ({k})") not in names)
            names.add(name)
            log = replace(log, name=name)
        found.append(log)
    return found


def by_file(logs: Sequence[MotionLog]) -> list[Split]:
    """Every log left out in turn.

    Raises:
        InputError: there is but one.
    """
    if len(logs) < 2:
        raise InputError(
            f"{logs[0].name}: a single log cannot be left out; give several, or --leave-out blocks"
        )
    whole = np.array([[-np.inf, np.inf]])
    return [
        Split(log.name, [other for other in logs if other is not log], {k: whole})
        for k, log in enumerate(logs)
    ]


def by_blocks(logs: Sequence[MotionLog], seconds: float) -> list[Split]:
    """Alternating blocks of every log left out: first the odd ones, then the even ones.

    Raises:
        InputError: blocks so short that the rest would not fall into runs, or longer than half of the logs.
    """
    for log in logs:
        if not seconds >= 2 * GAP_PERIODS * log.period:
            raise InputError(
                f"{log.name}: blocks of {seconds:g} s are too short at {1 / log.period:.4g} samples a second; give "
                f"--block of at least {2 * GAP_PERIODS * log.period:.2g} s"
            )
    numbers = []
    for log in logs:
        starts = np.array([run.start for run in log.runs()])
        numbers.append(block_numbers(Motion(log.time, log.q, log.v, log.q, starts), seconds))
    if all(len(np.unique(own)) < 2 for own in numbers):
        raise InputError(f"{logs[0].name}: shorter than two blocks of {seconds:g} s; give a smaller --block")
    splits = []
    for parity, name in ((0, "odd blocks"), (1, "even blocks")):
        training, left_out = [], {}
        for k, (log, own) in enumerate(zip(logs, numbers, strict=True)):
            kept = own % 2 != parity
            if kept.any():
                training.append(log.select(kept))
            ends = [log.time[own == number][[0, -1]] for number in np.unique(own[~kept])]
            left_out[k] = np.array(ends).reshape(-1, 2)
        splits.append(Split(name, training, left_out))
    return splits


def judging_rows(time: Array, samples: Samples, blocks: Array) -> Mask:
    """(N,) samples inside the blocks (R, 2), those left aside that the filter may have mixed with others.

    Args:
        time: (N,) of the samples in the time of the log.
    """
    margin = samples.reach
    rows = np.zeros(len(time), dtype=bool)
    for start, end in blocks:
        # a sample on the edge is inside, however its stamp is rounded
        rows |= (time >= start + margin - _ROUNDING) & (time <= end - margin + _ROUNDING)
    return rows
