"""A control law of a user's own runs in a scenario under its name, and what is none is refused in one line."""

import dataclasses
import json
import re
from pathlib import Path

import numpy as np
import pytest
from pydrake.systems.framework import DiagramBuilder, LeafSystem

from armloop.cli import main
from armloop.drake import Controller, add_arm_under, register_controller
from armloop.drake.control.controllers import REGISTRY
from armloop.drake.experiments.scenarios import load_tracking
from armloop.drake.experiments.tracking import controllers_for, run_tracking, track
from armloop.drake.plant.exact import exact_model
from armloop.reports.words import controller
from armloop.util.errors import InputError, ScenarioError

PAGE = Path(__file__).resolve().parents[3] / "docs" / "own_controller.md"


@pytest.fixture(autouse=True)
def sliding_mode():
    """The page's controller, registered as the page does it; forgotten after the test."""
    REGISTRY.forget()
    code = "\n".join(re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL))
    names: dict = {}
    exec(code, names)
    yield names["SlidingMode"]
    REGISTRY.forget()


@pytest.fixture(scope="module")
def short():
    scenario = load_tracking("three_axis_tracking")
    reference = dataclasses.replace(scenario.reference, duration=1.5)
    return dataclasses.replace(
        scenario, reference=reference, score=(0.5, 1.5), controllers=("pid", "sliding_mode")
    )


def test_it_runs_beside_the_listed_ones_and_gets_the_model(short):
    assert controllers_for(short, {}) == ["pid"]
    model = exact_model(short.plant.arm, short.plant.config.friction)
    results = run_tracking(short, {"sliding_mode": model}, processes=1)
    assert list(results) == ["pid", "sliding_mode"]
    assert np.all(results["sliding_mode"].eta < 0.1 * results["pid"].eta)
    assert controller("sliding_mode") == "sliding mode"
    with pytest.raises(
        ValueError, match="no model for the controller sliding_mode; the models given are: none"
    ):
        track(short, "sliding_mode", {})


@pytest.mark.slow
def test_a_scenario_file_and_a_command_know_it_by_its_name(tmp_path, short, capsys):
    model = tmp_path / "model.json"
    exact_model(short.plant.arm, short.plant.config.friction).save(model)
    places = "[[0.0, 0.0, 0.0], [0.1, 0.1, 0.1]]"
    (tmp_path / "mine.yaml").write_text(
        "plant: three_axis\ncontrollers: [sliding_mode]\nscore: []\n"
        f"reference: {{kind: places, dwell: 0.1, places: {places}}}\n"
    )
    line = ["track", str(tmp_path / "mine.yaml"), "--model", f"model={model}", "--json"]
    assert main(line) == 0
    assert list(json.loads(capsys.readouterr().out)["controllers"]) == ["sliding_mode"]
    REGISTRY.forget()
    with pytest.raises(
        ScenarioError, match=r"sliding_mode; there are: pid, pid_step1.*entry points armloop.controllers"
    ):
        load_tracking(tmp_path / "mine.yaml")


def test_what_is_no_controller_is_refused(sliding_mode):
    with pytest.raises(InputError, match="must be a subclass of armloop"):
        register_controller(dict)
    with pytest.raises(InputError, match="Nothing lacks law; define them in the class"):
        register_controller(type("Nothing", (Controller,), {"name": "nothing"}))
    with pytest.raises(InputError, match="the name 'pid' is that of a listed controller"):
        register_controller(type("Mine", (sliding_mode,), {"name": "pid"}))


def test_a_law_with_other_ports_is_refused(short):
    with pytest.raises(ValueError, match="mine: has the input ports none; a control law has state"):
        add_arm_under(DiagramBuilder(), short.plant, LeafSystem(), short.reference, name="mine")


class Ports(LeafSystem):
    """A law with the ports that are said, of so many entries each."""

    def __init__(self, inputs: dict[str, int], tau: int = 3) -> None:
        super().__init__()
        for name, size in inputs.items():
            self.DeclareVectorInputPort(name, size)
        if tau:
            self.DeclareVectorOutputPort("tau", tau, lambda context, output: None)


@pytest.mark.parametrize(
    ("law", "told"),
    [
        (Ports({"state": 6, "q_ref": 3, "wind": 3}), "has the input ports state, q_ref, wind; a control law"),
        (Ports({"q_ref": 3, "v_ref": 3}), "has the input ports q_ref, v_ref; a control law"),
        (Ports({"state": 6}, tau=0), "has the input ports state; a control law"),
        (Ports({"state": 3, "q_ref": 3}), "its port state has 3 entries, three_axis has 3 joints"),
        (Ports({"state": 6, "q_ref": 6}), "its port q_ref has 6 entries, three_axis has 3 joints"),
        (Ports({"state": 6}, tau=2), "its port tau has 2 entries, three_axis has 3 joints"),
    ],
)
def test_ports_of_a_law_are_those_of_the_loop_and_of_its_joints(short, law, told):
    with pytest.raises(ValueError, match=f"mine: {told}"):
        add_arm_under(DiagramBuilder(), short.plant, law, short.reference, name="mine")


@pytest.mark.parametrize("ports", [(), ("q_ref",), ("q_ref", "v_ref", "vdot_ref", "tau_ff")])
def test_a_law_has_those_ports_that_it_wants(short, ports):
    law = Ports({"state": 6, **dict.fromkeys(ports, 3)})
    assert add_arm_under(DiagramBuilder(), short.plant, law, short.reference).controller is law


class Holds(Ports):
    """A law that evaluates its model itself."""

    model = None

    def set_model(self, model):
        self.model = model


def test_the_model_of_a_law_is_exchanged_where_the_law_has_it(short):
    model = exact_model(short.plant.arm, short.plant.config.friction)
    fed, holds = Ports({"state": 6, "tau_ff": 3}), Holds({"state": 6})
    for law in (fed, holds):
        arm = add_arm_under(DiagramBuilder(), short.plant, law, short.reference)
        with pytest.raises(InputError, match="step is 5"):
            arm.set_model(model, 5)
        arm.set_model(model)
        tau = arm.reference.GetOutputPort("tau_ff").Eval(arm.reference.CreateDefaultContext())
        wanted = model.feedforward(*(table[0] for table in arm.reference.tables))
        np.testing.assert_allclose(tau, wanted if law is fed else np.zeros(3), atol=1e-9)
    assert holds.model is model
    arm = add_arm_under(DiagramBuilder(), short.plant, Ports({"state": 6}), short.reference, name="mine")
    with pytest.raises(InputError, match="mine: takes no model"):
        arm.set_model(model)
