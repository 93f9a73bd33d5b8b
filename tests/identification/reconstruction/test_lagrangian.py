"""The Lagrangian library finds the energies of an arm whose lengths and masses it is not told."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from synthetic import fourier_motion, friction, measured, rigid_torque, three_axis

from armloop.data.log import MotionLog
from armloop.data.motion import Motion
from armloop.data.signals import preprocess
from armloop.dynamics import Dynamics
from armloop.features.lagrangian import candidates
from armloop.identification.reconstruction import Options, Reconstruction, reconstruct
from armloop.identification.reconstruction.physical import PhysicalSolution
from armloop.identification.reconstruction.pooled import Solution
from armloop.identification.reconstruction.training import Survey
from armloop.identification.scoring import score
from armloop.model import ReconstructedModel, load_model
from armloop.model.components import Lagrangian
from armloop.robot.arm import load_arm
from armloop.robot.kinematics import regressor
from armloop.util.errors import ExcitationError, ModelError

#: Without what takes longest, and nobody looks at here.
PLAIN = Options(parts=False, standard_errors=False)

#: Terms of T and U, J per unit: links, and rotors on joints 1 and 2.
TRUTH = {
    "v1^2": 0.2,
    "v2^2": 0.3,
    "v3^2": 0.06,
    "cos(2*q2)*v1^2": 0.08,
    "cos(2*q2 + q3)*v1^2": 0.07,
    "cos(q3)*v1^2": 0.07,
    "cos(q3)*v2^2": 0.14,
    "cos(q3)*v2*v3": 0.14,
    "v2*v3": 0.1,
    "sin(q2)": 9.0,
    "sin(q2 + q3)": 1.8,
}


def planted() -> Lagrangian:
    library = candidates(three_axis())
    return Lagrangian(
        library.take(np.array([library.names.index(name) for name in TRUTH])), np.array(list(TRUTH.values()))
    )


def a_run(seed: int, noise: float = 0.01) -> MotionLog:
    motion = fourier_motion(40.0, 100.0, seed)
    return measured(motion, planted().torque(three_axis(), motion, 3) + friction(motion.v), seed, noise=noise)


@pytest.fixture(scope="module")
def result() -> Reconstruction:
    return reconstruct([a_run(1), a_run(2)], three_axis(), library="lagrangian", options=PLAIN)


def test_the_planted_energies_are_found_under_noise(result: Reconstruction):
    (body,) = result.model.components
    found = dict(zip(body.energy.names, body.coefficients, strict=True))
    assert set(TRUTH) <= set(found) and len(found) <= len(TRUTH) + 2
    for name, value in found.items():
        assert value == pytest.approx(TRUTH.get(name, 0.0), rel=0.1, abs=0.02)


def test_a_step_has_the_terms_that_act_on_a_joint_by_then(result: Reconstruction):
    (body,) = result.model.components
    count, friction = candidates(three_axis()).count, result.model.friction.terms
    assert {term.step for law in friction for term in law} == {1, 2}
    for step, report in enumerate(result.reports, 1):
        # at rest the potential energy, in motion the kinetic too, which each joint feels whose angle or speed is in it
        names = [name for name in body.energy.names if step > 1 or "v" not in name]
        acting = [sum(f"q{j}" in name or f"v{j}" in name for name in names) for j in (1, 2, 3)]
        rubbing = [sum(term.step <= step for term in law) for law in friction]
        assert report.terms == [a + b for a, b in zip(acting, rubbing, strict=True)]
        assert (report.step, report.candidates, report.independent) == (step, count, count)


def test_a_fresh_run_is_predicted(result: Reconstruction):
    samples = preprocess([a_run(9, noise=0.0)], result.model.conditioning)
    assert max(score(result.model, samples).moving["nrmse"]) < 0.02
    assert max(result.held_out.moving["nrmse"]) < 0.03


def test_the_steps_are_gravity_then_velocity_then_acceleration(result: Reconstruction):
    motion = fourier_motion(2.0, 50.0, 3)
    rest = replace(motion, v=0 * motion.v, vdot=0 * motion.vdot)
    coasting = replace(motion, vdot=0 * motion.vdot)
    (body,), arm = result.model.components, result.model.arm
    for step, part in ((1, rest), (2, coasting), (3, motion)):
        np.testing.assert_allclose(body.torque(arm, motion, step), body.torque(arm, part, 3), atol=1e-12)
    gravity = body.torque(arm, motion, 1)
    np.testing.assert_allclose(gravity[:, 0], 0.0)
    assert [report.step for report in result.reports] == [1, 2, 3]


def test_the_mass_matrix_is_symmetric_and_positive(result: Reconstruction):
    (body,) = result.model.components
    M = body.mass_matrix(fourier_motion(20.0, 20.0, 5).q)
    np.testing.assert_array_equal(M, M.transpose(0, 2, 1))
    assert np.linalg.eigvalsh(M).min() > 0
    assert not any("not positive definite" in note for note in result.notes)


def test_the_energies_can_be_read(result: Reconstruction):
    kinetic, potential = result.model.legend()
    assert kinetic.startswith("T = 0.") and "*cos(2*q2)*v1^2" in kinetic
    assert potential.startswith("U = ") and "*sin(q2 + q3)" in potential
    formula = result.model.formulas()[1]
    assert "dU/dq2" in formula and "(d/dt(dT/dv2) - dT/dq2)" in formula and "*v2" in formula
    assert "dU/dq1" not in result.model.formulas()[0]


def test_the_file_gives_the_same_model(result: Reconstruction, tmp_path):
    result.model.save(tmp_path / "model.json")
    again = load_model(tmp_path / "model.json", three_axis())
    motion = fourier_motion(2.0, 50.0, 3)
    for step in (1, 2, 3):
        np.testing.assert_array_equal(again.predict(motion, step), result.model.predict(motion, step))
    assert again.legend() == result.model.legend()


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"speeds": [1, 4]}, "speeds must be two joints from 1 to 3"),
        ({"speeds": [0, 2]}, "speeds must be two joints from 1 to 3"),
        ({"degrees": [1, 0]}, "lagrangian: degrees of '.*': 2 joints, the arm has 3"),
    ],
)
def test_a_spoilt_file_is_refused(result: Reconstruction, tmp_path, change: dict, expected: str):
    data = result.model.to_dict()
    data["components"][0]["terms"] = [{**data["components"][0]["terms"][0], **change}]
    (tmp_path / "model.json").write_text(json.dumps(data))
    with pytest.raises(ModelError, match=expected):
        load_model(tmp_path / "model.json")


@pytest.mark.parametrize("name", ["three_axis", "scara"])
def test_one_sample_at_a_time_gives_the_vectorised_torque(name: str, result: Reconstruction):
    arm, rng = load_arm(name), np.random.default_rng(4)
    library = candidates(arm)
    body = Lagrangian(library, rng.normal(size=library.count))
    law = replace(result.model.friction, terms=((),) * arm.n)
    model = ReconstructedModel(arm, (body,), law)
    for step in (1, 2, 3):
        for q, v, vdot in rng.uniform(-1, 1, (5, 3, arm.n)):
            motion = Motion(np.zeros(1), q[None], v[None], vdot[None], np.array([0]))
            expected = model.predict(motion, step)[0]
            np.testing.assert_allclose(model.feedforward(q, v, vdot, step), expected, rtol=1e-9, atol=1e-9)


def test_link_parameters_follow_from_the_energies(result: Reconstruction):
    # what the diagnosis of a payload needs: link parameters that give the same torques
    arm, library = three_axis(), candidates(three_axis())
    motion = fourier_motion(20.0, 20.0, 5)
    tau = rigid_torque(arm, motion.q, motion.v, motion.vdot)
    rows = library.columns(motion).reshape(-1, library.count)
    body = Lagrangian(library, np.linalg.lstsq(rows, tau.ravel(), rcond=1e-10)[0])
    model = replace(result.model, components=(body,))
    again = regressor(arm, motion.q, motion.v, motion.vdot) @ model.inertial_parameters()
    np.testing.assert_allclose(again, tau, atol=1e-2)


def test_without_room_for_a_positive_mass_matrix_the_notes_say_so(monkeypatch: pytest.MonkeyPatch):
    def no_room_for_mass(solution: Solution, *_) -> PhysicalSolution:
        negative = np.where(np.arange(len(solution.theta)) < 3, -1.0, solution.theta)
        return PhysicalSolution(negative, 0, where="free")

    monkeypatch.setattr(
        "armloop.identification.reconstruction.lagrangian.physical_solution", no_room_for_mass
    )
    notes = reconstruct([a_run(1)], three_axis(), library="lagrangian", options=PLAIN).notes
    assert any("contradict a positive definite M(q)" in note for note in notes)
    assert any(note.startswith("M(q) is not positive definite") for note in notes)
    assert any("do not suit this arm" in note for note in notes)


def test_where_no_positive_mass_matrix_is_found_the_notes_say_so(monkeypatch: pytest.MonkeyPatch):
    def none(*_) -> PhysicalSolution:
        raise ExcitationError("the motion tells too little")

    monkeypatch.setattr("armloop.identification.reconstruction.lagrangian.physical_solution", none)
    found = reconstruct([a_run(1)], three_axis(), library="lagrangian", options=PLAIN)
    assert found.model.history["kept_positive"] == "unknown"
    assert any("no coefficients with a positive definite M(q) were found" in note for note in found.notes)


def test_the_weight_of_an_upright_slide_is_gravity_and_no_offset_of_its_friction():
    arm = load_arm("scara")
    motion = fourier_motion(40.0, 100.0, 3, arm)
    rubs = 0.5 * np.tanh(motion.v / 1e-3) + motion.v
    log = measured(motion, rigid_torque(arm, motion.q, motion.v, motion.vdot) + rubs, 3)
    model = reconstruct([log], arm, library="lagrangian", options=PLAIN).model
    (slide,) = np.flatnonzero(~arm.revolute)
    rest = np.zeros((1, arm.n))
    weight = rigid_torque(arm, rest, rest, rest)[0]
    assert abs(weight[slide]) > 1.0
    np.testing.assert_allclose(Dynamics(model).gravity(rest)[0], weight, atol=0.01 * abs(weight[slide]))
    assert "offset" not in [term.kind for term in model.friction.terms[slide]]


def test_motion_that_tells_nothing_is_refused():
    motion = fourier_motion(40.0, 100.0, 1)
    q, v = 0.3 + 1e-6 * motion.q, 0.04 * np.sign(motion.v) * (1 + 1e-3 * np.cos(motion.q))
    log = MotionLog(motion.time, q, v, 1.0 + friction(v), np.zeros_like(q), name="creep")
    with pytest.raises(ExcitationError, match=r"\d+ of \d+ inertial parameters undetermined"):
        reconstruct([log], three_axis(), library="lagrangian", options=PLAIN)
    still = replace(a_run(1), q=motion.q * [1.0, 0.0, 1.0], v=motion.v * [1.0, 0.0, 1.0])
    with pytest.raises(ExcitationError, match=r"^q2: joint 'joint_2' moves in \d+ samples"):
        reconstruct([still], three_axis(), library="lagrangian", options=PLAIN)


def test_the_load_of_an_upright_slide_is_known_with_its_weight(monkeypatch: pytest.MonkeyPatch) -> None:
    """Friction that grows with it must not be fitted to what an offset has left of it."""
    arm, asked = load_arm("scara"), list[Any]()

    def load(self: Survey, count: int, weights_of: Any = ()) -> Any:
        asked.append(list(weights_of))
        raise ExcitationError("enough")

    monkeypatch.setattr(Survey, "load", load)
    motion = fourier_motion(20.0, 100.0, 3, arm, 0.1)
    tau = rigid_torque(arm, motion.q, motion.v, motion.vdot) + 0.3 * np.sign(motion.v)
    for library in ("lagrangian", "rigid-body"):
        with pytest.raises(ExcitationError, match="enough"):
            reconstruct([measured(motion, tau, 1)], arm, library=library, options=PLAIN)
    assert asked == [np.flatnonzero(~arm.revolute).tolist()] * 2
