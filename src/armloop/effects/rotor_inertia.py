"""Additional inertia of one joint's drive, reflected to the joint."""

from __future__ import annotations

from armloop.effects.base import Array, LinearJointEffect
from armloop.motion import Motion


class RotorInertia(LinearJointEffect):
    """tau_j += I v̇_j."""

    name = "rotor_inertia"
    parameter = "inertia"
    unit = "INERTIA"
    law = "I vdot"
    nonnegative = True

    def column(self, motion: Motion, joint: int) -> Array:
        return motion.vdot[:, joint]
