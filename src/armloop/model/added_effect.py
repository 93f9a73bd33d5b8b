"""An effect of a model, with its estimated parameters, and how a file holds it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from armloop.laws.effects import Context, Effect, Estimate, Value, effect
from armloop.laws.effects.base import Placed, Pointwise, entry
from armloop.laws.effects.onset import Onset
from armloop.laws.effects.spells import Spells
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

    def __repr__(self) -> str:
        values = ", ".join(
            f"{key} {e.words()}" for key, e in self.parameters.items() if np.ndim(e.value) == 0
        )
        return f"<{self.effect.label()}{': ' + values if values else ''}>"

    def torque(self, context: Context) -> Array:
        """(N, n) torque of the effect."""
        torque, onset = self.effect.torque(context, self.values), self.effect.onset
        return torque if onset is None else torque * onset.there(context.motion)[:, None]

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

    def sentence(self) -> str:
        """What was found, in words, and since when, where it began within a run."""
        onset = self.effect.onset
        return self.effect.sentence(self.parameters) + ("" if onset is None else f", {onset.words()}")

    def remedy(self) -> str:
        """What the arm's owner should do, in words, and of which record; empty for what acts on the arm itself."""
        words, onset = self.effect.remedy(self.parameters), self.effect.onset
        return f"{words}. This goes for what was recorded {onset.words()}" if words and onset else words

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready values, as in ``diagnosis.json``."""
        return {
            **entry(*self.effect.place),
            "parameters": {key: e.to_dict() for key, e in self.parameters.items()},
            **({"when": self.when} if self.when else {}),
            **({} if self.effect.onset is None else {self.effect.onset.word: self.effect.onset.to_model()}),
        }

    @staticmethod
    def from_dict(data: dict[str, Any]) -> AddedEffect:
        """Rebuild from :meth:`to_dict`."""
        kind = effect(data["effect"], data["joint"], data.get("other_joint"))
        for word in ("since", "until"):
            if word in data:
                kind = kind.within(Onset.from_model(data[word], word == "until"))
        if Spells.word in data:
            kind = kind.within(Spells.from_model(data[Spells.word]))
        return AddedEffect(
            kind,
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


def ripples(effects: Sequence[AddedEffect]) -> dict[int, tuple[float, ...]]:
    """Orders of the effects that ripple with the angle of a joint, by that joint (1-based)."""
    found: dict[int, tuple[float, ...]] = {}
    for added in effects:
        joint, order = added.effect.joint, added.effect.order(added.values)
        if joint is not None and order:
            found[joint] = (*found.get(joint, ()), order)
    return found
