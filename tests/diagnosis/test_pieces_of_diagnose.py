"""The order in which a run is judged: what is asked of whom, and what verdict comes of the answers."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import three_axis
from told_answers import CONTACT, Answers, Evidence, judged, module

from armloop.data.log import unchecked_log
from armloop.diagnosis.diagnose import diagnose
from armloop.diagnosis.suspected import Suspected
from armloop.diagnosis.unlisted import Unlisted
from armloop.diagnosis.verdict import Diagnosis
from armloop.laws.effects import effect
from armloop.laws.effects.events import interval
from armloop.model import AddedEffect, ReconstructedModel
from armloop.util.errors import InputError, InputWarning
from armloop.util.finite import finite


@pytest.mark.parametrize(
    ("contacts", "known", "verdict"),
    [([], False, "cannot_tell"), ([], True, "no_effect"), ([CONTACT], False, "effects_found")],
)
def test_a_run_that_rests_is_judged_by_its_events_alone(
    contacts: list[Any], known: bool, verdict: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    answers = Answers(monkeypatch, still=True, contacts=contacts, known=known)
    found = judged()
    assert found.verdict == verdict and found.unlisted is None and found.contacts == contacts
    # of no joint is it known what it lacks
    model = ("with", *(["push"] if contacts else []))
    name, augmented, left, joints = answers.asked["standing"]
    assert (name, augmented, joints) == ("left", model, [1, 2, 3]) and found.model == model
    # nothing was looked for, and of what is left nothing is said but how much it is
    assert np.isnan(left).all()
    assert found.reasons == ["still", "stands", "zeros of ['run']"] and found.zeros.tolist() == [[0.1] * 3]
    assert answers.asked["contacts"] == "residual of whole" and "best" not in answers.asked
    assert found.outcome.before == found.outcome.after and found.evidence.name == "left"


def test_an_event_that_may_be_a_law_of_a_run_too_short_to_look_for_one_is_not_stated(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    Answers(monkeypatch, still=True, contacts=[CONTACT], untold=True)
    found = judged()
    assert found.verdict == "cannot_tell" and found.contacts == [] and found.model == ("with",)
    assert found.reasons == ["not told: push", "still", "stands", "zeros of ['run']"]


def test_a_run_that_is_all_events_is_searched_without_those_that_may_be_a_law(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A load that was there all the while looks like one push after the other."""
    answers = Answers(monkeypatch, still=("left",), contacts=[CONTACT], untold=True, found=["load"])
    found = judged(jobs=2)
    assert answers.asked["best"] == ("whole", [], ("whole", 2)) and answers.asked["laws"] == ("whole", 2)
    assert found.verdict == "effects_found" and found.contacts == [] and "not told: push" not in found.reasons
    # what can be told stays, and so little is left that it is all
    answers = Answers(monkeypatch, still=("left",), contacts=[CONTACT], found=["load"])
    assert judged().contacts == [CONTACT] and "best" not in answers.asked


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(
    ("found", "contacts", "unlisted", "unknown", "verdict"),
    [
        ([], [], None, False, "no_effect"),
        ([], [], None, True, "cannot_tell"),
        (["spring"], [], None, True, "effects_found"),
        ([], [CONTACT], None, True, "effects_found"),
        ([], [], 2, False, "unlisted_effect"),
        ([], [], 2, True, "unlisted_effect"),
        (["spring"], [], 3, False, "effects_found"),
    ],
)
def test_a_run_that_moves_is_searched(
    found: list[Any],
    contacts: list[Any],
    unlisted: int | None,
    unknown: bool,
    verdict: str,
    turned: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    law = (
        None
        if unlisted is None
        else SimpleNamespace(joint=unlisted, parameters={}, instead="drag is a part", added=list)
    )
    answers = Answers(
        monkeypatch, found=found, contacts=contacts, unlisted=law, turned=turned, unknown=unknown
    )
    made = judged(jobs=2)
    assert made.verdict == verdict and made.unlisted is law and made.contacts == contacts
    assert answers.asked["best"] == ("whole", contacts, ("whole", 2))
    # what is regressed at reversals is not asked of the joint with an unlisted law
    assert answers.asked["kept"].tolist() == [[j + 1 != unlisted for j in range(3)]] * 4
    name = "turned" if turned else "account"
    assert (made.outcome.name, made.evidence.name) == (name, name) and made.strengths[0] == name
    assert (made.reversals is not None) == turned and answers.asked["useful"] == (name, name)
    assert answers.asked["plain"][0] == name and answers.asked["ordered"] == name
    assert answers.asked["carried"] == ("whole", "account", 2)
    model = ("with", *found, *(["push"] if contacts else []))
    assert made.model == model
    assert answers.asked["standing"] == (
        name,
        model,
        ("errors", True),
        [] if unlisted is None else [unlisted],
    )
    assert answers.asked["found"] == bool(found or contacts or law)
    # what is too small to be stated is asked of what nothing accounts for, beside no law that is not listed
    small = None if turned or law else ("account", found, [1])
    assert answers.asked.get("suspected") == small
    part = [] if law is None else ["drag is a part"]
    assert made.reasons == [*part, "stands", "zeros of ['run']"] and made.zeros.tolist() == [[0.1] * 3]


@pytest.mark.parametrize(("joint", "asked"), [(1, []), (2, [1])])
def test_of_a_joint_of_which_something_hidden_is_told_nothing_else_is_suspected(
    joint: int, asked: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    hidden = SimpleNamespace(effect=effect("viscous_friction", joint + 1))
    law = Suspected(effect("coulomb_friction", 2), (1,), 0.8, small=bool(asked), errors=9.0)
    told = {
        "of_too_few_logs": ["a model of one log"],
        "of_a_constant_pull": ["a counterweight"],
        "of_a_balancer": ["gas"],
        "of_an_efficiency": ["a gear"],
        "localised": ["where it is slow"],
    }
    answers = Answers(monkeypatch, masked=((hidden, hidden),), suspected=[law], **told)
    reasons = judged(jobs=2).reasons
    assert {sentence for each in told.values() for sentence in each} <= set(reasons)
    assert answers.asked["suspected"] == ("account", [], asked)
    assert any("viscous friction at joint 2 would explain" in reason for reason in reasons) == (not asked)
    (said,) = [
        reason for reason in reasons if "joint 2: coulomb friction at joint 2 would explain 80%" in reason
    ]
    assert ("no more than the model leaves" in said) == bool(asked)


def test_the_account_with_a_load_takes_the_place_of_that_without(monkeypatch: pytest.MonkeyPatch) -> None:
    law = SimpleNamespace(joint=1)
    answers = Answers(monkeypatch, carried=True, found=["load"], contacts=[CONTACT], unlisted=law)
    made = judged()
    assert (made.outcome.name, made.evidence.name) == ("with the load", "loaded")
    assert made.verdict == "effects_found" and made.unlisted is None and made.contacts == []
    assert made.model == ("with", "load") and answers.asked["kept"].all()


@pytest.mark.parametrize(("carried", "asked"), [(False, "account"), (True, "with the load")])
def test_a_cable_is_asked_for_beside_what_is_stated_without(
    carried: bool, asked: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    answers = Answers(monkeypatch, carried=carried, cable=True, found=["cable"])
    assert judged(jobs=2).outcome.name == "with the cable"
    assert answers.asked["cable"] == ("whole", asked, 2)
    assert answers.asked["spells"] == ("whole", "with the cable", 2)


def test_logs_of_other_joints_and_motor_currents_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    Answers(monkeypatch)
    arm: Any = SimpleNamespace(n=3, name="arm")
    law: Any = None
    for unit, joints, says in (
        ("A", 3, "the model predicts motor currents.*reconstruct it with --drive-gains"),
        ("N*m", 2, "run: 2 joints, but the model's arm arm has 3"),
        ("N*m", 4, "run: 4 joints"),
    ):
        model = ReconstructedModel(arm, (), law, recorded={"unit": unit, "drive_gains": None})
        logs: Any = [SimpleNamespace(name="run", joints=joints)]
        with pytest.raises(InputError, match=says):
            diagnose(model, logs)


def of(**given: Any) -> Diagnosis:
    """A diagnosis of three joints, of which the second is without rows: three rows of the first, two of the third."""
    rows = np.array([[1, 0, 0], [1, 0, 1], [1, 0, 1]], dtype=bool)
    stacked = SimpleNamespace(joint=np.array([0, 0, 2, 0, 2]), joints=3, y=np.zeros(5))
    before, after = (
        SimpleNamespace(stacked=stacked, held_out=np.array(x))
        for x in ([3.0, 4.0, 2.0, 5.0, 4.0], [1.0, 1.0, 3.0, 2.0, 1.0])
    )
    tau = np.array([[2.0, 9, 9], [4.0, 9, 6.0], [4.0, 9, 8.0]])
    evidence: Any = SimpleNamespace(
        scale=np.array([0.5, 1.0, 2.0]), rows=rows, samples=SimpleNamespace(tau=tau)
    )
    model: Any = SimpleNamespace(
        arm=SimpleNamespace(torque_units=["N*m"] * 3),
        with_effects=lambda law: SimpleNamespace(arm=model.arm, effects=law),
    )
    outcome: Any = SimpleNamespace(before=before, after=after, found=[], masked=())
    values = {"verdict": "no_effect", "outcome": outcome, "model": model, "unlisted": None, "sliding": rows}
    return Diagnosis(**(values | {"evidence": evidence, "contacts": []} | given))


def law(rmse: float, added: list[Any]) -> Any:
    made = object.__new__(Unlisted)
    for name, value in {"joint": 3, "rmse_with_form": rmse}.items():
        object.__setattr__(made, name, value)
    object.__setattr__(made, "added", lambda: added)
    return made


def test_errors_are_root_mean_squares_of_held_out_rows_in_the_torques_unit() -> None:
    errors = of().errors()
    before = [0.5 * np.sqrt(50 / 3), np.nan, 2.0 * np.sqrt(10)]
    after = [0.5 * np.sqrt(2), np.nan, 2.0 * np.sqrt(5)]
    np.testing.assert_allclose(errors["before"], before)
    np.testing.assert_allclose(errors["after"], after)
    size = np.array([np.sqrt(36 / 3), np.nan, np.sqrt(50)])
    np.testing.assert_allclose(errors["nrmse"]["before"], before / size)
    np.testing.assert_allclose(errors["nrmse"]["after"], after / size)
    assert (
        errors["noise_floor"] == [0.5, 1.0, 2.0] and errors["held_out"] is True and "reversals" not in errors
    )
    # what is a reversal, as the first row of the last joint, has numbers of its own
    sliding = np.array([[1, 0, 0], [1, 0, 0], [1, 0, 1]], dtype=bool)
    errors = of(sliding=sliding).errors()
    assert finite(errors["before"])[2] == pytest.approx(2.0 * 4.0) and errors["before"][0] == before[0]
    assert errors["after"][2] == pytest.approx(2.0) and errors["nrmse"]["after"][2] == pytest.approx(2 / 8)
    turned: Any = SimpleNamespace(before=np.array([1.0, np.nan, 3.0]), after=np.array([0.5, np.nan, 1.0]))
    assert finite(of(reversals=turned).errors()["reversals"]) == {
        "before": [1.0, None, 3.0],
        "after": [0.5, None, 1.0],
    }


def test_a_law_without_a_name_is_in_the_model_once_it_is_adopted() -> None:
    found = law(0.7, ["law"])
    plain = of(unlisted=found)
    assert plain.errors()["after"][2] == pytest.approx(2.0 * np.sqrt(5))
    adopted = plain.adopt()
    assert adopted.adopted and adopted.model.effects == ["law"] and adopted.errors()["after"][2] == 0.7
    assert adopted.adopt() is adopted
    for nothing in (of(), of(unlisted=law(0.7, []))):
        assert nothing.adopt() is nothing
    plain = of()
    assert plain.zeros.shape == (0, 0)
    assert (plain.reasons, plain.standing.joints, plain.standing.unknown) == ([], [], False)
    assert of(adopted=True).errors()["after"][2] == pytest.approx(2.0 * np.sqrt(5))


def test_what_friction_is_at_reversals_alone() -> None:
    one, other = SimpleNamespace(effect=1), SimpleNamespace(effect=2)
    turned: Any = SimpleNamespace(found=[one])
    made = of(reversals=turned)
    assert made._only_at_reversals(one) and not made._only_at_reversals(other)  # type: ignore[arg-type]
    assert not of()._only_at_reversals(one)  # type: ignore[arg-type]


def test_what_the_models_own_errors_hide_is_said_of_a_joint_of_which_more_is_left() -> None:
    hidden, stated, elsewhere = (effect("viscous_friction", joint) for joint in (2, 2, 1))
    outcome: Any = SimpleNamespace(found=[])
    assert module._is_left(hidden, outcome, (1,)) and not module._is_left(elsewhere, outcome, (1,))
    outcome.found = [SimpleNamespace(effect=stated)]
    assert not module._is_left(hidden, outcome, (1,))


def test_what_is_outweighed_by_an_unknown_rest_goes_and_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two effects, of which the first goes, and with it one of two events; the other is asked with what is left."""
    spring, load = (SimpleNamespace(effect=SimpleNamespace(label=lambda: "spring"), share=0.25), "load")
    other = SimpleNamespace(added="other push", rows=np.zeros(4, dtype=bool), clear=2.0)
    answers = Answers(monkeypatch, found=[spring, load], contacts=[CONTACT, other], unknown=True)
    asked: list[Any] = []

    def outweighed(evidence: Evidence, outcome: Any, among: Any, left: Any, counted: Any) -> Any:
        assert among == outcome.found and counted.shape == (12,) and counted.all()
        asked.append((evidence.name, [*outcome.found], left))
        return spring if spring in outcome.found else None

    def without_effect(evidence: Evidence, outcome: Any, effect: Any) -> Any:
        kept = [f for f in outcome.found if f is not effect]
        return SimpleNamespace(name="fewer", found=kept, added=lambda: kept, masked=())

    monkeypatch.setattr(module, "outweighed", outweighed)
    monkeypatch.setattr(module, "without_effect", without_effect)
    made = judged()
    assert asked == [("account", [spring, load], (1,)), ("account", [load], (1,))]
    assert made.outcome.name == "fewer" and made.contacts == [CONTACT]
    assert made.model == ("with", "load", "push") and made.strengths[1] is made.outcome
    assert made.verdict == "effects_found" and made.reasons[1:] == ["stands", "zeros of ['run']"]
    assert made.reasons[0].startswith("spring would remove 25% of what can be explained")
    # and where nothing else was found, nobody knows what is there
    answers.given.update(found=[spring], contacts=[])
    made = judged()
    assert made.verdict == "cannot_tell" and made.reasons[0].startswith("spring")


@pytest.mark.parametrize("form", ["", "sin(q3)"])
def test_an_event_that_may_be_of_an_unknown_rest_goes_and_is_told(
    form: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = SimpleNamespace(added="other push", rows=np.zeros(4, dtype=bool), clear=2.0)
    unlisted = SimpleNamespace(joint=3, parameters={"law": form} if form else {}, instead="", added=list)
    Answers(monkeypatch, contacts=[CONTACT, other], unlisted=unlisted)
    asked: list[Any] = []

    def drowned(evidence: Evidence, model: Any, contact: Any) -> bool:
        asked.append((evidence.name, model, contact.added))
        return contact is other

    monkeypatch.setattr(module, "drowned", drowned)
    monkeypatch.setattr(module, "event_in_doubt", lambda added: f"{added} in doubt")
    made = judged()
    assert asked[0] == ("account", ("with", "push", "other push"), "push")
    assert made.contacts == [CONTACT] and made.model == ("with", "push")
    assert made.reasons[:2] == ["other push in doubt", "stands"]


def test_an_event_within_two_errors_of_none_goes_and_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    torque = AddedEffect(effect("external_torque", 2), interval(3.0, 4.0, (0.1, 0.1), np.zeros(3), "rad"))
    vague = SimpleNamespace(added=torque, rows=np.zeros(4, dtype=bool), clear=1.9)
    answers = Answers(monkeypatch, contacts=[CONTACT, vague])
    made = judged()
    assert made.contacts == [CONTACT] and made.model == ("with", "push")
    said = "from 3.0 to 4.0 s external torque at joint 2 would explain what is left, but it is 1.9 of its stated errors"
    assert made.reasons[0].startswith(said)
    vague.clear = 2.0
    assert judged().contacts == [CONTACT, vague] and answers.asked["found"]
    # of a run too short to be searched an event's few pieces tell its error no better than its size
    vague.clear = 1.9
    Answers(monkeypatch, still=True, contacts=[CONTACT, vague])
    assert judged().contacts == [CONTACT, vague]


def test_what_is_left_is_judged_where_joints_slide_and_what_is_found_at_reversals_is_not_asked(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    answers = Answers(monkeypatch, found=["memory", "drag"], turned=True)
    answers.account.rows[1:3, 0] = False
    asked: list[Any] = []
    monkeypatch.setattr(module, "outweighed", lambda *given: asked.append(given[2:]))
    made = judged()
    assert made.evidence.name == "turned" and made.evidence.rows.all()
    assert answers.asked["judged"] is answers.account.rows and made.sliding is answers.account.rows
    ((among, left, counted),) = asked
    assert among == ["drag"] and left == (1,) and counted.tolist() == answers.account.rows.ravel().tolist()


def test_a_joint_that_never_moves_is_said_before_the_work() -> None:
    time = 0.01 * np.arange(200)
    q = np.outer(np.sin(time), [1.0, 1.0, 0.0])
    log = unchecked_log(time=time, q=q, v=q, tau=q, name="run")

    def stop(said: str) -> None:
        raise KeyboardInterrupt

    model: Any = SimpleNamespace(arm=three_axis(), require_torques=lambda: None)
    dead = "run: column q3 is 0 in every row: if joint_3 moved, its encoder is dead"
    with pytest.warns(InputWarning, match=dead), pytest.raises(KeyboardInterrupt):
        diagnose(model, [log], stop)
