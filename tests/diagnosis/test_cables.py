"""A cable between a fixed point and a link, slack for a part of the time, is one effect, and no push after the other."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from exact_parts import as_it_was
from synthetic import three_axis
from written_laws import on_joint, run

from armloop.data.motion import Motion
from armloop.data.signals import preprocess
from armloop.diagnosis import cables, diagnose
from armloop.diagnosis.account import Account
from armloop.diagnosis.contacts import without
from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.fit import Shape
from armloop.diagnosis.outcomes import Found, Outcome
from armloop.diagnosis.trials import Known
from armloop.laws.effects import hypotheses
from armloop.laws.effects.coulomb_friction import CoulombFriction
from armloop.laws.effects.elastic_cable import ElasticCable
from armloop.laws.effects.joint_spring import JointSpring
from armloop.model import AddedEffect, ReconstructedModel
from armloop.robot.kinematics import LinkPoses

ANCHOR, ATTACHED, SLACK, STIFFNESS = np.array([0.4, 0.3, 0.2]), np.array([0.2, 0.0, 0.0]), 0.45, 20.0


def pull(motion: Motion, link: int = 3, least: float = 0.0) -> np.ndarray:
    """J(q)ᵀ F of a cable that is taut beyond its slack length, or of a spring, which is stretched by no least."""
    poses = LinkPoses.of(three_axis(), motion.q)
    point = poses.p[link - 1] + poses.R[link - 1] @ ATTACHED
    away = point - ANCHOR
    length = np.linalg.norm(away, axis=1)
    force = (STIFFNESS * np.maximum(length - SLACK, least) / length)[:, None] * away
    return np.einsum("kfn,kf->kn", poses.jacobian(link - 1, point), force)


@pytest.fixture(scope="module")
def model() -> ReconstructedModel:
    return as_it_was(run(None, seed=90))


def evidence(model: ReconstructedModel, law: Any, seed: int = 7) -> Evidence:
    samples = preprocess([run(law, seed=seed)], model.conditioning)
    return without(Evidence.of(model, samples, hypotheses(model.arm)), [])


def both(motion: Motion) -> np.ndarray:
    """A cable, and dry friction that grew."""
    return pull(motion) + on_joint(motion, 2, 0.2 * np.sign(motion.v[:, 1]))


def of_nothing(whole: Evidence) -> Account:
    """What a search that found nothing states."""
    left = Known.of(whole).fit
    return Account(whole, [], whole, Outcome([], left, left), None)


def check(added: AddedEffect) -> None:
    """Within three stated errors, which are small."""
    p = added.parameters
    for key, truth in (
        ("stiffness", STIFFNESS),
        ("slack_length", SLACK),
        ("anchor", ANCHOR),
        ("attached", ATTACHED),
        ("link", 3.0),
    ):
        off, error = np.abs(np.asarray(p[key].value) - truth), np.asarray(p[key].std_error)
        assert (off <= 3 * error + 1e-12).all(), f"{key}: {p[key].value} ± {error}, not {truth}"
        assert (error < 0.1 * np.abs(truth) + 0.02).all()


def test_a_cable_is_named_with_where_it_runs_and_what_is_there_beside_it(model: ReconstructedModel) -> None:
    whole = evidence(model, both)
    found = cables.account_with_cable(whole, of_nothing(whole), lambda text: None, 1)
    assert found is not None and found.contacts == [] and found.laws == []
    added = {a.effect.name: a for a in found.outcome.added()}
    assert sorted(added) == ["coulomb_friction", "elastic_cable"]
    check(added["elastic_cable"])
    level = added["coulomb_friction"].parameters["level"]
    assert added["coulomb_friction"].effect.joint == 2 and level.value == pytest.approx(0.2, rel=0.05)
    assert found.outcome.found[0].share > 0.8
    # its feedforward supplies it where the run has not been, too
    q, still = np.array([0.3, -0.4, 0.5]), np.zeros(3)
    augmented = model.with_effects([added["elastic_cable"]])
    more = augmented.feedforward(q, still, still) - model.feedforward(q, still, still)
    expected = pull(Motion(np.zeros(1), q[None], still[None], still[None]))[0]
    np.testing.assert_allclose(more, expected, atol=0.05)


def test_springs_of_two_joints_are_no_cable(model: ReconstructedModel) -> None:
    whole = evidence(
        model, lambda m: on_joint(m, 1, 0.5 * m.q[:, 0]) + on_joint(m, 2, 0.8 * (m.q[:, 1] - 0.2))
    )
    springs = [JointSpring(1), JointSpring(2)]
    known = Known.of(whole, springs, [Shape.fixed(0.0)] * 2).fit
    outcome = Outcome([Found(s, Shape.fixed(0.0), 0.5) for s in springs], Known.of(whole).fit, known)
    asked: list[str] = []
    assert cables.account_with_cable(whole, Account(whole, [], whole, outcome, None), asked.append, 1) is None
    assert asked == ["whether a cable pulls at a link"]


@pytest.mark.long
def test_a_run_with_a_cable_is_told_so(model: ReconstructedModel) -> None:
    """Without its law it was one push after the other."""
    found = diagnose(model, [run(both, seed=7)])
    assert sorted(found.named) == [("coulomb_friction", 2), ("elastic_cable", None)]
    assert found.contacts == [] and found.unlisted is None
    check(next(a for a in found.model.effects if a.effect.name == "elastic_cable"))
    errors = found.errors()
    after, floor = (np.array(errors[key]) for key in ("after", "noise_floor"))
    assert (after < 1.5 * floor).all()


def test_where_it_runs_is_found_without_the_fold_that_is_judged(model: ReconstructedModel) -> None:
    whole = evidence(model, pull)
    found = cables.find_cable(whole)
    assert found is not None and len(found.shape.without) == 2
    assert isinstance(found.effect, ElasticCable) and found.effect.cables[found.shape.final].link == 3
    for k in (0, 1):
        # whatever a fold shows, it has no say in what judges it
        spoilt = replace(whole.samples, tau=whole.samples.tau + 3.0 * (whole.fold == k)[:, None])
        other = cables.find_cable(replace(whole, samples=spoilt))
        assert other is None or other.shape.without[k] == found.shape.without[k]


def test_what_is_there_beside_it_is_fitted_without_the_fold_too(model: ReconstructedModel) -> None:
    whole = evidence(model, both)
    cable = cables.find_cable(whole)
    assert cable is not None
    friction = CoulombFriction(2)
    known = Known.of(whole, [friction], [Shape.fixed(0.0)]).fit
    outcome = Outcome([Found(friction, Shape.fixed(0.0), 0.5)], Known.of(whole).fit, known)
    account = Account(whole, [], whole, outcome, None)

    def levels(run: Evidence) -> list[Any]:
        return [each[0].parameters["level"].value for each in cables._beside(run, cable, account)]

    first = levels(whole)
    assert 0.15 < first[0] < 0.25
    for k in (0, 1):
        tau = whole.samples.tau + 3.0 * (whole.fold == k)[:, None] * np.sign(whole.samples.motion.v)
        spoilt = levels(replace(whole, samples=replace(whole.samples, tau=tau)))
        assert spoilt[1 + k] == first[1 + k] and spoilt[0] > first[0] + 0.5
    # nor does the cable that all of the run says
    shape = cable.shape._replace(final=cable.shape.without[0])
    other = [
        each[0].parameters["level"].value
        for each in cables._beside(whole, replace(cable, shape=shape), account)
    ]
    assert other[1:] == first[1:] and other[0] != first[0]


def test_a_spring_that_pushes_while_it_is_short_is_told_from_a_cable(model: ReconstructedModel) -> None:
    for least, pushes in ((-np.inf, True), (0.0, False)):
        found = cables.find_cable(evidence(model, lambda m, least=least: pull(m, least=least)))
        assert found is not None and isinstance(found.effect, ElasticCable)
        cable = found.effect.cables[found.shape.final]
        assert (cable.pushes, cable.link) == (pushes, 3) and cable.slack_length == pytest.approx(
            SLACK, abs=0.01
        )


def test_of_two_joints_a_family_of_cables_is_alike_and_the_errors_hold_it(model: ReconstructedModel) -> None:
    """What link 2 feels two joints show: where its cable runs nobody can tell to a centimetre."""
    found = cables.find_cable(evidence(model, lambda m: 5.0 * pull(m, 2)))
    assert found is not None and isinstance(found.effect, ElasticCable)
    cable = found.effect.cables[found.shape.final]
    errors = np.array(cable.errors[1:5])
    off = np.abs(np.array([cable.slack_length, *cable.anchor]) - [SLACK, *ANCHOR])
    assert (off < 3 * errors).all() and errors.max() > 0.05


def test_what_no_cable_explains_has_none(model: ReconstructedModel) -> None:
    assert cables.find_cable(evidence(model, lambda m: on_joint(m, 2, 0.6 * m.v[:, 1]))) is None


@pytest.mark.parametrize(
    ("laws", "events", "unlisted", "much", "asked"),
    [
        (0, 0, False, False, False),
        (1, 0, False, False, False),
        (0, 1, False, False, False),
        (1, 1, False, False, True),
        (2, 0, False, False, True),
        (0, 2, False, False, True),
        (0, 0, True, False, True),
        (0, 0, False, True, True),
    ],
)
def test_it_is_asked_of_what_it_may_look_like(
    laws: int, events: int, unlisted: bool, much: bool, asked: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cables, "much_is_left", lambda score: np.array([False, much]))
    made = [SimpleNamespace(effect=SimpleNamespace(load=load)) for load in [True] * laws + [False] * 3]
    outcome = SimpleNamespace(found=made, after=SimpleNamespace(score=None))
    account: Any = SimpleNamespace(
        outcome=outcome, contacts=["push"] * events, unlisted="law" if unlisted else None
    )
    assert cables._is_asked(account) == asked


def of_cables(model: ReconstructedModel, law: Any) -> tuple[cables._Problem, cables.Cable]:
    whole = evidence(model, law)
    problem = cables._Problem.of(whole, whole.kept, whole.residual([]))
    return problem, problem.best()[0]


def test_a_cable_that_is_never_slack_is_no_spring_that_pushes(model: ReconstructedModel) -> None:
    def taut(motion: Motion) -> np.ndarray:
        poses = LinkPoses.of(three_axis(), motion.q)
        point = poses.p[2] + poses.R[2] @ ATTACHED
        return np.einsum("kfn,kf->kn", poses.jacobian(2, point), 5.0 * (point - ANCHOR))

    problem, cable = of_cables(model, taut)
    assert not cable.pushes and cable.slack_length < 0.05
    x = cables._numbers(cable)
    assert problem._squares(2, x, True) == pytest.approx(problem._squares(2, x, False))


@pytest.mark.parametrize(("spring", "pushes"), [(0.9995, False), (0.998, True)])
def test_a_spring_must_leave_less_than_a_cable_by_more_than_rounding(
    spring: float, pushes: bool, model: ReconstructedModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = evidence(model, None)
    problem = cables._Problem.of(whole, whole.kept, whole.residual([]))
    monkeypatch.setattr(
        cables._Problem, "_refined", lambda self, link, x, pushes=False: (spring if pushes else 1.0, x)
    )
    left, cable = problem._of_link(1)
    assert (cable.pushes, left) == (pushes, spring if pushes else 1.0)


def test_errors_follow_the_likelihood_however_small_they_begin(model: ReconstructedModel) -> None:
    problem, cable = of_cables(model, pull)
    errors, count = problem.errors(cable)
    assert count < np.count_nonzero(problem.weight)
    found = problem.profiled(cable, 0.01 * errors, count)
    assert (found[2:] > 0.3 * errors[2:]).all() and (found < 5 * errors + 0.01).all()


def test_a_profile_moves_on_however_little_is_said_of_its_errors(
    model: ReconstructedModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By ten doublings at the most: a cable of no stiffness has no errors, and nothing holds it."""
    problem, cable = of_cables(model, pull)
    moved: list[np.ndarray] = []

    def refined(self: Any, link: int, x: np.ndarray, pushes: bool, held: int) -> tuple[float, np.ndarray]:
        moved.append(x)
        return best, x

    best = problem._squares(cable.link - 1, cables._numbers(cable))
    monkeypatch.setattr(cables._Problem, "_refined", refined)
    problem.profiled(cable, np.zeros(8), 100.0)
    assert 0 < len(moved) <= 12 * 11


def test_what_may_run_to_another_link_is_as_uncertain_as_they_are_apart(model: ReconstructedModel) -> None:
    problem, cable = of_cables(model, pull)
    left = min(each for each, _ in problem.found)
    other = replace(cable, link=2, slack_length=cable.slack_length + 0.2, attached=(9.0, 9.0, 9.0))
    far = replace(other, slack_length=200.0)
    for times, another, alike in ((1.01, other, True), (2.0, far, False)):
        problem.found[:] = [(left, cable), (times * left, another)]
        error = problem.over_links(cable, np.full(8, 1e-3))
        assert (error[8] > 0.4) == alike and (error[1] > 0.08) == alike
        # a point in the frame of another link is another point
        assert (error[5:8] == 1e-3).all()


@pytest.mark.parametrize(
    ("likelier", "named", "costly", "taken"),
    [
        ((True, True), True, False, True),
        ((False, True, True), True, False, True),  # in place of what was found, though not beside it
        ((False, False), True, False, False),
        ((True, False), True, False, False),
        ((True, True), False, False, False),
        ((True, True), True, True, False),
    ],
)
def test_it_is_taken_if_the_run_is_likelier_with_it_and_no_joint_pays(
    likelier: tuple[bool, ...],
    named: bool,
    costly: bool,
    taken: bool,
    monkeypatch: pytest.MonkeyPatch,
    several: int = 2,
) -> None:
    rows = np.ones((2, 2), dtype=bool)
    whole: Any = SimpleNamespace(rows=rows, only=lambda rows: None)
    made = SimpleNamespace(added=lambda: ["cable"], effects=[ElasticCable()] if named else [])
    more: Any = SimpleNamespace(outcome=SimpleNamespace(after=made), whole=whole)
    found = SimpleNamespace(found=["stop", "spring"][:several])
    account: Any = SimpleNamespace(whole=whole, remaining=lambda: "left", outcome=found, contacts=[])
    asked = iter(likelier)
    for name, answer in {
        "_is_asked": True,
        "without": SimpleNamespace(rows=rows),
        "find_cable": "cable",
        "posterior": 0.0,
        "with_account": SimpleNamespace(fit=made),
        "_beside": [[], [], []],
        "_alone": "alone",
        "_of_nothing": account,
        "account_beside": SimpleNamespace(outcome=SimpleNamespace(after=SimpleNamespace(effects=[]))),
        "merged": more,
        "at_the_cost_of_others": costly,
    }.items():
        monkeypatch.setattr(cables, name, lambda *given, answer=answer: answer)
    monkeypatch.setattr(cables, "_is_likelier", lambda *given: next(asked))
    assert (cables.account_with_cable(whole, account, lambda text: None, 1) is more) == taken


def test_one_thing_that_was_found_is_no_cable_unless_one_is_beside_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A torque that grows with the square of the angle is as near a stop as the model itself is."""
    judged = test_it_is_taken_if_the_run_is_likelier_with_it_and_no_joint_pays
    judged((False, True, True), True, False, False, monkeypatch, several=1)
    judged((True, True), True, False, True, monkeypatch, several=1)


@pytest.mark.parametrize("pushes", [True, False])
def test_where_a_cable_runs_is_refined_by_the_derivatives_of_what_it_leaves(pushes: bool) -> None:
    """Half of the postures leave the cable slack; a cable drawn to a point has no direction, and no infinite slope."""
    arm, rng = three_axis(), np.random.default_rng(0)
    poses = LinkPoses.of(arm, rng.uniform(-1, 1, (40, 3)))
    weight, left = rng.uniform(0.5, 1, (40, 3)), rng.normal(size=(40, 3))
    problem = cables._Problem(poses, weight, left, np.arange(40) // 5, 1.0)
    x, h = np.array([0.3, 0.2, -0.5, 0.05, 0.1, 0.02, 0.0]), 1e-6
    for link in range(3):
        x[6] = np.median(problem._drawn(link, x, True)[1])
        for value, slopes in ((problem._torque, problem._torque_slopes), (problem._left, problem._slopes)):
            ends = [[value(link, x + way * h * e, pushes) for way in (1, -1)] for e in np.eye(7)]
            numeric = np.stack([(up - down) / (2 * h) for up, down in ends], axis=2)
            np.testing.assert_allclose(slopes(link, x, pushes), numeric, atol=1e-7)
    at_point = np.r_[poses.p[0][0], np.zeros(3), 0.4]
    assert np.isfinite(problem._slopes(0, at_point, pushes)).all()
