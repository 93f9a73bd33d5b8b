"""Dry friction that differs between the two directions of one joint."""

from __future__ import annotations

import numpy as np

from armloop.effects.base import Array, Estimate, LinearJointEffect, number
from armloop.motion import Motion


class FrictionAsymmetry(LinearJointEffect):
    """tau_j += a while the joint slides, either way: f+ = f + a forward, f- = f - a backward."""

    name = "friction_asymmetry"
    parameter = "level"
    unit = "TAU"
    law = "a"

    def column(self, motion: Motion, joint: int) -> Array:
        return np.abs(np.sign(motion.v[:, joint]))

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        e = parameters["level"]
        return (
            f"joint {self.joint} rubs harder one way than the other: half the difference, forward minus backward, is "
            f"{number(e.value):.4g} ± {number(e.std_error):.2g} {e.unit}"
        )
