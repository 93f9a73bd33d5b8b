"""Time delay of the torque record: it is later than the motion it belongs to."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armloop.laws.effects.base import Array, Context, Effect, Estimate, Parameter, Value, Values, number
from armloop.robot.arm import Arm


class TimeDelay(Effect):
    """recorded tau(t) = true tau(t - d), all joints alike: a fault of the recording."""

    name = "time_delay"
    scope = "arm"
    role = "sensor"
    fault_order = 3
    parameters = (Parameter("seconds", "s"),)

    def shapes(self, context: Context) -> Sequence[float]:
        # Delays of some milliseconds to a fifth of a second, either way; at each the column is exact.
        sizes = np.geomspace(0.002, 0.2, 12)
        return [float(d) for d in np.concatenate([-sizes[::-1], sizes])]

    def refined(self, x: Array, shape: float) -> float:
        # A delay is not linear in its time: the tangent at the time found is the exact one.
        return shape * float(np.clip(x[0] / shape, 0.5, 2.0))

    def columns(self, context: Context, shape: float) -> Array:
        # What a delay d adds is tangent(0) + d tangent'. The secant through no delay, d late(shape) / shape, would be one
        # column, but has the noise of the motion in it that the residual has, too: it finds delays that are too short.
        h = 0.5 * context.motion.period
        slope = (self._late(context, shape + h) - self._late(context, shape - h)) / (2 * h)
        return np.stack([self._late(context, shape) - shape * slope, slope], axis=2)

    def start(self, beta: Array) -> Array:
        return beta[-1:]

    def embed(self, x: Array) -> tuple[Array, Array]:
        return np.array([1.0, x[0]]), np.array([[0.0], [1.0]])

    def torque(self, context: Context, parameters: dict[str, Value]) -> Array:
        return self._late(context, number(parameters["seconds"]))

    def _late(self, context: Context, delay: float) -> Array:
        """tau(t - d) - tau(t), run by run."""
        motion, tau = context.motion, self.recorded(context)
        late = np.empty_like(tau)
        for run in motion.runs():
            late[run] = later(motion.time[run], tau[run], delay)
        return late - tau

    def recorded(self, context: Context) -> Array:
        """(N, k) torques, as the known model says, of the joints whose record is late."""
        assert context.predicted is not None
        return context.predicted

    def falsified(self, time: Array, q: Array, tau: Array, parameters: Values) -> tuple[Array, Array]:
        return q, later(time, tau, number(parameters["seconds"]))

    def plausible(self, arm: Arm, parameters: dict[str, Estimate]) -> bool:
        return abs(number(parameters["seconds"].value)) < 0.3

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        e = parameters["seconds"]
        way = "later" if number(e.value) > 0 else "earlier"
        return (
            f"the torque is recorded {1e3 * abs(number(e.value)):.3g} ± {1e3 * number(e.std_error):.2g} ms {way} than "
            "the motion: the recording, not the arm"
        )

    def remedy(self, parameters: dict[str, Estimate]) -> str:
        seconds = number(parameters["seconds"].value)
        return (
            f"Shift the torque record by {1e3 * abs(seconds):.3g} ms {'back' if seconds > 0 else 'forward'} before it is "
            "compared with the motion. The feedforward is not shifted: a record cannot tell whether commands are late, too"
        )


def later(time: Array, tau: Array, delay: float) -> Array:
    """tau(t - d) of one run; what was before it is taken to be as at its start."""
    return np.column_stack([np.interp(time - delay, time, column) for column in tau.T])
