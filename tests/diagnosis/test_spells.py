"""Friction that comes and goes within a run is one effect with its times; pushes and laws of the motion are none."""

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
from armloop.diagnosis import Diagnosis, diagnose, spells
from armloop.diagnosis.account import Account, best_account
from armloop.diagnosis.contacts import find_contacts, without
from armloop.diagnosis.evidence import Evidence
from armloop.laws.effects import Estimate, effect, hypotheses
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import AddedEffect, ReconstructedModel, load_model
from armloop.reports.diagnosis_tables import diagnosis_table
from armloop.schemas.answers import DiagnosisData
from armloop.schemas.checking import checked
from armloop.util.progress import silent

TIMES, LEVEL = [(5.0, 11.0), (17.0, 24.0)], 0.15


def within(motion: Motion) -> np.ndarray:
    """(N, 1) whether a sample lies within the times."""
    return np.any([(motion.time >= a) & (motion.time < b) for a, b in TIMES], axis=0)[:, None]


def drags(motion: Motion) -> np.ndarray:
    return np.asarray(within(motion) * np.tanh(motion.v / 1e-4) * [0.0, LEVEL, 0.0])


def log_of(seed: int, more: Callable[[Motion], np.ndarray], seconds: float = 30.0) -> MotionLog:
    """A measured run with torque in addition."""
    motion = motion_of(seed, seconds)
    return replace(measured(motion, torque(motion) + more(motion), seed, 0.01), name=f"run_{seed}")


@pytest.fixture(scope="module")
def model() -> ReconstructedModel:
    return model_with_baseline()


@pytest.fixture(scope="module")
def dragging(model: ReconstructedModel) -> Diagnosis:
    return diagnose(model, [log_of(1, drags)], jobs=1)


@pytest.fixture(scope="module")
def whole(model: ReconstructedModel) -> Evidence:
    return evidence(model, log_of(1, drags))


@pytest.fixture(scope="module")
def account(whole: Evidence) -> Account:
    """What is said of the run without: a residual of no law."""
    found = best_account(whole, find_contacts(whole, whole.residual([])), silent)
    assert [(law.joint, law.parameters) for law in found.laws] == [(2, {})]
    return found


def test_friction_that_comes_and_goes_is_told_with_its_times(dragging: Diagnosis) -> None:
    assert dragging.named == [("coulomb_friction", 2)] and not dragging.contacts
    answer = dragging.to_dict()
    checked({**answer, "feedforward_change": {}}, DiagnosisData)
    (entry,) = answer["effects"]
    assert entry["when"] == "event" and answer["verdict"] == "effects_found"
    during, level = entry["during"], entry["parameters"]["level"]
    # nothing is known of when but while the joint slides
    times = np.transpose([during["start"], during["end"]])
    np.testing.assert_allclose(times, TIMES, atol=3 * during["std_error"])
    assert during["std_error"] < 0.3
    assert abs(level["value"] - LEVEL) < 3 * level["std_error"] < 0.05
    error = dragging.errors()
    assert max(np.divide(error["after"], error["noise_floor"])) < 1.2
    words = f"from {during['start'][0]:.1f} to {during['end'][0]:.1f} s and from {during['start'][1]:.1f} to"
    said = " ".join(diagnosis_table(dragging).split())
    assert words in said and f"{during['end'][1]:.1f} s of run_1" in said and during["log"] == ["run_1"] * 2


def test_the_augmented_model_has_it_then_and_no_controller_supplies_it(
    model: ReconstructedModel, dragging: Diagnosis, tmp_path: Any
) -> None:
    dragging.model.save(tmp_path / "model.json")
    kept, motion = load_model(tmp_path / "model.json"), dragging.samples.motion
    more = np.abs(kept.predict(motion) - model.predict(motion))[:, 1]
    inside, edge = within(motion)[:, 0], np.zeros(motion.samples, dtype=bool)
    for instant in np.ravel(TIMES):
        edge |= np.abs(motion.time - instant) < 0.5
    assert (more[inside & ~edge & (np.abs(motion.v[:, 1]) > 0.05)] > 0.1).all()
    assert not more[~inside & ~edge].any()
    other = preprocess([run(2, 20.0)], model.conditioning).motion
    np.testing.assert_array_equal(kept.predict(other), model.predict(other))
    asked = motion.q[40], np.array([0.0, 0.5, 0.0]), motion.vdot[40]
    np.testing.assert_array_equal(kept.feedforward(*asked), model.feedforward(*asked))


def test_of_two_logs_it_is_said_which(model: ReconstructedModel) -> None:
    logs = [log_of(1, drags), log_of(3, lambda motion: 0 * motion.v)]
    (entry,) = diagnose(model, logs, jobs=1).to_dict()["effects"]
    assert entry["effect"] == "coulomb_friction" and entry["during"]["log"] == ["run_1", "run_1"]
    assert "s and from" in entry["words"]


def pushes(motion: Motion) -> np.ndarray:
    """Three of them, whatever the joint does meanwhile."""
    each = [(6.0, 7.0, 0.5), (13.0, 13.8, -0.6), (22.0, 23.2, 0.5)]
    size = sum(x * ((motion.time >= a) & (motion.time < b)) for a, b, x in each)
    return np.asarray(size)[:, None] * np.array([0.0, 1.0, 0.0])


def long_push(motion: Motion) -> np.ndarray:
    """One while the joint goes to and fro."""
    return np.asarray((np.abs(motion.time - 15) < 2.5)[:, None] * np.array([0.0, 0.4, 0.0]))


def rubs_there(motion: Motion) -> np.ndarray:
    """Where joint 1 stands to one side, joint 2 rubs more."""
    return np.asarray((motion.q[:, :1] > 0.2) * np.tanh(motion.v / 1e-4) * [0.0, LEVEL, 0.0])


@pytest.mark.parametrize("more", [pushes, long_push, rubs_there])
def test_what_is_none_is_not_taken_for_it(
    more: Callable[[Motion], np.ndarray], model: ReconstructedModel
) -> None:
    found = diagnose(model, [log_of(2, more)], jobs=1).to_dict()["effects"]
    assert found and not any("during" in entry for entry in found)
    if more is pushes:
        assert [(e["effect"], e["joint"]) for e in found] == [("external_torque", 2)] * 3


def test_a_push_is_in_one_direction() -> None:
    v, gains = np.array([1.0, 2.0, -1.0]), np.array([5.0, 4.0, 1.0])
    assert spells._turns(np.sign(v), gains, v)
    # hardly anything is explained in one of them
    assert not spells._turns(np.sign(v), gains * [1, 1, 0.9], v)
    assert not spells._turns(np.ones(3), gains, np.abs(v))
    # what is the same in both does not turn, and what drives is no friction
    assert not spells._turns(np.ones(3), gains, v) and not spells._turns(-np.sign(v), gains, v)


def test_what_a_posture_says_as_well_is_a_law_of_the_motion(model: ReconstructedModel) -> None:
    own = evidence(model)
    motion = own.samples.motion
    there = {"time": within(motion)[:, 0], "posture": motion.q[:, 0] > 0.2}
    for name, rows in there.items():
        gains = np.where(rows, 5.0, -5.0)[own.kept]
        # in time a posture is left and taken again and again, each at its price
        run_of = np.ones(len(gains), dtype=np.intp)
        most = spells.worth(gains, spells.likeliest(gains, run_of), run_of)
        assert spells._of_motion(own, gains, most) == (name == "posture")


def test_between_two_samples_that_count_nobody_knows_when_it_comes(whole: Evidence, account: Account) -> None:
    best = spells._best(whole, account, [1])
    assert best is not None
    for gap, error in ((0.6, 0.3), (1e-3, max(whole.samples.period, whole.samples.reach))):
        one = replace(
            best, intervals=(replace(best.intervals[0], gap=gap), replace(best.intervals[1], gap=0.0))
        )
        onset = spells._given(whole, one, []).effect.onset
        assert onset is not None and onset.error == pytest.approx(error)


def test_until_its_memory_is_used_up_a_joint_has_not_slid(model: ReconstructedModel) -> None:
    own = evidence(model)
    q, v = own.samples.motion.q[:, 1], own.samples.motion.v[:, 1]
    (turns,) = np.nonzero(np.diff(np.sign(v)) != 0)
    width = 0.1
    memory = FrictionLaw(
        ((), (FrictionTerm("hysteresis", 1.0, 0.01), FrictionTerm("hysteresis", 1.0, width)), ())
    )
    bare, remembering = (
        spells._slid(replace(own, model=replace(own.model, friction=law)), 1)
        for law in (FrictionLaw(((), (), ())), memory)
    )
    assert not (remembering & ~bare).any()
    since = np.abs(q - q[turns[np.clip(np.searchsorted(turns, np.arange(len(q))) - 1, 0, None)]])
    after = np.arange(len(q)) > turns[0]
    lost = after & bare & ~remembering
    assert (
        lost.any()
        and (since[lost] < 2 * width).all()
        and (since[after & remembering] > 2 * width).mean() > 0.8
    )


def evidence(model: ReconstructedModel, log: MotionLog | None = None) -> Evidence:
    samples = preprocess([log or run(2, 30.0)], model.conditioning)
    return Evidence.of(model, samples, hypotheses(model.arm))


def test_it_is_found_of_samples_in_which_the_joint_has_slid(
    whole: Evidence, account: Account, monkeypatch: pytest.MonkeyPatch
) -> None:
    best = spells._best(whole, account, [1])
    assert best is not None and (best.effect.name, best.shape) == ("coulomb_friction", 0.0)
    assert spells._best(whole, account, [0, 2]) is None
    others: list[tuple[str, Any]] = [
        ("_slid", lambda evidence, j: np.zeros(whole.samples.motion.samples, dtype=bool)),
        ("_of_motion", lambda *_: True),
        ("MOSTLY", 1.0),  # it must explain most of what is left
    ]
    for name, other in others:
        with monkeypatch.context() as patch:
            patch.setattr(spells, name, other)
            assert spells._best(whole, account, [1]) is None


def test_it_is_asked_in_the_place_of_what_was_found_at_its_joint(
    whole: Evidence, monkeypatch: pytest.MonkeyPatch
) -> None:
    level = {"level": Estimate(0.05, 0.01, "N*m")}
    first, second = (AddedEffect(effect("coulomb_friction", j), level) for j in (1, 2))
    known: list[list[AddedEffect]] = []
    monkeypatch.setattr(spells, "_known", lambda whole, added: known.append(added) or without(whole, []))
    account: Any = SimpleNamespace(outcome=SimpleNamespace(added=lambda: [first, second]))
    assert spells._best(whole, account, [1, 2]) is not None
    # all that was found, and without that of joint 2; of joint 3 nothing was
    assert known == [[first, second], [first]]


def test_what_begins_or_ends_and_no_more_has_an_instant(model: ReconstructedModel, account: Account) -> None:
    begins = evidence(
        model, log_of(1, lambda m: (m.time > 14.0)[:, None] * np.tanh(m.v / 1e-4) * [0.0, LEVEL, 0.0])
    )
    assert spells._best(begins, account, [1]) is None


@pytest.mark.parametrize("viscous", [(0.3, 0.0), pytest.param((0.2, 0.3), marks=pytest.mark.long)])
def test_beside_what_is_there_all_the_while(viscous: tuple[float, float], model: ReconstructedModel) -> None:
    """Of another joint, and of the same."""
    log = log_of(1, lambda m: drags(m) + m.v * [*viscous, 0.0])
    told = {(e["effect"], e["joint"]): e for e in diagnose(model, [log], jobs=1).to_dict()["effects"]}
    true = {("viscous_friction", j): x for j, x in enumerate(viscous, 1) if x} | {
        ("coulomb_friction", 2): LEVEL
    }
    assert set(told) == set(true)
    for place, size in true.items():
        (estimate,) = told[place]["parameters"].values()
        assert abs(estimate["value"] - size) < 3.5 * estimate["std_error"]
        assert ("during" in told[place]) == (place[0] == "coulomb_friction")


@pytest.mark.parametrize(("price", "taken"), [(1.0, True), (0.0, False)])
def test_every_instant_of_an_event_has_its_price(
    price: float, taken: bool, whole: Evidence, account: Account, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the accounts are as likely else; nor is one taken at the cost of other joints."""
    monkeypatch.setattr(spells, "posterior", lambda *_: 0.0)
    monkeypatch.setattr(spells, "instant_price", lambda evidence: price)
    events: Any = [None, None]
    account = replace(account, contacts=events)
    made = spells.account_with_spells(whole, account, [], silent, 1)
    assert (made is not None) is taken
    monkeypatch.setattr(spells, "at_the_cost_of_others", lambda *_: True)
    assert spells.account_with_spells(whole, account, [], silent, 1) is None


@pytest.mark.parametrize(
    ("left", "law", "events", "asked"),
    [
        (3.9, None, 0, False),
        (4.1, None, 0, True),
        (0.0, {"v2": 1.0}, 0, False),
        (0.0, {}, 0, True),
        (0.0, None, 1, True),
    ],
)
def test_it_is_asked_where_something_came_and_went_or_much_is_left_without_a_law(
    left: float, law: dict[str, float] | None, events: int, asked: bool
) -> None:
    score = SimpleNamespace(energy=np.array([0.0, 10 * left]), rows=np.array([10, 10]))
    account: Any = SimpleNamespace(
        laws=[] if law is None else [SimpleNamespace(parameters=law)],
        outcome=SimpleNamespace(after=SimpleNamespace(score=score)),
        contacts=[None] * events,
    )
    assert spells._is_asked(account) is asked
