"""A model's forces beside its bodies, against the model's own torques and those of its links."""

import numpy as np
import pytest
from exact_parts import model_of
from numpy.testing import assert_allclose

from armloop.drake import BeyondBodies, friction_systems
from armloop.drake.plant.beyond_bodies import explicit_part, per_joint, presliding_elements
from armloop.laws.effects import Estimate, effect
from armloop.laws.friction import FrictionTerm
from armloop.model import AddedEffect
from armloop.robot.arm import load_arm
from armloop.robot.kinematics import nominal_parameters, regressor

Q, V = np.array([0.3, -0.5, 0.7]), np.array([0.4, -0.01, 0.0])


def added(name: str, joint: int | None, other: int | None = None, **values: float) -> AddedEffect:
    return AddedEffect(effect(name, joint, other), {key: Estimate(x, 0.0, "1") for key, x in values.items()})


def force(model, q=Q, v=V, time: float = 0.0, **of) -> np.ndarray:
    system = BeyondBodies(model, **of)
    context = system.CreateDefaultContext()
    context.SetTime(time)
    system.GetInputPort("state").FixValue(context, [*q, *v])
    return system.GetOutputPort("force").Eval(context)


@pytest.fixture(scope="module")
def arm():
    return load_arm("three_axis")


def test_dry_friction_fades_in_and_viscous_friction_is_the_plants(arm) -> None:
    model = model_of(
        arm,
        friction=(FrictionTerm("sign", 2.0), FrictionTerm("viscous", 9.0), FrictionTerm("quadratic", 3.0)),
    )
    drag = 3.0 * np.abs(V) * V
    assert_allclose(force(model), -(2 * np.tanh(V / 0.02) + drag), rtol=1e-12)
    assert_allclose(force(model, smoothing=0.1), -(2 * np.tanh(V / 0.1) + drag), rtol=1e-12)
    each = [0.1, 0.2, 0.3]
    assert_allclose(force(model, smoothing=each), -(2 * np.tanh(V / each) + drag), rtol=1e-12)


def test_friction_by_load_has_the_load_of_the_links_that_do_not_accelerate(arm) -> None:
    model = model_of(arm, friction=(FrictionTerm("load_sign", 0.1),))
    load = (regressor(arm, Q[None], V[None], 0 * V[None]) @ nominal_parameters(arm))[0]
    assert np.abs(load[1:]).min() > 0.1
    assert_allclose(force(model), -0.1 * np.abs(load) * np.tanh(V / 0.02), rtol=1e-9, atol=1e-12)


def test_what_fades_in_more_slowly_keeps_its_own_width(arm) -> None:
    model = model_of(arm, friction=(FrictionTerm("smooth_sign", 2.0, 0.05),))
    assert_allclose(
        force(model, smoothing=[0.02, 0.05, 0.5]), -2 * np.tanh(V / [0.05, 0.05, 0.5]), rtol=1e-12
    )


def test_springs_are_there_and_bodies_and_sensors_are_not(arm) -> None:
    spring = added("joint_spring", 2, stiffness=3.0, rest=0.25)
    pull = np.array([0.0, 3.0 * (Q[1] - 0.25), 0.0])
    assert_allclose(force(model_of(arm, friction=()).with_effects([spring])), -pull, atol=1e-9)
    others = [
        added("rotor_inertia", 1, inertia=0.5),
        added("torque_offset", 1, offset=7.0),
        added("viscous_friction", 3, coefficient=5.0),
        spring,
    ]
    assert_allclose(force(model_of(arm, friction=()).with_effects(others)), -pull, atol=1e-9)
    assert not force(model_of(arm, friction=()).with_effects(others[:3])).any()


def test_joints_are_started_at_time_zero(arm) -> None:
    drift = added("friction_drift", 1, level=2.0, time_constant=10.0)
    model = model_of(arm, friction=()).with_effects([drift])
    for time in (0.0, 5.0):
        assert_allclose(
            force(model, time=time), [-2 * np.exp(-time / 10) * np.tanh(0.4 / 0.02), 0, 0], atol=1e-9
        )


def test_what_remembers_has_a_system_of_its_own(arm) -> None:
    terms = (FrictionTerm("sign", 1.0), FrictionTerm("hysteresis", 0.5, 0.01))
    model = model_of(arm, friction=terms)
    found = model.with_effects([added("presliding_hysteresis", 2, level=0.25, width=0.02)])
    elements = presliding_elements(found)
    assert [tuple(each) for each in elements] == [
        (1, 0.5, 0.01),
        (2, 0.5, 0.01),
        (3, 0.5, 0.01),
        (2, 0.25, 0.02),
    ]
    assert len(friction_systems(found, 0.02, 1e-3)) == 2
    assert len(friction_systems(model_of(arm, friction=terms[:1]), 0.02, 1e-3)) == 1
    # it is not in the explicit part
    assert_allclose(force(found), -np.tanh(V / 0.02), rtol=1e-12)
    rest = explicit_part(found)
    assert [[t.kind for t in law] for law in rest.friction.terms] == [["sign"]] * 3
    assert [a.parameters["level"].value for a in rest.effects] == [0.0]


def test_a_width_is_above_zero_and_there_are_one_or_as_many_as_joints() -> None:
    assert per_joint(1, 2) == [1.0, 1.0] and per_joint((0.1, 2), 2) == [0.1, 2.0]
    for wrong in (0, -1.0, [0.1], [0.1, 0.0], [0.1, 0.2, 0.3]):
        with pytest.raises(ValueError, match=r"smoothing (must be 2 finite numbers|is .* must be above 0)"):
            per_joint(wrong, 2)
