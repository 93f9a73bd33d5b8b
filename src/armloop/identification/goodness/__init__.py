"""Goodness of fit: the parts of the measured torque that a model explains, that it could explain, and that is noise.

Only motions, torques and residuals come in, so that a reconstruction and the diagnosis of any run use the same
measure.
"""

from armloop.identification.goodness.extrapolation import (
    WORTH_A_WORD,
    extrapolated,
    outside_trained_range,
    trained_range,
)
from armloop.identification.goodness.parts import Parts, merged, parts_of, unjudged
from armloop.identification.goodness.witness import Witness, witness

__all__ = [
    "WORTH_A_WORD",
    "Parts",
    "Witness",
    "extrapolated",
    "merged",
    "outside_trained_range",
    "parts_of",
    "trained_range",
    "unjudged",
    "witness",
]
