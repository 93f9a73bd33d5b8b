"""Monte Carlo over friction: repeatable, around the nominal values, and its cost."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from armloop.drake.experiments import wear
from armloop.drake.experiments.scenarios import Wear, load_tracking
from armloop.drake.experiments.wear import draw_friction, run_wear
from armloop.drake.plant.exact import exact_model
from armloop.drake.plant.friction import JointFriction
from armloop.reports.tracking_tables import spread_table
from armloop.util.errors import ScenarioError


def test_draws_have_the_spread_that_was_asked_for():
    nominal = (JointFriction(1.3, 1.0, 0.1, 2.0),)
    drawn = [draw_friction(nominal, 0.3, seed)[0] for seed in range(2000)]
    logs = np.log(
        [[f.coulomb, (f.static - f.coulomb) / 0.3, f.stribeck_velocity / 0.1, f.viscous / 2] for f in drawn]
    )
    assert_allclose(logs.std(axis=0), 0.3, rtol=0.06)
    assert_allclose(logs.mean(axis=0), 0.0, atol=0.03)
    assert draw_friction(nominal, 0.3, 7) == draw_friction(nominal, 0.3, 7)


def test_wear_costs_and_the_answer_does_not_depend_on_the_processes():
    built_in = load_tracking("friction_wear")
    brief = dataclasses.replace(
        built_in,
        controllers=("pid_step3",),
        reference=dataclasses.replace(built_in.reference, duration=0.4),
        score=(0.1, 0.4),
        wear=Wear(3, 0.3),
    )
    models = {"model": exact_model(brief.plant.arm, brief.plant.config.friction)}
    one, two = (run_wear(brief, models, processes=k) for k in (1, 2))
    assert one.eta["pid_step3"].shape == (3, 3)
    assert np.array_equal(one.eta["pid_step3"], two.eta["pid_step3"])
    assert np.all(one.eta["pid_step3"] > 0.005)  # with the friction it was made for, 2e-4
    assert len(spread_table(one).rows) == 3


@pytest.mark.parametrize("kept", [False, True])
def test_each_controller_has_the_errors_of_its_own_runs_on_the_plants_that_were_drawn(kept, monkeypatch):
    """Runs whose errors are the Coulomb levels of their plant, ten times those for another controller."""
    built_in = load_tracking("friction_wear")
    scenario = dataclasses.replace(built_in, controllers=("pid", "exact"), wear=Wear(3, 0.3), seed=5)
    ran = []

    def track(scenario, name, models):
        levels = np.array([f.coulomb for f in scenario.plant.config.friction])
        ran.append((name, levels[0]))
        return SimpleNamespace(eta=levels * (10.0 if name == "exact" else 1.0))

    class Store:
        """A run of the second draw that was made before."""

        def __init__(self):
            self.put_in = {}

        def get(self, job):
            return [7.0, 8.0, 9.0] if job == (1, "pid") else None

        def put(self, job, answer):
            self.put_in[job] = answer

    monkeypatch.setattr(wear, "track", track)
    store = Store() if kept else None
    found = run_wear(scenario, {}, processes=1, kept=store)
    nominal = tuple(scenario.plant.config.friction)
    drawn = np.array([[f.coulomb for f in draw_friction(nominal, 0.3, 5 + k)] for k in range(3)])
    assert len(np.unique(drawn)) == 9
    assert_allclose(found.coulomb, drawn)
    assert_allclose(found.eta["exact"], 10.0 * drawn)
    if store:
        drawn[1] = 7.0, 8.0, 9.0
        assert len(ran) == 5 and len(store.put_in) == 5
        assert_allclose(store.put_in[2, "exact"], 10.0 * drawn[2])
    assert_allclose(found.eta["pid"], drawn)
    assert found.unit == ("deg",) * 3


def test_what_is_wrong_with_wear_is_told(tmp_path):
    path = tmp_path / "mine.yaml"
    for fields, message in (("samples: 1", "wear.samples is 1"), ("spread: 3.0", "wear.spread is 3.0")):
        path.write_text(f"plant: three_axis\nwear: {{{fields}}}\n")
        with pytest.raises(ScenarioError, match=rf"mine.yaml: {message}"):
            load_tracking(path)
