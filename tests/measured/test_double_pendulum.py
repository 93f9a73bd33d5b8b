"""A double pendulum with quasi-direct drives: encoders that are zeroed by hand, and torque pulses of known time and joint.

What came out: zeros that differ by two hundredths of a radian, without which 27 and 12 % of the torque are left and with
which 17 and 7.7 %; 15 of 18 pulses with their joint, and no event in twenty clean runs. Two of the others act while joint 1
stands still, held by its friction.
"""

from pathlib import Path

import numpy as np
import pytest

from armloop.data.log import read_log
from armloop.diagnosis import Diagnosis, diagnose
from armloop.identification.reconstruction import Options, reconstruct
from armloop.model import ReconstructedModel
from armloop.robot.arm import load_arm

pytestmark = pytest.mark.measured


@pytest.fixture(scope="module")
def pendulum(measured: Path) -> Path:
    return measured / "double_pendulum"


@pytest.fixture(scope="module")
def model(pendulum: Path) -> ReconstructedModel:
    """The model of the ten logs of exciting motion."""
    logs = [read_log(path, quiet=True) for path in sorted(pendulum.glob("sysid_*.csv"))]
    options = Options(standard_errors=False, parts=False)
    return reconstruct(logs, load_arm(pendulum / "double_pendulum.urdf"), options=options).model


def judged(model: ReconstructedModel, path: Path) -> Diagnosis:
    return diagnose(model, [read_log(path, quiet=True)], jobs=1)


def pulses(path: Path) -> list[tuple[int, float, float]]:
    """Joint, start and end of each pulse."""
    truth, found = np.genfromtxt(path, delimiter=",", names=True), []
    for joint in (1, 2):
        edges = np.flatnonzero(np.diff((np.abs(truth[f"pert{joint}"]) > 0.05).astype(int)))
        found += [
            (joint, float(truth["time"][a]), float(truth["time"][b]))
            for a, b in edges.reshape(-1, 2).tolist()
        ]
    return found


@pytest.mark.slow
def test_zeros_set_by_hand_are_found_and_halve_what_the_model_leaves(model: ReconstructedModel) -> None:
    spread = model.history["encoder_zeros"]["spread"]
    assert all(0.01 < x < 0.04 for x in spread)
    assert model.baseline["nrmse"][0] < 0.2 and model.baseline["nrmse"][1] < 0.1


@pytest.mark.slow
def test_four_pulses_in_five_are_found_with_their_joint(model: ReconstructedModel, pendulum: Path) -> None:
    found = total = 0
    for path in sorted(pendulum.glob("acrobot_pushed_0?.csv")):
        events = [contact.added for contact in judged(model, path).contacts]
        for joint, start, end in pulses(path.with_suffix(".truth.csv")):
            total += 1
            found += any(
                event.effect.joint == joint
                and event.parameters["start"].value < end
                and event.parameters["end"].value > start
                for event in events
            )
    assert total == 18 and found >= 15


@pytest.mark.long
def test_no_clean_run_has_an_event(model: ReconstructedModel, pendulum: Path) -> None:
    paths = [*sorted(pendulum.glob("acrobot_clean_*.csv")), *sorted(pendulum.glob("acrobot_pilco_*.csv"))]
    assert len(paths) == 20
    for path in paths:
        assert judged(model, path).verdict in ("no_effect", "cannot_tell"), path.name
