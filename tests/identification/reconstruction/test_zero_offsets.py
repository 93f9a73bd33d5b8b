"""Joints that are further than their positions say: by a little, which the model takes in, or by a quarter turn."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import fourier_motion, rigid_torque
from synthetic import measured as recorded

from armloop.data.log import MotionLog, read_log
from armloop.data.signals import preprocess
from armloop.identification.reconstruction import Options, reconstruct, stance_angles, zero_offsets
from armloop.identification.reconstruction.mounting import Mounting
from armloop.identification.reconstruction.plain_fits import Fit
from armloop.identification.reconstruction.stances import Stance
from armloop.identification.reconstruction.torque_checks import check_torques
from armloop.identification.reconstruction.zero_offsets import ZeroOffset
from armloop.identification.scoring import score
from armloop.model import load_model
from armloop.robot.arm import Arm, load_arm
from armloop.util.errors import LogError


def six_axes(folder: Path) -> Arm:
    """An arm of an upright first axis, shoulder, elbow and a wrist of three, none of whose links lies on its axis."""
    place = [(0, 0, 0.2), (0.05, 0, 0.1), (0, 0, 0.4), (0, 0.02, 0.1), (0, 0, 0.3), (0, 0, 0.1)]
    axis = ["0 0 1", "0 1 0", "0 1 0", "0 0 1", "0 1 0", "0 0 1"]
    text = '<robot name="six"><link name="l0"/>'
    for k in range(6):
        m, c = 6.0 / (k + 1), 0.03 * (k + 1)
        text += (
            f'<link name="l{k + 1}"><inertial><origin xyz="{0.02 + c / 4} {0.01 + c / 6} {0.05 + c / 2}"/>'
            f'<mass value="{m}"/>'
            f'<inertia ixx="{0.02 * m}" iyy="{0.025 * m}" izz="{0.01 * m}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
            f'<joint name="j{k + 1}" type="revolute"><parent link="l{k}"/><child link="l{k + 1}"/>'
            f'<origin xyz="{place[k][0]} {place[k][1]} {place[k][2]}"/><axis xyz="{axis[k]}"/>'
            '<limit lower="-3" upper="3" velocity="5" effort="200"/></joint>'
        )
    (folder / "six.urdf").write_text(text + "</robot>")
    return load_arm(folder / "six.urdf")


def a_run(arm: Arm, seed: int, seconds: float = 60.0) -> MotionLog:
    motion = fourier_motion(seconds, 100.0, seed, arm)
    tau = rigid_torque(arm, motion.q, motion.v, motion.vdot)
    size = np.sqrt(np.mean(tau**2, axis=0))
    return recorded(motion, tau + size * (0.1 * np.sign(motion.v) + 0.1 * motion.v), seed, name=f"run_{seed}")


def zeros_of(found: list[Stance]) -> dict[int, float]:
    return {one.joint: one.angle for one in found if isinstance(one, ZeroOffset)}


@pytest.mark.parametrize("seed", [pytest.param(1, marks=pytest.mark.long), 2])
def test_a_zero_that_is_slightly_off_is_found_within_its_errors(seed: int, tmp_path: Path) -> None:
    arm = six_axes(tmp_path)
    assert check_torques([a_run(arm, seed)], arm, 10.0) == []
    for joint, angle in ((1, 0.08), (2, -0.15)):
        (found,) = check_torques([a_run(arm.with_zero(joint, angle), seed)], arm, 10.0)
        assert isinstance(found, ZeroOffset) and found.joint == joint
        assert abs(found.angle - angle) < 5 * found.std_error < 0.02


@pytest.mark.parametrize(
    ("joint", "angle", "words"),
    [
        (2, -np.pi / 2, r"q3 - 1\.57"),
        pytest.param(1, np.pi / 2, r"q2 \+ 1\.57", marks=pytest.mark.long),
    ],
)
def test_a_quarter_turn_is_another_zero(joint: int, angle: float, words: str, tmp_path: Path) -> None:
    arm = six_axes(tmp_path)
    with pytest.raises(
        LogError, match=f"joint {joint + 1} counts from another zero than the URDF's; give {words}"
    ):
        check_torques([a_run(arm.with_zero(joint, angle), 1)], arm, 10.0)


def test_a_model_of_an_arm_whose_zero_is_off_has_it(tmp_path: Path) -> None:
    arm = six_axes(tmp_path)
    real = arm.with_zero(1, 0.08)
    options = Options(parts=False, standard_errors=False)
    logs = [a_run(real, seed) for seed in (1, 2)]
    found = reconstruct(logs, arm, library="rigid-body", options=options)
    (said,) = [note for note in found.notes if note.startswith("joint 2 is 0.0")]
    assert "further than q2 says by the URDF's zero, and the model takes it so; give q2 + 0.0" in said
    found.model.save(tmp_path / "model.json")
    kept = load_model(tmp_path / "model.json", arm)
    assert kept.arm.zeros[1] == pytest.approx(0.08, abs=0.005)
    assert kept.history["zeros"][0]["joint"] == 2
    fresh = preprocess([a_run(real, 3)], kept.conditioning)
    assert max(score(kept, fresh).moving["nrmse"]) < 0.06


@pytest.mark.parametrize(
    ("angle", "error", "springs", "slight"),
    [(0.011, 1e-4, False, True), (0.009, 1e-4, False, None), (0.02, 0.0039, False, True), (0.02, 0.0041, False, None),
     (0.34, 0.01, False, True), (0.34, 0.01, True, None), (-0.36, 0.01, False, False)],
)  # fmt: skip
def test_a_zero_is_off_by_more_than_its_error_and_another_one_by_more_than_a_third(
    angle: float, error: float, springs: bool, slight: bool | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And by none where springs at the joints explain as much."""
    asked = set()

    def refined(problem: Any, stances: list[ZeroOffset]) -> list[ZeroOffset]:
        (own,) = stances
        asked.add(own.joint)
        return [ZeroOffset(own.joint, angle if own.joint == 1 else 0.0, error)]

    errors = {
        False: Fit(*np.array([[0.3] * 4, [1.0] * 4, [1.0] * 4])),
        True: Fit(*np.array([[0.1] * 4, [1.0] * 4, [1.0] * 4])),
    }
    fits = {key: SimpleNamespace(left=lambda f=fit: f, fit=lambda f=fit: f) for key, fit in errors.items()}
    problem: Any = SimpleNamespace(
        arm=SimpleNamespace(
            n=4, revolute=np.array([True, True, False, True]), with_zero=lambda joint, by: (joint, by)
        ),
        as_of=lambda arm: fits[arm == (1, angle)],
        sprung=lambda: fits[springs],
        left=lambda: errors[False],
    )
    problem.every = lambda step: problem
    monkeypatch.setattr(zero_offsets, "refined", refined)
    found = zero_offsets.other_zero(problem, errors[False])
    # what slides has no zero that torques tell, nor has the last joint
    assert asked == {0, 1}
    assert found is None if slight is None else (found is not None and found.slight is slight)


@pytest.mark.parametrize(
    ("lean", "zeros"),
    [
        (0.0, {1: 0.12, 2: -0.1}),
        (0.1, {1: 0.05, 2: 0.05, 3: 0.05, 4: 0.05}),
        pytest.param(0.1, {1: 0.12, 2: -0.1}, marks=pytest.mark.long),
        pytest.param(0.0, {1: 0.05, 2: 0.05, 3: 0.05, 4: 0.05}, marks=pytest.mark.long),
    ],
)
def test_all_that_is_off_is_found_together(lean: float, zeros: dict[int, float], tmp_path: Path) -> None:
    """One by one, two parallel axes seemed to be one that was off by the difference, .024."""
    arm = six_axes(tmp_path)
    stands = replace(arm, gravity=9.81 * np.array([np.sin(lean), 0.0, -np.cos(lean)]))
    for joint, angle in zeros.items():
        stands = stands.with_zero(joint, angle)
    found = check_torques([a_run(stands, 1)], arm, 10.0)
    assert zeros_of(found) == {joint: pytest.approx(angle, abs=0.005) for joint, angle in zeros.items()}
    for one in found:
        if isinstance(one, ZeroOffset):
            assert abs(one.angle - zeros[one.joint]) < 5 * one.std_error < 0.01
    leans = [one for one in found if isinstance(one, Mounting)]
    assert len(leans) == (lean > 0) and all(abs(one.angle - lean) < 0.002 for one in leans)


@pytest.mark.long
@pytest.mark.measured
def test_zeros_of_a_measured_arm_are_found_together(measured: Path) -> None:
    arm = load_arm(measured / "panda" / "panda.urdf")
    log = read_log(measured / "panda" / "exciting_1a.csv", quiet=True)
    turns = {1: 0.1, 2: -0.1, 3: 0.1, 4: -0.1}
    for joint, angle in turns.items():
        arm = arm.with_zero(joint, angle)
    found = zeros_of(check_torques([log], arm, 8.0))
    # its own are not quite those of its URDF
    assert found == {joint: pytest.approx(-angle, abs=0.04) for joint, angle in turns.items()}


@pytest.mark.long
@pytest.mark.measured
def test_measured_arms_have_the_urdfs_zeros_but_where_that_is_turned(measured: Path) -> None:
    arm = load_arm(measured / "panda" / "panda.urdf")
    log = read_log(measured / "panda" / "exciting_1a.csv", quiet=True)
    # a tenth of joint 4 is no more than springs would explain
    for joint, angle in ((1, 0.1), (4, 0.15)):
        found = zeros_of(check_torques([log], arm.with_zero(joint, -angle), 8.0))
        assert found.pop(joint) == pytest.approx(angle, abs=0.01)
        # its own, beside that
        assert all(abs(angle) < 0.03 for angle in found.values())
    with pytest.raises(LogError, match=r"joint 2 counts from another zero .* give q2 \+ 1\.57"):
        check_torques([log], arm.with_zero(1, -np.pi / 2), 8.0)


def test_no_step_is_longer_than_the_slopes_are_good_for(monkeypatch: pytest.MonkeyPatch) -> None:
    offs = iter([3.0, -0.1, 1e-6])
    step = lambda problem, stances: ([1], np.array([next(offs)]), np.eye(1) * 1e-4)  # noqa: E731
    monkeypatch.setattr(stance_angles, "_step", step)
    problem: Any = SimpleNamespace(
        arm=SimpleNamespace(with_zero=lambda joint, angle: None), as_of=lambda arm: None
    )
    (found,) = stance_angles.refined(problem, [ZeroOffset(1, 0.0, np.inf)])
    assert found.angle == pytest.approx(0.4 - 0.1, abs=1e-5) and found.std_error == pytest.approx(0.01)
    # it ends once steps are short
    assert next(offs, None) is None
