"""A folder with everything right in it, and some things wrong, for the cases of faults."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from exact_parts import as_it_was
from synthetic import fourier_motion, friction, measured, rigid_torque, three_axis

from armloop.data.log import MotionLog, write_log
from armloop.laws.friction import FrictionLaw
from armloop.model import ReconstructedModel
from armloop.model.components import RigidBody
from armloop.robot.kinematics import nominal_parameters


def good_log(seconds: float = 12.0) -> MotionLog:
    motion = fourier_motion(seconds, 100.0, 1)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)
    return measured(motion, tau, 1)


def good_model() -> ReconstructedModel:
    """The arm as it is, but for a little of its third joint's viscous friction: a diagnosis has something to find."""
    exact = as_it_was()
    *others, (sign, stribeck, viscous) = exact.friction.terms
    less = replace(viscous, coefficient=viscous.coefficient - 0.5)
    law = FrictionLaw((*others, (sign, stribeck, less)))
    return replace(exact, friction=law, baseline={"rmse": [0.05] * 3})


@pytest.fixture(scope="session")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with everything right in it."""
    folder = tmp_path_factory.mktemp("inputs")
    log = good_log()
    write_log(folder / "good.csv", log)
    two = replace(log, q=log.q[:, :2], v=log.v[:, :2], tau=log.tau[:, :2])
    write_log(folder / "two_joints.csv", two)
    write_log(folder / "short.csv", log.select(slice(0, 400)))
    gaps = log.time + 5.0 * (np.arange(log.samples) // 15)
    write_log(folder / "gaps.csv", replace(log, time=gaps))
    still = log.q.copy()
    still[:, 1] = 0.3
    write_log(folder / "still.csv", replace(log, q=still, v=log.v * [1, 0, 1]))
    write_log(folder / "no_torque.csv", replace(log, tau=log.tau * [1, 1, 0]))
    header, *rows = (folder / "good.csv").read_text().splitlines()
    table = np.array([[float(cell) for cell in row.split(",")] for row in rows])
    table[:, 1:7] = np.degrees(table[:, 1:7])
    np.savetxt(folder / "degrees.csv", table, delimiter=",", header=header, comments="")
    good_model().save(folder / "model.json")
    (folder / "a_file").write_text("here")
    return folder


@pytest.fixture(scope="session")
def scara_model(inputs: Path) -> Path:
    from armloop.robot.arm import load_arm

    arm = load_arm("scara")
    body = RigidBody(nominal_parameters(arm), ("m1",), np.ones(1))
    path = inputs / "scara.json"
    ReconstructedModel(arm, (body,), FrictionLaw(((),) * 4)).save(path)
    return path
