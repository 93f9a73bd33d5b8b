"""Effects that begin, or end, within a run: told with the time, and what is there all the while told without one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rubbing_arm import model_with_baseline, motion_of, run, torque
from synthetic import measured

from armloop.data.log import MotionLog
from armloop.data.motion import Motion
from armloop.data.signals import preprocess
from armloop.diagnosis import Diagnosis, diagnose, onset
from armloop.diagnosis.change_points import ChangePoints, Part
from armloop.diagnosis.contacts import without
from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.fit import Shape
from armloop.laws.effects import Context, effect, hypotheses
from armloop.model import ReconstructedModel, load_model
from armloop.reports.diagnosis_tables import diagnosis_table
from armloop.schemas.answers import DiagnosisData
from armloop.schemas.checking import checked


def rubs_more(motion, since: float) -> np.ndarray:
    return (motion.time >= since)[:, None] * np.tanh(motion.v / 1e-4) * [0.0, 0.15, 0.0]


def log_of(seed: int, more: Callable | None = None, seconds: float = 30.0) -> MotionLog:
    """A measured run with torque in addition."""
    motion = motion_of(seed, seconds)
    tau = torque(motion)
    return replace(measured(motion, tau if more is None else tau + more(motion), seed, 0.01), name="a_run")


def slipped(seed: int, since: float, by: float) -> MotionLog:
    """A run in which the encoder of joint 2 slips."""
    log = run(seed, 30.0)
    return replace(log, q=log.q + (log.time >= since)[:, None] * np.array([0.0, by, 0.0]), name="a_run")


@pytest.fixture(scope="module")
def model() -> ReconstructedModel:
    return model_with_baseline()


@pytest.fixture(scope="module")
def rubbing(model: ReconstructedModel) -> Diagnosis:
    """What is found where dry friction rises after 17 s."""
    return diagnose(model, [log_of(1, lambda motion: rubs_more(motion, 17.0))], jobs=1)


def test_friction_that_rises_within_a_run_is_told_with_the_time(rubbing: Diagnosis) -> None:
    assert rubbing.verdict == "effects_found" and rubbing.named == [("coulomb_friction", 2)]
    answer = rubbing.to_dict()
    checked({**answer, "feedforward_change": {}}, DiagnosisData)
    (entry,) = answer["effects"]
    since = entry["since"]
    assert since["unit"] == "s" and since["log"] == "a_run" and entry["when"] == "changed"
    assert abs(since["value"] - 17.0) < 3 * since["std_error"] < 1.0
    level = entry["parameters"]["level"]
    assert abs(level["value"] - 0.15) < 3 * level["std_error"]
    assert entry["share"] > 0.95
    error = rubbing.errors()
    assert max(np.divide(error["after"], error["noise_floor"])) < 1.2
    words = diagnosis_table(rubbing)
    assert f"since {since['value']:.1f} ± {since['std_error']:.1f} s of a_run" in " ".join(words.split())


def test_the_augmented_model_has_it_from_then_on(
    model: ReconstructedModel, rubbing: Diagnosis, tmp_path
) -> None:
    rubbing.model.save(tmp_path / "model.json")
    kept, motion = load_model(tmp_path / "model.json"), rubbing.samples.motion
    more = kept.predict(motion) - model.predict(motion)
    since = rubbing.to_dict()["effects"][0]["since"]["value"]
    assert not more[motion.time < since].any() and np.abs(more[motion.time >= since, 1]).max() > 0.1
    # any other log has it all the while, and so has a controller
    other = preprocess([run(2, 20.0)], model.conditioning).motion
    assert (np.abs(kept.predict(other) - model.predict(other))[np.abs(other.v[:, 1]) > 0.05, 1] > 0.1).all()
    q, v, vdot = motion.q[40], np.array([0.0, 0.5, 0.0]), motion.vdot[40]
    assert kept.feedforward(q, v, vdot)[1] - model.feedforward(q, v, vdot)[1] > 0.1


@pytest.mark.long
def test_an_encoder_that_slips_is_one_offset_since_then(model: ReconstructedModel) -> None:
    found = diagnose(model, [slipped(2, 18.0, 0.03)], jobs=1)
    assert found.named == [("encoder_offset", 2)] and not found.contacts
    (entry,) = found.to_dict()["effects"]
    assert abs(entry["since"]["value"] - 18.0) < 3 * entry["since"]["std_error"] + 0.05
    assert abs(entry["parameters"]["offset"]["value"] - 0.03) < 0.003
    assert "This goes for what was recorded since 1" in entry["remedy"]


def test_a_body_is_asked_about_and_what_fades_by_itself_is_not(
    model: ReconstructedModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(onset, "_asked", lambda account: np.ones(3, dtype=bool))
    account: Any = SimpleNamespace(outcome=SimpleNamespace(after=SimpleNamespace(effects=[], shapes=[])))
    asked = {e.name for e, _ in onset._hypotheses(points_of(model, log_of(1)).evidence, account)}
    assert {"payload", "coulomb_friction", "joint_spring"} <= asked
    assert not {"friction_drift", "carried_load", "torque_ripple"} & asked


@pytest.mark.long
def test_a_tool_that_is_lost_within_a_run_is_a_body_that_is_gone_since(model: ReconstructedModel) -> None:
    body = {"mass": -0.4, "com": [0.05, 0.0, 0.1], "own_inertia": 0.0}

    def lost(motion: Motion) -> np.ndarray:
        torque = effect("payload", None).torque(Context(model.arm, motion), body)
        return torque * (motion.time >= 17.0)[:, None]

    found = diagnose(model, [log_of(4, lost)], jobs=1)
    assert found.named == [("payload", None)] and not found.contacts
    (entry,) = found.to_dict()["effects"]
    mass, since = entry["parameters"]["mass"], entry["since"]
    assert abs(mass["value"] + 0.4) < 3 * mass["std_error"] < 0.2
    assert abs(since["value"] - 17.0) < 3 * since["std_error"] < 1.0


def test_what_ended_is_an_event_of_the_run_and_no_controller_supplies_it(model: ReconstructedModel) -> None:
    log = log_of(3, lambda m: (m.time < 14.0)[:, None] * m.v * [0.3, 0.0, 0.0])
    found = diagnose(model, [log], jobs=1)
    (entry,) = found.to_dict()["effects"]
    assert (entry["effect"], entry["joint"], entry["when"]) == ("viscous_friction", 1, "event")
    assert abs(entry["until"]["value"] - 14.0) < 3 * entry["until"]["std_error"] + 0.05
    asked = [x[50] for x in (log.q, log.v, np.zeros_like(log.v))]
    np.testing.assert_array_equal(found.model.feedforward(*asked), model.feedforward(*asked))


@pytest.mark.parametrize(
    "name", ["all the while", *(pytest.param(k, marks=pytest.mark.long) for k in ("fading", "push"))]
)
def test_what_does_not_begin_within_the_run_is_told_without_a_time(
    model: ReconstructedModel, name: str
) -> None:
    def more(motion) -> np.ndarray:
        rubs, time = np.tanh(motion.v / 1e-4) * [0.0, 0.2, 0.0], motion.time[:, None]
        if name == "push":
            return np.asarray(((time > 14.0) & (time < 15.0)) * np.array([0.0, 0.8, 0.4]))
        return np.asarray(rubs * (np.exp(-time / 8) if name == "fading" else 1.0))

    found = diagnose(model, [log_of(4, more)], jobs=1)
    entries = found.to_dict()["effects"]
    kinds = {"all the while": "coulomb_friction", "fading": "friction_drift"}
    if name == "push":
        assert len(found.contacts) == len(entries) > 0
    else:
        assert [entry["effect"] for entry in entries] == [kinds[name]]
    assert not any("since" in entry or "until" in entry for entry in entries)


def points_of(model: ReconstructedModel, *logs: MotionLog) -> ChangePoints:
    samples = preprocess(list(logs), model.conditioning)
    return ChangePoints(without(Evidence.of(model, samples, hypotheses(model.arm)), []))


def part_of(points: ChangePoints, name: str, joint: int = 2) -> list[Part]:
    return list(points.parts(effect(name, joint), Shape.fixed(0.0), ()))


def test_a_run_without_it_has_no_likelier_instant_on_blocks_that_did_not_choose(
    model: ReconstructedModel,
) -> None:
    """The best of many instants bends to what it was chosen on; what judges are the others."""
    worse = []
    for seed in (11, 12, 13):
        points = points_of(model, run(seed, 30.0))
        for name in ("coulomb_friction", "viscous_friction", "torque_offset"):
            part = part_of(points, name)[0]
            judged = points.judged(part, points.best(part)[1])
            none = points.evidence.only(judged.known.evidence.rows)
            bare = part.fitted(none, points.onset(part, judged.cut)).fit.stacked.y
            worse.append((judged.held_out**2).sum() - (bare**2).sum())
    assert np.mean(np.array(worse) > 0) > 0.5


def test_an_effect_of_faster_motion_is_no_onset(model: ReconstructedModel) -> None:
    """A program that is slow first and fast then shows what a law gets wrong of speed in its second half."""
    motion = motion_of(5, 30.0)
    slow = replace(motion, time=2.0 * motion.time, v=motion.v / 2, vdot=motion.vdot / 4)
    half, later = slow.samples // 2, motion.time + slow.time[slow.samples // 2 - 1] + 1.0
    both = replace(
        motion,
        time=np.concatenate([slow.time[:half], later[:half]]),
        **{
            key: np.concatenate([getattr(slow, key)[:half], getattr(motion, key)[:half]])
            for key in ("q", "v", "vdot")
        },
    )
    tau = torque(both)
    tau[:, 1] += 0.3 * np.where(np.abs(both.v[:, 1]) > 0.6, both.v[:, 1], 0.0)
    faster = points_of(model, measured(both, tau, 5, 0.01))
    rising = points_of(model, log_of(5, lambda m: rubs_more(m, 15.0)))
    answers = []
    for points, name in ((faster, "viscous_friction"), (rising, "coulomb_friction")):
        part = part_of(points, name)[0]
        answers.append(points.of_motion(part, points.best(part)[1]))
    assert answers == [True, False]


def test_what_grows_all_along_has_no_instant(model: ReconstructedModel) -> None:
    """A belt that creeps is no belt that slips, though a step comes nearer to it than a constant."""
    answers = []
    for seed in (1, 2, 3):
        log = run(seed, 30.0)
        course = np.outer(log.time / 30.0, [0.0, 0.03, 0.0])
        for points in (
            points_of(model, replace(log, q=log.q + course)),
            points_of(model, slipped(seed, 15.0, 0.03)),
        ):
            part = part_of(points, "encoder_offset")[0]
            answers.append(points.gradual(part, points.best(part)[1]))
    assert answers == [True, False] * 3


def test_a_step_of_an_angle_is_known_to_twice_the_filters_reach_at_best(model: ReconstructedModel) -> None:
    """Rates and torques that are made of it ring, before the filter and after."""
    points = points_of(model, slipped(2, 15.0, 0.03))
    rings = 2 * points.evidence.samples.reach
    for name, least in (("encoder_offset", rings), ("torque_offset", 0.0)):
        part = part_of(points, name)[0]
        cut = points.best(part)[1]
        error, instant = points.error(part, cut), points.onset(part, cut).time
        assert error >= least
        if least:
            assert abs(instant - 15.0) < 3 * error < 8 * rings


def test_of_several_logs_the_one_that_it_begins_in_is_found(model: ReconstructedModel) -> None:
    """Their clocks pass the same times: nothing tells which was recorded first, and each may have it or not."""
    first, then = run(6, 20.0), log_of(7, lambda m: rubs_more(m, 9.0), 20.0)
    points = points_of(model, first, then)
    parts = part_of(points, "coulomb_friction")
    assert len(parts) == 8  # of two logs, since and until, with and without the other
    best = max(parts, key=lambda part: points.best(part)[0])
    onset = points.onset(best, points.best(best)[1])
    assert not best.until and not best.elsewhere and abs(onset.time - 9.0) < 1.0
    motion = points.evidence.samples.motion
    assert not onset.there(motion)[: motion.starts[1]].any()


@pytest.mark.parametrize(
    ("likely", "worth_than", "found", "ahead", "gradual", "of_motion", "told"),
    [
        (1.0, "constant", True, 9.0, False, False, True),
        (-1.0, "constant", True, 9.0, False, False, False),  # what was found without it is likelier
        (1.0, "", True, 9.0, False, False, False),  # the same effect all the while is as good
        (1.0, "constant", True, 9.0, True, False, False),
        (1.0, "constant", True, 9.0, False, True, False),
        # of one that was not found all the while it is enough to be worth it, and plainly better than that
        (1.0, "bare", False, 3.1, False, False, True),
        (1.0, "bare", False, 2.9, False, False, False),
        (1.0, "bare", True, 3.1, False, False, False),
        (1.0, "", False, 3.1, False, False, False),
    ],
)
def test_it_must_be_likelier_than_all_else_worth_more_than_all_the_while_and_of_time_alone(
    likely: float,
    worth_than: str,
    found: bool,
    ahead: float,
    gradual: bool,
    of_motion: bool,
    told: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rows = np.ones((4, 3), dtype=bool)
    evidence = SimpleNamespace(rows=rows)
    part = SimpleNamespace(effect=effect("coulomb_friction", 2), shape=Shape.fixed(0.0), others=())
    judged: Any = SimpleNamespace(
        known=SimpleNamespace(evidence=evidence), part=part, cut=7, likely=likely, score=lambda rows: "gated"
    )
    points: Any = SimpleNamespace(
        gradual=lambda *asked: asked == (part, 7) and gradual, of_motion=lambda *asked: of_motion
    )

    def known(evidence: Any, effects: Any, shapes: Any) -> Any:
        return SimpleNamespace(fit=SimpleNamespace(score="constant" if effects else "bare"))

    monkeypatch.setattr(onset.Known, "of", staticmethod(known))
    monkeypatch.setattr(
        onset, "is_worth", lambda _, plain, gated, *rest: (plain, gated) == (worth_than, "gated")
    )
    monkeypatch.setattr(
        onset, "lead", lambda worse, better: ahead if (worse, better) == ("constant", "gated") else 0.0
    )
    monkeypatch.setattr(onset, "posterior", lambda account, residual, rows: 0.0)
    stated = [SimpleNamespace(effect=part.effect)] if found else []
    account: Any = SimpleNamespace(contacts=[], evidence=evidence, outcome=SimpleNamespace(found=stated))
    assert onset._is_told(points, judged, account, np.zeros((4, 3))) == told


def test_an_account_is_as_likely_as_its_effects_events_and_law_allow(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(onset, "told", lambda score: score)
    monkeypatch.setattr(onset, "price", lambda evidence, effects: -10.0 * len(effects))
    monkeypatch.setattr(onset, "law_log_prior", lambda evidence, terms, j: -100.0 * len(terms) - j)
    law = SimpleNamespace(joint=3, parameters={"v3^3": 1.0, "q3*v3": 2.0, "q_low": [], "q_high": []})
    given: Any = SimpleNamespace(
        evidence=None,
        outcome=SimpleNamespace(after=SimpleNamespace(effects=["friction"])),
        contacts=[SimpleNamespace(added=SimpleNamespace(effect="push"))],
        laws=[],
        everywhere=lambda residual, rows: -1.0,
    )
    nothing: Any = None
    assert onset.posterior(given, nothing, nothing) == -21.0
    given.laws = [law]
    assert onset.posterior(given, nothing, nothing) == -21.0 - 202.0
    given.laws = [law, SimpleNamespace(joint=1, parameters={"v1": 1.0})]
    assert onset.posterior(given, nothing, nothing) == -21.0 - 302.0
