"""The arms from outside are what they say: torque, motion and log agree with Newton and Euler to rounding."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest

from armloop.data.log import read_log
from armloop.robot.arm import load_arm
from armloop.robot.kinematics import nominal_parameters, regressor
from armloop.robot.newton_euler import inverse_dynamics

pytest.importorskip("mujoco", reason="mujoco is needed for tests only; it is in requirements-test.lock")

from outside.mujoco_arms import random_arm, write_log
from outside.references import fourier_reference, mixed_reference, point_reference

HERE = Path(__file__).parent


def columns_of(log: dict[str, np.ndarray], name: str) -> np.ndarray:
    return np.column_stack([log[f"{name}{j + 1}"] for j in range(sum(k.startswith("vdot") for k in log))])


def rigid(arm, log: dict[str, np.ndarray]) -> np.ndarray:
    q, v, vdot = (columns_of(log, name) for name in ("q", "v", "vdot"))
    law = inverse_dynamics(arm, nominal_parameters(arm))
    return np.array([law(*state) for state in zip(q, v, vdot, strict=True)])


@pytest.mark.parametrize(("joints", "sliding"), [(2, False), (4, True), (6, False)])
def test_the_torque_is_that_of_newton_and_euler(joints: int, sliding: bool, tmp_path: Path) -> None:
    made = random_arm(7, joints, sliding)
    bare = type(made)(
        made.name, tuple(type(k)(**{**vars(k), "frictionloss": 0.0, "damping": 0.0}) for k in made.links)
    )
    log = bare.simulate(fourier_reference(bare, 1, 2.0), clean=True, rate=200)
    arm = load_arm(bare.write_urdf(tmp_path / "arm.urdf"))
    armature = np.array([link.armature for link in bare.links]) * columns_of(log, "vdot")
    tau = columns_of(log, "tau")
    np.testing.assert_allclose(rigid(arm, log) + armature, tau, atol=1e-6 * np.abs(tau).max())


def test_friction_is_that_of_the_model_while_a_joint_slides(tmp_path: Path) -> None:
    made = random_arm(3, 3)
    log = made.simulate(fourier_reference(made, 1, 5.0), clean=True, rate=200)
    arm = load_arm(made.write_urdf(tmp_path / "arm.urdf"))
    v = columns_of(log, "v")
    rub = sum(
        np.array([getattr(k, name) for k in made.links]) * x
        for name, x in (("armature", columns_of(log, "vdot")), ("damping", v), ("frictionloss", np.sign(v)))
    )
    tau, slides = columns_of(log, "tau"), np.abs(v) > 0.1
    off = np.abs(tau - rigid(arm, log) - rub)[slides]
    # MuJoCo's friction is a soft constraint: its force falls short of the limit by a part, near zero speed alone.
    assert np.quantile(off, 0.99) < 1e-6 * np.abs(tau).max()


def test_a_push_asks_for_the_torque_of_its_jacobian(tmp_path: Path) -> None:
    made = random_arm(5, 3)
    push = {"name": "external_contact", "body": 3, "start": 0.5, "end": 1.5, "force": [3.0, -4.0, 5.0]}
    log = made.simulate(fourier_reference(made, 1, 2.0), [push], clean=True, rate=200, controller="pd")
    arm = load_arm(made.write_urdf(tmp_path / "arm.urdf"))
    v, vdot = columns_of(log, "v"), columns_of(log, "vdot")
    rub = sum(
        np.array([getattr(k, name) for k in made.links]) * x
        for name, x in (("armature", vdot), ("damping", v), ("frictionloss", np.sign(v)))
    )
    left = columns_of(log, "tau") - rigid(arm, log) - rub
    # A force on a point is what gravity would be on a unit mass there.
    q = columns_of(log, "q")
    mass = np.concatenate([np.zeros(20), [1.0], made.links[2].com, np.zeros(6)])
    needed = regressor(arm, q, 0 * q, 0 * q, np.array(push["force"])) @ mass
    during = (log["time"] > 0.5) & (log["time"] < 1.5) & (np.abs(v).min(axis=1) > 0.05)
    before = (log["time"] < 0.5) & (np.abs(v).min(axis=1) > 0.05)
    assert np.abs(left[before]).max() < 1e-4
    assert during.sum() > 50
    np.testing.assert_allclose(left[during], needed[during], atol=1e-4)


@pytest.mark.parametrize("seed", range(4))
def test_points_are_gone_to_in_turn_from_rest_to_rest(seed: int) -> None:
    """Both kinds of velocity among the seeds; the derivatives are those of the angles, which repeat."""
    made = random_arm(3, 3)
    r = point_reference(made, seed, 20.0, speed=0.8)
    assert len(r.q) == len(r.v) == len(r.vdot) == 20_001 and abs(r.seconds - 20.0) < 1e-9
    within = [np.abs(r.v[:, j]).max() <= 0.81 * link.speed for j, link in enumerate(made.links)]
    assert all(within)
    # a sample is half a millisecond off in the middle between two
    np.testing.assert_allclose(np.diff(r.q, axis=0), 0.5e-3 * (r.v[1:] + r.v[:-1]), atol=2e-5)
    rests = (r.v == 0).all(axis=1)
    places = np.unique(np.round(r.q[rests], 6), axis=0)
    assert 4 <= len(places) <= 7 and 0.05 < rests.mean() < 0.7


def test_a_log_is_read(tmp_path: Path) -> None:
    made = random_arm(2, 2)
    path = write_log(made.simulate(mixed_reference(made, 1, 20.0), seed=1, rate=100), tmp_path / "run.csv")
    log = read_log(path)
    assert log.joints == 2
    assert np.ptp(log.time) > 19


def test_what_generates_imports_nothing_of_what_judges() -> None:
    for path in (HERE / "mujoco_arms.py", HERE / "mujoco_run.py", HERE / "references.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        names = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
        names |= {a.name for node in ast.walk(tree) if isinstance(node, ast.Import) for a in node.names}
        assert not any(str(name).startswith("armloop") for name in names)
