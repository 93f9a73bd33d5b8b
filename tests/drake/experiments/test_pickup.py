"""A load grasped mid-run: the state goes on, the log is that of the loaded arm, what is learned is used."""

import dataclasses

import numpy as np
import pytest

from armloop.data.motion import Motion
from armloop.drake.experiments.pickup import PHASES, run_pickup
from armloop.drake.experiments.scenarios import Pickup, load_tracking
from armloop.drake.plant.exact import exact_model
from armloop.util.errors import InputError, ScenarioError
from armloop.util.progress import silent
from armloop.workflows.pickup import run_pickup_scenario


@pytest.fixture(scope="module")
def run():
    built_in = load_tracking("payload_pickup")
    scenario = dataclasses.replace(
        built_in,
        reference=dataclasses.replace(built_in.reference, duration=3.0),
        pickup=Pickup(1.0, 2.0, built_in.pickup.payload),
    )
    arm, friction = scenario.plant.arm, scenario.plant.config.friction
    knowing = exact_model(arm, friction, [scenario.pickup.payload])
    logs = []

    def learn(log):
        logs.append(log)
        return knowing

    ignorant = exact_model(arm, friction)
    return scenario, ignorant, knowing, run_pickup(scenario, ignorant, learn), logs


def test_one_run_in_three_phases(run):
    *_, result, logs = run
    assert tuple(result.phases) == PHASES and logs == [result.log]
    whole = result.phases["loaded"]
    assert len(whole.time) == 3001 and np.all(np.diff(whole.time) > 0)
    # no jump at the grasp: no step is longer than the fastest speed allows
    assert np.abs(np.diff(whole.q, axis=0)).max() < 2e-3
    assert [result.phases[name].scored for name in PHASES] == [
        slice(0, 1000), slice(1000, 2000), slice(2000, 3000)
    ]  # fmt: skip


def test_the_load_costs_and_the_augmented_model_pays(run):
    phases = run[3].phases
    assert np.all(phases["unloaded"].eta < 0.01)
    assert phases["loaded"].eta[1] > 0.4
    assert phases["augmented"].eta[1] < 0.2 * phases["loaded"].eta[1]


def test_the_log_is_that_of_the_loaded_arm(run):
    _, ignorant, knowing, result, _ = run
    log = result.log
    assert log.time[0] == pytest.approx(1.5) and log.time[-1] < 2.0
    vdot = np.gradient(log.v, log.time, axis=0)
    motion = Motion(log.time, log.q, log.v, vdot, np.array([0]))
    residual = [
        np.sqrt(np.mean((m.predict(motion) - log.tau)[10:-10] ** 2, axis=0)) for m in (ignorant, knowing)
    ]
    assert np.all(residual[1] < 0.15) and residual[0][1] > 1.0


def test_a_grasp_between_two_samples_loses_none(run):
    scenario, ignorant, knowing, *_ = run
    odd = dataclasses.replace(scenario, pickup=Pickup(0.9995, 2.0, scenario.pickup.payload))
    found = run_pickup(odd, ignorant, lambda log: knowing).phases
    whole = found["loaded"]
    assert len(whole.time) == 3001
    np.testing.assert_allclose(np.diff(whole.time), 1e-3, atol=1e-9)
    # the reference beside it is that of the same instants
    np.testing.assert_allclose(found["augmented"].eta, run[3].phases["augmented"].eta, rtol=0.2)


def test_a_model_that_it_would_not_run_with_is_told(run):
    scenario, ignorant, *_ = run
    with pytest.raises(
        InputError, match=r"run with one named step3 or model; nothing would run with foo, bar"
    ):
        run_pickup_scenario(scenario, {"model": ignorant, "foo": ignorant, "bar": ignorant}, None, silent)
    with pytest.raises(InputError, match="needs a model named step3 or model"):
        run_pickup_scenario(scenario, {"foo": ignorant}, None, silent)


def test_what_is_wrong_with_a_pickup_is_told(tmp_path):
    text = "plant: three_axis\nreference: {periods: 2}\n"
    path = tmp_path / "mine.yaml"
    for fields, message in (
        ("{at: 20.0, diagnose_at: 30.0}", "14 s or more between them"),
        ("{at: 20.0, diagnose_at: 40.0}", "must lie within 0 and 40 s"),
        ("{at: 5.0, diagnose_at: 30.0, mass: 0}", "mass is 0; it must be a finite number above 0"),
    ):
        path.write_text(f"{text}pickup: {fields}\n")
        with pytest.raises(ScenarioError, match=rf"mine.yaml: pickup.*{message}"):
            load_tracking(path)
