"""What a verdict rests on: how far a run can be judged, and what is an event."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic import fourier_motion, measured, rigid_torque, three_axis

from armloop.data.log import MotionLog
from armloop.data.reversals import turning
from armloop.data.signals import preprocess
from armloop.diagnosis import contacts, diagnose
from armloop.diagnosis.contacts import Burst, _distinct, _standing_out, _sticks, find_contacts
from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.innovations import contradiction, deviations, innovations
from armloop.diagnosis.pushes import Contact
from armloop.features.double_feature_set import Factors
from armloop.identification.scoring import score
from armloop.laws.effects import Estimate, effect
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import AddedEffect, ReconstructedModel
from armloop.model.components import RigidBody, SparseTerms
from armloop.robot.kinematics import nominal_parameters

VISCOUS, COULOMB = (0.8, 1.0, 0.5), (0.3, 0.4, 0.2)


def run(seed: int, seconds: float, noise: float = 0.01, event: tuple[float, ...] = ()) -> MotionLog:
    """A log of an arm with Coulomb and viscous friction; an event is joint, start, end and height of a smooth torque."""
    motion = fourier_motion(seconds, 125.0, seed)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot)
    tau = tau + motion.v * VISCOUS + np.tanh(motion.v / 1e-3) * COULOMB
    if event:
        joint, start, end, height = event
        inside = (motion.time > start) & (motion.time < end)
        course = np.sin(np.pi * (motion.time - start) / (end - start)) ** 2
        tau[:, int(joint) - 1] += np.where(inside, height * course, 0.0)
    return measured(motion, tau, seed, noise)


@pytest.fixture(scope="module")
def model() -> ReconstructedModel:
    """The arm as it is, with the baseline of a run that nothing was fitted to."""
    terms = tuple(
        (FrictionTerm("sign", f), FrictionTerm("viscous", c)) for f, c in zip(COULOMB, VISCOUS, strict=True)
    )
    body = RigidBody(nominal_parameters(three_axis()), (), np.zeros(0))
    bare = ReconstructedModel(three_axis(), (body,), FrictionLaw(terms))
    samples = preprocess([run(90, 60.0)], bare.conditioning)
    motion = samples.motion
    ranges = [np.ptp(motion.q, axis=0) / 2, *(np.abs(x).max(axis=0) for x in (motion.v, motion.vdot))]
    ranges.append((motion.q.max(axis=0) + motion.q.min(axis=0)) / 2)
    return replace(
        bare, baseline=score(bare, samples).moving, history={"range": [x.tolist() for x in ranges]}
    )


def events(model: ReconstructedModel, log: MotionLog) -> list:
    evidence = Evidence.of(model, preprocess([log], model.conditioning), [])
    return find_contacts(evidence, evidence.residual([]))


@pytest.mark.parametrize("length", [0.4, 1.5, 4.0])
def test_a_torque_that_comes_and_goes_smoothly_is_an_event(model: ReconstructedModel, length: float) -> None:
    (found,) = events(model, run(5, 30.0, event=(2, 12.0, 12.0 + length, 2.0)))
    assert (found.added.effect.name, found.added.effect.joint) == ("external_torque", 2)
    start, end, torque = (float(found.added.parameters[key].value) for key in ("start", "end", "torque"))
    assert 11.9 < start < 12.0 + length / 2 < end < 12.1 + length
    assert 0.8 < torque < 2.1


def test_an_event_smaller_than_what_the_model_gets_wrong_all_the_time_stands_out_beside_it(
    model: ReconstructedModel,
) -> None:
    """A reading that wanders by four deviations of the baseline in seconds."""
    log = run(5, 30.0, event=(2, 16.0, 16.7, 0.4))
    wanders = 0.1 * np.sin(2 * np.pi * log.time / 7.0)[:, None] * [0.0, 1.0, 0.0]
    assert events(model, replace(run(5, 30.0), tau=run(5, 30.0).tau + wanders)) == []
    (found,) = events(model, replace(log, tau=log.tau + wanders))
    assert (found.added.effect.name, found.added.effect.joint) == ("external_torque", 2)
    start, end, torque = (float(found.added.parameters[key].value) for key in ("start", "end", "torque"))
    assert 15.95 < start < 16.35 < end < 16.75
    assert 0.15 < torque < 0.41


@pytest.mark.parametrize("seed", [6, 7])
def test_a_run_like_the_baseline_has_no_event(model: ReconstructedModel, seed: int) -> None:
    assert events(model, run(seed, 30.0)) == []


def test_more_dry_friction_at_a_joint_that_turns_back_is_no_event(model: ReconstructedModel) -> None:
    log = run(8, 40.0)
    more = replace(log, tau=log.tau + [0.0, 0.4, 0.0] * np.tanh(log.v / 1e-2))
    assert events(model, more) == []


def test_what_comes_back_with_the_motion_is_no_event(model: ReconstructedModel) -> None:
    motion = fourier_motion(60.0, 125.0, 9)
    log = run(9, 60.0)
    phase = motion.time % 20.0
    again = replace(
        log, tau=log.tau + np.where((phase > 4.0) & (phase < 4.6), 2.0, 0.0)[:, None] * [0.0, 1.0, 0.0]
    )
    assert events(model, again) == []


def test_a_short_run_cannot_tell_and_says_why(model: ReconstructedModel) -> None:
    answer = diagnose(model, [run(10, 5.0)]).to_dict()
    assert answer["verdict"] == "cannot_tell"
    assert any("too little motion to judge" in words for words in answer["reasons"])
    assert not any("multiple of the baseline" in words for words in answer["reasons"])


def test_what_a_short_run_leaves_is_not_what_nothing_accounts_for(model: ReconstructedModel) -> None:
    log = run(10, 5.0)
    more = replace(log, tau=log.tau + [0.0, 2.0, 0.0] * np.sin(log.q))
    answer = diagnose(model, [more]).to_dict()
    assert answer["verdict"] == "cannot_tell"
    assert any("multiple of the baseline" in words and "(joint 2)" in words for words in answer["reasons"])
    assert not any("accounts for" in words or "play in" in words for words in answer["reasons"])


def test_a_short_run_still_shows_its_event(model: ReconstructedModel) -> None:
    answer = diagnose(model, [run(10, 7.0, event=(3, 3.0, 3.5, 1.5))]).to_dict()
    assert [(e["effect"], e["joint"], e["when"]) for e in answer["effects"]] == [
        ("external_torque", 3, "event")
    ]


def test_a_noisier_sensor_is_no_unlisted_law(model: ReconstructedModel) -> None:
    answer = diagnose(model, [run(11, 30.0, noise=0.03)]).to_dict()
    assert (answer["verdict"], answer["effects"]) == ("no_effect", [])
    assert any("predicts little of it on blocks left out" in words for words in answer["reasons"])


@pytest.mark.parametrize(("rest", "kept"), [(3.0, 1), (5.0, 0)])
def test_an_event_stands_out_of_all_the_rest_of_the_run(
    model: ReconstructedModel, rest: float, kept: int
) -> None:
    motion = fourier_motion(10.0, 25.0, 12)
    level = np.full((motion.samples, 3), 0.5)
    level[100:110, 1] = 6.0  # the burst, and what the model errs by elsewhere
    level[200, 1] = rest
    level[200, 2] = 20.0  # what another joint shows at another time says nothing of this one
    burst = Burst(slice(100, 110), frozenset({1}))
    assert len(_standing_out(motion, np.arange(motion.samples), level, [burst])) == kept


def test_a_joint_that_sticks_while_another_slides_shows_no_event(model: ReconstructedModel) -> None:
    samples = preprocess([run(13, 10.0)], model.conditioning)
    a, b = (int(np.searchsorted(samples.motion.time, t)) for t in (4.0, 5.0))
    v = samples.motion.v.copy()
    v[a:b] = [0.0, 0.5, 0.5]  # joint 1 is held by its friction, the others go on
    evidence = Evidence.of(model, replace(samples, motion=replace(samples.motion, v=v)), [])
    alone, both, other = (Burst(slice(a, b), frozenset(js)) for js in ({0}, {0, 1}, {1}))
    nothing, much = np.zeros_like(v), np.full_like(v, 1.5)
    assert _sticks(evidence, alone, nothing)
    assert not _sticks(evidence, both, nothing)
    assert not _sticks(evidence, other, nothing)
    # more than twice its friction it does not hold; a joint that never slides may have a brake
    assert not _sticks(evidence, alone, much)
    assert _sticks(evidence.only(evidence.rows & [False, True, True]), alone, much)


def test_what_friction_holds_meanwhile_does_not_hide_an_event(model: ReconstructedModel) -> None:
    motion = fourier_motion(30.0, 125.0, 16)
    for x, there in ((motion.q, 0.4), (motion.v, 0.0), (motion.vdot, 0.0)):
        x[:, 2] = there  # joint 3 is at rest all the time
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot)
    tau = tau + motion.v * VISCOUS + np.tanh(motion.v / 1e-3) * COULOMB
    inside = (motion.time > 12.0) & (motion.time < 13.0)
    tau[inside] += [0.0, 0.25, 0.18]  # the latter is within the dry friction of joint 3
    (found,) = events(model, measured(motion, tau, 16, 0.01))
    assert (found.added.effect.name, found.added.effect.joint) == ("external_torque", 2)
    assert found.added.parameters["torque"].value == pytest.approx(0.25, abs=0.05)


def test_what_friction_may_do_where_a_joint_turns_round_tells_nothing_of_an_event(
    model: ReconstructedModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    samples = preprocess([run(17, 30.0, event=(2, 12.0, 16.0, 0.5))], model.conditioning)
    evidence = Evidence.of(model, samples, [])
    innovation, rest = innovations(evidence, evidence.residual([]))
    asked = []
    monkeypatch.setattr(contacts, "push", lambda *given: asked.append(given[2:]))
    assert find_contacts(evidence, evidence.residual([])) == []
    ((burst, counted, shown),) = asked
    assert shown == [1]
    turns = turning(samples.motion, samples.moving)
    silent = (innovation[burst, 1] == 0.0) & (turns | rest)[burst, 1]
    assert silent.any()  # it turns round meanwhile
    np.testing.assert_array_equal(counted[burst, 1], ~silent)
    np.testing.assert_array_equal(counted[burst, 0], innovation[burst, 0] != 0.0)


def test_an_event_stands_out_from_what_lies_within_the_trained_range(
    model: ReconstructedModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    samples = preprocess([run(18, 20.0)], model.conditioning)
    evidence, N = Evidence.of(model, samples, []), samples.motion.samples
    new, far, asked = np.zeros((N, 3)), np.zeros((N, 3), dtype=bool), []
    new[1000:1100, 1], new[1500, 1] = 10.0, 9.0  # what is so short is no event
    monkeypatch.setattr(contacts, "novelty", lambda *given: (np.arange(N), new))
    monkeypatch.setattr(contacts, "far_outside", lambda *given: far)
    monkeypatch.setattr(contacts, "push", lambda *given: asked.append(given[2]))
    find_contacts(evidence, evidence.residual([]))
    assert asked == []
    far[1500] = True
    find_contacts(evidence, evidence.residual([]))
    assert asked == [slice(1000, 1100)]


def test_one_event_is_listed_once(model: ReconstructedModel) -> None:
    motion = fourier_motion(10.0, 25.0, 14)

    def contact(start: float, end: float, share: float) -> Contact:
        values = {"start": Estimate(start, None, "s"), "end": Estimate(end, None, "s")}
        added = AddedEffect(effect("external_torque", 2), values)
        nothing = np.zeros(3)
        return Contact(added, np.zeros(motion.samples, dtype=bool), nothing, nothing, share, share)

    first, same, later = contact(2.0, 3.0, 0.7), contact(2.2, 3.1, 0.9), contact(5.0, 6.0, 0.6)
    assert _distinct(motion, [first, same, later]) == [same, later]
    # what lies within a long one is it, however short; what shares half of the shorter is another
    within, half = contact(2.4, 2.6, 0.5), contact(3.04, 4.0, 0.5)
    assert _distinct(motion, [same, within]) == [same]
    assert _distinct(motion, [half, contact(2.56, 3.48, 0.9)])[1:] == [half]
    assert _distinct(motion, [half, contact(2.56, 3.52, 0.9)])[1:] == []


def test_a_model_is_unsure_where_its_mass_matrix_is_not_symmetric(model: ReconstructedModel) -> None:
    motion = fourier_motion(10.0, 25.0, 15)
    assert np.abs(contradiction(model, motion)).max() < 1e-12
    factors = Factors(3)
    index = np.array([[0, factors.names.index("vdot2")]], dtype=np.intp)
    lopsided = SparseTerms(3, index, np.array([[0.3, 0.0, 0.0]]))  # tau1 has 0.3 vdot2, tau2 no vdot1
    unsure = contradiction(replace(model, components=(*model.components, lopsided)), motion)
    assert unsure[:, 0] == pytest.approx(0.15 * motion.vdot[:, 1], abs=1e-12)
    assert unsure[:, 1] == pytest.approx(-0.15 * motion.vdot[:, 0], abs=1e-12)


def test_a_model_that_contradicts_itself_is_unsure_by_as_much(model: ReconstructedModel) -> None:
    factors = Factors(3)
    index = np.array([[0, factors.names.index("vdot2")]], dtype=np.intp)
    terms = SparseTerms(3, index, np.array([[2.0, 0.0, 0.0]]))
    lopsided = replace(model, components=(*model.components, terms))
    evidence = Evidence.of(lopsided, preprocess([run(17, 10.0)], model.conditioning), [])
    unsure = np.abs(contradiction(lopsided, evidence.samples.motion))
    assert unsure.max() > 20 * evidence.scale.max()
    assert (deviations(evidence, evidence.residual([])) >= unsure - 1e-12).all()


@pytest.mark.parametrize(("rest", "found"), [(1.0, 1), (4.1, 0)])
def test_what_hardly_exceeds_the_rest_of_the_run_is_no_event(
    model: ReconstructedModel, monkeypatch: pytest.MonkeyPatch, rest: float, found: int
) -> None:
    def seen(evidence: Evidence, *_: object) -> tuple[np.ndarray, np.ndarray]:
        time = evidence.samples.motion.time
        level = np.full((len(time), 3), 0.5)
        level[(time > 12.0) & (time < 13.0), 1] = 6.0
        level[(time > 20.0) & (time < 20.5), 1] = rest  # below what makes an event
        return np.arange(len(time)), level

    monkeypatch.setattr("armloop.diagnosis.contacts.novelty", seen)
    monkeypatch.setattr("armloop.diagnosis.contacts.pulses", lambda *_: [])
    assert len(events(model, run(18, 30.0, event=(2, 12.0, 13.0, 2.0)))) == found


@pytest.mark.parametrize(("joint", "found"), [(3, 0), (2, 1)])
def test_a_joint_held_by_its_friction_makes_no_event_of_its_own(
    model: ReconstructedModel, joint: int, found: int
) -> None:
    motion = fourier_motion(30.0, 125.0, 19)
    for x, there in ((motion.q, 0.4), (motion.v, 0.0), (motion.vdot, 0.0)):
        x[:, 2] = there  # joint 3 rests, and what sticks there may let go at any time
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot)
    tau = tau + motion.v * VISCOUS + np.tanh(motion.v / 1e-3) * COULOMB
    tau[(motion.time > 12.0) & (motion.time < 13.0), joint - 1] += 1.0
    assert len(events(model, measured(motion, tau, 19, 0.01))) == found


def test_an_event_that_is_seen_twice_is_one(
    model: ReconstructedModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    together = contacts._together
    monkeypatch.setattr(contacts, "_together", lambda bursts: [b for b in together(bursts) for _ in range(2)])
    assert len(events(model, run(20, 30.0, event=(2, 12.0, 13.0, 2.0)))) == 1
