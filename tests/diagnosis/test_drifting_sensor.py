"""A torque sensor whose zero drifts: named with its rate, of the record and not of the arm; and what is no spring."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rubbing_arm import model_with_baseline, run
from synthetic import three_axis

from armloop.data.motion import Motion
from armloop.data.signals import preprocess
from armloop.diagnosis import diagnose
from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.fit import Shape
from armloop.diagnosis.judgement import SIGNIFICANCE
from armloop.diagnosis.trials import Known
from armloop.laws.effects import Context, Estimate, effect, hypotheses
from armloop.model import ReconstructedModel


@pytest.fixture(scope="module")
def model() -> ReconstructedModel:
    return model_with_baseline()


@pytest.mark.parametrize(
    ("seed", "seconds", "rate", "constant"), [(1, 40.0, 0.01, 1e9), (2, 40.0, -0.02, 15.0)]
)
def test_a_drift_is_named_with_its_rate(
    model: ReconstructedModel, seed: int, seconds: float, rate: float, constant: float
) -> None:
    log = run(seed, seconds)
    drift = rate * constant * -np.expm1(-log.time / constant)
    drifting = replace(log, tau=log.tau + np.outer(drift + 0.05, [0.0, 1.0, 0.0]), name="drifting")
    found = diagnose(model, [drifting], jobs=1)
    assert found.named == [("torque_drift", 2)]
    (entry,) = found.to_dict()["effects"]
    for key, truth in (("rate", rate), ("offset", 0.05)):
        stated = entry["parameters"][key]
        assert abs(stated["value"] - truth) < 4 * stated["std_error"] < abs(truth), key
    assert entry["sensor"] and entry["when"] == "changed" and "warm up" in entry["remedy"]
    # a controller supplies nothing of it
    asked = [x[50] for x in (log.q, log.v, np.zeros_like(log.v))]
    np.testing.assert_array_equal(found.model.feedforward(*asked), model.feedforward(*asked))


def test_a_drift_that_goes_on_is_a_straight_line_and_has_no_time_constant() -> None:
    given = {"rate": Estimate(0.01, 1e-4, "N*m/s"), "offset": Estimate(0.1, 0.01, "N*m")}
    drift = effect("torque_drift", 2)
    words = drift.sentence({**given, "time_constant": Estimate(1e6, np.nan, "s")})
    assert "in a straight line by 0.0100" in words and "time constant" not in words
    words = drift.sentence({**given, "time_constant": Estimate(800.0, 40.0, "s")})
    assert "at first by 0.0100" in words and "with a time constant of 800" in words


def test_a_time_constant_that_wants_to_be_longer_than_the_first_order_tells_is_that_of_a_straight_line() -> (
    None
):
    drift = effect("torque_drift", 2)
    assert drift.refined(np.array([1.0, 9.0, 0.0]), 100.0) == 1e6
    assert 10.0 < drift.refined(np.array([1.0, -9.0, 0.0]), 100.0) < 90.0
    assert drift.refined(np.array([1.0, 0.1, 0.0]), 100.0) == pytest.approx(100 * np.exp(0.1))
    for further in (-9.0, -0.1, 0.1, 9.0):
        assert drift.refined(np.array([1.0, further, 0.0]), 1e6) == 1e6
    t = np.arange(0.0, 40.0, 0.1)
    still = np.zeros((400, 3))
    shapes = drift.shapes(Context(three_axis(), Motion(t, still, still, still, np.array([0]))))
    assert shapes[0] == 4.0 and shapes[-2:] == pytest.approx([20 * 39.9, 1e6])


def test_a_constant_and_a_short_log_hold_no_drift(model: ReconstructedModel) -> None:
    log = run(3, 30.0)
    found = diagnose(model, [replace(log, tau=np.add(log.tau, [0.0, 0.2, 0.0]))], jobs=1)
    assert found.named in ([("torque_offset", 2)], [("friction_asymmetry", 2)])
    # a straight line has a time constant beyond all that are tried, a transient of the filter one below
    drift = effect("torque_drift", 2)
    fits = [drift.resolved({"time_constant": Estimate(T, 0.0, "s")}, [4.0, 600.0]) for T in (3.9, 4.0, 900.0)]
    assert fits == [False, True, True]
    short = preprocess([run(3, 30.0)], model.conditioning).motion
    context = replace(model.context(short), motion=short.take(slice(0, 200)))
    assert effect("torque_drift", 2).shapes(context) == []


def test_a_spring_is_there_if_its_stiffness_is_and_a_drift_if_its_rate_is(model: ReconstructedModel) -> None:
    """Of either, the last coefficient would be an offset of the torque by itself, and that is what this run has."""
    log = run(4, 30.0)
    held = replace(log, tau=np.add(log.tau, [0.0, 0.2, 0.0]))
    evidence = Evidence.of(model, preprocess([held], model.conditioning), hypotheses(model.arm))
    for name, shape in (("torque_offset", 0.0), ("joint_spring", 0.0), ("torque_drift", 100.0)):
        clear = Known.of(evidence, [effect(name, 2)], [Shape.fixed(shape)]).fit.clear[0]
        assert (clear > 20) if name == "torque_offset" else (clear < SIGNIFICANCE), name
