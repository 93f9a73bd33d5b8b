"""Encoder offset: a position reading of one joint that is shifted by a constant."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from armloop.laws.effects.base import Array, Context, Effect, Estimate, Parameter, Value, Values, number
from armloop.robot.arm import Arm


class EncoderOffset(Effect):
    """recorded q_j = true q_j + d: the arm's torque belongs to another posture than the record says."""

    name = "encoder_offset"
    role = "sensor"
    fault_order = 0  # first where the encoder says the arm is
    parameters = (Parameter("offset", "POS"),)
    alike: ClassVar = {
        "gravity_tilt": (
            "both turn gravity against a link; a run with fast motion at different postures would tell them apart; for "
            "the first joint only a spirit level does"
        ),
        "joint_spring": (
            "over a small range a shifted gravity torque is a spring; a run over the whole range would tell them apart"
        ),
    }

    mesh: ClassVar = 0.02
    #: Half the step of the derivative, rad (m).
    step = 0.001
    #: A ripple of a higher order turns round within small faults.
    slow = 15.0
    #: A larger shift is no small fault, rad (m).
    farthest = 0.6

    def refined(self, x: Array, shape: float) -> float:
        # The torque is not linear in the shift: the column of the shift found is the exact one.
        return float(np.clip(x[0], -self.farthest, self.farthest))

    def columns(self, context: Context, shape: float) -> Array:
        """Change of torque per rad (m) up to the shift ``shape``; at zero the derivative.

        That of a ripple tells no shift of more than a part of its period, and hides what the rest of the torque tells: the
        difference is taken over a period, of the longest of several.
        """
        if abs(shape) > self.step:
            return ((self._shifted(context, shape) - self._shifted(context, 0.0)) / shape)[:, :, None]
        fast = [order for order in context.ripples.get(self.index + 1, ()) if order > self.slow]
        step = np.pi / min(fast) if fast else self.step
        change = self._shifted(context, step) - self._shifted(context, -step)
        return (change / (2 * step))[:, :, None]

    def torque(self, context: Context, parameters: dict[str, Value]) -> Array:
        return self._shifted(context, number(parameters["offset"])) - self._shifted(context, 0.0)

    def _shifted(self, context: Context, offset: float) -> Array:
        if offset == 0.0:
            return context.unfaulty
        assert context.predict is not None
        q = np.array(context.motion.q)
        q[:, self.index] -= offset
        return context.predict(replace(context.motion, q=q))

    def falsified(self, time: Array, q: Array, tau: Array, parameters: Values) -> tuple[Array, Array]:
        q = q.copy()
        q[:, self.index] += number(parameters["offset"])
        return q, tau

    def plausible(self, arm: Arm, parameters: dict[str, Estimate]) -> bool:
        return abs(number(parameters["offset"].value)) < self.farthest

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        return f"the encoder of joint {self.joint} reads {parameters['offset'].words()} too much: the sensor, not the arm"

    def remedy(self, parameters: dict[str, Estimate]) -> str:
        e = parameters["offset"]
        offset = number(e.value)
        return (
            f"Subtract {offset:.4g} {e.unit} from the position readings of joint {self.joint}, or bring its encoder back "
            "to where it was when the model was trained, before anything uses them. The feedforward itself stays as it is: "
            f"at the true posture it is right. Until then the joint stands {-offset:+.4g} {e.unit} from where it is told "
            "and receives the torque of another posture; no feedforward can mend the position"
        )
