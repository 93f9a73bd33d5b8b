"""The tuning of a scenario, start to end, on a short reference."""

import dataclasses
import warnings

import numpy as np
import pytest
from answers import answered

from armloop.drake.experiments.scenarios import load_tracking
from armloop.drake.plant.exact import exact_model
from armloop.drake.plant.fault_injection import UndeclaredEffect
from armloop.model.components import RigidBody
from armloop.reports.plots.loops import bode_figure
from armloop.reports.tuning_tables import gains_table, margins_table, missed_notes, verified_table
from armloop.robot.kinematics import nominal_parameters
from armloop.util.errors import InputWarning
from armloop.util.progress import silent
from armloop.workflows import tune_scenario
from armloop.workflows.other_arm import other_friction, other_inertia


def test_files_tables_and_a_better_loop(tmp_path):
    built_in = load_tracking("three_axis_tracking")
    scenario = dataclasses.replace(
        built_in, reference=dataclasses.replace(built_in.reference, duration=0.6), score=(0.1, 0.6)
    )
    answer, tuning = tune_scenario(scenario, 2 * np.pi * 5, 60.0, None, tmp_path, silent)
    written = answered((tmp_path / "tune.json").read_text(), "tune")
    assert {key: written[key] for key in answer} == answer
    assert {"bode.png", "step.png"} <= {path.name for path in tmp_path.iterdir()}
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert page.count('<svg class="wide"') == 2 and "peak |S|" in page and "step off linear" in page
    assert "http" not in page.split("<main", 1)[0].replace("http-equiv", "")
    assert answer["present"]["gains"]["kp"] == [80.0] * 3
    assert answer["present"]["stable"] and answer["proposed"]["stable"]
    assert max(answer["present"]["step_deviation"] + answer["proposed"]["step_deviation"]) < 0.03
    # stiffer gains follow better without a model
    assert np.mean(answer["proposed"]["eta_deg"]["pid"]) < np.mean(answer["present"]["eta_deg"]["pid"])
    assert min(m["phase_margin"] for m in answer["proposed"]["loop"]) == pytest.approx(60, abs=5)
    # a phase margin is what is left to -180 deg
    bode = bode_figure(tuning)
    for j, margin in enumerate(tuning.present.margins):
        phase = bode.axes[3 + j].lines[0].get_ydata()
        gain = np.abs(tuning.present.loops[:, j])
        last = np.flatnonzero(gain > 1)[-1]
        assert np.interp(0, [-1, 1], phase[[last, last + 1]]) == pytest.approx(
            margin.phase_margin - 180, abs=3
        )
    # gains of zero close no loop: nothing is drawn of it, and no logarithm of zero is taken
    none = dataclasses.replace(tuning.present, loops=0 * tuning.present.loops)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        alone = bode_figure(dataclasses.replace(tuning, present=none))
    assert [len(axes.lines) for axes in alone.axes] == [len(axes.lines) - 1 for axes in bode.axes]
    for table in (gains_table, margins_table, verified_table):
        assert len(table(tuning).rows) == 6
    # asked for what these gains have is missing nothing; each joint alone then would have to be faster than it is
    has = min(m.bandwidth for m in tuning.proposed.margins)
    thin = min(m.phase_margin for m in tuning.proposed.margins)
    assert missed_notes(dataclasses.replace(tuning, bandwidth=has, margin=thin)) == []
    slow = missed_notes(dataclasses.replace(tuning, bandwidth=4 * np.pi * has, margin=thin))
    assert len(slow) == 3 and all("Hz of bandwidth, not" in note for note in slow)
    assert missed_notes(tuning)[0].startswith("Joint 2 has 4.4") and "and here they move it" in page


def test_what_the_arm_has_beside_is_said_not_to_be_tuned_for(monkeypatch):
    built_in = load_tracking("three_axis_tracking")
    drag = UndeclaredEffect("quadratic_drag", 2, {"coefficient": 0.1})
    with (
        monkeypatch.context() as patch,
        pytest.warns(InputWarning, match=r"without the scenario's effects \(.*joint 2\)"),
    ):
        patch.setattr("armloop.workflows.tuning.propose_gains", lambda *_: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            tune_scenario(dataclasses.replace(built_in, effects=(drag,)), 30.0, 60.0, None, None, silent)


@pytest.mark.parametrize(("factor", "said"), [(1.4, False), (1.6, True), (1 / 1.6, True)])
def test_a_model_of_another_inertia_than_the_simulated_arms_is_said(factor, said, monkeypatch):
    """As of an arm whose URDF knows no rotors: gains for the model's may be unstable on it."""
    scenario = load_tracking("three_axis_tracking")
    model = exact_model(scenario.plant.arm, scenario.plant.config.friction)
    (bodies,) = model.components
    assert isinstance(bodies, RigidBody)
    heavy = dataclasses.replace(bodies, parameters=factor * bodies.parameters, values=factor * bodies.values)
    model = dataclasses.replace(model, components=(heavy,))
    monkeypatch.setattr("armloop.workflows.tuning.propose_gains", lambda *_: 1 / 0)
    with warnings.catch_warnings(record=True) as caught, pytest.raises(ZeroDivisionError):
        warnings.simplefilter("always")
        tune_scenario(scenario, 30.0, 60.0, model, None, silent)
    told = [str(w.message) for w in caught if "for the model's inertia" in str(w.message)]
    assert bool(told) == said and (not said or "at joint 3" in told[0])


@pytest.mark.parametrize(("factor", "said"), [(1.4, False), (1.6, True), (1 / 1.6, True)])
def test_friction_that_is_another_than_the_models_is_said_with_what_to_state(
    factor: float, said: bool
) -> None:
    plant = load_tracking("three_axis_tracking").plant
    model = exact_model(plant.arm, plant.config.friction)
    more = tuple(
        dataclasses.replace(
            f, static=factor * f.static, coulomb=factor * f.coulomb, viscous=factor * f.viscous
        )
        for f in plant.config.friction
    )
    other = dataclasses.replace(plant, config=dataclasses.replace(plant.config, friction=more))
    words = other_friction(model, other)
    assert bool(words) == said and other_friction(model, plant) == ""
    if said:
        # it is no other arm if an effect is what makes the difference, declared to the model or not
        rising = tuple(
            UndeclaredEffect(name, j, {key: (1 / factor - 1) * size})
            for j, f in enumerate(more, 1)
            for name, key, size in (
                ("coulomb_friction", "level", f.coulomb),
                ("viscous_friction", "coefficient", f.viscous),
            )
            if factor < 1
        )
        assert not rising or other_friction(model, other, rising) == ""
        first = plant.config.friction[0]
        assert "at joint 1" in words and "at joint 3" in words
        assert f"{{static: {first.static:.3g}, coulomb: {first.coulomb:.3g}, stribeck_velocity: " in words


class TestInertiaOfAnother:
    """A model of the three-axis arm with rotors, beside a plant whose URDF states none."""

    ROTORS = (0.4, 0.3, 0.2)

    def told(
        self,
        *rotors: float,
        effects: tuple[UndeclaredEffect, ...] = (),
        links: float = 1.0,
        lost: tuple[float, ...] = (0.0, 0.0, 0.0),
    ) -> str:
        plant = load_tracking("three_axis_tracking").plant
        own = tuple(x - less for x, less in zip(self.ROTORS, lost, strict=True))
        config = dataclasses.replace(plant.config, rotor_inertia=own)
        model = exact_model(plant.arm, config.friction, config.with_rotors())
        body = RigidBody(links * nominal_parameters(plant.arm), (), np.zeros(0))
        model = dataclasses.replace(model, components=(body,))
        known = dataclasses.replace(plant, config=dataclasses.replace(plant.config, rotor_inertia=rotors))
        return other_inertia(model, known, [0.0, 0.5, -0.5], effects)

    def test_rotors_that_a_urdf_does_not_state_are_said_with_what_to_state(self) -> None:
        assert "rotor_inertia: [0.4, 0.3, 0.2]" in self.told()
        assert self.told(*self.ROTORS) == ""
        # what is stated already is a part of it
        assert "rotor_inertia: [0.4, 0.3, 0.2]" in self.told(0.01, 0.0, 0.0)
        assert "rotor_inertia: [0.4, 0.3, 0.2]" in self.told(3.0, 3.0, 3.0)
        # of a joint that is hardly another
        assert "rotor_inertia: [0, 0.2" in self.told(links=0.98, lost=(0.4, 0.0, 0.0))
        # no rotor makes an arm lighter than its links
        assert (
            "where the model has" in (words := self.told(links=0.1, lost=self.ROTORS))
            and "rotor_inertia" not in words
        )

    def test_an_effect_that_nobody_declared_is_no_other_arm(self) -> None:
        more = tuple(
            UndeclaredEffect("rotor_inertia", j, {"inertia": x}) for j, x in enumerate(self.ROTORS, 1)
        )
        # stated as effects in the place of the field, or as what has changed about the arm
        assert self.told(effects=more) == "" and self.told(*self.ROTORS, effects=more) == ""
