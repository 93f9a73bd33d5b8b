"""An effect of a model, with its estimated parameters, and how a file holds it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from armloop.laws.effects import Context, Effect, Estimate, Value, effect
from armloop.laws.effects.base import Placed, Pointwise, entry
from armloop.robot.arm import Arm
from armloop.util.arrays import Array


@dataclass(frozen=True)
class AddedEffect:
    """An effect that is not among the model's components, with its estimated parameters.

    ``when`` is ``"always"`` where a reconstruction found it in the training data, None where a diagnosis added it.
    """

    effect: Effect
    parameters: dict[str, Estimate]
    when: str | None = None

    def torque(self, context: Context) -> Array:
        """(N, n) torque of the effect."""
        return self.effect.torque(context, self.values)

    def pointwise(self, arm: Arm, inertial: Array | None) -> Pointwise:
        """The effect's torque for one sample at a time."""
        return self.effect.pointwise(arm, self.values, inertial)

    def placed(self) -> Placed | None:
        """The effect's law along its direction, where it has one."""
        return self.effect.placed(self.values)

    @property
    def values(self) -> dict[str, Value]:
        """The parameters without their errors."""
        return {key: e.value for key, e in self.parameters.items()}

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready values, as in ``diagnosis.json``."""
        return {
            **entry(*self.effect.place),
            "parameters": {key: e.to_dict() for key, e in self.parameters.items()},
            **({"when": self.when} if self.when else {}),
        }

    @staticmethod
    def from_dict(data: dict[str, Any]) -> AddedEffect:
        """Rebuild from :meth:`to_dict`."""
        return AddedEffect(
            effect(data["effect"], data["joint"], data.get("other_joint")),
            {
                key: Estimate(e["value"], _error(e["std_error"]), str(e["unit"]))
                for key, e in data["parameters"].items()
            },
            data.get("when"),
        )


def _error(value: Any) -> Any:
    """A standard error as it is read: null where nobody knows it."""
    if isinstance(value, list):
        return [_error(each) for each in value]
    return math.nan if value is None else value
