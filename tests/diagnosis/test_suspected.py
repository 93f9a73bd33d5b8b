"""A law that is no chance, and no more than the model leaves at its worst, is said and not stated; nothing else is."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rubbing_arm import model_with_baseline, motion_of, run, torque
from scores import score
from synthetic import measured

from armloop.data.log import MotionLog
from armloop.data.signals import preprocess
from armloop.diagnosis import diagnose
from armloop.diagnosis import suspected as module
from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.reasons import too_little
from armloop.diagnosis.suspected import suspected
from armloop.laws.effects import effect, hypotheses
from armloop.model import ReconstructedModel


@pytest.fixture(scope="module")
def model() -> ReconstructedModel:
    """Its residual is noise, and the worst tenth of it was twice as much."""
    own = model_with_baseline()
    rmse = np.array(own.baseline["rmse"])
    noise = [{"joint": j + 1, "predictable_left": 0.0, "std_error": 1e-6, "noise": 1e-4} for j in range(3)]
    return replace(own, baseline={**own.baseline, "worst": (2.0 * rmse).tolist(), "joints": noise})


def evidence_of(model: ReconstructedModel, log: MotionLog) -> Evidence:
    return Evidence.of(model, preprocess([log], model.conditioning), hypotheses(model.arm))


def hints(model: ReconstructedModel, log: MotionLog) -> tuple[str, list[str]]:
    found = diagnose(model, [log], jobs=1)
    return found.verdict, [reason for reason in found.reasons if "not stated" in reason]


@pytest.mark.parametrize("seed", [1, *(pytest.param(k, marks=pytest.mark.long) for k in (2, 3))])
def test_a_small_law_is_said_and_not_stated(model: ReconstructedModel, seed: int) -> None:
    """More dry friction by as much as the model leaves: over a minute plain, and less than the worst tenth."""
    small = float(model.baseline["rmse"][1])
    verdict, (said,) = hints(model, run(seed, 60.0, small))
    assert verdict == "no_effect"
    # the same of one that the search had named, and took back
    assert "coulomb friction at joint 2 would explain " in said and "at its worst" in said


@pytest.mark.parametrize("known", [{"predictable_left": 1e-4, "std_error": 1e-6, "noise": 1e-4}, {}])
def test_what_the_model_itself_gets_wrong_may_look_like_it(
    model: ReconstructedModel, known: dict[str, float]
) -> None:
    """Half of what it leaves can be predicted, twice as much of it on the worst tenth; or nobody asked."""
    joints = [{"joint": j + 1, **known} for j in range(3)]
    poor = replace(model, baseline={**model.baseline, "joints": joints})
    log = run(1, 60.0, float(model.baseline["rmse"][1]))
    (one,) = suspected(evidence_of(model, log), [], [1])
    assert (one.effect.label(), one.joints, one.small) == ("coulomb_friction at joint 2", (1,), True)
    assert suspected(evidence_of(poor, log), [], [1]) == []


@pytest.mark.parametrize("seed", [1, *(pytest.param(k, marks=pytest.mark.long) for k in (2, 3))])
def test_of_an_unchanged_arm_nothing_is_said(model: ReconstructedModel, seed: int) -> None:
    assert hints(model, run(seed, 60.0)) == ("no_effect", [])
    # though it be asked
    assert suspected(evidence_of(model, run(seed, 60.0)), [], [0, 1, 2]) == []


@pytest.mark.parametrize("seed", [4, pytest.param(5, marks=pytest.mark.long)])
def test_a_law_of_the_whole_arm_goes_before_those_of_its_joints(model: ReconstructedModel, seed: int) -> None:
    motion = motion_of(seed, 60.0)
    tau = torque(motion)
    late = np.column_stack([np.interp(motion.time - 0.006, motion.time, x) for x in tau.T])
    evidence = evidence_of(model, measured(motion, late, seed, 0.01))
    (one,) = suspected(evidence, [], [0, 1, 2])
    assert (one.effect.name, one.joints) == ("time_delay", (0, 1, 2)) and 0.75 <= one.share <= 1.0
    # of one joint alone a delay of the record is not asked
    assert {each.effect.joint for each in suspected(evidence, [], [1])} <= {2}


@pytest.mark.parametrize(
    ("left", "after", "known", "said"),
    [
        # of 100 rows in 20 blocks: what lies beyond the baseline is 60, and three quarters of it are asked
        (160.0, 110.0, {}, True),
        (160.0, 116.0, {}, False),
        (160.0, 110.0, {"predictable_left": 0.2, "std_error": 0.01, "noise": 0.8}, True),  # 23 of 100
        (160.0, 110.0, {"predictable_left": 0.2, "std_error": 0.2, "noise": 0.8}, False),  # or up to 80
        (160.0, 110.0, {"predictable_left": 0.6, "std_error": 0.0, "noise": 0.4}, False),
    ],
)
def test_it_explains_most_and_more_than_could_be_predicted_of_what_the_model_leaves(
    left: float, after: float, known: dict[str, float], said: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = asked_of(
        monkeypatch, left, after, known or {"predictable_left": 0.0, "std_error": 0.0, "noise": 1.0}
    )
    assert [(each.effect.name, each.joints) for each in found] == [("coulomb_friction", (0,))] * said
    if said:
        assert found[0].share == pytest.approx((left - after) / 60.0) and found[0].small


def test_what_is_more_than_the_worst_tenth_is_not_said_to_be_small(monkeypatch: pytest.MonkeyPatch) -> None:
    (one,) = asked_of(monkeypatch, 260.0, 101.0, {})
    assert not one.small and one.share == pytest.approx(159.0 / 160.0) and one.errors == 2.5


@pytest.mark.parametrize(("errors", "laws", "said"), [(3.5, 1, True), (3.5, 30, False), (5.2, 30, True)])
def test_it_is_no_chance_though_so_many_laws_were_asked(
    errors: float, laws: int, said: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of three standard errors, by Student's t of 20 blocks."""
    monkeypatch.setattr(module, "lead", lambda before, after: errors)
    assert bool(asked_of(monkeypatch, 160.0, 110.0, NOISE, laws)) == said


NOISE = {"predictable_left": 0.0, "std_error": 0.0, "noise": 1.0}


def asked_of(
    monkeypatch: pytest.MonkeyPatch, left: float, after: float, known: dict[str, float], laws: int = 1
) -> list[module.Suspected]:
    """What is suspected at one joint, where so much is left and the first of some laws would leave so much."""
    effects = [effect("coulomb_friction", 1)] * laws
    monkeypatch.setattr(module, "hypotheses", lambda arm: effects)
    monkeypatch.setattr(module, "log_posterior", lambda evidence, score, effects: -score.error)
    trial = SimpleNamespace(score=score(after, blocks=20), clear=(9.0, 2.5))
    given = SimpleNamespace(fit=SimpleNamespace(score=score(left, blocks=20)), trial=lambda effect: trial)
    monkeypatch.setattr(module.Known, "of", staticmethod(lambda *_: given))
    model = SimpleNamespace(arm=None, baseline={"joints": [known]})
    evidence: Any = SimpleNamespace(
        model=model, scale=np.ones(1), variation=np.ones(1), blocks=np.repeat(np.arange(20), 5)
    )
    return suspected(evidence, [], [0])


@pytest.mark.parametrize(
    ("small", "errors", "why"),
    [
        (True, 2.5, "no more than the model leaves at its worst"),
        (False, 2.5, "it is 2.5 of its stated errors from none"),
        (False, 3.1, "all that is asked"),
    ],
)
def test_the_sentence_names_the_joints(small: bool, errors: float, why: str) -> None:
    said = too_little("time_delay", (0, 2), 0.5, small, errors)
    assert said.startswith("joints 1, 3: time delay would explain 50%") and why in said
