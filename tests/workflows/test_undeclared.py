"""The effect of the demonstration: random in kind, place and size, the same for the same seed."""

from types import SimpleNamespace

import numpy as np
import pytest

from armloop.drake.plant.fault_injection import UndeclaredEffect
from armloop.laws.effects import EFFECTS as LISTED
from armloop.robot.arm import load_arm
from armloop.workflows.loop import _is_right
from armloop.workflows.undeclared import EFFECTS, draw


@pytest.mark.parametrize("name", ["three_axis", "scara"])
def test_every_effect_and_joint_is_drawn(name):
    arm = load_arm(name)
    drawn = [draw(arm, seed) for seed in range(200)]
    assert {effect.name for effect in drawn} == set(EFFECTS)
    joints = {effect.joint for effect in drawn if effect.name == "viscous_friction"}
    assert joints == set(range(1, arm.n + 1))
    assert all(LISTED[effect.name].joint_wise == (effect.joint is not None) for effect in drawn)


def test_a_seed_stands_for_one_effect():
    arm = load_arm("three_axis")
    first, again, other = draw(arm, 7), draw(arm, 7), draw(arm, 8)
    assert (first.name, first.joint, dict(first.parameters)) == (
        again.name,
        again.joint,
        dict(again.parameters),
    )
    assert dict(first.parameters) != dict(other.parameters)


def test_sizes_vary_fourfold():
    arm = load_arm("three_axis")
    effects = [draw(arm, seed) for seed in range(400)]
    levels = [e.parameters["level"] for e in effects if e.name == "coulomb_friction" and e.joint == 2]
    assert 2.5 < np.max(levels) / np.min(levels) <= 4.0


@pytest.mark.parametrize(
    ("named", "unlisted", "right"),
    [
        ([("coulomb_friction", 2)], None, True),
        ([("coulomb_friction", 3)], None, False),
        ([("coulomb_friction", 2), ("external_torque", 2)], None, False),  # an event that nobody caused
        ([("coulomb_friction", 2)], "a law", False),
        ([], None, False),
    ],
)
def test_a_verdict_is_right_with_the_effect_and_nothing_beside_it(named, unlisted, right):
    hidden = UndeclaredEffect("coulomb_friction", 2, {"level": 0.5})
    assert _is_right(SimpleNamespace(named=named, unlisted=unlisted), hidden) is right
