"""Decomposition of a torque's energy: explained by the model, predictable but not explained, noise.

What is predictable is what a flexible regression of the residual on state, direction, recent path and load removes
of its energy on blocks left out: a lower bound for what a better model could explain, as the model's own error is an
upper bound for the noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from armloop.data.blocks import block_sums
from armloop.identification.goodness.regression import left_out
from armloop.identification.goodness.split import correlation_time, split
from armloop.identification.goodness.witness import JointRows, Witness
from armloop.util.arrays import TINY
from armloop.util.progress import Progress, silent

#: A joint with fewer rows is not judged; how long a residual's memory may be, s.
_FEWEST, _LONGEST = 200, 20.0
#: What is much: so large a part of the torque's RMS could still be predicted, which is its square of the energy, by
#: so many standard errors.
MUCH, _SURE = 0.1, 3.0
#: What is next to nothing, of the energy.
_LITTLE = 0.1


@dataclass(frozen=True)
class Parts:
    """Parts of one joint's torque energy on data held out; they add to one. None where there are too few data.

    Attributes:
        joint: from 1.
        explained: by the model; zero for a model that is worse than none.
        predictable_left: of the residual, by a flexible regression on blocks left out.
        noise: the rest.
        std_error: of ``predictable_left``, over blocks: how sure the line between it and the noise is.
        correlation_time: s that the residual remembers itself.
        separated: whether the blocks left out lie further apart than that.
    """

    joint: int
    explained: float | None = None
    predictable_left: float | None = None
    noise: float | None = None
    std_error: float | None = None
    correlation_time: float | None = None
    separated: bool = True

    @property
    def much_is_left(self) -> bool:
        """Whether a model leaves much that is predictable: then it lacks a law, and its noise is not noise."""
        left, error = self.predictable_left, self.std_error
        return left is not None and error is not None and left > max(MUCH**2, _SURE * error)

    @property
    def little_is_explained(self) -> bool:
        """Whether next to nothing of the torque follows from the motion, by this model or any other."""
        return self.explained is not None and self.explained < _LITTLE and not self.much_is_left

    def little(self) -> str:
        """What a model that explains next to nothing must say first."""
        assert self.explained is not None
        return (
            f"joint {self.joint}: the model explains {self.explained:.1%} of the torque's energy, and nothing more of it is "
            "predictable from the motion: was this tau recorded with this motion?"
        )

    def sentence(self) -> str:
        """What a model that leaves much must say first."""
        assert self.explained is not None and self.predictable_left is not None
        rest, left = 1 - self.explained, self.predictable_left
        share = "most" if left > 0.5 * rest else f"{left / rest:.0%}"
        return (
            f"joint {self.joint}: the model leaves {np.sqrt(rest):.0%} of the torque ({rest:.1%} of its energy), {share} of "
            f"it predictable from the motion: a law is missing"
        )


def unjudged(parts: Sequence[Parts]) -> list[str]:
    """A note on the joints whose torque was not parted, and why; none where all were."""
    joints = [str(one.joint) for one in parts if one.explained is None]
    if not joints:
        return []
    return [
        f"joint{'s' if len(joints) > 1 else ''} {', '.join(joints)}: the torque's energy is not parted, for fewer than "
        f"{_FEWEST} samples of the moving joint ({_FEWEST // 5} that no fit has seen) can be judged; log more of its motion"
    ]


def parts_of(witness: Witness, progress: Progress = silent) -> list[Parts]:
    """Parts of every joint's torque energy on the rows that judge."""
    found = []
    for j, rows in enumerate(witness.joints):
        progress(f"what a flexible regression still finds: joint {j + 1} of {len(witness.joints)}")
        found.append(_of_joint(j + 1, rows))
    return found


def _of_joint(joint: int, rows: JointRows) -> Parts:
    judged = rows.judged
    if len(rows.residual) < _FEWEST or judged.sum() < _FEWEST // 5:
        return Parts(joint)
    residual, energy = rows.residual, float(np.sum(rows.torque[judged] ** 2))
    left = float(np.sum(residual[judged] ** 2))
    whole = max(energy, left)
    if whole <= 0:
        return Parts(joint)
    memory = correlation_time(residual, rows.place, _LONGEST)
    cut = split(rows.place, rows.run, memory)
    rest = residual - left_out(rows.X, residual, cut)
    removed = block_sums((residual**2 - rest**2)[judged], cut.block[judged])
    blocks = block_sums((residual**2)[judged], cut.block[judged])
    predictable = float(np.clip(removed.sum(), 0.0, left))
    # of the part that is predictable, a ratio of sums over blocks (Cochran, Sampling Techniques, 1977, Ch. 6)
    scatter = removed - predictable / max(left, TINY) * blocks
    error = float(np.sqrt(len(removed) * np.mean(scatter**2))) if len(removed) > 1 else left
    return Parts(
        joint,
        1 - left / whole,
        predictable / whole,
        (left - predictable) / whole,
        error / whole,
        memory,
        cut.enough,
    )


def merged(parts: list[Parts], outside: Any = None) -> list[dict[str, Any]]:
    """Entries of ``joints`` as in ``diagnosis.json``.

    Args:
        outside: (n,) of :func:`.extrapolation.outside_trained_range`; left away by default.
    """
    found = [asdict(one) for one in parts]
    if outside is not None:
        for entry, share in zip(found, outside, strict=True):
            entry["outside_trained_range"] = float(share)
    return found
