"""Common-cause failure: friction that changes at most joints alike is of what they share, such as the temperature."""

from __future__ import annotations

from collections.abc import Sequence

from armloop.diagnosis.judgement import MOSTLY, MULTIPLE
from armloop.laws.effects.base import number
from armloop.laws.effects.viscous_friction import ViscousFriction
from armloop.model import AddedEffect, ReconstructedModel

#: Fewest joints that can be alike by more than chance.
_FEWEST = 3


def of_the_temperature(model: ReconstructedModel, added: Sequence[AddedEffect]) -> list[str]:
    """A sentence on viscous friction that has risen, or fallen, at most joints by a like part of the model's; else none."""
    parts: dict[int, float] = {}
    for one in added:
        if isinstance(one.effect, ViscousFriction) and one.effect.onset is None:
            terms = model.friction.terms[one.effect.index]
            own = sum(term.coefficient for term in terms if term.kind == "viscous")
            if own > 0:
                parts[one.effect.index + 1] = number(one.values["coefficient"]) / own
    if len(parts) < max(_FEWEST, MOSTLY * model.arm.n):
        return []
    low, high = sorted((min(parts.values()), max(parts.values())), key=abs)
    if not 0 < high / low <= MULTIPLE:
        return []
    way, grease = ("risen", "colder") if low > 0 else ("fallen", "warmer")
    joints = ", ".join(map(str, sorted(parts)))
    return [
        f"viscous friction has {way} at joints {joints} by like parts of the model's ({abs(low):.0%} to {abs(high):.0%}): "
        f"one cause that they share, such as grease that is {grease} than in the training logs, is likelier than "
        f"{len(parts)} faults; what is adopted then holds at that temperature"
    ]
