"""Logs in which the arm was not the same are judged apart, and logs in which it was together."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rubbing_arm import model_with_baseline, motion_of, torque
from synthetic import measured

from armloop.data.log import MotionLog
from armloop.data.motion import Motion
from armloop.data.signals import preprocess
from armloop.diagnosis import Diagnosis, diagnose, homogeneity
from armloop.diagnosis.account import Account, best_account
from armloop.diagnosis.contacts import find_contacts
from armloop.diagnosis.evidence import Evidence
from armloop.laws.effects import hypotheses
from armloop.model import ReconstructedModel
from armloop.reports.diagnosis_report import diagnosis_report
from armloop.reports.diagnosis_tables import diagnosis_table
from armloop.schemas.answers import DiagnosisData
from armloop.schemas.checking import checked
from armloop.util.progress import silent

Law = Callable[[Motion], np.ndarray]


def nothing(motion: Motion) -> np.ndarray:
    return 0 * motion.v


def wave(motion: Motion) -> np.ndarray:
    """Ripple of joint 1."""
    return np.asarray(np.sin(8 * motion.q) * [0.15, 0.0, 0.0])


def spring(motion: Motion) -> np.ndarray:
    """At joint 2."""
    return np.asarray(motion.q * [0.0, 0.3, 0.0])


def log_of(seed: int, law: Law, seconds: float = 24.0) -> MotionLog:
    motion = motion_of(seed, seconds)
    return replace(measured(motion, torque(motion) + law(motion), seed, 0.01), name=f"run_{seed}")


@pytest.fixture(scope="module")
def model() -> ReconstructedModel:
    """Of a baseline that is half as large again at its worst."""
    made = model_with_baseline()
    worst = [1.5 * rmse for rmse in made.baseline["rmse"]]
    return replace(made, baseline={**made.baseline, "worst": worst})


@pytest.fixture(scope="module")
def half_changed(model: ReconstructedModel) -> Diagnosis:
    return diagnose(model, [log_of(1, wave), log_of(3, nothing)], jobs=1)


def test_a_log_of_the_arm_as_it_was_is_judged_apart(half_changed: Diagnosis) -> None:
    assert half_changed.named == [("torque_ripple", 1)] and half_changed.logs == ("run_1",)
    (other,) = half_changed.apart
    assert (other.verdict, other.named, other.logs) == ("no_effect", [], ("run_3",))
    errors = half_changed.errors()
    assert max(np.divide(errors["after"], errors["noise_floor"])) < 1.2


def test_it_is_told_wherever_a_verdict_is(half_changed: Diagnosis, model: ReconstructedModel) -> None:
    answer: dict[str, Any] = half_changed.to_dict()
    checked({**answer, "feedforward_change": {}}, DiagnosisData)
    assert answer["logs"] == ["run_1"] and [each["logs"] for each in answer["apart"]] == [["run_3"]]
    said = "and they were judged apart: all else here is said of run_1 (in run_3: no effect)"
    assert answer["reasons"][0] == f"the arm was not the same in all logs, or not at the same times, {said}"
    again = half_changed.beside(half_changed.apart)
    assert len(again.reasons) == 1 and again.reasons[0].endswith("(in run_3: no effect; in run_3: no effect)")
    assert "run_3, judged apart: no effect" in diagnosis_table(half_changed)
    page = diagnosis_report(half_changed, model)
    assert "run_3, judged apart: no effect" in page and "predicted the torque of run_1 (" in page


def test_what_has_changed_is_the_verdict_whatever_the_order(model: ReconstructedModel) -> None:
    """Of a baseline that is as large at its worst as ever, no log is quiet: each is asked by itself."""
    narrow = replace(model, baseline={**model.baseline, "worst": model.baseline["rmse"]})
    found = diagnose(narrow, [log_of(1, wave), log_of(4, nothing)], jobs=1)
    assert (found.named, found.logs) == ([("torque_ripple", 1)], ("run_1",))
    assert [(other.verdict, other.logs) for other in found.apart] == [("no_effect", ("run_4",))]


def test_of_logs_that_changed_each_in_its_way_the_last_is_the_arm(model: ReconstructedModel) -> None:
    found = diagnose(model, [log_of(1, wave), log_of(2, spring)], jobs=1)
    assert (found.named, found.logs) == ([("joint_spring", 2)], ("run_2",))
    (other,) = found.apart
    assert (other.named, other.logs) == ([("torque_ripple", 1)], ("run_1",))
    assert "(in run_1: torque ripple at joint 1)" in found.reasons[0]


def test_logs_of_the_same_arm_are_judged_together(model: ReconstructedModel) -> None:
    said: list[str] = []
    found = diagnose(model, [log_of(1, wave), log_of(2, wave)], said.append, jobs=1)
    assert not any("by itself" in words or "by themselves" in words for words in said)
    assert (found.named, found.logs, found.apart) == ([("torque_ripple", 1)], ("run_1", "run_2"), ())
    assert "apart" not in found.to_dict() and not found.reasons
    clean = diagnose(model, [log_of(3, nothing), log_of(4, nothing)], jobs=1)
    assert (clean.verdict, clean.logs, clean.apart) == ("no_effect", ("run_3", "run_4"), ())


def test_a_log_that_does_not_show_what_changed_is_judged_with_the_others(model: ReconstructedModel) -> None:
    moves = motion_of(3, 24.0)
    q, v, vdot = (x * [0, 1, 1] for x in (moves.q, moves.v, moves.vdot))
    motion = replace(moves, q=q, v=v, vdot=vdot)
    resting = replace(measured(motion, torque(motion), 3, 0.01), name="resting")
    found = diagnose(model, [log_of(1, wave), resting], jobs=1)
    assert (found.named, found.logs, found.apart) == ([("torque_ripple", 1)], ("run_1", "resting"), ())


def account_of(model: ReconstructedModel, *logs: MotionLog) -> Account:
    whole = Evidence.of(model, preprocess(logs, model.conditioning), hypotheses(model.arm))
    return best_account(whole, find_contacts(whole, whole.residual([])), silent)


def test_an_account_for_each_log_pays_for_what_it_states(
    model: ReconstructedModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Logs of one law are likelier with one account, of two laws with two; of other samples nothing is said."""
    waves = [log_of(1, wave), log_of(2, wave)]
    each = [account_of(model, log) for log in waves]
    assert not homogeneity.are_unlike(account_of(model, *waves), each)
    unlike = [waves[0], log_of(2, spring)]
    together, apart = account_of(model, *unlike), [account_of(model, log) for log in unlike]
    assert homogeneity.are_unlike(together, apart) and not homogeneity.are_unlike(together, apart[:1])
    # the common account pays for the events of a log, and for no law
    asked: list[int] = []
    monkeypatch.setattr(homogeneity, "price", lambda _, effects: asked.append(len(effects)) or 0.0)
    first = len(apart[0].whole.samples.motion.time)
    event: Any = SimpleNamespace(
        rows=np.arange(together.whole.rows.shape[0]) == first, added=SimpleNamespace(effect="push")
    )
    scored: Any = replace(together, contacts=[])
    monkeypatch.setattr(
        type(scored), "everywhere", lambda self, residual, rows: apart[0].score(apart[0].evidence.rows)
    )
    homogeneity.are_unlike(replace(scored, contacts=[event]), apart)
    assert asked == [0, 1]


def test_which_logs_are_as_the_model(model: ReconstructedModel) -> None:
    def pushed(motion: Motion) -> np.ndarray:
        return np.asarray(((motion.time > 9) & (motion.time < 9.6))[:, None] * [0.02, 0.0, 0.0])

    logs = [log_of(1, wave), log_of(3, nothing), log_of(4, pushed)]
    assert homogeneity.as_modelled(model, logs).tolist() == [False, True, False]
    assert homogeneity.as_modelled(model, logs[1:2]).tolist() == [False]
    # an event is asked of where another log has changed: it would be lost where that is judged alone
    assert homogeneity.as_modelled(model, logs[1:]).tolist() == [True, True]


def test_what_a_log_does_not_show_contradicts_nothing(
    model: ReconstructedModel, half_changed: Diagnosis
) -> None:
    still = log_of(3, nothing)
    moving = preprocess([still], model.conditioning)
    assert homogeneity.is_contradicted(half_changed, model, moving)
    # joint 1 rests: of a wave of its angle only an offset is left, which dry friction may hold
    resting = preprocess([replace(still, q=still.q * [0, 1, 1], v=still.v * [0, 1, 1])], model.conditioning)
    rows = homogeneity.Evidence.of(model, resting, []).rows
    assert not rows[:, 0].any() and not homogeneity.is_contradicted(half_changed, model, resting)


def test_what_has_no_law_is_lacked_by_a_log_that_is_as_the_model(model: ReconstructedModel) -> None:
    unnamed: Any = SimpleNamespace(laws=[SimpleNamespace(parameters={})])
    nobody: Any = None
    assert homogeneity.is_contradicted(unnamed, model, nobody)


def told(after: list[float], contacts: int = 0, law: bool | None = None) -> Any:
    """A diagnosis with a baseline of one."""
    laws = [] if law is None else [SimpleNamespace(parameters={"v2^3": 1.0} if law else {})]
    errors = {"after": after, "noise_floor": [1.0] * len(after)}
    found = SimpleNamespace(laws=laws, contacts=[0] * contacts, errors=lambda: errors)
    return found


@pytest.mark.parametrize(
    ("found", "much"),
    [
        (told([1.9, 1.0]), False),
        (told([1.0, 2.0]), True),
        (told([float("nan"), 1.0]), False),
        (told([1.0], contacts=2), False),
        (told([1.0], contacts=3), True),
        (told([1.0], law=True), False),
        (told([1.0], law=False), True),
    ],
)
def test_when_each_log_is_asked_by_itself(monkeypatch: pytest.MonkeyPatch, found: Any, much: bool) -> None:
    monkeypatch.setattr(homogeneity, "replace", lambda one, **_: one)
    assert homogeneity.leaves_much(found) == much
