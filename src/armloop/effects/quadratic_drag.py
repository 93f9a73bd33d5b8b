"""Drag that grows with the square of one joint's speed: churning oil, a fan."""

from __future__ import annotations

import numpy as np

from armloop.effects.base import Array, LinearJointEffect
from armloop.motion import Motion


class QuadraticDrag(LinearJointEffect):
    """tau_j += c v_j |v_j|."""

    name = "quadratic_drag"
    parameter = "coefficient"
    unit = "TAU*s^2/POS^2"
    law = "c v |v|"

    def column(self, motion: Motion, joint: int) -> Array:
        v = motion.v[:, joint]
        return v * np.abs(v)
