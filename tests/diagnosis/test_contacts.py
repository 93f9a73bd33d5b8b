"""When bursts of a residual are events: their number, their length, and what is known of them already."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from events import event, motion
from synthetic import three_axis

from armloop.data.motion import Motion
from armloop.diagnosis import contacts
from armloop.diagnosis.contacts import Burst
from armloop.laws.effects import effect
from armloop.model import AddedEffect


def test_an_event_is_of_an_interval() -> None:
    assert contacts.is_event(event(1.0, 2.0))
    assert not contacts.is_event(AddedEffect(effect("external_torque", 1), {}))
    assert not contacts.is_event(event(1.0, 2.0, "joint_spring"))


def test_samples_of_events_that_are_known_and_of_new_ones_do_not_count() -> None:
    """0.3 s beside an event may be its own; a spring is no event."""
    given = motion((50, 50), period=0.08)
    known = [event(2.0, 3.0), event(1.0, 2.0, "joint_spring")]
    rows = np.ones((100, 2), dtype=bool)
    rows[0, 1] = False
    kept: list[np.ndarray] = []
    evidence: Any = SimpleNamespace(
        samples=SimpleNamespace(motion=given),
        model=SimpleNamespace(effects=known),
        rows=rows,
        only=kept.append,
    )
    expected = list(range(25 - 3, 37 + 4))
    assert np.flatnonzero(contacts.known_contacts(evidence)).tolist() == expected
    new: Any = SimpleNamespace(rows=np.arange(100) >= 95)
    contacts.without(evidence, [new])
    gone = [*expected, *range(95, 100)]
    assert np.flatnonzero(~kept[0][:, 0]).tolist() == gone
    assert np.flatnonzero(~kept[0][:, 1]).tolist() == [0, *gone]


@pytest.mark.parametrize(
    ("start", "end", "whole"),
    [(0.11, 9.79, True), (0.09, 9.79, False), (0.11, 9.81, False)],
)
def test_an_event_is_seen_to_begin_and_to_end_in_its_run(start: float, end: float, whole: bool) -> None:
    given = motion((100,))
    rows = np.zeros(100, dtype=bool)
    rows[50:60] = True
    for later in (0.0, 7.0):
        contact: Any = SimpleNamespace(added=event(start + later, end + later), rows=rows)
        assert contacts._seen_whole(replace(given, time=given.time + later), contact) == whole


@pytest.mark.parametrize(
    ("events", "kept"),
    [
        ([(10, 20, 0.5), (10, 20, 0.8)], [1]),  # the same twice: the larger share
        ([(0, 20, 0.9), (15, 25, 0.5)], [0, 1]),  # half of the shorter is not most of it
        ([(0, 20, 0.9), (14, 24, 0.5)], [0]),
        ([(60, 80, 0.9), (10, 20, 0.8), (14, 24, 0.7), (30, 40, 0.1)], [1, 3, 0]),  # in order of time
    ],
)
def test_of_events_that_are_one_for_most_of_the_shorter_the_larger_is_listed(
    events: list[tuple[int, int, float]], kept: list[int]
) -> None:
    found: Any = [
        SimpleNamespace(
            added=event(0.1 * first - 0.05, 0.1 * end - 0.05), share=share, shown=frozenset({0, 1})
        )
        for first, end, share in events
    ]
    assert [found.index(one) for one in contacts._distinct(motion((100,)), found)] == kept


def test_torques_on_two_joints_that_account_for_one_burst_are_two_events() -> None:
    given = motion((100,))

    def torque(joint: int, start: float, end: float, *shown: int) -> Any:
        added = AddedEffect(effect("external_torque", joint), event(start, end).parameters)
        return SimpleNamespace(added=added, share=0.5, shown=frozenset(shown))

    both = [torque(1, 1.0, 2.0, 0, 1), torque(2, 1.2, 2.0, 0, 1)]
    assert len(contacts._distinct(given, both)) == 2
    assert len(contacts._distinct(given, [both[0], torque(1, 1.2, 2.0, 0, 1)])) == 1
    assert len(contacts._distinct(given, [both[0], torque(2, 1.2, 2.0, 1)])) == 1
    force = torque(2, 1.2, 2.0, 0, 1)
    force.added = AddedEffect(effect("external_contact", None), force.added.parameters)
    assert len(contacts._distinct(given, [both[0], force])) == 1


@pytest.mark.parametrize(
    ("left", "errors", "shown", "stands"),
    [
        ((3.1, 0.0), ((1.0, 0.0), (0.0, 0.0)), (0, 1), True),  # three standard errors are no chance
        ((2.9, 0.0), ((1.0, 0.0), (0.0, 0.0)), (0, 1), False),
        ((-3.1, 2.9), ((1.0, 0.0), (0.0, 1.0)), (0, 1), True),  # any joint that shows it
        ((9.0, 2.9), ((1.0, 0.0), (0.0, 1.0)), (1,), False),  # and no other
        ((4.9, 0.0), ((1.0, 1.4), (0.0, 0.0)), (0,), False),  # what a model errs by in several ways adds up
        ((0.1, 0.0), (), (0,), True),  # a model that keeps no errors is taken at its word
    ],
)
def test_what_the_model_itself_may_err_by_is_no_event(
    left: tuple[float, ...], errors: tuple[tuple[float, ...], ...], shown: tuple[int, ...], stands: bool
) -> None:
    """On average over the event, at samples that the filter leaves apart; before and after they may be anything."""
    given, rows = motion((100,)), np.zeros(100, dtype=bool)
    rows[35:65] = True
    inside = np.arange(40, 60)
    residual, own = np.full((100, 2), 99.0), np.full((100, 2, len(errors[0]) if errors else 0), -99.0)
    own[inside] = np.array(errors).reshape(2, -1) if errors else 0.0
    own[inside[::4]] *= 2.0  # the mean is of all of them
    own[inside[2::4]] *= 0.0
    residual[inside] = left
    apart = np.arange(0, 100, 2)
    evidence: Any = SimpleNamespace(
        samples=SimpleNamespace(motion=given), independent=apart, errors=own[apart]
    )
    found: Any = SimpleNamespace(added=event(3.95, 5.95), rows=rows, shown=frozenset(shown))
    assert contacts._beyond_errors(evidence, residual, found) == stands
    found.added = event(3.91, 3.95)
    assert contacts._beyond_errors(evidence, residual, found)


class TestFinding:
    """Joint 1 and joint 2 have bursts where they are given; what is pushed is told of them."""

    def pushed(self, monkeypatch: pytest.MonkeyPatch, *bursts: tuple[int, int, int], **of: Any) -> list[Any]:
        given, asked = motion(), []
        innovation = np.zeros((100, 2))
        innovation[:, 1] = 1.0  # joint 1 tells nothing but where it slides

        def push(evidence: Any, residual: Any, rows: slice, counted: Any, own: list[int]) -> Any:
            asked.append((rows.start, rows.stop, own, counted.sum(axis=0).tolist()))
            self.left.append(float(residual[0, 0]))
            return of["push"](rows, own) if "push" in of else None

        self.left: list[float] = []
        by_joint = [[slice(a, z) for a, z, j in bursts if j == k] for k in (0, 1)]
        following = iter(by_joint)
        friction: Any = ["friction"]  # what was found so far, and holds a joint at rest
        told = {"friction": (innovation, None)}
        monkeypatch.setattr(contacts, "innovations", lambda evidence, residual, known: told[known[0]])
        monkeypatch.setattr(contacts, "deviations", lambda evidence, residual: np.ones((100, 2)))
        monkeypatch.setattr(contacts, "dry_level", lambda evidence, known: np.ones((100, 2)))
        monkeypatch.setattr(contacts, "novelty", lambda *_: (np.arange(100), np.ones((100, 2))))
        monkeypatch.setattr(contacts, "known_contacts", lambda evidence: np.arange(100) < of.get("known", 0))
        monkeypatch.setattr(contacts, "_bursts", lambda *_: next(following))
        monkeypatch.setattr(
            contacts, "comes_back", lambda motion, rows, level, b: b.rows.start in of.get("back", ())
        )
        monkeypatch.setattr(contacts, "averaged", lambda samples, of: of)
        monkeypatch.setattr(
            contacts, "rubs", lambda motion, rows, mean, b: b.rows.start in of.get("rubs", ())
        )
        monkeypatch.setattr(
            contacts, "_sticks", lambda evidence, b, held: b.rows.start in of.get("sticks", ())
        )

        def standing_out(motion: Any, rows: Any, level: Any, bursts: Any) -> Any:
            self.level = level.sum(axis=0).tolist()
            return bursts

        monkeypatch.setattr(contacts, "_standing_out", standing_out)
        monkeypatch.setattr(
            contacts,
            "_beyond_errors",
            lambda evidence, residual, one: not one.rows[list(of.get("erring", ()))].any(),
        )
        monkeypatch.setattr(contacts, "turning", lambda motion, moving: np.arange(200).reshape(100, 2) < 60)
        monkeypatch.setattr(contacts, "at_rest", lambda samples, model: np.arange(200).reshape(100, 2) >= 180)
        monkeypatch.setattr(contacts, "outlying", lambda evidence, residual: [slice(10, 20), slice(60, 70)])
        monkeypatch.setattr(contacts, "push", push)
        monkeypatch.setattr(contacts, "torque_on", lambda *given: push(*given[:-1], [given[-1]]))
        scanned = [
            SimpleNamespace(rows=slice(a, b), joint=j, level=innovation) for a, b, j in of.get("beside", ())
        ]
        far = np.zeros((100, 2), dtype=bool)
        far[:, of.get("far", [])] = True
        monkeypatch.setattr(contacts, "far_outside", lambda motion, ranges: far)

        def pulses(samples: Any, left: Any, judged: Any) -> list[Any]:
            assert left is innovation
            self.judged = judged.sum(axis=0).tolist()
            return scanned

        monkeypatch.setattr(contacts, "pulses", pulses)
        monkeypatch.setattr(contacts, "beside", lambda samples, residual, rows: residual + rows.start)
        rows = np.full((100, 2), False) | of.get("judged", True)
        own = SimpleNamespace(
            samples=SimpleNamespace(motion=given, moving=None),
            rows=rows,
            model=SimpleNamespace(arm=three_axis(), history={}),
            scale=np.ones(2),
        )
        # what differs from log to log does not come and go within one
        evidence: Any = SimpleNamespace(within_a_log=lambda: own, samples=own.samples)
        monkeypatch.setattr(
            contacts, "_strays", lambda far, b: far.shape == (100, 2) and b.rows.start in of.get("strays", ())
        )
        events = contacts.find_contacts(evidence, np.zeros((100, 2)), friction)
        self.events = [event.share for event in events]
        return asked

    def test_each_is_explained_with_the_samples_that_tell_of_it(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Joints turn round in the first thirty samples and rest in the last ten: they tell there nothing but what exceeds
        their friction, of joint 2 all. Beside another's burst a joint is left out.
        """
        assert self.pushed(monkeypatch, (40, 50, 0)) == [(40, 50, [0], [60, 100])]
        assert self.pushed(monkeypatch, (40, 50, 0), (41, 50, 1))[:1] == [(40, 50, [0, 1], [60, 100])]
        apart = [(20, 30, [0], [60, 100]), (60, 70, [1], [0, 100])]
        assert self.pushed(monkeypatch, (20, 30, 0), (60, 70, 1)) == apart
        near = [(20, 30, [0], [60, 0]), (31, 40, [1], [0, 100])]
        assert self.pushed(monkeypatch, (20, 30, 0), (31, 40, 1)) == near

    def test_one_force_or_a_torque_on_each_joint(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """On few joints torques that explain more than a force, but for what freedom explains, are what is named."""
        asked: list[list[int]] = []

        def push(rows: slice, own: list[int]) -> Any:
            asked.append(own)
            if tuple(own) not in told:
                return None
            name, joint, share, *rivals = told[tuple(own)]
            time, inside = motion().time, np.zeros(100, dtype=bool)
            inside[rows] = True
            added = AddedEffect(effect(name, joint), event(time[rows.start], time[rows.stop - 1]).parameters)
            before = np.where([0 in own, 1 in own], [3.0, 4.0], 0.0)
            return contacts.Contact(
                added, inside, before, before, share, share, rivals=rivals, shown=frozenset(own)
            )

        def named(*bursts: tuple[int, int, int]) -> list[tuple[int | None, frozenset[int]]]:
            asked.clear()
            monkeypatch.setattr(contacts, "_with_what_is_between", lambda *_: None)
            kept: list[Any] = []
            distinct = contacts._distinct

            def seen(given: Motion, events: list[Any]) -> list[Any]:
                kept.extend(distinct(given, events))
                return kept

            with monkeypatch.context() as patched:
                patched.setattr(contacts, "_distinct", seen)
                self.pushed(patched, *bursts, push=push)
            return [(one.added.effect.joint, one.shown) for one in kept]

        pair, both = [(40, 50, 0), (41, 50, 1)], frozenset({0, 1})
        force: tuple[Any, ...] = ("external_contact", None, 0.849)
        told = {(0, 1): force, (0,): ("external_torque", 1, 0.9), (1,): ("external_torque", 2, 0.9)}
        assert named(*pair) == [(1, both), (2, both)] and asked == [[0, 1], [0], [1]]
        told[0, 1] = ("external_contact", None, 0.851)
        assert named(*pair) == [(None, both)]
        # a single torque is one of them, and no freedom more: 16 of 25 parts are of joint 2
        told[0, 1] = ("external_torque", 2, 0.883)
        assert named(*pair) == [(2, both)]
        told[0, 1] = ("external_torque", 2, 0.881)
        assert named(*pair) == [(1, both), (2, both)]
        # unless a force explains as much as both
        told[0, 1] = ("external_torque", 2, 0.87, (effect("external_contact", None), 0.883))
        assert named(*pair) == [(2, both)]
        told[0, 1] = ("external_torque", 2, 0.87, (effect("external_torque", 1), 0.883))
        assert named(*pair) == [(1, both), (2, both)]
        # one joint has but one
        assert named((40, 50, 0)) == [(1, frozenset({0}))] and asked == [[0]]
        # what no torque explains at one of the joints is a force
        told[0, 1] = ("external_contact", None, 0.6)
        last = told.pop((1,))
        assert named(*pair) == [(None, both)]
        told[1,] = last
        # what is another event's does not tell of it
        assert self.pushed(monkeypatch, *pair)[1] == (40, 50, [0], [60, 0])
        assert self.pushed(monkeypatch, *pair, (80, 85, 0))[1] == (40, 50, [0], [55, 0])
        # many joints tell a force
        told[0, 1] = force
        monkeypatch.setattr(contacts, "FEW", 2)
        assert named(*pair) == [(None, both)] and asked == [[0, 1]]

    def test_two_that_one_explains_are_one(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Events by how many samples they hold; a third one is asked with what the first two have become."""

        def push(rows: slice, own: list[int]) -> Any:
            time, inside = motion().time, np.zeros(100, dtype=bool)
            inside[rows] = True
            added = event(time[rows.start], time[rows.stop - 1])
            return SimpleNamespace(added=added, rows=inside, share=int(inside.sum()), shown=frozenset(own))

        def between(evidence: Any, tells: Any, first: Any, then: Any) -> Burst | None:
            rows = np.flatnonzero(first.rows | then.rows)
            return Burst(slice(int(rows[0]), int(rows[-1]) + 1), first.shown | then.shown)

        monkeypatch.setattr(contacts, "_with_what_is_between", between)
        monkeypatch.setattr(contacts, "_explains_both", lambda evidence, one, first, then: one.share < 30)
        bursts = [(20, 25, 0), (30, 35, 1), (50, 55, 0)]
        asked = self.pushed(monkeypatch, *bursts, push=push)
        assert self.events == [15, 5] and [a[:3] for a in asked[3:]] == [(20, 35, [0, 1]), (20, 55, [0, 1])]
        monkeypatch.setattr(contacts, "_explains_both", lambda evidence, one, first, then: False)
        self.pushed(monkeypatch, *bursts, push=push)
        assert self.events == [5, 5, 5]
        # what the model itself may err by is none of them
        self.pushed(monkeypatch, *bursts, push=push, erring=[32])
        assert self.events == [5, 5]
        # too long to be one: more than two fifths of what the joints do
        monkeypatch.setattr(contacts, "_explains_both", lambda evidence, one, first, then: True)
        self.pushed(monkeypatch, (20, 25, 0), (56, 61, 0), push=push)
        assert self.events == [5, 5]
        self.pushed(monkeypatch, (20, 25, 0), (55, 60, 0), push=push)
        assert self.events == [40]

    def test_what_comes_back_or_sticks_or_strays_is_none(self, monkeypatch: pytest.MonkeyPatch) -> None:
        bursts = [(20, 30, 0), (40, 50, 0), (60, 70, 0)]
        assert [a for a, *_ in self.pushed(monkeypatch, *bursts, back=[20])] == [40, 60]
        assert [a for a, *_ in self.pushed(monkeypatch, *bursts, sticks=[60])] == [20, 40]
        assert [a for a, *_ in self.pushed(monkeypatch, *bursts, rubs=[60])] == [20, 40]
        assert [a for a, *_ in self.pushed(monkeypatch, *bursts, strays=[40])] == [20, 60]

    def test_what_differs_from_before_and_after_is_explained_less_what_is_there(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Unless it comes back, sticks, or lies within 0.3 s of what stands out already."""
        bursts, scanned = [(20, 30, 0)], [(32, 36, 1), (34, 38, 1), (60, 64, 1), (80, 84, 0)]
        assert [a for a, *_ in self.pushed(monkeypatch, *bursts, beside=scanned)] == [20, 34, 60, 80]
        assert self.left == [0.0, 34.0, 60.0, 80.0]
        assert [a for a, *_ in self.pushed(monkeypatch, *bursts, beside=scanned, back=[60])] == [20, 34, 80]
        assert [a for a, *_ in self.pushed(monkeypatch, *bursts, beside=scanned, sticks=[80])] == [20, 34, 60]
        assert [a for a, *_ in self.pushed(monkeypatch, *bursts, beside=scanned, rubs=[80])] == [20, 34, 60]

    def test_one_of_several_that_stand_out_is_near_enough(self, monkeypatch: pytest.MonkeyPatch) -> None:
        bursts, scanned = [(20, 30, 0), (70, 75, 0)], [(32, 36, 1), (50, 54, 1)]
        assert [a for a, *_ in self.pushed(monkeypatch, *bursts, beside=scanned)] == [20, 70, 50]

    def test_what_is_known_or_lies_far_outside_of_the_trained_range_is_not_scanned(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        self.pushed(monkeypatch, known=30, far=[1])
        assert self.judged == [70, 0]
        assert self.level == [70.0, 0.0]

    def test_what_fills_more_than_four_tenths_of_a_joints_motion_is_none(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """A law of a joint that moves but once or twice shows like an event of most of its motion."""
        assert len(self.pushed(monkeypatch, (10, 30, 0), (50, 70, 0))) == 2
        assert len(self.pushed(monkeypatch, (10, 30, 0), (50, 71, 0))) == 0
        once = np.ones((100, 2), dtype=bool)
        once[:, 0] = (np.arange(100) >= 20) & (np.arange(100) < 45)
        bursts = (20, 31, 0), (60, 85, 1)
        assert [a for a, *_ in self.pushed(monkeypatch, *bursts, judged=once)] == [60]
        # another joint that shows it, too, moves at other times
        asked = self.pushed(monkeypatch, *bursts, (20, 29, 1), judged=once)
        assert sorted({a for a, *_ in asked}) == [20, 60]
        # a joint that never moves is judged by all of the run
        assert len(self.pushed(monkeypatch, *bursts, judged=[False, True])) == 2

    def test_where_no_joint_can_be_judged_what_stands_out_counts(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        found = self.pushed(monkeypatch, judged=False)
        every = [(10, 20, [0, 1], [100, 100]), (60, 70, [0, 1], [100, 100])]
        assert [a for a in found if len(a[2]) == 2] == every
        assert [a for a in self.pushed(monkeypatch, judged=False, known=11) if len(a[2]) == 2] == every[1:]
        # one joint that can be judged is enough for the rest
        assert self.pushed(monkeypatch, (40, 50, 0), judged=[True, False]) == [(40, 50, [0], [60, 100])]


def at(time: list[float], starts: tuple[int, ...] = (0,)) -> Motion:
    N = len(time)
    return Motion(np.array(time), *np.zeros((3, N, 1)), np.array(starts))


def stretches(time: list[float], new: list[float], starts: tuple[int, ...] = (0,)) -> list[tuple[int, int]]:
    """Those of a run beside one in which nothing happens: half of all samples are quiet."""
    quiet = (100.0 + np.arange(20.0)).tolist()
    motion = at([*time, *quiet], (*starts, len(time)))
    found = contacts._bursts(motion, np.arange(motion.samples), np.array([*new, *(0.0 * x for x in quiet)]))
    return [(burst.start, burst.stop) for burst in found]


class TestStretches:
    #: Differences of neighbours are a tenth of a second to the bit.
    FIVE = (-0.2, -0.1, 0.0, 0.1, 0.2)

    @pytest.mark.parametrize(
        ("new", "found"),
        [
            ((0, 10, 10, 10, 0), [(1, 4)]),  # a tenth of a second of the run before it and after it
            ((0, 10, 10, 0, 0), [(1, 3)]),  # and that long itself
            ((0, 0, -10, -10, 0), [(2, 4)]),
            ((0, 0, 10, 0, 0), []),
            ((0, 2.5, 10, 10, 0), [(2, 4)]),  # a quarter of its peak is none of it
            ((0, 10, 10, 2.5, 0), [(1, 3)]),
            ((0, 2.6, 10, 2.6, 0), [(1, 4)]),
            ((2.6, 2.6, 10, 10, 0), []),  # there since the run began, or until it ended
            ((0, 10, 10, 2.6, 2.6), []),
            ((0, 4.2, 4.2, 4.2, 0), []),  # as much as is asked is not above it
            ((0, 4.3, 4.3, 4.3, 0), [(1, 4)]),
            ((10, 10, 10, 10, 10), []),
        ],
    )
    def test_one(self, new: tuple[float, ...], found: list[tuple[int, int]]) -> None:
        assert stretches(list(self.FIVE), list(new)) == found

    def test_its_edge_is_a_part_of_its_highest(self) -> None:
        time = (0.1 * np.arange(11)).tolist()
        assert stretches(time, [0, 0, 0, 4, 6, 20, 6, 4, 0, 0, 0]) == [(4, 7)]

    def test_a_run_that_has_just_begun_or_is_about_to_end(self) -> None:
        time = (7.0 + 0.0625 * np.arange(9)).tolist()
        assert stretches(time, [0, 9, 9, 9, 9, 9, 0, 0, 0]) == []
        assert stretches(time, [0, 0, 0, 9, 9, 9, 9, 9, 0]) == []
        assert stretches(time, [0, 0, 0, 9, 9, 9, 0, 0, 0]) == [(3, 6)]

    def test_what_lasts_to_the_end_of_its_run_is_none_whatever_comes_next(self) -> None:
        time = [0.0, 0.1, 0.2, 0.3, 5.0, 5.1, 5.2, 5.3]
        assert stretches(time, [0, 0, 9, 9, 0, 0, 0, 0], (0, 4)) == []
        assert stretches(time, [0, 0, 0, 0, 9, 9, 0, 0], (0, 4)) == []

    def test_two_are_one_unless_they_are_farther_apart_than_a_pause(self) -> None:
        pause = contacts.PAUSE
        low = [0.0, 9.0, 9.0, 2.0, 9.0, 9.0, 0.0]
        for gap, found in ((pause, [(1, 6)]), (pause + 0.01, [(1, 3), (4, 6)])):
            time = [-9.0, -0.25, 0.0, 0.5 * gap, gap, gap + 0.25, gap + 9]
            assert stretches(time, low) == found

    def test_they_meet_at_a_pause(self) -> None:
        one, other = (Burst(slice(*rows), frozenset({0})) for rows in ((0, 2), (3, 5)))
        for gap, meet in ((contacts.PAUSE, True), (1.01 * contacts.PAUSE, False)):
            time = at([-1.0, 0.0, 0.5 * gap, gap, gap + 1.0])
            assert contacts._meet(time, one, other) is contacts._meet(time, other, one) is meet


def test_a_tenth_of_a_second_before_and_after_an_event_is_enough() -> None:
    given = at([-0.2, -0.1, 0.0, 0.1, 0.2])
    rows = np.array([False, True, True, True, False])
    for start, end, whole in ((-0.1, 0.1, True), (-0.11, 0.1, False), (-0.1, 0.11, False)):
        contact: Any = SimpleNamespace(added=event(start, end), rows=rows)
        assert contacts._seen_whole(given, contact) is whole
