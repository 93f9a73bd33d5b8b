"""Two libraries on the same logs: which of them a user who asked for none is better served with.

The double feature set needs no geometry, but its terms grow with the number of joints that gravity sees, and a
data collection of fifty postures does not tell hundreds of them apart. The base parameters of the URDF are few. They
take over where they leave much less on held-out data: then the geometry is right, and terms are missing or wrong.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from armloop.errors import InputError
from armloop.model import ReconstructedModel
from armloop.reconstruction.data import Data
from armloop.reconstruction.fitted import in_memory
from armloop.reconstruction.found import Found
from armloop.reconstruction.sorter import Sorter
from armloop.reconstruction.tally import Tally
from armloop.signals import Conditioning

#: What is much worse: so many times the other's nRMSE at some joint, and more than so much of the torque.
_TIMES, _NOTABLE = 2.0, 0.005


@dataclass(frozen=True, eq=False)
class Attempt:
    """What a library found on conditioned logs."""

    library: str
    conditioning: Conditioning
    data: Data
    found: Found

    @property
    def may_have_rival(self) -> bool:
        """Whether the base parameters can be regressed on the same logs, kept in memory, and be judged on time series."""
        return (
            self.library == "double-feature-set" and self.conditioning.cutoff_hz > 0 and in_memory(self.data)
        )

    def tally(self, sorter: Sorter | None) -> Tally:
        """Errors on the held-out blocks, of the model that has not seen them; per condition where they are sorted."""
        model = ReconstructedModel(
            self.found.arm,
            tuple(self.found.components),
            self.found.law,
            self.conditioning,
            effects=self.found.effects,
        )
        return self.data.sum(partial(Tally.of, model=model, sorter=sorter))


def better(tried: Attempt, attempt: Callable[[str], Attempt]) -> Attempt:
    """The attempt with base parameters where it leaves much less than the one given, with a note; else the one given.

    Both are judged on held-out blocks, joint by joint on the working condition that they explain worst.

    Args:
        attempt: makes the attempt of a library.
    """
    try:
        rival = attempt("rigid-body")
    except InputError:  # more parameters than the motion determines, say
        return tried
    sorter = tried.found.sorter
    errors = [one.tally(sorter).baseline()["nrmse"] for one in (tried, rival)]
    pairs = [
        (a, b, joint)
        for joint, (a, b) in enumerate(zip(*errors, strict=True), start=1)
        if a is not None and b is not None
    ]
    worse = [(a / max(b, 1e-12), a, b, joint) for a, b, joint in pairs if a > max(_TIMES * b, _NOTABLE)]
    if not worse or sum(b for _, b, _ in pairs) >= sum(a for a, _, _ in pairs):
        return tried
    _, a, b, joint = max(worse)
    rival.found.notes.insert(
        0,
        f"of the torque of joint {joint} the double feature set leaves {a:.2%} on held-out data, the base parameters of "
        f"the URDF {b:.2%}: library rigid-body was taken; --library double-feature-set has its way all the same",
    )
    return rival
