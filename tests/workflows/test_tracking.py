"""What is doubtful about the models of a comparison is said before it runs."""

from dataclasses import replace

import pytest
from exact_parts import model_of, rigid_body

from armloop.drake.experiments.scenarios import load_tracking
from armloop.drake.plant.fault_injection import UndeclaredEffect
from armloop.robot.levelling import base_rotation
from armloop.util.errors import InputWarning
from armloop.util.progress import silent
from armloop.workflows.tracking import run_scenario


def test_a_model_whose_arm_stands_otherwise_is_said_by_its_name(recwarn: pytest.WarningsRecorder) -> None:
    usual = load_tracking("three_axis_tracking")
    short = replace(usual.reference, duration=1.0)
    scenario = replace(usual, controllers=("pid",), reference=short, score=(0.1, 1.0))
    arm = scenario.plant.arm
    leaning = replace(arm, gravity=base_rotation(0.0, 0.05).T @ arm.gravity)
    model = model_of(leaning, rigid_body(leaning))
    with pytest.warns(InputWarning, match=r"three_axis_tracking, model mine: its base leans by 2\.9 degrees"):
        run_scenario(scenario, {"mine": model}, None, silent)
    tilt = UndeclaredEffect("gravity_tilt", None, {"roll": 0.0, "pitch": 0.05})
    recwarn.clear()
    run_scenario(replace(scenario, effects=(tilt,)), {"mine": model}, None, silent)
    assert not [warning for warning in recwarn.list if "leans" in str(warning.message)]
