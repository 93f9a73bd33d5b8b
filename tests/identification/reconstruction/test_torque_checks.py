"""Torques that cannot be the arm's are refused with the likely cause; honest ones never are."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic import fourier_motion, friction, measured, rigid_torque, three_axis

from armloop.data.log import MotionLog, read_log, unchecked_log
from armloop.identification.reconstruction import reconstruct
from armloop.identification.reconstruction.torque_checks import check_torques
from armloop.robot.arm import load_arm
from armloop.util.errors import LogError


def run(seed: int = 1, dry: float = 1.0, seconds: float = 40.0) -> MotionLog:
    motion = fourier_motion(seconds, 100.0, seed)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + dry * friction(motion.v)
    return measured(motion, tau, seed)


def exchanged(log: MotionLog, i: int, j: int, *keys: str) -> MotionLog:
    order = np.arange(log.joints)
    order[[i, j]] = order[[j, i]]
    return unchecked_log(**{**vars(log), **{key: getattr(log, key)[:, order] for key in keys}})


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
@pytest.mark.parametrize("dry", [1.0, 0.3])
def test_turned_and_exchanged_columns_are_named(seed: int, dry: float) -> None:
    log = run(seed, dry)
    check_torques([log], three_axis(), 10.0)
    with pytest.raises(LogError, match=r"run: the sign of all joints is turned: .* friction drives"):
        check_torques([replace(log, tau=-log.tau)], three_axis(), 10.0)
    for j in range(3):
        signs = 1.0 - 2.0 * np.eye(3)[j]
        with pytest.raises(LogError, match=rf"the sign of tau{j + 1} is turned"):
            check_torques([replace(log, tau=log.tau * signs)], three_axis(), 10.0)
    for i, j in ((0, 1), (1, 2), (0, 2)):
        with pytest.raises(LogError, match=rf"columns tau{i + 1} and tau{j + 1} are exchanged"):
            check_torques([exchanged(log, i, j, "tau")], three_axis(), 10.0)


def test_reconstruct_asks_for_the_check() -> None:
    for library in (None, "rigid-body"):
        with pytest.raises(LogError, match="the sign of all joints is turned"):
            reconstruct([replace(run(), tau=-run().tau)], three_axis(), library=library)


def test_an_arm_without_friction_is_not_accused() -> None:
    for seed in (1, 2, 3):
        check_torques([run(seed, dry=0.0)], three_axis(), 10.0)


@pytest.mark.measured
def test_measured_arms_are_not_accused_and_their_faults_are_found(measured: Path) -> None:
    ur5 = [12.5, 12.5, 12.5, 9.2, 9.2, 9.2]
    arms = {"ur10e": None, "ur5": ur5, "panda": None, "double_pendulum": None}
    for folder, gains in arms.items():
        arm = load_arm(measured / folder / f"{folder}.urdf")
        for path in sorted(measured.glob(f"{folder}/*.csv"))[::3]:
            if not path.name.endswith(".truth.csv"):
                check_torques([read_log(path, drive_gains=gains, quiet=True)], arm, 8.0)
    arm = load_arm(measured / "ur10e" / "ur10e.urdf")
    log = read_log(measured / "ur10e" / "noload_20_01_31-unload.csv")
    for j in range(6):
        with pytest.raises(LogError, match=rf"the sign of tau{j + 1} is turned"):
            check_torques([replace(log, tau=log.tau * (1.0 - 2.0 * np.eye(6)[j]))], arm, 8.0)
        if j:
            with pytest.raises(LogError, match=rf"columns tau{j} and tau{j + 1} are exchanged"):
                check_torques([exchanged(log, j - 1, j, "tau")], arm, 8.0)
