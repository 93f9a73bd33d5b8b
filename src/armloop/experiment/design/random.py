"""Random references within the same limits: what an optimised one is compared with, and what scales its columns."""

from __future__ import annotations

from armloop.experiment.design.limits import Limits
from armloop.experiment.excitation import FourierReference, fourier_reference

#: s between the samples at which their limits are checked.
_STEP = 5e-3


def random_references(limits: Limits, duration: float, count: int, seed: int) -> list[FourierReference]:
    """Return `count` references as collections draw them, five harmonics of 0.05 to 0.35 Hz a joint.

    Each fills 0.97 of the tightest limit of its motion, and is made smaller where its torque would not fit. Those
    whose torque does not fit at any size are drawn again; there may be fewer if that fails ten times in a row.
    """
    found: list[FourierReference] = []
    failures, draw = 0, 0
    while len(found) < count and failures < 10:
        # seeds of their own, apart from those of the optimiser's starts
        reference = fourier_reference(limits.ranges, duration, 100_000 * (seed + 1) + draw, harmonics=5)
        draw += 1
        fitted = limits.fitted(reference, _STEP)
        if fitted is None:
            failures += 1
        else:
            failures = 0
            found.append(fitted)
    return found
