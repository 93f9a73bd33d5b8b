"""The rigid-body library recovers base parameters and friction from a log, and says when motion is missing."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import fourier_motion, friction, measured, three_axis

from armloop.data.log import MotionLog
from armloop.data.motion import Motion
from armloop.data.signals import preprocess
from armloop.features.rigid_body import BaseParameters
from armloop.identification.reconstruction import Options, Reconstruction, reconstruct
from armloop.identification.reconstruction.shared import SHARED_CONDITIONING, sliding_rows, sticking
from armloop.identification.scoring import score
from armloop.robot.arm import Arm
from armloop.robot.kinematics import nominal_parameters, regressor
from armloop.util.errors import ExcitationError

#: What takes longest of a reconstruction, left out where nobody looks at it.
PLAIN = Options(parts=False, standard_errors=False)


def heavier(arm: Arm) -> Arm:
    """The arm as it really is: links 20-50 % heavier than the URDF says, centres elsewhere."""
    factor = np.array([1.2, 1.5, 1.3])
    com = arm.com * 1.1 + [0.0, 0.01, 0.01]
    shifted = [m * (c @ c * np.eye(3) - np.outer(c, c)) for m, c in zip(arm.mass * factor, com, strict=True)]
    return replace(arm, mass=arm.mass * factor, com=com, inertia=np.array(shifted) + 0.003 * np.eye(3))


ROTORS = np.array([0.08, 0.12, 0.05])  # kg m^2, at the joint


def a_run(seed: int, **change):
    motion = fourier_motion(40.0, 100.0, seed)
    if change:
        motion = replace(motion, **{k: f(getattr(motion, k)) for k, f in change.items()})
    true = nominal_parameters(heavier(three_axis()))
    tau = regressor(three_axis(), motion.q, motion.v, motion.vdot) @ true
    return measured(motion, tau + ROTORS * motion.vdot + friction(motion.v), seed, noise=0.005)


@pytest.fixture(scope="module")
def result() -> Reconstruction:
    return reconstruct([a_run(1), a_run(2)], three_axis(), library="rigid-body")


def test_a_step_has_all_base_parameters_of_a_joint_and_the_friction_found_by_then(result: Reconstruction):
    base, (body,) = BaseParameters.of_arm(three_axis(), rotors=True), result.model.components
    friction = result.model.friction.terms
    for step, report in enumerate(result.reports, 1):
        rubbing = [sum(term.step <= step for term in law) for law in friction]
        assert report.terms == [len(body.terms(three_axis(), j)) + rubbing[j] for j in range(3)]
        # friction that was regressed, and what of it vanished
        assert report.candidates >= base.count + sum(len(law) for law in friction)
        assert (report.step, report.independent) == (step, base.count)
    assert result.reports[0].terms != result.reports[1].terms == result.reports[2].terms


def test_base_parameters_are_recovered_though_the_urdf_is_wrong(result: Reconstruction):
    base = BaseParameters.of_arm(three_axis(), rotors=True)
    (body,) = result.model.components
    truth = base.from_full(np.concatenate([nominal_parameters(heavier(three_axis())), ROTORS]))
    wrong = base.from_full(np.concatenate([nominal_parameters(three_axis()), np.zeros(3)]))
    found = base.from_full(body.parameters)
    size = np.abs(truth).max()
    assert np.abs(found - truth).max() < 0.03 * size
    assert np.linalg.norm(found - truth) < 0.06 * np.linalg.norm(wrong - truth)
    assert body.names == tuple(base.names)
    np.testing.assert_allclose(body.values, found, atol=1e-9)


def test_a_fresh_run_is_predicted(result: Reconstruction):
    samples = preprocess([a_run(9)], result.model.conditioning)
    assert max(score(result.model, samples).moving["nrmse"]) < 0.03
    assert max(result.held_out.moving["nrmse"]) < 0.03


def test_the_steps_are_gravity_then_velocity_then_acceleration(result: Reconstruction):
    motion = fourier_motion(2.0, 50.0, 3)
    rest = replace(motion, v=0 * motion.v, vdot=0 * motion.vdot)
    coasting = replace(motion, vdot=0 * motion.vdot)
    body = result.model.components[0]
    arm = result.model.arm
    for step, part in ((1, rest), (2, coasting), (3, motion)):
        np.testing.assert_allclose(body.torque(arm, motion, step), body.torque(arm, part, 3), atol=1e-12)
    assert [report.step for report in result.reports] == [1, 2, 3]
    assert all(report.orders is None for report in result.reports)


def test_a_joint_that_never_moves_is_named():
    still = {key: (lambda x: x * [1.0, 0.0, 1.0]) for key in ("q", "v", "vdot")}
    with pytest.raises(ExcitationError, match=r"^q2: joint 'joint_2' moves in \d+ samples"):
        reconstruct([a_run(1, **still)], three_axis(), library="rigid-body")


def test_what_no_torque_feels_is_no_base_parameter():
    # joint 2 turns about link 2's y: its first moment along y is seen by nothing but round-off
    assert not any(name.startswith("my2") for name in BaseParameters.of_arm(three_axis()).names)
    assert BaseParameters.of_arm(three_axis()).count == 15


def test_friction_never_drives_and_the_mass_matrix_is_positive(result: Reconstruction):
    model = result.model
    motion = fourier_motion(20.0, 20.0, 5)
    law = model.friction.torque(motion, load=model.rigid_body(motion))
    offsets = np.array(
        [sum(t.coefficient for t in joint if t.kind == "offset") for joint in model.friction.terms]
    )
    assert ((law - offsets) * motion.v)[np.abs(motion.v) > 0.05].min() > 0
    unit = np.eye(3)
    weightless = replace(model.arm, gravity=np.zeros(3))
    for q in motion.q[::40]:
        rows = replace(motion, time=np.arange(3.0), q=np.tile(q, (3, 1)), v=np.zeros((3, 3)), vdot=unit)
        M = model.components[0].torque(weightless, rows, 3)
        np.testing.assert_allclose(M, M.T, atol=1e-9)
        assert np.linalg.eigvalsh(M).min() > 0


def test_parameters_that_the_motion_leaves_open_are_said_to_be():
    # all joints creep around one posture: there is friction to see, and one load
    motion = fourier_motion(40.0, 100.0, 1)
    q, v = 0.3 + 1e-6 * motion.q, 0.04 * np.sign(motion.v) * (1 + 1e-3 * np.cos(motion.q))
    log = MotionLog(motion.time, q, v, 1.0 + friction(v), np.zeros_like(q), name="creep")
    found = reconstruct([log], three_axis(), library="rigid-body", options=PLAIN)
    (note,) = [note for note in found.notes if "does not determine" in note]
    assert "taken from the URDF" in note and "what it determines is" in note
    # what cannot be kept physical on such data is said where it is not
    assert set(found.model.history["physics"]["faults"]) <= set(found.notes)


def test_the_notes_say_what_the_errors_are_of(result: Reconstruction):
    # of the model, whether it is written or not: a call from Python writes none
    note = "errors are of a model fitted without the held-out blocks; the model itself is fitted to all data"
    assert note in result.notes and not any("written" in each for each in result.notes)


def test_the_ladder_says_what_each_rung_brought(result: Reconstruction):
    ladder = result.model.history["friction_ladder"]
    assert ladder[0]["rung"] == "Coulomb and viscous" and ladder[0]["joints"] == [1, 2, 3]
    assert all(rung["after"] <= 1.02 * rung["before"] for rung in ladder)
    # what the arm does not have: friction that grows with load
    assert not any(t.by_load for joint in result.model.friction.terms for t in joint)
    assert any(note.startswith("friction, Stribeck:") for note in result.notes)


def test_friction_terms_dissipate_one_by_one(result: Reconstruction):
    for joint in result.model.friction.terms:
        assert all(term.coefficient > 0 for term in joint if term.kind != "offset")


def creeping(seed: int) -> MotionLog:
    """Short stretches at a tenth of a degree per second in postures all over, each a run of its own."""
    rng = np.random.default_rng(seed)
    v = np.repeat(0.00175 * rng.choice([-1.0, 1.0], (30, 3)), 80, axis=0)
    within = np.tile(np.arange(80) / 100, 30)
    q = np.repeat(rng.uniform(-1.0, 1.0, (30, 3)), 80, axis=0) + within[:, None] * v
    motion = Motion(within + np.repeat(np.arange(30.0), 80), q, v, np.zeros_like(q), np.arange(0, 2400, 80))
    return exact(motion, seed)


def exact(motion: Motion, seed: int) -> MotionLog:
    """A log whose velocities are so good that creeping is told from standing."""
    rigid = regressor(three_axis(), motion.q, motion.v, motion.vdot) @ nominal_parameters(three_axis())
    log = measured(motion, rigid + friction(motion.v), seed, noise=0.005)
    return replace(log, q=motion.q, v=motion.v.round(7))


@pytest.mark.long
def test_friction_keeps_its_level_where_a_joint_creeps() -> None:
    logs = [exact(fourier_motion(40.0, 100.0, seed), seed) for seed in (1, 2)]
    for library, most in (("rigid-body", 0.01), ("lagrangian", 0.03)):
        model = reconstruct([*logs, creeping(1)], three_axis(), library=library, options=PLAIN).model
        slow = preprocess([creeping(2)], model.conditioning)
        assert slow.moving.all()
        error = model.predict(slow.motion) - slow.tau
        level = np.sqrt(np.mean(slow.tau**2, axis=0))
        assert (np.sqrt(np.mean(error**2, axis=0)) < most * level).all()


@pytest.mark.parametrize(("fastest", "edge"), [(1.0, 0.01), (0.4, 0.01), (0.1, 0.005), (0.04, 0.002)])
def test_steady_creeping_counts_and_a_slow_reversal_does_not(fastest: float, edge: float) -> None:
    """Slow is what is slow for the joint, where it never goes fast."""
    slow = preprocess([creeping(1)], SHARED_CONDITIONING)
    assert sliding_rows(slow).all()
    time = np.arange(0, 4.0, 0.01)
    v = np.column_stack([fastest * np.sin(np.pi * time)] * 3)
    motion = Motion(time, np.cumsum(v, axis=0) / 100, v, np.zeros_like(v), np.array([0]))
    swing = preprocess([exact(motion, 1)], SHARED_CONDITIONING)
    rows, speed = sliding_rows(swing), np.abs(swing.motion.v)
    assert rows[swing.moving & (speed > 1.1 * edge)].all() and not rows[speed < 0.9 * edge].any()
    np.testing.assert_allclose(sticking(swing), edge, rtol=0.01)
