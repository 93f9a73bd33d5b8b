"""One mixed log of a random arm from an engine of its own: friction as it is, M(q) positive definite within the limits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from armloop.data.log import read_log
from armloop.dynamics import check_physics
from armloop.dynamics.physics import joint_limits, mass_matrix
from armloop.identification.reconstruction import Options, reconstruct
from armloop.robot.arm import Arm, load_arm

pytest.importorskip("mujoco", reason="mujoco is needed for tests only; it is in requirements-test.lock")

from outside.mujoco_arms import OutsideArm, random_arm, write_log
from outside.references import fourier_reference, mixed_reference

#: Ten arms of two to six joints; what their seeds are was not looked at.
TEN = [(100 + k, 2 + k % 5) for k in range(10)]


def a_mixed_log(seed: int, joints: int, seconds: float, folder: Path) -> tuple[OutsideArm, Arm, Path]:
    made = random_arm(seed, joints)
    columns = made.simulate(mixed_reference(made, seed, seconds), seed=seed, rate=250)
    log = write_log(columns, folder / "mixed.csv")
    return made, load_arm(made.write_urdf(folder / "arm.urdf", mass_error=0.1)), log


def check(seed: int, joints: int, seconds: float, folder: Path) -> None:
    made, arm, log = a_mixed_log(seed, joints, seconds, folder)
    result = reconstruct([read_log(log)], arm, options=Options(parts=False))
    model = result.model
    off = []
    for link, line in zip(made.links, model.uncertainty["friction_line"], strict=True):
        for key, truth in (("coulomb", link.frictionloss), ("viscous", link.damping)):
            off.append(abs(line[key]["value"] - truth) / line[key]["std_error"])
    assert max(off) < 3, f"arm {seed}: {np.round(off, 2)} standard errors"
    assert model.history["physics"]["passed"], model.history["physics"]["faults"]
    proven = model.history["physics"]["mass_matrix"]["certificate"]
    assert (proven is not None) == (model.history["library"] in ("rigid-body", "lagrangian"))
    # other postures than those that the checks draw
    low, high = joint_limits(arm)
    q = np.random.default_rng(7).uniform(low, high, (2000, arm.n))
    assert np.linalg.eigvalsh(mass_matrix(model, q))[:, 0].min() > 0
    assert check_physics(model, seed=11).passed


def test_friction_and_mass_matrix_of_one_arm(tmp_path: Path) -> None:
    check(1, 2, 30.0, tmp_path)


@pytest.mark.long
def test_joints_that_never_go_fast(tmp_path: Path) -> None:
    """Two that turn at two degrees a second, and one that slides a centimetre in a second."""
    made = random_arm(33, 3, sliding=True)
    paths = [
        write_log(
            made.simulate(fourier_reference(made, seed, 100.0, 0.03, period=200.0), seed=seed, rate=100),
            tmp_path / f"{seed}.csv",
        )
        for seed in (33, 34)
    ]
    arm = load_arm(made.write_urdf(tmp_path / "arm.urdf", mass_error=0.1))
    model = reconstruct([read_log(path) for path in paths], arm, options=Options(parts=False)).model
    assert max(model.history["range"][1]) < 0.05 and model.history["range"][1][2] < 0.015
    assert max(model.baseline["nrmse"]) < 0.01
    for link, line in zip(made.links, model.uncertainty["friction_line"], strict=True):
        assert line["coulomb"]["value"] == pytest.approx(link.frictionloss, rel=0.02)


@pytest.mark.long
@pytest.mark.parametrize(("seed", "joints"), TEN)
def test_friction_and_mass_matrix_of_ten_arms(seed: int, joints: int, tmp_path: Path) -> None:
    check(seed, joints, 60.0, tmp_path)
