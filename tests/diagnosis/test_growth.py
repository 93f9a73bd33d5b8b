"""What friction has become is told in parts of what the model has, where its uncertainties state that."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from armloop.diagnosis.growth import of_growth, with_growth
from armloop.diagnosis.reasons import Standing
from armloop.diagnosis.verdict import Diagnosis
from armloop.laws.effects import Estimate, effect
from armloop.model import AddedEffect

NOTHING: Any = None
EMPTY = Diagnosis("effects_found", NOTHING, NOTHING, None, NOTHING, [], NOTHING)


def added(name: str, joint: int, **values: float) -> AddedEffect:
    return AddedEffect(effect(name, joint), {key: Estimate(x, 0.1, "") for key, x in values.items()})


def law(**values: float) -> dict[str, Any]:
    return {key: {"value": x, "std_error": 0.01} for key, x in values.items()}


def model(stribeck: Any = None, line: Any = None, *effects: AddedEffect) -> Any:
    return SimpleNamespace(uncertainty={"stribeck": stribeck, "friction_line": line}, effects=effects)


MORE = [
    added("coulomb_friction", 2, level=3.0),
    added("viscous_friction", 2, coefficient=1.0),
    added("stribeck_friction", 2, static_excess=0.5, velocity=0.1),
]


def test_each_part_is_told_in_times_what_it_was() -> None:
    known = model([{}, law(coulomb=3.0, viscous=4.0, static=4.0)], [law(coulomb=9.0), law(coulomb=9.0)])
    assert of_growth(known, MORE) == [
        "joint 2: dry friction is 2 times, viscous friction is 1.25 times, the rise of friction at low speed is 1.5 times "
        "what the model has"
    ]


def test_of_another_law_the_nearest_line_counts() -> None:
    known = model([{}, {}], [law(coulomb=9.0, viscous=1.0), law(coulomb=6.0, viscous=4.0)])
    assert of_growth(known, MORE) == [
        "joint 2: dry friction is 1.5 times, viscous friction is 1.25 times what the model has"
    ]


@pytest.mark.parametrize("known", [model(), model([{}], [{}]), model([{}, law(coulomb=0.0)], [])])
def test_nothing_is_told_of_what_the_model_has_none_of(known: Any) -> None:
    assert of_growth(known, MORE) == []


def test_other_effects_are_no_growth() -> None:
    known = model([law(coulomb=3.0, viscous=4.0)])
    assert of_growth(known, [added("torque_offset", 1, offset=1.0)]) == []
    both = of_growth(known, [added("coulomb_friction", 1, level=-1.5), added("torque_offset", 1, offset=1.0)])
    assert both == ["joint 1: dry friction is 0.5 times what the model has"]


def test_friction_with_memory_is_dry_friction_once_it_slides() -> None:
    known = model([{}, law(coulomb=4.0)])
    memory = added("presliding_hysteresis", 2, level=1.0, width=0.001, level_change=1.5)
    assert of_growth(known, [memory]) == ["joint 2: dry friction is 1.62 times what the model has"]
    assert of_growth(known, [memory, added("coulomb_friction", 2, level=1.5)]) == [
        "joint 2: dry friction is 2 times what the model has"
    ]
    # what only turns a step into a memory is no growth
    turned = added("presliding_hysteresis", 2, level=1.0, width=0.001, level_change=-1.0)
    assert of_growth(known, [turned]) == []
    said = memory.sentence()
    assert "2.5 N" not in said and said.endswith("2.5  more dry friction once it slides")
    assert "more dry" not in added("presliding_hysteresis", 2, level=1.0, width=0.001).sentence()


def test_what_was_found_before_is_part_of_what_the_model_has() -> None:
    before = (
        added("coulomb_friction", 2, level=3.0),
        added("coulomb_friction", 1, level=9.0),
        AddedEffect(effect("payload", None), {}),
    )
    known = model([{}, law(coulomb=3.0, viscous=4.0)], None, *before)
    assert of_growth(known, MORE[:1]) == ["joint 2: dry friction is 1.5 times what the model has"]


def test_a_verdict_says_it_last() -> None:
    standing = Standing(["a reason"], [], False)
    outcome = SimpleNamespace(added=lambda: MORE[:1], growths=dict)
    found: Any = replace(EMPTY, outcome=outcome, standing=standing)
    known = model([{}, law(coulomb=3.0)])
    assert with_growth(known, found).standing.reasons == [
        "a reason",
        "joint 2: dry friction is 2 times what the model has",
    ]
    assert with_growth(model(), found) is found
