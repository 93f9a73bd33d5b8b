"""Two events between which nothing tells: when they may be one, and when one explains both."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from armloop.data.motion import Motion
from armloop.diagnosis import contacts
from armloop.diagnosis.contacts import Burst
from armloop.laws.effects import Estimate, effect
from armloop.model import AddedEffect


def motion() -> Motion:
    """Two runs of ten seconds, 5 s apart, of two joints."""
    time = np.arange(200) * 0.1 + np.repeat([0.0, 5.0], 100)
    return Motion(time, *np.zeros((3, 200, 2)), np.array([0, 100]))


def event(start: float, end: float) -> AddedEffect:
    values = {"start": Estimate(start, 0.0, "s"), "end": Estimate(end, 0.0, "s")}
    return AddedEffect(effect("external_torque", 1), values)


class TestTwoBetweenWhichNothingTells:
    """Joint 1 shows an event from 2 s to 3 s, joint 2 one from 4 s to 5 s; edges are sharp to a quarter of a second."""

    given = motion()

    def found(self, start: float, end: float, joint: int, **known: Any) -> Any:
        rows = (self.given.time >= start) & (self.given.time <= end)
        return SimpleNamespace(added=event(start, end), rows=rows, shown=frozenset({joint}), **known)

    def evidence(self) -> Any:
        return SimpleNamespace(
            samples=SimpleNamespace(motion=self.given, reach=0.25), scale=np.array([1.0, 2.0])
        )

    def between(
        self, telling: list[tuple[float, int]], then: tuple[float, float] = (4.0, 5.0)
    ) -> Burst | None:
        tells = np.zeros((200, 2), dtype=bool)
        tells[20:31] = tells[40:51] = True
        for time, joint in telling:
            tells[int(np.argmin(np.abs(self.given.time - time))), joint] = True
        events = self.found(2.0, 3.0, 0), self.found(*then, 1)
        return contacts._with_what_is_between(self.evidence(), tells, *events)

    def test_may_be_one(self) -> None:
        both = self.between([])
        assert both is not None and both.joints == {0, 1} and not both.beside
        np.testing.assert_allclose(self.given.time[both.rows][[0, -1]], [2.0, 5.0])
        # what lies within the edges may be either's
        assert self.between([(3.2, 0), (3.8, 1)]) is not None
        assert self.between([(3.3, 0)]) is None and self.between([(3.7, 1)]) is None
        # nothing is between those that touch; a run ends what it began
        assert self.between([(3.2, 0)], (3.1, 5.0)) is not None
        assert self.between([], (16.0, 17.0)) is None

    def test_may_be_one_if_a_joint_of_theirs_leaves_more_than_its_baseline_all_the_while(self) -> None:
        tells, residual = np.ones((200, 2), dtype=bool), np.zeros((200, 2))
        events = self.found(2.0, 3.0, 0), self.found(4.0, 5.0, 1)

        def both() -> Burst | None:
            quiet = contacts._quiet(self.evidence(), residual, tells, frozenset({0, 1}))
            return contacts._with_what_is_between(self.evidence(), quiet, *events)

        assert both() is None
        # baselines are 1 and 2; now one of them shows it, now the other
        residual[20:36, 0], residual[35:51, 1] = -2.1, 4.1
        assert both() is not None
        residual[35:51, 1] = 3.9
        assert both() is None
        # what no sample tells of, nor another joint's, is not theirs
        residual[35:51, 1], tells[35:51, 1] = 9.0, False
        assert both() is None
        alone = contacts._quiet(self.evidence(), residual, tells, frozenset({1}))
        np.testing.assert_array_equal(alone, tells)

    def test_are_one_if_that_explains_both_but_for_what_freedom_explains(self) -> None:
        """Energies of 4 over two seconds, with a share of 0.9, and of 1 over one second, with a share of 0.6."""
        first = self.found(2.0, 4.0, 0, before=np.array([2.0, 0.0]), share=0.9)
        then = self.found(5.0, 6.0, 1, before=np.array([0.0, 2.0]), share=0.6)
        least = 8 * (0.9 - contacts.FREEDOM) + (0.6 - contacts.FREEDOM)

        def one(removed: float, start: float = 2.0, end: float = 6.0) -> bool:
            before = np.array([1.0, 2.0])  # an energy of 2
            event = self.found(start, end, 0, before=before, share=removed / (2 * (end - start)))
            return contacts._explains_both(self.evidence(), event, first, then)

        assert one(least + 1e-6) and not one(least - 1e-6)
        # in a part of each of them, and in no other place
        assert one(8.0, 3.9, 5.1) and not one(8.0, 4.1, 6.0) and not one(8.0, 2.0, 4.9)
