"""Motions and torques within limits, judged by Drake's inverse dynamics."""

import dataclasses
import types

import numpy as np
import pytest
from exact_model import ExactModel
from exact_parts import model_of
from numpy.testing import assert_allclose

from armloop.drake.control import bounded_feedforward
from armloop.drake.control.bounded_feedforward import bounded_reference
from armloop.drake.control.bounded_program import TOLERANCE
from armloop.drake.experiments.scenarios import load_plant, load_tracking
from armloop.drake.experiments.tracking import run_tracking
from armloop.drake.plant.exact import exact_model
from armloop.dynamics import Dynamics
from armloop.experiment.excitation import MotionRanges, TableReference, fourier_reference, places_reference
from armloop.laws.effects import REGISTRY, Element, Estimate, Law, Parameter, register
from armloop.laws.friction import Direction, FrictionTerm
from armloop.model import AddedEffect
from armloop.robot.arm import load_arm
from armloop.util.errors import InputError, ScenarioError

PLACES = [[0.9, -0.7, 0.02, -0.3], [-0.6, 0.9, 0.02, 0.4]]


@pytest.fixture(scope="module")
def scara():
    return load_plant("scara")


@pytest.fixture(scope="module")
def hurry(scara):
    return places_reference(PLACES, scara.config.ranges, dwell=0.2, pace=2.5)


@pytest.fixture(scope="module")
def effort(scara, hurry):
    """Three quarters of the largest torque that is asked for; what holds the vertical joint is not touched."""
    peaks = np.abs(torques(scara, hurry)).max(axis=0)
    return np.where(scara.arm.revolute, 0.75 * peaks, 50.0)


def torques(plant, reference):
    exact = ExactModel(plant.arm, plant.config.friction)
    t = np.arange(0.0, reference.duration, 0.01)
    return np.array([exact.feedforward(*state, 3) for state in zip(*reference.evaluate(t), strict=True)])


def test_torques_keep_the_limits(scara, hurry, effort):
    model = exact_model(scara.arm, scara.config.friction)
    bounded = bounded_reference(hurry, model, effort)
    asked, kept = torques(scara, hurry), torques(scara, bounded)
    assert (np.abs(asked) > effort).any(axis=0).tolist() == [True, True, False, True]
    # which of the Stribeck levels acts depends on the deviation's own speed
    doubt = np.array([f.static - f.coulomb for f in scara.config.friction])
    assert np.all(np.abs(kept) < 1.01 * effort + doubt)
    assert (np.abs(kept) > 1.02 * effort).mean() < 0.02
    t = np.linspace(0, hurry.duration, 20_001)
    assert np.all(np.abs(bounded.torque(t)) <= (1 + TOLERANCE) * effort)
    # positions, velocities and accelerations belong together
    q, v, _ = bounded.evaluate(t)
    assert_allclose(np.gradient(q, t, axis=0)[2:-2], v[2:-2], atol=5e-3)


def test_torques_keep_their_rates_too(scara):
    scenario = load_tracking("torque_limits:weak_and_slow")
    hurry, rate = scenario.reference, scenario.rate
    effort = np.array([joint.effort for joint in scenario.plant.arm.joints])
    model = exact_model(scara.arm, scara.config.friction)
    bounded = bounded_reference(hurry, model, effort, rate)
    t = np.arange(0.0, hurry.duration, 1e-3)
    tau = bounded.torque(t)
    change = np.abs(np.diff(tau, axis=0)) / 1e-3
    turning = [0, 1, 3]
    # a part of an effort per knot of 10 ms is what the solver knows a rate by
    assert np.all(change <= rate + TOLERANCE * effort / 0.01)
    assert np.all(np.abs(tau) <= (1 + TOLERANCE) * effort)
    assert np.all(change.max(axis=0)[turning] > 0.99 * rate[turning])
    free = bounded_reference(hurry, model, effort)
    assert np.all((np.abs(np.diff(free.torque(t), axis=0)) / 1e-3).max(axis=0)[turning] > 1.5 * rate[turning])
    # where a joint slides, the torques are those of the motion
    exact = ExactModel(scara.arm, scara.config.friction)
    state = bounded.evaluate(bounded.deviation.time)
    sliding = (np.abs(hurry.evaluate(bounded.deviation.time)[1]) > 0.1) & (np.abs(state[1]) > 0.1)
    expected = np.array([exact.feedforward(*x, 3) for x in zip(*state, strict=True)])
    assert_allclose(bounded.torques[sliding], expected[sliding], atol=0.02 * effort.max())


def test_limits_that_do_not_bind_change_nothing(scara, hurry, effort):
    model = exact_model(scara.arm, scara.config.friction)
    t = np.linspace(0, hurry.duration, 200)
    for limit in (100 * effort, np.inf):
        free = bounded_reference(hurry, model, limit)
        assert_allclose(free.evaluate(t)[0], hurry.evaluate(t)[0], atol=1e-6)


def test_rates_are_kept_by_drives_without_a_limit_of_torque(scara):
    hurry, rate = load_tracking("torque_limits:weak_and_slow").reference, np.array([60.0, 60.0, np.inf, 60.0])
    bounded = bounded_reference(hurry, exact_model(scara.arm, scara.config.friction), np.inf, rate)
    tau, free = bounded.torques, torques(scara, hurry)
    change, asked = (np.abs(np.diff(each, axis=0)).max(axis=0) / 0.01 for each in (tau, free))
    assert asked[0] > 1.2 * rate[0] and np.all(change <= 1.02 * rate)


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"effort": -1.0}, "effort must be above 0"),
        ({"effort": [1.0, np.nan, 1.0, 1.0]}, "effort must be above 0"),
        ({"effort": [1.0, 1.0]}, "one for each of 4 joints"),
        ({"rate": [0.0] * 4}, "rate must be above 0"),
        ({"rate": "60"}, "rate must be above 0"),
        ({"knot": 0.0}, "knot must be a number above 0"),
        ({"model": ExactModel}, "must be a ReconstructedModel"),
        (
            {"reference": fourier_reference(MotionRanges.of(load_arm("three_axis")), 1.0, 2)},
            "the reference is for 3",
        ),
    ],
)
def test_limits_that_are_none_are_refused(scara, hurry, given, told):
    model = exact_model(scara.arm, scara.config.friction)
    with pytest.raises(InputError, match=told):
        bounded_reference(**{"reference": hurry, "model": model, "effort": 9.0} | given)


def test_what_gravity_alone_exceeds_is_refused():
    plant = load_plant("three_axis")
    stretched = places_reference([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]], plant.config.ranges, dwell=0.3, pace=1.0)
    with pytest.raises(InputError, match="no motion near the reference keeps the torque limits"):
        bounded_reference(
            stretched, exact_model(plant.arm, plant.config.friction), np.array([30.0, 0.5, 20.0])
        )


def test_within_limits_the_arm_follows_better_than_clipped(hurry, effort):
    built_in = load_tracking("torque_limits")
    plant = built_in.plant
    assert [joint.effort for joint in plant.arm.joints] == [3.0, 1.75, 50.0, 1.0]
    joints = tuple(
        dataclasses.replace(j, effort=float(e)) for j, e in zip(plant.arm.joints, effort, strict=True)
    )
    scenario = dataclasses.replace(
        built_in,
        plant=dataclasses.replace(plant, arm=dataclasses.replace(plant.arm, joints=joints)),
        reference=hurry,
        score=(0.0, hurry.duration),
    )
    compared(scenario)


def test_within_its_rates_the_arm_follows_better_than_clipped():
    scenario = load_tracking("torque_limits:slow_drives")
    for result in compared(scenario).values():
        assert np.all(np.abs(np.diff(result.tau, axis=0)) <= 1e-3 * scenario.rate * (1 + 1e-9))


def compared(scenario):
    model = exact_model(scenario.plant.arm, scenario.plant.config.friction)
    results = run_tracking(
        dataclasses.replace(scenario, controllers=("pid_step3", "bounded")), {"model": model}
    )
    clipped, bounded = results["pid_step3"], results["bounded"]
    turning = [0, 1, 3]
    assert np.all(clipped.metrics.clipped[turning] > 0.01)
    assert np.all(bounded.metrics.clipped[turning] < clipped.metrics.clipped[turning])
    assert np.all(bounded.largest[turning] < clipped.largest[turning])
    assert np.all(bounded.eta[turning] < clipped.eta[turning])
    return results


def test_what_is_wrong_with_limits_is_told(tmp_path):
    path = tmp_path / "mine.yaml"
    for fields, message in (
        ("effort: [1.0, 2.0]", "limits.effort has 2 numbers"),
        ("effort: [0.0]", r"limits.effort\[1\] is 0.0; it must be a finite number above 0"),
        ("effort: [9.0], used: 2.0", "limits.used is 2.0"),
        ("rate: [9.0, -1.0, 9.0]", r"limits.rate\[2\] is -1.0; it must be a finite number above 0"),
        ("used: 0.9", "limits needs an effort or a rate"),
    ):
        path.write_text(f"plant: three_axis\nlimits: {{{fields}}}\n")
        with pytest.raises(ScenarioError, match=rf"mine.yaml: {message}"):
            load_tracking(path)


class PlacedDrag(Law):
    """A gear that is tighter at some places."""

    name = "placed_drag"
    parameters = (Parameter("coefficient", "TAU*s/POS"),)
    law = "c (1 + sin 3q) v"
    elements = (Element(lambda x, p, f: (1.0 + f.sin(3.0 * x.q)) * x.v, "(1+sin(3*q{j}))*v{j}"),)


@pytest.mark.parametrize("kind", ["cubic", "quadratic", "viscous_forward", "root"])
def test_friction_that_is_not_linear_in_the_speed_is_in_the_torques(kind):
    friction = (FrictionTerm("sign", 0.3), FrictionTerm("viscous", 0.5), FrictionTerm(kind, 1.5))
    told_as_they_are(model_of(load_arm("three_axis"), friction=friction), 4.0)


@pytest.fixture
def placed_drag():
    REGISTRY.forget()
    yield register(PlacedDrag)
    REGISTRY.forget()


def test_friction_that_depends_on_the_place_is_in_the_torques(placed_drag):
    model = model_of(load_arm("three_axis"), friction=(FrictionTerm("sign", 0.3),))
    drag = AddedEffect(placed_drag(3), {"coefficient": Estimate(2.0, 0.0, "")})
    told_as_they_are(dataclasses.replace(model, effects=(drag,)), 2.0)


def told_as_they_are(model, duration):
    """The torques of a motion within limits are those of the model on it."""
    arm = model.arm
    reference = fourier_reference(MotionRanges.of(arm), duration, 2)
    dynamics, t = Dynamics(model), np.arange(0.0, duration, 0.01)
    asked = np.abs(dynamics.torque(*reference.evaluate(t)))
    effort = np.where([False, False, True], 0.85, 1.5) * asked.max(axis=0)
    bounded = bounded_reference(reference, model, effort)
    knots = bounded.deviation.time
    assert (asked > effort).any(axis=0).tolist() == [False, False, True]
    state = bounded.evaluate(knots)
    # where no sign is open the torques told are those of the motion told, to second order in what the last round moved
    slides = (np.abs(state[1]) > 0.1) & (np.abs(reference.evaluate(knots)[1]) > 0.1)
    error = np.abs(bounded.torques - dynamics.torque(*state))[slides]
    assert error.max() < 2e-3 * asked.max()


class TestLinearised:
    """Torques, their derivatives and friction, of equations that are written down here."""

    @staticmethod
    def equations(**of):
        def rigid(q, v, vdot):
            return [q[0] ** 2 + 3 * v[1] + 2 * vdot[0], q[0] * q[1] - v[0] * v[1] + 5 * vdot[1]]

        given = {"rigid": rigid, "load_matters": False, "load": None, "dry_and_smooth": lambda *_: []}
        return types.SimpleNamespace(**(given | of))

    def test_derivatives_by_position_velocity_and_acceleration(self):
        q, v, vdot = np.array([[1.0, 2.0]]), np.array([[3.0, 4.0]]), np.array([[5.0, 6.0]])
        tau, J = bounded_feedforward._derivatives(self.equations(), q, v, vdot)
        assert tau.tolist() == [[1 + 12 + 10, 2 - 12 + 30]]
        assert_allclose(J[0], [[[2.0, 0.0], [2.0, 1.0]]], atol=1e-8)
        assert_allclose(J[1], [[[0.0, 3.0], [-4.0, -3.0]]], atol=1e-8)
        assert_allclose(J[2], [[[2.0, 0.0], [0.0, 5.0]]], atol=1e-8)

    def test_dry_friction_its_level_and_where_its_sign_is_open(self):
        def laws(q, v, load):
            first = Direction(0, 1, -0.5), np.array([2.0, 2.0, 2.0, 2.0]), 0.0
            return [first, (Direction(1), np.abs(load[1]), 0.0)]

        equations = self.equations(
            load_matters=True, load=lambda q, v, vdot: [q[0], v[0] + vdot[1]], dry_and_smooth=laws
        )
        v = np.array([[1.0, 0.1], [0.1, 1.0], [0.52, 0.93], [0.0, -0.049]])
        dry, level, slow = bounded_feedforward._dry_friction(equations, 0 * v, v, 0 * v + 1.0)
        load = v[:, 0] + 1
        # v1 - v2 / 2 is 0.95, -0.4, 0.055 and 0.0245
        sign = np.array([1, -1, 1, 1])
        assert_allclose(dry, np.stack([2 * sign, -sign + load * [1, 1, 1, -1]], axis=1))
        assert_allclose(level, np.stack([0 * load + 2, 1 + load], axis=1))
        assert slow.tolist() == [[False, False], [False, False], [False, False], [True, True]]

    def test_smooth_friction_is_a_straight_line_where_it_is_slow(self):
        along = Direction(0, 1, -0.5)
        equations = self.equations(dry_and_smooth=lambda q, v, load=None: [(along, None, along.of(v) ** 3)])
        v = np.array([[1.0, 0.4], [0.02, 0.4], [0.05, 0.4]])
        tau, slope = bounded_feedforward._smooth_friction(equations, 0 * v, v)
        w = 1.0 - 0.2
        assert_allclose(tau[0], [w**3, -0.5 * w**3], atol=1e-8)
        rate = 3 * w**2
        assert_allclose(slope[0], [[rate, -0.5 * rate], [-0.5 * rate, 0.25 * rate]], atol=1e-6)
        # between -0.05 and 0.05 rad/s of the first joint: w from -0.25 to -0.15
        rate = ((-0.15) ** 3 - (-0.25) ** 3) / 0.1
        line = (-0.25) ** 3 + rate * (-0.18 + 0.25)
        assert_allclose(tau[1], [line, -0.5 * line], atol=1e-12)
        assert_allclose(slope[1], [[rate, -0.5 * rate], [-0.5 * rate, 0.25 * rate]], atol=1e-12)
        assert slope[2, 0, 0] == pytest.approx(3 * 0.15**2, abs=1e-6)


def test_friction_that_alone_takes_the_limit_is_refused():
    arm = load_arm("three_axis")
    model = model_of(arm, friction=(FrictionTerm("sign", 0.5),))
    reference = fourier_reference(MotionRanges.of(arm), 1.0, 2)
    for effort, told in ((0.5, "dry friction alone takes them"), (0.501, "limits")):
        with pytest.raises(InputError, match=told) as error:
            bounded_reference(reference, model, np.array([500.0, 500.0, effort]))
        assert ("alone" in str(error.value)) == (effort == 0.5)
        assert f"limits [500.0, 500.0, {effort}]" in str(error.value)


def test_between_knots_torques_are_linear():
    time = np.array([0.0, 1.0, 2.0])
    still = np.zeros((3, 2))
    deviation = TableReference(time, still, still, still)
    torques = np.array([[0.0, 4.0], [2.0, 0.0], [4.0, 8.0]])
    bounded = bounded_feedforward.BoundedReference(deviation, deviation, torques)
    assert bounded.torque([0.5, 1.25]).tolist() == [[1.0, 2.0], [2.5, 2.0]]
