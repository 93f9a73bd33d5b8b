"""A spring that the model has may break; one that it has not cannot push away."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rubbing_arm import model_with_baseline, motion_of, torque
from synthetic import measured

from armloop.data.log import MotionLog
from armloop.diagnosis import diagnose
from armloop.laws.effects import Effect, Estimate, effect
from armloop.model import AddedEffect, ReconstructedModel, load_model
from armloop.util.errors import ModelError

K, REST = 0.4, 0.2
SPRINGS = {
    "joint_spring": (effect("joint_spring", 2), {"rest": REST}),
    "coupling_spring": (effect("coupling_spring", 2, 3), {"rest": REST, "ratio": -1.0}),
}


def added(name: str, stiffness: float) -> AddedEffect:
    own, rest = SPRINGS[name]
    values = {"stiffness": stiffness, **rest}
    units = {"stiffness": "N*m/rad", "rest": "rad", "ratio": "1"}
    return AddedEffect(own, {key: Estimate(value, 0.01, units[key]) for key, value in values.items()})


def plain_log(seed: int = 3) -> MotionLog:
    motion = motion_of(seed, 24.0)
    return measured(motion, torque(motion), seed, 0.01)


@pytest.fixture(scope="module")
def model() -> ReconstructedModel:
    return model_with_baseline()


@pytest.mark.parametrize("name", SPRINGS)
def test_a_spring_of_the_model_that_is_gone_is_told_as_that(
    model: ReconstructedModel, name: str, tmp_path: Path
) -> None:
    found = diagnose(model.with_effects([added(name, K)]), [plain_log()], jobs=1)
    (one,) = found.outcome.added()
    assert one.effect.place == SPRINGS[name][0].place
    stiffness = one.parameters["stiffness"]
    assert abs(float(np.asarray(stiffness.value)) + K) < 3 * float(np.asarray(stiffness.std_error)) < 0.05
    assert "has become weaker, by 0.4" in one.sentence() or "has become weaker, by 0.39" in one.sentence()
    found.model.save(tmp_path / "model.json")
    # with both of them the model is that without
    motion = found.samples.motion
    left = load_model(tmp_path / "model.json").predict(motion) - model.predict(motion)
    assert np.abs(left).max() < 0.03


def test_what_pushes_away_is_no_spring_that_an_arm_lost_which_had_none(model: ReconstructedModel) -> None:
    log = plain_log()
    pushed = replace(log, tau=log.tau - K * (log.q - REST) * [0, 1, 0])
    assert ("joint_spring", 2) not in diagnose(model, [pushed], jobs=1).named


@pytest.mark.parametrize("name", SPRINGS)
def test_a_file_holds_less_of_a_spring_only_beside_the_spring(
    model: ReconstructedModel, name: str, tmp_path: Path
) -> None:
    for k, stiffnesses in enumerate([(K, -K), (-K,), (-K, K)]):
        path = tmp_path / f"{k}.json"
        model.with_effects([added(name, stiffness) for stiffness in stiffnesses]).save(path)
        if k == 0:
            assert len(load_model(path).effects) == 2
        else:
            with pytest.raises(ModelError, match=r"stiffness -0\.4.* cannot be"):
                load_model(path)


@pytest.mark.parametrize("name", SPRINGS)
def test_what_comes_off_rests_where_a_spring_may(model: ReconstructedModel, name: str) -> None:
    own: Effect = SPRINGS[name][0]
    lost = added(name, -K).parameters
    far = {**lost, **{key: Estimate(9e3, 0.0, "") for key in ("rest", "ratio") if key in lost}}
    assert own.comes_off(model.arm, lost) and not own.comes_off(model.arm, added(name, K).parameters)
    assert not own.comes_off(model.arm, far)
    assert own.possible(model.arm, lost, {own.place}) and not own.possible(model.arm, lost)
