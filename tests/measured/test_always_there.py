"""Laws that a measured arm has all along: none but its gears' ripple by itself, and one that is added to its logs.

The coupling's torque is added to the recorded torque of joints 5 and 6, as a coupled wrist's drives would supply it.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from armloop.data.log import MotionLog, read_log
from armloop.identification.reconstruction import Options, Reconstruction, reconstruct
from armloop.model import load_model
from armloop.robot.arm import load_arm

pytestmark = pytest.mark.measured

GAINS = (11.75, 11.98, 9.83, 10.75, 10.55, 10.9)
COUPLING = {"inertia": 0.05, "viscous": 0.15, "coulomb": 0.12}


def coupled(log: MotionLog) -> MotionLog:
    """The log of an arm whose motor 5 turns with the sum of the speeds of joints 5 and 6."""
    w = log.v[:, 4] + log.v[:, 5]
    rate = np.gradient(gaussian_filter1d(w, 3.0), log.time)
    torque = COUPLING["inertia"] * rate + COUPLING["viscous"] * w + COUPLING["coulomb"] * np.sign(w)
    return replace(log, tau=log.tau + np.outer(torque, [0, 0, 0, 0, 1, 1]))


def made(logs: list[MotionLog], arm: Path) -> Reconstruction:
    return reconstruct(logs, load_arm(str(arm)), library="rigid-body", options=Options(standard_errors=False))


@pytest.fixture(scope="module")
def logs(ur10e: Path) -> list[MotionLog]:
    return [read_log(path, drive_gains=GAINS) for path in sorted(ur10e.glob("noload_*.csv"))[:3]]


@pytest.fixture(scope="module")
def clean(logs: list[MotionLog], ur10e: Path) -> Reconstruction:
    return made(logs, ur10e / "ur10e.urdf")


def test_the_arm_by_itself_has_but_the_ripple_of_its_gears(
    model: Path, answer_of_model: dict[str, Any]
) -> None:
    """Strain-wave gears of ratio 101 have two meshes per turn of the motor: 202 per revolution of the joint; motors cog."""
    for added in load_model(model).effects:
        assert added.effect.name == "torque_ripple"
        order = float(np.asarray(added.parameters["order"].value))
        assert min(abs(order - 101 * turns) for turns in (1, 2, 4, 8)) <= 2
    assert answer_of_model["warnings"] == [] and len(answer_of_model["joints"]) == 6
    for part in answer_of_model["joints"]:
        assert part["explained"] > 0.99 and part["predictable_left"] < 0.002


@pytest.mark.long
def test_a_coupled_wrist_is_found_and_named(
    clean: Reconstruction, logs: list[MotionLog], ur10e: Path
) -> None:
    found = made([coupled(log) for log in logs], ur10e / "ur10e.urdf")
    (added,) = (a for a in found.model.effects if a.effect.name != "torque_ripple")
    assert added.effect.place == ("transmission_coupling", 5, 6)
    assert added.parameters["ratio"].value == 1.0
    for key, value in COUPLING.items():
        estimate = added.parameters[key]
        assert abs(estimate.value - value) < 4 * estimate.std_error, key
    # fitted together, nothing of it is left: the joints are as well known as without it
    for joint in (4, 5):
        assert found.held_out.moving["rmse"][joint] < 1.3 * clean.held_out.moving["rmse"][joint]


@pytest.mark.long
def test_a_panda_has_none(measured: Path) -> None:
    found = made([read_log(measured / "panda" / "exciting_1a.csv")], measured / "panda" / "panda.urdf")
    assert [a.effect.name for a in found.model.effects if a.effect.name != "torque_ripple"] == []
