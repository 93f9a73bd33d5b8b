"""Diagrams of a user's own, from the exported parts."""

import runpy

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput
from pydrake.trajectories import PiecewisePolynomial

from armloop.drake import PidGains, add_arm_with_controller
from armloop.experiment.excitation import FourierReference, paper_reference
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import ReconstructedModel, load_model
from armloop.model.components import RigidBody
from armloop.robot.arm import load_arm
from armloop.robot.kinematics import nominal_parameters
from armloop.util.errors import InputError

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


def test_a_model_file_takes_the_place_of_nothing(tmp_path):
    """The same lines with a model: what PID alone leaves of the error nearly goes away."""
    arm = load_arm("three_axis")
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
    body = RigidBody(nominal_parameters(arm), ("m1",), np.array([1.0]))
    ReconstructedModel(arm, (body,), friction).save(tmp_path / "model.json")

    largest = {}
    for model in (None, load_model(tmp_path / "model.json", arm)):
        builder = DiagramBuilder()
        loop = add_arm_with_controller(builder, "three_axis", PidGains.paper(3), paper_reference(), model)
        simulator = Simulator(builder.Build())
        loop.start_on_reference(simulator.get_mutable_context())
        simulator.AdvanceTo(0.5)
        state = loop.plant.GetOutputPort("state").Eval(
            loop.plant.GetMyContextFromRoot(simulator.get_context())
        )
        largest[model is None] = np.abs(state[:3] - loop.reference.tables[0][500]).max()
    assert largest[False] < 0.01 * largest[True]


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
