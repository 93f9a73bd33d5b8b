"""Time delay of one joint's torque record: its drive filters or sends its torque later than the others do."""

from __future__ import annotations

from armloop.laws.effects.base import Array, Context, Estimate, Value, Values, number
from armloop.laws.effects.time_delay import TimeDelay, later


class TorqueDelay(TimeDelay):
    """recorded tau_j(t) = true tau_j(t - d), of one joint: a fault of its drive's recording."""

    name = "torque_delay"
    scope = "joint"
    role = "sensor"

    def columns(self, context: Context, shape: float) -> Array:
        return super().columns(context, shape)[:, 0]

    def torque(self, context: Context, parameters: dict[str, Value]) -> Array:
        return self.on_all_joints(super().torque(context, parameters), context.arm.n)[:, :, 0]

    def recorded(self, context: Context) -> Array:
        return super().recorded(context)[:, [self.index]]

    def falsified(self, time: Array, q: Array, tau: Array, parameters: Values) -> tuple[Array, Array]:
        tau, own = tau.copy(), slice(self.index, self.index + 1)
        tau[:, own] = later(time, tau[:, own], number(parameters["seconds"]))
        return q, tau

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        words = super().sentence(parameters)
        return words.replace("the torque", f"the torque of joint {self.joint}", 1)

    def remedy(self, parameters: dict[str, Estimate]) -> str:
        words = super().remedy(parameters)
        return words.replace("the torque record", f"the torque record of joint {self.joint}", 1)
