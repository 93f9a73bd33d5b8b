"""Carried load: a payload that the arm picks up and puts down within a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from armloop.data.motion import Motion
from armloop.laws.effects.base import Array, Context, Estimate, Value, Values
from armloop.laws.effects.payload import Payload
from armloop.laws.effects.spells import Interval, during_any
from armloop.robot.arm import Arm
from armloop.util.arrays import Mask


class CarriedLoad(Payload):
    """tau += the torque of a :class:`Payload` in each interval from ``picked_up`` to ``put_down``, none outside of them.

    What is carried is a fact of one run, and when is known from its record alone: no controller supplies it. The
    intervals are found by :mod:`armloop.diagnosis.carried`.

    Args:
        intervals: when it is carried.
        error: of their ends, s.
    """

    name = "carried_load"
    role = "event"
    simulated = False
    removable = False
    memory = True

    def __init__(
        self,
        joint: int | None = None,
        other_joint: int | None = None,
        intervals: Sequence[Interval] = (),
        error: float = 0.0,
    ) -> None:
        super().__init__(joint, other_joint)
        self.intervals, self.error = tuple(intervals), error

    def columns(self, context: Context, shape: float) -> Array:
        return super().columns(context, shape) * self.carried(context.motion)[:, None, None]

    def carried(self, motion: Motion) -> Mask:
        """(N,) samples in which it is carried."""
        return during_any(motion, self.intervals)

    def torque(self, context: Context, parameters: dict[str, Value]) -> Array:
        carried = during_any(context.motion, _intervals(parameters, context.arm.n))
        return super().torque(context, parameters) * carried[:, None]

    @classmethod
    def fault(cls, parameters: Mapping[str, Any]) -> str:
        first, last = (np.atleast_1d(parameters.get(key, [])) for key in ("picked_up", "put_down"))
        late = len(first) != len(last) or len(first) == 0 or (last <= first).any()
        return "each put_down must come after its picked_up, as many of them" if late else ""

    def estimates(self, arm: Arm, x: Array, covariance: Array, shape: float) -> dict[str, Estimate]:
        ends = {"picked_up": [i.start for i in self.intervals], "put_down": [i.end for i in self.intervals]}
        posture = [q for i in self.intervals for q in i.posture]
        unit = arm.joints[0].position_unit if len({j.position_unit for j in arm.joints}) == 1 else "rad or m"
        return {
            **super().estimates(arm, x, covariance, shape),
            **{key: Estimate(times, [self.error] * len(times), "s") for key, times in ends.items()},
            "posture": Estimate(posture, [0.0] * len(posture), unit),
        }

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        first, last = (np.atleast_1d(np.asarray(parameters[key].value)) for key in ("picked_up", "put_down"))
        when = ", ".join(f"{a:.1f} to {b:.1f}" for a, b in zip(first, last, strict=True))
        return f"{super().sentence(parameters)}, carried from {when} s"


def _intervals(parameters: Values, n: int) -> list[Interval]:
    first, last = (np.atleast_1d(np.asarray(parameters[key])) for key in ("picked_up", "put_down"))
    posture = np.asarray(parameters["posture"], dtype=float).reshape(-1, n)
    return [
        Interval(float(a), float(b), tuple(q)) for a, b, q in zip(first, last, posture.tolist(), strict=True)
    ]
