"""What is doubtful about the models of a comparison is said before it runs."""

import warnings
from dataclasses import replace

import pytest
from exact_parts import model_of, rigid_body

from armloop.drake.experiments.scenarios import load_tracking
from armloop.drake.plant.exact import exact_model
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


def test_rotors_of_the_plant_are_in_its_closed_loop_and_a_model_without_a_word_about_them() -> None:
    """The arm's own inverse dynamics follow as well with rotors as without; a model of the arm's links alone does not."""
    usual = load_tracking("three_axis_tracking")
    short = replace(usual.reference, duration=2.0)
    config = replace(usual.plant.config, rotor_inertia=(1.0, 1.5, 0.5))
    geared = replace(usual.plant, config=config)
    scenario = replace(usual, controllers=("exact",), reference=short, score=(0.1, 2.0), plant=geared)
    model = exact_model(geared.arm, config.friction)
    with pytest.warns(
        InputWarning, match=r"its rotors are those that the scenario states|is another than the model's"
    ):
        _, results = run_scenario(scenario, {"step3": model}, None, silent)
    own, links = (results[name].eta.max() for name in ("exact", "pid_step3"))
    assert own < 0.1 * links
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        known = exact_model(geared.arm, config.friction, config.with_rotors())
        _, results = run_scenario(scenario, {"step3": known}, None, silent)
    assert results["pid_step3"].eta.max() == pytest.approx(own)


def test_steps_without_acceleration_terms_are_not_said_to_have_another_inertia() -> None:
    usual = load_tracking("three_axis_tracking")
    short = replace(usual.reference, duration=1.0)
    plant = replace(usual.plant, config=replace(usual.plant.config, rotor_inertia=(3.0, 3.0, 3.0)))
    scenario = replace(usual, controllers=("pid",), reference=short, score=(0.1, 1.0), plant=plant)
    model = exact_model(plant.arm, plant.config.friction)
    with warnings.catch_warnings():
        warnings.filterwarnings("error", message=".*inertia")
        run_scenario(scenario, {"step1": model}, None, silent)
        with pytest.raises(InputWarning, match="inertia is another"):
            run_scenario(scenario, {"step3": model}, None, silent)
