"""A cable at a link, and a spring over two joints, that nobody declared: found in a run, and supplied in closed loop."""

from typing import Any

import pytest

from armloop.diagnosis import diagnose
from armloop.drake.experiments.collection import measure_run
from armloop.drake.experiments.scenarios import load_plant, load_tracking
from armloop.drake.experiments.tracking import run_tracking
from armloop.drake.plant.exact import exact_model
from armloop.drake.plant.fault_injection import UndeclaredEffect

CABLE = {
    "stiffness": 60.0,
    "slack_length": 0.4,
    "anchor": [0.5, 0.3, 0.3],
    "attached": [0.2, 0.0, 0.0],
    "link": 3.0,
}
SPRING = {"stiffness": 3.0, "rest": 0.2, "ratio": -0.7}


@pytest.mark.long
@pytest.mark.parametrize(
    ("hidden", "joints"),
    [
        (UndeclaredEffect("elastic_cable", None, CABLE), [0, 1, 2]),
        (UndeclaredEffect("coupling_spring", 2, SPRING, other_joint=3), [1, 2]),
    ],
    ids=["cable", "spring"],
)
def test_what_pulls_is_supplied_in_closed_loop(hidden: Any, joints: list[int]) -> None:
    plant = load_plant("three_axis")
    model = exact_model(plant.arm, plant.config.friction)
    found = diagnose(model, [measure_run(plant.arm, plant.config, seed=2, duration=30.0, effects=[hidden])])
    assert found.named == [(hidden.name, hidden.joint)]
    models = {"step3": model, "augmented": found.model}
    tracked = run_tracking(load_tracking("three_axis_tracking"), models, [hidden])
    for j in joints:
        assert 100 * tracked["pid_augmented"].eta[j] < tracked["pid_step3"].eta[j]
