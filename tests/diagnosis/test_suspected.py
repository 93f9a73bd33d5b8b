"""A law that is no chance, and no more than the model leaves at its worst, is said and not stated; nothing else is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rubbing_arm import model_with_baseline, motion_of, run, torque
from synthetic import measured

from armloop.data.log import MotionLog
from armloop.data.signals import preprocess
from armloop.diagnosis import diagnose
from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.reasons import too_small
from armloop.diagnosis.suspected import suspected
from armloop.laws.effects import hypotheses
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
    assert "coulomb_friction at joint 2 would explain " in said and "at its worst" in said


@pytest.mark.parametrize("known", [{"predictable_left": 1e-4, "std_error": 1e-6, "noise": 1e-4}, {}])
def test_what_the_model_itself_gets_wrong_may_look_like_it(
    model: ReconstructedModel, known: dict[str, float]
) -> None:
    """Half of what it leaves can be predicted, twice as much of it on the worst tenth; or nobody asked."""
    joints = [{"joint": j + 1, **known} for j in range(3)]
    poor = replace(model, baseline={**model.baseline, "joints": joints})
    log = run(1, 60.0, float(model.baseline["rmse"][1]))
    assert [e.label() for e, _, _ in suspected(evidence_of(model, log), [], [1])] == [
        "coulomb_friction at joint 2"
    ]
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
    ((effect, joints, share),) = suspected(evidence, [], [0, 1, 2])
    assert (effect.name, joints) == ("time_delay", (0, 1, 2)) and 0.75 <= share <= 1.0
    # of one joint alone a delay of the record is not asked
    assert {e.joint for e, _, _ in suspected(evidence, [], [1])} <= {2}


def test_the_sentence_names_the_joints() -> None:
    assert too_small("time_delay", (0, 2), 0.5).startswith("joints 1, 3: time_delay would explain 50%")
