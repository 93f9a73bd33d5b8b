"""Diagrams of a user's own, from the exported parts."""

import runpy
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput
from pydrake.trajectories import PiecewisePolynomial

from armloop.drake import PidGains, add_arm_with_controller
from armloop.drake.experiments.scenarios import Plant, load_plant
from armloop.drake.plant.fault_injection import UndeclaredEffect
from armloop.experiment.excitation import FourierReference, paper_reference
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import ReconstructedModel, load_model
from armloop.model.components import RigidBody
from armloop.robot.arm import Arm, load_arm
from armloop.robot.kinematics import nominal_parameters
from armloop.robot.levelling import base_rotation
from armloop.util.errors import InputError, InputWarning

MOTIONS = {
    3: paper_reference(),
    4: FourierReference(np.zeros(4), np.full((4, 1), 0.02), np.zeros((4, 1)), np.ones((4, 1)), 1.0),
}


def test_an_arm_under_pid_in_a_diagram_of_ones_own():
    reference = paper_reference()
    builder = DiagramBuilder()
    loop = add_arm_with_controller(builder, "three_axis", PidGains.paper(3), reference)
    log = LogVectorOutput(loop.plant.GetOutputPort("state"), builder, 1e-3)
    simulator = Simulator(builder.Build())
    loop.start_on_reference(simulator.get_mutable_context())
    simulator.AdvanceTo(0.5)
    q = log.FindLog(simulator.get_context()).data()[:3].T
    error = np.abs(q - loop.reference.tables[0][: len(q)])
    assert len(q) == 501
    assert 1e-4 < error.max() < 0.2


def known(arm: Arm) -> ReconstructedModel:
    """The model of the simulated three-axis arm, on an arm that stands like this one."""
    laws = [(0.557, 2.65, 0.1671), (0.757, 1.82, 0.2271), (0.585, 3.14, 0.1755)]
    friction = FrictionLaw(
        tuple(
            (
                FrictionTerm("sign", fc + drop),
                FrictionTerm("stribeck", -drop, 0.1),
                FrictionTerm("viscous", fv),
            )
            for fc, fv, drop in laws
        )
    )
    return ReconstructedModel(arm, (RigidBody(nominal_parameters(arm), ("m1",), np.array([1.0])),), friction)


def largest_error(model: ReconstructedModel | None, arm: str | Plant = "three_axis", effects=()) -> float:
    """After half a second under PID, with a model or alone, rad."""
    builder = DiagramBuilder()
    loop = add_arm_with_controller(builder, arm, PidGains.paper(3), paper_reference(), model, effects=effects)
    simulator = Simulator(builder.Build())
    loop.start_on_reference(simulator.get_mutable_context())
    simulator.AdvanceTo(0.5)
    state = loop.plant.GetOutputPort("state").Eval(loop.plant.GetMyContextFromRoot(simulator.get_context()))
    return float(np.abs(state[:3] - loop.reference.tables[0][500]).max())


def test_a_model_file_takes_the_place_of_nothing(tmp_path):
    """The same lines with a model: what PID alone leaves of the error nearly goes away."""
    arm = load_arm("three_axis")
    known(arm).save(tmp_path / "model.json")
    assert largest_error(load_model(tmp_path / "model.json", arm)) < 0.01 * largest_error(None)


def test_a_model_of_an_arm_that_stands_otherwise_serves_one_that_does(recwarn):
    """A base that leans and a joint whose zero is off; beside an arm as its URDF has it, that is said."""
    arm = load_arm("three_axis")
    leaning = replace(arm, gravity=base_rotation(0.05, -0.1).T @ arm.gravity)
    tilt = [UndeclaredEffect("gravity_tilt", None, {"roll": 0.05, "pitch": -0.1})]
    assert largest_error(known(leaning), effects=tilt) < 0.01 * largest_error(None, effects=tilt)
    further = arm.with_zero(1, 0.2)
    plant = replace(load_plant("three_axis"), arm=further)
    assert largest_error(known(further), plant) < 0.01 * largest_error(None, plant)
    assert not recwarn.list
    for model, words in (
        (known(leaning), "its base leans by 6"),
        (known(further), "its zero of joint 2 is 0.2000 rad"),
    ):
        with pytest.warns(InputWarning, match=words):
            largest_error(model)


@pytest.mark.parametrize("arms", [("three_axis", "three_axis", "three_axis"), ("three_axis", "scara")])
def test_several_arms_in_one_diagram_move_as_each_alone(arms):
    """Names are asked before `Build`, which ends the process where two are the same."""

    def moved(which):
        builder = DiagramBuilder()
        loops = [
            add_arm_with_controller(builder, arm, PidGains.paper(n), MOTIONS[n], torque_rate=np.full(n, 1e3))
            for arm, n in ((arm, {"three_axis": 3, "scara": 4}[arm]) for arm in which)
        ]
        names = [system.get_name() for system in builder.GetSystems()]
        assert len(set(names)) == len(names) == 4 * len(which)
        simulator = Simulator(builder.Build())
        context = simulator.get_mutable_context()
        for loop in loops:
            loop.start_on_reference(context)
        simulator.AdvanceTo(0.1)
        return names, [
            loop.plant.GetOutputPort("state").Eval(loop.plant.GetMyContextFromRoot(context)) for loop in loops
        ]

    names, together = moved(arms)
    assert {"three_axis", "reference", "pid", "drives", "reference_2", "pid_2", "drives_2"} <= set(names)
    for arm, state in zip(arms, together, strict=True):
        alone = moved([arm])[1][0]
        assert np.abs(alone).max() > 1e-3
        np.testing.assert_allclose(state, alone, atol=1e-9)


def test_a_drake_trajectory_is_a_reference():
    knots = np.array([[0.0, 0.3, 0.1], [-0.2, 0.1, 0.0], [0.5, 0.2, 0.4]])
    wanted = PiecewisePolynomial.CubicWithContinuousSecondDerivatives([2.0, 3.0, 4.0], knots)
    builder = DiagramBuilder()
    loop = add_arm_with_controller(builder, "three_axis", PidGains.paper(3), wanted)
    assert loop.followed.duration == 2.0
    for k, table in enumerate(loop.reference.tables):
        assert_allclose(table[500], wanted.EvalDerivative(2.5, k).ravel(), atol=1e-12)
    q, v, vdot = loop.followed.evaluate([2.0, 9.0])
    assert_allclose(q, np.tile(knots[:, 2], (2, 1)), atol=1e-12)
    assert v[0].any() and not v[1].any() and not vdot[1].any()
    simulator = Simulator(builder.Build())
    loop.start_on_reference(simulator.get_mutable_context())
    simulator.AdvanceTo(0.05)
    table = PiecewisePolynomial(np.eye(3))
    for other in (table, PiecewisePolynomial.FirstOrderHold([0.0, 1.0], [[0.0, 1.0]])):
        with pytest.raises(InputError, match=r"3 rows and 3 columns|the reference for 1"):
            add_arm_with_controller(DiagramBuilder(), "three_axis", PidGains.paper(3), other)


def test_reference_and_gains_must_fit_the_arm():
    still = FourierReference(np.zeros(2), np.zeros((2, 1)), np.zeros((2, 1)), np.ones((2, 1)), 1.0)
    with pytest.raises(ValueError, match="three_axis has 3 joints; the gains are for 3, the reference for 2"):
        add_arm_with_controller(DiagramBuilder(), "three_axis", PidGains.paper(3), still)


def test_the_script_to_copy_runs_and_tells_what_is_wrong(repository, tmp_path, capsys):
    script = runpy.run_path(str(repository / "scenarios" / "closed_loop.py"))["main"]
    script(["--seconds", "0.2"])
    alone, fed = (line.split()[-3:] for line in capsys.readouterr().out.splitlines())
    assert float(fed[1].rstrip("°")) < 0.01 < float(alone[1].rstrip("°"))
    for words, told in (
        (["nowhere.json"], "nowhere.json: no such file"),
        (["--seconds", "41"], "--seconds 41: give 0.004 to 40"),
        (["--seconds", "nan"], "--seconds nan: give"),
    ):
        with pytest.raises(SystemExit, match="2"):
            script(words)
        assert told in capsys.readouterr().err
