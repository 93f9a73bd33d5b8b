"""An unlisted law found in a run and adopted: the arm tracks better with it in the feedforward, in closed loop."""

import pytest

from armloop.diagnosis import diagnose
from armloop.drake.experiments.collection import measure_run
from armloop.drake.experiments.scenarios import load_plant, load_tracking
from armloop.drake.experiments.tracking import run_tracking
from armloop.drake.plant.exact import exact_model
from armloop.drake.plant.fault_injection import UndeclaredEffect
from armloop.util.errors import ScenarioError


@pytest.mark.long
@pytest.mark.parametrize(
    ("law", "better"), [({"cos(2*q1)*v2": 3.0}, 50.0), ({"sin(q1+q2)*v1*v2": 2.0}, 4.0)], ids=str
)
def test_an_adopted_law_is_supplied_in_closed_loop(law: dict[str, float], better: float) -> None:
    plant = load_plant("three_axis")
    hidden = UndeclaredEffect("unlisted", 2, law)
    model = exact_model(plant.arm, plant.config.friction)
    found = diagnose(model, [measure_run(plant.arm, plant.config, seed=2, duration=20.0, effects=[hidden])])
    assert found.verdict == "unlisted_effect"
    models = {"step3": model, "adopted": found.adopt().model}
    tracked = run_tracking(load_tracking("three_axis_tracking"), models, [hidden])
    assert better * tracked["pid_adopted"].eta[1] < tracked["pid_step3"].eta[1]


def test_a_law_that_no_arm_can_have_is_refused() -> None:
    with pytest.raises(ScenarioError, match="unlisted: unknown term 'tan\\(q1\\)'"):
        UndeclaredEffect("unlisted", 2, {"tan(q1)": 3.0})
