"""Additional viscous friction of one joint."""

from __future__ import annotations

from armloop.effects.base import Array, LinearJointEffect
from armloop.motion import Motion


class ViscousFriction(LinearJointEffect):
    """tau_j += c v_j."""

    name = "viscous_friction"
    parameter = "coefficient"
    unit = "TAU*s/POS"
    law = "c v"

    def column(self, motion: Motion, joint: int) -> Array:
        return motion.v[:, joint]
