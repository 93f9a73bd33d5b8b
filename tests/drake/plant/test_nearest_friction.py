"""The Stribeck law nearest to a model's friction: its own where it has that form, else a fit to the curve of both ways."""

import dataclasses

import numpy as np
import pytest
from exact_parts import model_of
from numpy.testing import assert_allclose

from armloop.drake.plant import nearest_friction as nearest
from armloop.drake.plant.friction import JointFriction
from armloop.dynamics import Dynamics, training_range
from armloop.laws.effects import REGISTRY, Element, Estimate, Law, Parameter, effect
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import AddedEffect
from armloop.robot.arm import load_arm
from armloop.robot.kinematics import nominal_parameters, regressor
from armloop.util.errors import ModelError


@pytest.fixture(scope="module")
def arm():
    return load_arm("three_axis")


def of_joints(arm, *laws):
    return dataclasses.replace(model_of(arm, friction=()), friction=FrictionLaw(laws))


def numbers(friction: JointFriction) -> tuple[float, ...]:
    return friction.static, friction.coulomb, friction.stribeck_velocity, friction.viscous


def test_a_law_of_that_form_is_taken_as_it_is_and_none_drives(arm) -> None:
    whole = (FrictionTerm("sign", 0.5), FrictionTerm("stribeck", -0.2, 0.3), FrictionTerm("viscous", 2.0))
    rising = (FrictionTerm("sign", 0.5), FrictionTerm("stribeck", 0.25, 0.3), FrictionTerm("viscous", -2.0))
    driving = (FrictionTerm("sign", -0.5), FrictionTerm("stribeck", 0.25, 0.3))
    found = [numbers(one) for one in nearest.nearest_friction(of_joints(arm, whole, rising, driving))]
    assert found == [
        pytest.approx((0.5, 0.3, 0.3, 2.0)),
        pytest.approx((0.75, 0.75, 0.3, 0.0)),
        (0.0, 0.0, 0.3, 0.0),
    ]
    falling = (FrictionTerm("smooth_sign", 0.5, 0.003), FrictionTerm("stribeck_peak", 0.25, 0.123))
    assert numbers(nearest.nearest_friction(of_joints(arm, falling, (), ()))[0]) == (0.75, 0.5, 0.123, 0.0)
    plain = nearest.nearest_friction(of_joints(arm, (FrictionTerm("sign", 0.5),), (), ()))
    assert [numbers(one) for one in plain] == [
        (0.5, 0.5, 0.1, 0.0),
        (0.0, 0.0, 0.1, 0.0),
        (0.0, 0.0, 0.1, 0.0),
    ]


def test_of_another_form_the_mean_of_both_ways_is_fitted(arm) -> None:
    law = (FrictionTerm("smooth_sign", 0.5, 1e-6), FrictionTerm("offset", 3.0), FrictionTerm("viscous", 2.0))
    found = nearest.nearest_friction(of_joints(arm, law, (), ()))
    assert_allclose([found[0].static, found[0].coulomb, found[0].viscous], [0.5, 0.5, 2.0], atol=1e-6)
    # what was found since is a part of it
    drag = AddedEffect(effect("viscous_friction", 2), {"coefficient": Estimate(0.7, 0.0, "1")})
    other = AddedEffect(
        effect("joint_spring", 3), {"stiffness": Estimate(9.0, 0.0, "1"), "rest": Estimate(0.0, 0.0, "1")}
    )
    model = of_joints(arm, law, (FrictionTerm("sign", 0.25),), ()).with_effects([drag, other])
    found = nearest.nearest_friction(model)
    assert_allclose([found[1].static, found[1].coulomb, found[1].viscous], [0.25, 0.25, 0.7], atol=1e-6)
    assert numbers(found[2]) == (0.0, 0.0, 0.1, 0.0)


class Eccentric(Law):
    """A seal that rubs by the position: b (1 + sin q) sign(v)."""

    name = "eccentric_seal"
    parameters = (Parameter("level", "TAU"),)
    law = "b (1 + sin(q)) sign(v)"
    elements = (Element(lambda x, p, f: (1 + f.sin(x.q)) * x.sign, "(1+sin(q{j}))*sign(v{j})"),)


def test_friction_by_the_position_is_its_mean_over_the_postures_of_training(arm, monkeypatch) -> None:
    find = REGISTRY.find
    monkeypatch.setattr(REGISTRY, "find", lambda name: Eccentric if name == Eccentric.name else find(name))
    model = of_joints(arm, (FrictionTerm("sign", 0.25),), (), ())
    model = dataclasses.replace(
        model, history={**model.history, "range": [[0.1] * 3, [1.0] * 3, [1.0] * 3, [1.5] * 3]}
    )
    rubs = AddedEffect(Eccentric(1), {"level": Estimate(0.4, 0.0, "1")})
    worn = model.with_effects([rubs])
    lower, upper = training_range(worn)
    expected = 0.25 + 0.4 * (1 + (np.cos(lower[0]) - np.cos(upper[0])) / (upper[0] - lower[0]))
    found = nearest.nearest_friction(worn)[0]
    assert_allclose([found.static, found.coulomb, found.viscous], [expected, expected, 0.0], atol=2e-3)
    # friction at no position is none that anybody could rely on
    with pytest.raises(ModelError, match="friction changes with the position of a joint; give q as well"):
        Dynamics(worn).friction(np.ones((2, 3)))
    q = np.array([[1.5, 0.0, 0.0], [-1.5, 0.0, 0.0]])
    torques = Dynamics(worn).friction(np.ones((2, 3)), q=q)
    assert_allclose(torques[:, 0], 0.25 + 0.4 * (1 + np.sin(q[:, 0])))
    assert_allclose(Dynamics(model).friction(np.ones((2, 3)))[:, 0], 0.25)


@pytest.mark.parametrize(
    ("name", "joints", "parameters", "more"),
    [
        ("presliding_hysteresis", (2, None), {"level": 0.7, "width": 0.01, "level_change": 0.0}, (0.7, 0.0)),
        ("viscous_asymmetry", (2, None), {"coefficient": 0.7}, (0.0, 0.0)),
        (
            "transmission_coupling",
            (1, 2),
            {"inertia": 0.0, "viscous": 0.3, "coulomb": 0.7, "ratio": 1.0},
            (0.7, 0.3),
        ),
        (
            "transmission_coupling",
            (2, 3),
            {"inertia": 0.0, "viscous": 0.3, "coulomb": 0.7, "ratio": -1.0},
            (0.7, 0.3),
        ),
    ],
)
def test_every_law_that_rubs_is_a_part_of_it(arm, name, joints, parameters, more) -> None:
    law = (FrictionTerm("sign", 0.25), FrictionTerm("viscous", 1.0))
    added = AddedEffect(effect(name, *joints), {key: Estimate(x, 0.0, "1") for key, x in parameters.items()})
    found = nearest.nearest_friction(of_joints(arm, law, law, law).with_effects([added]))
    for joint in range(3):
        level, slope = more if joint + 1 in joints else (0.0, 0.0)
        assert_allclose([found[joint].coulomb, found[joint].viscous], [0.25 + level, 1.0 + slope], atol=1e-6)


def test_the_fit_finds_the_velocity_of_its_grid() -> None:
    v = np.geomspace(1e-3, 1.0, 60) * 2.0
    for part in nearest._VELOCITIES[[0, 17, 39]]:
        speed = part * 2.0
        curve = 0.5 + 0.3 * np.exp(-((v / speed) ** 2)) + 0.2 * v
        assert_allclose(numbers(nearest._fitted(v, curve)), [0.8, 0.5, speed, 0.2], rtol=1e-6)
    assert_allclose(nearest._VELOCITIES[[0, -1]], [0.005, 1.0])


def test_friction_by_load_has_the_mean_load_of_postures_within_the_training_range(arm) -> None:
    law = (FrictionTerm("load_sign", 0.1), FrictionTerm("viscous", 2.0))
    model = dataclasses.replace(
        of_joints(arm, (), law, ()), history={"range": [[0.5] * 3, [2.0, 3.0, 1e-3], [9.0] * 3, [0.1] * 3]}
    )
    speeds, friction = nearest._curves(model)
    # up to the largest speed of the training, a hundredth of a rad/s at least
    assert speeds.shape == friction.shape == (60, 3)
    assert_allclose(speeds[-1], [2.0, 3.0, 0.01])
    assert_allclose(speeds[0], 1e-3 * speeds[-1])
    q = np.random.default_rng(0).uniform(*training_range(model), (20, 3))
    load = regressor(arm, q, 0 * q, 0 * q) @ nominal_parameters(arm)
    assert_allclose(friction[:, 1], 0.1 * np.abs(load[:, 1]).mean() + 2.0 * speeds[:, 1], rtol=1e-6)
    assert not friction[:, [0, 2]].any()
    bare = dataclasses.replace(model, history={})
    assert_allclose(nearest._curves(bare)[0][-1], 1.0)
