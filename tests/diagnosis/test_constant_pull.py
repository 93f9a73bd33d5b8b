"""What may be a counterweight, a balancer that has lost force, or a gear's efficiency, is said beside what is stated."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from armloop.diagnosis.reasons import of_a_balancer, of_a_constant_pull, of_an_efficiency
from armloop.laws.effects import Estimate, effect
from armloop.model import AddedEffect
from armloop.robot.arm import load_arm


@pytest.mark.parametrize(
    ("name", "joint", "told"),
    [("torque_offset", 3, True), ("torque_offset", 1, False), ("coulomb_friction", 3, False)],
)
def test_a_slide_that_lifts_one_weight_may_have_another_counterweight(
    name: str, joint: int, told: bool
) -> None:
    arm = load_arm("scara")
    (quill,) = [j for j, one in enumerate(arm.joints, 1) if one.kind == "prismatic"]
    joint = quill if joint == 3 else joint
    key = "offset" if name == "torque_offset" else "level"
    added = AddedEffect(effect(name, joint), {key: Estimate(-39.2, 0.3, "N")})
    model: Any = SimpleNamespace(arm=arm)
    found = of_a_constant_pull(model, [added])
    assert bool(found) == told
    if told:
        (words,) = found
        assert words.startswith(f"joint {quill} lifts one weight at all postures: a counterweight")
        assert "a constant force of -39.20 ± 0.30 N" in words and "must supply as much in addition" in words


@pytest.mark.parametrize(
    ("joint", "terms", "told"),
    [
        (2, ["sin(q2)", "cos(2*q2)"], True),
        (2, ["sin(q2)*v2"], False),
        (3, ["sin(q3)"], False),
        (2, [], False),
    ],
)
def test_a_law_of_the_angle_beside_a_spring_with_levers_may_be_that_spring(
    joint: int, terms: list[str], told: bool
) -> None:
    sizes = {"second": 4.0, "second_phase": 0.1, "third": 1.0, "third_phase": 0.2}
    spring = AddedEffect(effect("spring_balancer", 2), {k: Estimate(x, 0.1, "") for k, x in sizes.items()})
    model: Any = SimpleNamespace(effects=(spring,))
    names = [*terms, "q_low", "v_high"] if terms else []
    law: Any = SimpleNamespace(joint=joint, parameters={name: Estimate(1.0, 0.1, "N*m") for name in names})
    found = of_a_balancer(model, [law])
    assert [
        words.startswith("joint 2 has a spring that pulls by levers: one that has lost force")
        for words in found
    ] == ([True] if told else [])


@pytest.mark.parametrize(("joint", "told"), [(2, True), (3, False)])
def test_a_gain_beside_friction_that_grows_with_the_load_may_be_a_gears_efficiency(
    joint: int, told: bool
) -> None:
    rubs = AddedEffect(effect("load_dependent_friction", 2), {"coefficient": Estimate(0.0873, 0.0049, "1")})
    gain = AddedEffect(effect("torque_gain", joint), {"gain": Estimate(1.0449, 0.0028, "1")})
    found = of_an_efficiency([rubs, gain])
    assert bool(found) == told and of_an_efficiency([gain]) == []
    # of a load L it drives with (mu + g - 1) L more than L, and is driven by it with as much less
    assert not told or "loses 0.132 of the load while it drives it and 0.0424 while the load" in found[0]
