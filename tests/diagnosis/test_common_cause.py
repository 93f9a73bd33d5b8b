"""Viscous friction that changes at most joints by a like part has one cause, and that is said."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
from rubbing_arm import model_with_baseline, motion_of, torque
from synthetic import measured

from armloop.diagnosis import diagnose
from armloop.diagnosis.common_cause import of_the_temperature
from armloop.laws.effects import Estimate, effect
from armloop.laws.effects.spells import Interval, Spells
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import AddedEffect


def model(*viscous: float) -> Any:
    """The model of an arm with this viscous friction, beside dry friction."""
    terms = tuple((FrictionTerm("sign", 9.0), FrictionTerm("viscous", x)) for x in viscous)
    return replace(model_with_baseline(), friction=FrictionLaw(terms))


def more(*viscous: float) -> list[AddedEffect]:
    """So much viscous friction in addition, joint by joint; none where it is zero."""
    return [
        AddedEffect(effect("viscous_friction", j), {"coefficient": Estimate(x, 0.1 * abs(x), "N*m*s/rad")})
        for j, x in enumerate(viscous, 1)
        if x
    ]


def test_what_rises_alike_is_one_cause() -> None:
    (words,) = of_the_temperature(model(1.0, 2.0, 0.5), more(0.35, 0.6, 0.2))
    assert "has risen at joints 1, 2, 3 by like parts of the model's (30% to 40%)" in words
    assert "likelier than 3 faults" in words and "grease that is colder" in words
    (words,) = of_the_temperature(model(1.0, 2.0, 0.5), more(-0.2, -0.4, -0.2))
    assert "has fallen at joints 1, 2, 3 by like parts of the model's (20% to 40%)" in words
    assert "grease that is warmer" in words


@pytest.mark.parametrize(
    ("viscous", "rises"),
    [
        ((1.0, 2.0, 0.5), (0.35, 0.6, 0.0)),  # two joints may be alike by chance
        ((1.0, 2.0, 0.5), (0.35, 0.6, 0.31)),  # more than twice the part of another
        ((1.0, 2.0, 0.5), (0.35, 0.6, -0.2)),
        ((1.0, 2.0, 0.0), (0.35, 0.6, 0.2)),  # of friction that the model has not nothing is a part
    ],
)
def test_what_does_not_is_faults(viscous: tuple[float, ...], rises: tuple[float, ...]) -> None:
    assert of_the_temperature(model(*viscous), more(*rises)) == []


def test_it_is_asked_of_most_joints() -> None:
    given = model(1.0, 2.0, 0.5)
    for joints, told in ((6, True), (7, False)):
        arm: Any = SimpleNamespace(arm=SimpleNamespace(n=joints), friction=given.friction)
        assert bool(of_the_temperature(arm, more(0.35, 0.6, 0.2))) is told


def test_what_is_there_at_times_is_no_temperature() -> None:
    spells = Spells((Interval(1.0, 2.0, (0.0, 0.0, 0.0)),), 0.1)
    at_times = [AddedEffect(one.effect.within(spells), one.parameters) for one in more(0.35, 0.6, 0.2)]
    assert of_the_temperature(model(1.0, 2.0, 0.5), at_times) == []


def test_a_cold_arm_is_told_so() -> None:
    arm, motion = model_with_baseline(), motion_of(4, 30.0)
    own = [sum(t.coefficient for t in terms if t.kind == "viscous") for terms in arm.friction.terms]
    assert min(own) > 0
    log = measured(motion, torque(motion) + 0.5 * motion.v * own, 4, 0.01)
    found = diagnose(arm, [log], jobs=1).to_dict()
    assert [e["effect"] for e in found["effects"]] == ["viscous_friction"] * 3
    assert any("grease that is colder" in words for words in found["reasons"])
