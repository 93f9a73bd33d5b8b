"""What an account leaves and explains, and what is recorded late of joints at rest."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from armloop.data.motion import Motion, Samples
from armloop.diagnosis import account as accounts
from armloop.diagnosis.account import Account
from armloop.diagnosis.evidence import Evidence
from armloop.laws.effects.found import RANGE
from armloop.laws.effects.joint_spring import JointSpring
from armloop.laws.effects.time_delay import TimeDelay
from armloop.laws.effects.torque_delay import TorqueDelay


def test_the_part_of_bursts_that_effects_and_law_explain() -> None:
    """Rows of two joints at four samples; the law of joint 2 has its own rows."""
    rows = np.array([[True, True], [True, True], [True, False], [True, True]])
    stacked = SimpleNamespace(joint=np.nonzero(rows)[1])
    outcome = SimpleNamespace(after=SimpleNamespace(stacked=stacked, held_out=np.arange(1.0, 8.0)))
    evidence = SimpleNamespace(rows=rows, scale=np.array([1.0, 0.5]), stacking=np.nonzero(rows))
    law = SimpleNamespace(joint=2, left=np.array([0.1, 0.2, 0.3]))
    whole: Any = None
    bursts: Any = [
        SimpleNamespace(rows=np.array([False, True, False, False])),
        SimpleNamespace(rows=np.array([False, True, True, False])),
    ]
    residual = np.array([[9.0, 9.0], [5.0, 10.0], [6.0, 99.0], [9.0, 9.0]])
    account = Account(whole, [], evidence, outcome, None)  # type: ignore[arg-type]
    # samples 2 and 3: 5 and 6 N·m of joint 1, 10 N·m of joint 2
    before = 5**2 + 6**2 + 20**2
    assert account.explains(bursts, residual) == pytest.approx(1 - (3**2 + 4**2 + 5**2) / before)
    with_law = Account(whole, [], evidence, outcome, law)  # type: ignore[arg-type]
    assert with_law.explains(bursts, residual) == pytest.approx(1 - (3**2 + 0.2**2 + 5**2) / before)
    assert outcome.after.held_out.tolist() == [1, 2, 3, 4, 5, 6, 7]


def test_effects_foretell_events_of_which_they_predict_most_by_the_rest_of_the_run(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of a residual of 4 N·m the effects leave 2 in the first event and 3 in the second: three quarters and 7/16 of it."""
    fitted: list[Any] = []

    def fit(evidence: Any, residual: Any, effects: Any, shapes: Any) -> Any:
        fitted.append((evidence, residual, effects, shapes))
        return SimpleNamespace(added=lambda: ["as outside"])

    monkeypatch.setattr(accounts, "fit", fit)
    left = np.array([[9.0, 9.0], [2.0, 9.0], [3.0, 9.0]])
    whole: Any = SimpleNamespace(
        rows=np.array([[True, True], [True, False], [True, False]]),
        scale=np.array([0.5, 1.0]),
        model=SimpleNamespace(with_effects=lambda added: added),
        left_by=lambda model: left if model == ["as outside"] else None,
    )
    after = SimpleNamespace(effects=("spring",), shapes=("soft",))
    outside: Any = SimpleNamespace(residual=lambda known: f"beside {known}")

    def event(sample: int, share: float) -> Any:
        return SimpleNamespace(rows=np.arange(3) == sample, share=share)

    def foretold(*events: Any) -> bool:
        outcome: Any = SimpleNamespace(after=after)
        return Account(whole, [], outside, outcome, None).foretells(outside, [*events], np.full((3, 2), 4.0))

    assert foretold(event(1, 1.0), event(2, 0.874))
    assert fitted == [(outside, "beside []", ("spring",), ("soft",))]
    assert not foretold(event(1, 1.0), event(2, 0.876))
    assert not foretold(event(2, 0.876), event(1, 1.0))
    after.effects = ()
    assert not foretold(event(1, 1.0))


def test_a_joint_that_rested_so_long_ago_is_recorded_at_rest() -> None:
    """Two runs, ten samples a second, torques recorded 0.15 s late."""
    time = np.concatenate([np.arange(10) * 0.1, 50 + np.arange(10) * 0.1])
    motion = Motion(time, *np.zeros((3, 20, 1)), np.array([0, 10]))
    moving = np.ones((20, 1), dtype=bool)
    moving[4] = moving[10] = False
    slid = accounts.slid_since(motion, moving, 0.15)
    # between two samples of which one is at rest it may have been; before a run it was as at its beginning
    assert np.flatnonzero(~slid[:, 0]).tolist() == [4, 5, 6, 10, 11, 12]
    assert np.flatnonzero(~accounts.slid_since(motion, moving, 0.0)[:, 0]).tolist() == [4, 10]


def test_a_joint_that_is_recorded_at_rest_tells_nothing_there() -> None:
    """It moves but in the fourth sample of ten, recorded a sample late; the second sample counts for nothing anyway."""
    nothing = np.zeros((10, 1))
    motion = Motion(0.1 * np.arange(10), nothing, nothing, nothing, np.array([0]))
    moving, rows = np.ones((10, 1), dtype=bool), np.ones((10, 1), dtype=bool)
    moving[3], rows[[1, 3]] = False, False
    samples = Samples(motion, nothing, moving, 0.1)
    known: Any = None
    evidence = Evidence(known, samples, np.ones(1), np.ones(1), rows, np.zeros(10, dtype=int), known)
    late = accounts._resting_late(evidence, 0.11)
    assert late.unknown is not None
    # half of a sample more: what lies between the fourth and a sample that moved is not known either
    assert np.flatnonzero(~late.samples.moving).tolist() == [3, 4, 5]
    assert np.flatnonzero(late.unknown).tolist() == [3, 4, 5]
    assert np.flatnonzero(~late.rows).tolist() == [1, 3, 4, 5]


def test_what_remains_is_beside_effects_and_the_law_whatever_its_range() -> None:
    @dataclass
    class Added:
        parameters: dict[str, float]

    law = Added({"v1": 2.0, **dict.fromkeys(RANGE, 9.0)})
    seen: list[Any] = []

    def with_effects(added: list[Any]) -> Any:
        seen.append([a.parameters for a in added])
        return 5.0

    whole: Any = SimpleNamespace(
        model=SimpleNamespace(with_effects=with_effects),
        left_by=lambda model: np.full((3, 1), 7.0 - model),
    )
    outcome: Any = SimpleNamespace(added=lambda: [Added({"of": 1.0})])
    nothing: Any = None
    for unlisted, expected in ((None, [{"of": 1.0}]), (law, [{"of": 1.0}, {"v1": 2.0}])):
        found: Any = None if unlisted is None else SimpleNamespace(added=lambda: [law])
        assert (Account(whole, [], nothing, outcome, found).remaining() == 2.0).all()
        assert seen.pop() == expected


def test_delays_of_all_joints_and_of_one_add_up() -> None:
    def late(*given: tuple[Any, float]) -> float:
        added = [
            SimpleNamespace(effect=effect, parameters={"seconds": SimpleNamespace(value=seconds)})
            for effect, seconds in given
        ]
        outcome: Any = SimpleNamespace(added=lambda: added)
        return accounts._delay(outcome)

    assert late() == late((JointSpring(1), 3.0)) == 0.0
    assert late((TimeDelay(None), 0.25)) == late((TorqueDelay(2), 0.25)) == 0.25
    assert late((TimeDelay(None), 0.25), (TorqueDelay(2), 0.5), (TorqueDelay(1), 0.125)) == 0.75
    assert late((TimeDelay(None), -0.5), (TorqueDelay(2), 0.25)) == -0.5


@pytest.mark.parametrize(
    ("late", "known", "reach"),
    [
        ([0.0], False, 0.0),
        ([0.3, 1.2], False, 1.2),
        ([-0.3, -0.4], False, -1.2),
        ([0.3, 1.3, 1.4], False, 5.2),  # longer than what had been left out
        ([0.3], True, 0.0),
    ],
)
def test_the_search_is_made_anew_while_the_torque_is_later_than_was_left_out(
    late: list[float], known: bool, reach: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[Any] = []
    monkeypatch.setattr(accounts, "without", lambda whole, contacts: (whole, len(contacts)))
    monkeypatch.setattr(
        accounts, "search", lambda evidence, progress, panel: made.append(evidence) or len(made)
    )
    monkeypatch.setattr(accounts, "_delay", lambda outcome: late[outcome - 1])
    monkeypatch.setattr(accounts, "_resting_late", lambda whole, seconds: ("later", seconds))
    monkeypatch.setattr(
        accounts, "find_law", lambda evidence, outcome, progress: (f"law of {evidence}", outcome)
    )
    further: list[Any] = []
    monkeypatch.setattr(
        accounts,
        "further_laws",
        lambda *given: further.append(given[:3]) or ([f"beside {given[2]}"], given[1] + 100),
    )
    asked: list[Any] = []
    monkeypatch.setattr(Account, "_or_listed", lambda account, first, *given: asked.append(first) or account)
    whole: Any = SimpleNamespace(unknown="known" if known else None)
    contact: Any = "contact"
    found = Account.of(whole, [contact], lambda text: None)
    searches, final = len(late), ("later", reach) if reach else whole
    final_evidence: Any = (final, 1)
    assert found.whole == final and found.outcome == searches + 100 and made[-1] == (final, 1)  # type: ignore[comparison-overlap]
    assert found.unlisted == f"law of {(final, 1)}" and len(made) == searches  # type: ignore[comparison-overlap]
    assert asked == [searches] and further == [(final_evidence, searches, f"law of {final_evidence}")]
    assert found.laws == [f"law of {final_evidence}", f"beside law of {final_evidence}"]


def test_without_an_effect_those_events_stay_that_are_one_without_it_too(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Two events, of five samples, of which the first is one without the effect, too; a third one shows without it alone."""

    def event(sample: int) -> Any:
        return SimpleNamespace(rows=np.arange(5) == sample)

    first, second, fresh = event(1), event(3), event(4)
    asked: list[Any] = []

    def find(whole: Any, residual: Any, added: Any) -> list[Any]:
        asked.append((whole, residual, added))
        return [event(1), fresh]

    monkeypatch.setattr(accounts, "find_contacts", find)
    monkeypatch.setattr(Account, "remaining", lambda account: f"without {account.outcome.name}")
    whole: Any = "run"
    nothing: Any = None
    fewer: Any = SimpleNamespace(name="spring", added=lambda: ["drag"])
    found = Account(whole, [first, second], nothing, nothing, nothing).without_effect(fewer)
    assert [contact.rows.tolist() for contact in found.contacts] == [first.rows.tolist()]
    assert found.outcome is fewer and asked == [("run", "without spring", ["drag"])]
    bare = Account(whole, [], nothing, nothing, nothing).without_effect(fewer)
    assert bare.outcome is fewer and bare.contacts == [] and len(asked) == 1
