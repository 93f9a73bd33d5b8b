"""The rules by which a trial is fitted and judged, each on numbers small enough to see through."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import armloop.diagnosis.account as accounts
from armloop.data.motion import Motion
from armloop.diagnosis import unlisted
from armloop.diagnosis.contacts import _seen_whole
from armloop.diagnosis.evidence import FOLDS, Evidence, Stacked
from armloop.diagnosis.fit import Fit, Solution
from armloop.diagnosis.judgement import SIGNIFICANCE, is_worth, lead, lead_of
from armloop.laws.effects import Estimate, effect
from armloop.regression.embedded import solve
from armloop.regression.moments import Moments

NOTHING = Solution(np.zeros(0), (), np.zeros((0, 0)), ())


def left(held_out: np.ndarray, block: np.ndarray, joint: np.ndarray | None = None) -> Fit:
    """A fit that leaves this, of one joint or those given (0-based), with blocks as given."""
    rows = len(held_out)
    joint = np.zeros(rows, dtype=np.intp) if joint is None else joint
    none = np.zeros((rows, 0))
    stacked = Stacked(none, held_out, block, block % 2, joint, int(joint.max()) + 1, joint, none)
    return Fit(cast(Any, None), (), (), NOTHING, np.tile(held_out, (FOLDS, 1)), stacked)


def test_a_gain_that_lies_in_few_blocks_is_no_chance() -> None:
    """Friction that fades within the first sixth of a run, against the noise that stays."""
    rng = np.random.default_rng(1)
    block = np.repeat(np.arange(34), 60)
    noise = rng.normal(size=len(block))
    fades = 30.0 * np.exp(-block / 5.0)
    assert lead(left(noise + fades, block).score, left(noise, block).score) > SIGNIFICANCE


def test_a_law_that_bites_in_one_block_of_many_is_no_chance() -> None:
    """What a drag leaves where the joint is fast once; elsewhere the two fits differ by chance."""
    rng = np.random.default_rng(3)
    block = np.repeat(np.arange(20), 60)
    before, after = rng.normal(size=(2, len(block)))
    before[block == 7] *= 9.0
    worse, better = left(before, block).score, left(after, block).score
    spread = lead_of(worse.errors[0], better.errors[0], worse.counts[0])
    assert spread < SIGNIFICANCE < lead(worse, better)


@pytest.mark.parametrize(("sizes", "worth"), [((0.6, 0.6), True), ((0.3, 0.6), False), ((0.0, 1.2), True)])
def test_what_shows_a_little_on_every_joint_adds_up(sizes: tuple[float, float], worth: bool) -> None:
    """Of an energy that the worst tenth of the baseline has, 2 here: parts of it that both joints gain."""
    rng = np.random.default_rng(4)
    block, joint = np.tile(np.repeat(np.arange(40), 50), 2), np.repeat([0, 1], 2000)
    after = rng.normal(size=4000)
    after /= np.sqrt(np.mean(after.reshape(2, -1) ** 2, axis=1))[joint]
    before = after * np.sqrt(1 + 2.0 * np.array(sizes))[joint]
    evidence = cast(Evidence, SimpleNamespace(variation=np.array([2.0, 2.0])))
    assert is_worth(evidence, left(before, block, joint).score, left(after, block, joint).score) == worth


def accounted(
    by_effects: float,
    looks: list[Any],
    monkeypatch: pytest.MonkeyPatch,
    of_event: float = 0.7,
    law: Any = None,
    foretold: bool = False,
) -> accounts.Account:
    """The account of a run of 1000 of which effects leave so much without an event, and 100 beside what each look shows.

    Without it they explain the part ``of_event`` of what it did; by what they do at other times it is foretold or not.
    """

    def of(whole: Any, contacts: list[Any], *rest: object) -> accounts.Account:
        evidence: Any = SimpleNamespace(rows=np.zeros((4, 1), dtype=bool))
        outcome: Any = SimpleNamespace(added=lambda: ["friction"])
        return accounts.Account(whole, contacts, evidence, outcome, law)

    tau = np.zeros((4, 1))
    samples = SimpleNamespace(tau=tau, motion=None)
    model = SimpleNamespace(with_effects=lambda added: SimpleNamespace(predict=lambda motion: tau))
    rows, one = np.ones((4, 1), dtype=bool), np.ones(1)
    run = np.full((4, 1), np.sqrt(1000 / 4))
    whole: Any = SimpleNamespace(
        model=model, samples=samples, rows=rows, scale=one, residual=lambda known: run
    )
    first, again = looks
    monkeypatch.setattr(accounts.Account, "of", staticmethod(of))
    monkeypatch.setattr(accounts.Account, "explains", lambda self, contacts, residual: of_event)
    monkeypatch.setattr(
        accounts.Account,
        "foretells",
        lambda self, evidence, contacts, residual: foretold and not self.contacts and bool(contacts),
    )
    monkeypatch.setattr(
        accounts.Account, "left", lambda self, residual: 100.0 if self.contacts else by_effects
    )
    looked = {"friction": [again]}  # with what was found so far: it holds a joint at rest
    monkeypatch.setattr(accounts, "find_contacts", lambda whole, residual, found: looked[found[0]])
    monkeypatch.setattr(accounts, "without", lambda whole, contacts: of(whole, contacts, None).evidence)
    monkeypatch.setattr(accounts.Account, "remaining", lambda self: tau)
    return accounts.best_account(whole, [first], lambda text: None)


@pytest.mark.parametrize(("by_effects", "kept"), [(50.0, 0), (150.0, 1)])
def test_an_event_gives_way_to_effects_that_leave_less_of_the_whole_run(
    by_effects: float, kept: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fast for once, a joint's drag looks like a push there; the push leaves what the drag does elsewhere."""
    event = SimpleNamespace(share=0.9)
    assert len(accounted(by_effects, [event, event], monkeypatch).contacts) == kept


@pytest.mark.parametrize(("parameters", "kept"), [({"law": 1.0}, 0), ({}, 1)])
def test_an_event_gives_way_to_an_unlisted_law_but_not_to_a_residual_without_one(
    parameters: dict[str, float], kept: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With the event and without it a joint has an unlisted residual: the event is a burst of its law, if there is one."""
    event = SimpleNamespace(share=0.9)
    law = SimpleNamespace(joint=1, parameters=parameters, added=list)
    assert len(accounted(150.0, [event, event], monkeypatch, 0.1, law).contacts) == kept


@pytest.mark.parametrize(("by_effects", "kept"), [(150.0, 0), (324.0, 0), (326.0, 1), (800.0, 1)])
def test_effects_that_explain_an_event_must_explain_the_rest_of_the_run_as_well(
    by_effects: float, kept: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Beside an event a law was found that explains the run; without it a drag that explains but what the event did."""
    event = SimpleNamespace(share=0.9)
    assert len(accounted(by_effects, [event, event], monkeypatch, of_event=0.95).contacts) == kept


@pytest.mark.parametrize(
    ("share", "part", "kept"), [(0.9, 0.79, 1), (0.9, 0.8, 0), (0.6, 0.59, 1), (0.6, 0.6, 0)]
)
def test_an_event_gives_way_if_four_fifths_of_it_or_its_own_share_are_explained(
    share: float, part: float, kept: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    event = SimpleNamespace(share=share)
    assert len(accounted(150.0, [event, event], monkeypatch, of_event=part).contacts) == kept


@pytest.mark.parametrize(("by_effects", "kept"), [(150.0, 0), (324.0, 0), (326.0, 1)])
def test_an_event_gives_way_to_effects_that_foretell_it(
    by_effects: float, kept: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Effects that explain the rest of the run as well, and less of the event than it does itself."""
    event = SimpleNamespace(share=0.9)
    told = accounted(by_effects, [event, event], monkeypatch, of_event=0.5, foretold=True)
    assert len(told.contacts) == kept


def test_an_event_is_what_it_looks_like_without_the_effects(monkeypatch: pytest.MonkeyPatch) -> None:
    """Friction hid what a push did to a joint; the samples are the same."""
    looks = [SimpleNamespace(share=0.6), SimpleNamespace(share=0.9)]
    (event,) = accounted(150.0, looks, monkeypatch).contacts
    assert event is looks[1]


def test_an_account_leaves_what_is_held_out_and_what_events_do_not_explain() -> None:
    """Two rows held out, 3 and 4 units; of an event's two counted rows of 10 N·m at a scale of 5 a quarter is left."""
    whole: Any = SimpleNamespace(rows=np.array([[True], [True], [True], [True], [False]]))
    evidence: Any = SimpleNamespace(scale=np.array([5.0]), rows=np.zeros((5, 1), dtype=bool))
    evidence.rows[:2] = True
    outcome: Any = SimpleNamespace(after=SimpleNamespace(held_out=np.array([3.0, 4.0])))
    event: Any = SimpleNamespace(share=0.75, rows=np.array([False, False, True, True, True]))
    account, residual = accounts.Account(whole, [event], evidence, outcome, None), np.full((5, 1), 10.0)
    assert account.left(residual) == pytest.approx(9 + 16 + 0.25 * (4 + 4))
    # taken back, its samples are nobody's: all that is left there counts
    assert replace(account, contacts=[]).left(residual) == pytest.approx(9 + 16 + 4 + 4)
    some = np.array([[False], [True], [True], [False], [True]])
    assert account.left(residual, some) == pytest.approx(16 + 0.25 * 4)
    assert replace(account, contacts=[]).left(residual, some) == pytest.approx(16 + 4)


@pytest.mark.parametrize(
    ("start", "end", "whole"), [(0.05, 2.0, False), (0.2, 2.0, True), (8.0, 9.95, False)]
)
def test_an_event_begins_and_ends_within_its_run(start: float, end: float, whole: bool) -> None:
    """What is there from the start may be a past that friction remembers."""
    time = np.concatenate([np.linspace(0.0, 10.0, 1001), np.linspace(0.0, 10.0, 1001)])
    still = np.zeros((2002, 1))
    motion = Motion(time, still, still, still, np.array([0, 1001]))
    rows = (np.arange(2002) > 1001) & (time >= start) & (time <= end)
    parameters = {"start": Estimate(start, 0.0, "s"), "end": Estimate(end, 0.0, "s")}
    contact: Any = SimpleNamespace(rows=rows, added=SimpleNamespace(parameters=parameters))
    assert _seen_whole(motion, contact) == whole


def test_noise_has_no_lead() -> None:
    block = np.repeat(np.arange(34), 60)
    for seed in range(20):
        one, other = np.random.default_rng(seed).normal(size=(2, len(block)))
        assert lead(left(one, block).score, left(other, block).score) < SIGNIFICANCE + 1


def test_a_column_of_rounding_errors_does_not_mislead_a_load() -> None:
    """The moment about a joint's own axis has no torque but what rounding leaves."""
    load = effect("payload", None)
    rng = np.random.default_rng(2)
    X = rng.normal(size=(500, 10))
    X[:, 2] *= 1e-17
    beta, _ = load.embed(np.array([0.5, 0.05, 0.0, 0.02, 0.0]))
    y = X @ beta + 0.01 * rng.normal(size=500)
    found = solve(Moments.of(X, y), [load], [10])[1][0]
    np.testing.assert_allclose(found[:2], [0.5, 0.05], atol=0.01)
    assert abs(found[2]) < 1.0


def test_a_width_beyond_what_was_tried_is_not_resolved() -> None:
    memory = effect("presliding_hysteresis", 1)
    for width, shown in ((1e-5, False), (1e-3, True), (1.0, False)):
        parameters = {"level": Estimate(1.0, 0.1, "N*m"), "width": Estimate(width, 0.0, "rad")}
        assert memory.resolved(parameters, [1e-4, 1e-2]) == shown


@pytest.mark.parametrize(
    ("joints", "law"), [(3, "sin(q1+2*q3)*v2^2"), (4, "sin(3*q4)*v4^2"), (6, "sin(3*q5)*v2*v5")]
)
def test_a_law_is_sought_among_waves_of_three_times_an_angle_whatever_the_arm(joints: int, law: str) -> None:
    assert law in unlisted.library_of((True,) * joints).names


def test_a_law_that_explains_an_event_holds_where_the_event_was() -> None:
    """Found without the last samples, in which something else was suspected."""
    q = np.array([[0.0], [1.0], [3.0], [9.0]])
    motion = Motion(np.arange(4.0), q, -q, 0 * q, np.array([0]))
    rows = np.array([[True], [True], [True], [False]])
    whole: Any = SimpleNamespace(rows=rows, samples=SimpleNamespace(motion=motion))
    ends = {"q_low": [0.0], "q_high": [1.0], "v_low": [-1.0], "v_high": [0.0]}
    parameters = {key: Estimate(value, [0.0], "rad") for key, value in ends.items()}
    found = unlisted.Unlisted(1, 1.0, 0.1, "2*v1", 0.1, parameters | {"v1": Estimate(2.0, 0.1, "N*m*s/rad")})
    wider = {key: e.value for key, e in found.over(whole).parameters.items()}
    assert wider == {"q_low": [0.0], "q_high": [3.0], "v_low": [-3.0], "v_high": [-0.0], "v1": 2.0}


@pytest.mark.parametrize(("without_it", "kept"), [(500.0, True), (20.0, False)])
def test_a_law_found_beside_an_event_that_it_explains_is_kept_without_the_event(
    without_it: float, kept: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The law leaves 50 of the run; a search among all samples finds something else, which leaves so much."""
    law = SimpleNamespace(over=lambda whole: "everywhere")

    def of(whole: Any, contacts: list[Any], *rest: object) -> accounts.Account:
        evidence: Any = SimpleNamespace(rows=np.zeros((4, 1), dtype=bool))
        outcome: Any = SimpleNamespace(added=list)
        return accounts.Account(whole, contacts, evidence, outcome, law if contacts else None)  # type: ignore[arg-type]

    monkeypatch.setattr(accounts.Account, "of", staticmethod(of))
    monkeypatch.setattr(
        accounts.Account, "left", lambda self, residual: 50.0 if self.unlisted else without_it
    )
    monkeypatch.setattr(accounts.Account, "remaining", lambda self: np.zeros((4, 1)))
    monkeypatch.setattr(accounts, "find_contacts", lambda whole, residual, found: [])
    every: Any = SimpleNamespace(rows=np.ones((4, 1), dtype=bool))
    beside: Any = SimpleNamespace(rows=np.zeros((4, 1), dtype=bool))
    monkeypatch.setattr(accounts, "without", lambda whole, contacts: beside if contacts else every)
    event: Any = SimpleNamespace(share=0.9)
    found = accounts.best_account(every, [event], lambda text: None)
    assert (found.unlisted == "everywhere") == kept and not found.contacts  # type: ignore[comparison-overlap]
