"""Localisation of a residual: in which stretch of time, and under which condition of the motion most of it is found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.fit import Fit
from armloop.diagnosis.judgement import MOSTLY, MULTIPLE, NEARLY_ALL
from armloop.diagnosis.outcomes import Outcome
from armloop.util.arrays import TINY, Array, Index, Mask


@dataclass(frozen=True)
class Whereabouts:
    """Where most of one joint's residual is.

    Attributes:
        time: start and end, s, of the shortest stretch with most of the energy; None where it is all over the run.
        condition: the half of the motion with most of the energy, in words with its limit; empty where no half is.
        share: the part of the energy that is found under the condition.
    """

    time: tuple[float, float] | None
    condition: str
    share: float

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready values."""
        time = None if self.time is None else list(self.time)
        return {"time": time, "condition": self.condition, "share": self.share if self.condition else None}

    def words(self) -> str:
        """A sentence without its full stop."""
        found = "it is found all over the run"
        if self.time is not None:
            found = f"nearly all of it is found from {self.time[0]:.1f} to {self.time[1]:.1f} s"
        if not self.condition:
            return f"{found}, under no condition above all"
        return f"{found}, {100 * self.share:.0f} % of it where {self.condition}"


def whereabouts(evidence: Evidence, fit: Fit, joint: int) -> Whereabouts:
    """Localise what a fit leaves on held-out rows of a joint (0-based).

    A stretch of time or a half of the motion is named where it holds nearly all of the energy above the baseline, and a
    stretch only if it is not itself most of what was judged.
    """
    mine = fit.stacked.joint == joint
    energy = np.maximum(fit.held_out[mine] ** 2 - 1.0, 0.0)
    rows = np.flatnonzero(evidence.rows[:, joint])
    halves = _halves(evidence, rows, joint)
    shares = [float(energy[chosen].sum() / max(energy.sum(), TINY)) for _, chosen in halves]
    own = [k for k, (words, _) in enumerate(halves) if words.startswith(f"joint {joint + 1} ")]
    best, mine_best = int(np.argmax(shares)), max(own, key=shares.__getitem__, default=None)
    # of so many conditions of other joints one or the other comes as near by chance
    if mine_best is not None and shares[mine_best] >= max(NEARLY_ALL, 1 - MULTIPLE * (1 - shares[best])):
        best = mine_best
    named = shares[best] >= NEARLY_ALL
    return Whereabouts(
        _stretch(evidence.samples.motion.time[rows], fit.stacked.block[mine], energy),
        halves[best][0] if named else "",
        shares[best],
    )


def localised(evidence: Evidence, outcome: Outcome, left: Sequence[float], known: Sequence[int]) -> list[str]:
    """A sentence on each joint of which nearly all of a multiple of the baseline is found under one condition of the motion.

    Args:
        left: RMSE of what the outcome leaves per joint, N·m (N); NaN where a joint did not move.
        known: joints (1-based) of which that is told otherwise.
    """
    much = [j for j, x in enumerate(left) if x >= MULTIPLE * evidence.scale[j] and j + 1 not in known]
    found = [(j, whereabouts(evidence, outcome.after, j)) for j in much]
    return [
        f"joint {j + 1}: {100 * where.share:.0f} % of what is left there is found where {where.condition}"
        for j, where in found
        if where.condition
    ]


def _halves(evidence: Evidence, rows: Index, joint: int) -> list[tuple[str, Mask]]:
    """Conditions in words, each met by half of a joint's samples (or by one direction of its motion)."""
    motion, joints = evidence.samples.motion, evidence.model.arm.joints
    load, of = evidence.context.load, joints[joint]
    v = motion.v[rows]
    found = [
        (f"joint {joint + 1} moves in the positive direction", v[:, joint] > 0),
        (f"joint {joint + 1} moves in the negative direction", v[:, joint] < 0),
    ]
    sizes = [
        (f"joint {k + 1} moves", "faster", "slower", np.abs(v[:, k]), f"{each.position_unit}/s")
        for k, each in enumerate(joints)
    ]
    turn = np.abs(motion.vdot[rows, joint])
    sizes.append((f"joint {joint + 1} accelerates", "by more", "by less", turn, f"{of.position_unit}/s^2"))
    sizes.append((f"joint {joint + 1} stands", "above", "below", motion.q[rows, joint], of.position_unit))
    if load is not None:
        carried = np.abs(load[rows, joint])
        sizes.append((f"joint {joint + 1} carries", "more", "less", carried, of.torque_unit))
    for what, more, less, size, unit in sizes:
        limit = float(np.median(size))
        than = "" if more == "above" else " than"
        found += [
            (f"{what} {more}{than} {limit:.3g} {unit}", size > limit),
            (f"{what} {less}{than} {limit:.3g} {unit}", size < limit),
        ]
    return found


def _stretch(time: Array, block: Index, energy: Array) -> tuple[float, float] | None:
    """The shortest stretch of whole blocks that holds most of the energy, if it is short."""
    names, index = np.unique(block, return_inverse=True)
    sums = np.concatenate([[0.0], np.cumsum(np.bincount(index, weights=energy))])
    needed = NEARLY_ALL * sums[-1]
    ends = np.searchsorted(sums, sums[:-1] + needed)
    lengths = np.where(ends < len(sums), ends - np.arange(len(names)), len(names))
    first = int(np.argmin(lengths))
    if lengths[first] > MOSTLY * len(names):
        return None
    inside = (index >= first) & (index < first + lengths[first])
    start, end = float(time[inside][0]), float(time[inside][-1])
    return (start, end) if end > start else None
