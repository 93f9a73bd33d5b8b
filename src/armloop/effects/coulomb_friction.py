"""Additional dry friction of one joint."""

from __future__ import annotations

import numpy as np

from armloop.effects.base import Array, LinearJointEffect
from armloop.motion import Motion


class CoulombFriction(LinearJointEffect):
    """tau_j += f sign(v_j), while the joint slides."""

    name = "coulomb_friction"
    parameter = "level"
    unit = "TAU"
    law = "f sign(v)"

    def column(self, motion: Motion, joint: int) -> Array:
        return np.sign(motion.v[:, joint])
