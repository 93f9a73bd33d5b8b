"""Dry friction that fades as one joint warms up."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armloop.arm import Arm
from armloop.effects.base import Array, Context, Pointwise, ProfiledJointEffect, Value
from armloop.motion import Motion


class FrictionDrift(ProfiledJointEffect):
    """tau_j += f exp(-t/T) sign(v_j), t from the start of the log.

    A controller does not know when the joint was started: it supplies what is left once the joint is warm.
    """

    name = "friction_drift"
    memory = True
    parameter = "level"
    shape_name = "time_constant"
    unit = "TAU"
    shape_unit = "s"
    law = "f exp(-t/T) sign(v)"

    def shapes(self, context: Context) -> Sequence[float]:
        length = float(np.ptp(context.motion.time))
        # Shorter than a few blocks it is no drift; longer than the run it is a constant level.
        return [] if length < 12.0 else [float(T) for T in np.geomspace(4.0, 1.5 * length, 10)]

    def column(self, motion: Motion, joint: int, shape: float) -> Array:
        elapsed = motion.time - motion.time[0]
        return np.exp(-elapsed / shape) * np.sign(motion.v[:, joint])

    def pointwise(self, arm: Arm, parameters: dict[str, Value], inertial: Array | None) -> Pointwise:
        warm = np.zeros(arm.n)
        return lambda q, v, vdot: warm
