"""A constant error of one joint's torque reading."""

from __future__ import annotations

import numpy as np

from armloop.effects.base import Array, Estimate, LinearJointEffect, number
from armloop.motion import Motion


class TorqueOffset(LinearJointEffect):
    """recorded tau_j = true tau_j + b: a fault of the sensor, which a controller must not supply."""

    name = "torque_offset"
    sensor = True
    parameter = "offset"
    unit = "TAU"
    law = "b"

    def column(self, motion: Motion, joint: int) -> Array:
        return np.ones(motion.samples)

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        e = parameters["offset"]
        return (
            f"the torque reading of joint {self.joint} is off by "
            f"{number(e.value):.4g} ± {number(e.std_error):.2g} {e.unit}: the sensor, not the arm"
        )
