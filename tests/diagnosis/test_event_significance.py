"""What an event stands out of: what a law leaves at other times, and what nothing accounts for."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
from events import event, motion

from armloop.diagnosis import event_significance
from armloop.laws.effects import effect


def test_an_event_of_no_more_than_twice_what_nothing_accounts_for_at_other_times_is_drowned() -> None:
    """A second of ten samples removes 9 of a joint's baselines, as energy; half of that is left once in the second run."""
    given = motion((100, 50), 2)
    left, rows = np.full((150, 2), 4.4), np.ones((150, 2), dtype=bool)
    rows[20:32] = False
    left[20:32] = 99.0  # of the event
    evidence: Any = SimpleNamespace(
        samples=SimpleNamespace(motion=given),
        independent=np.arange(150),
        rows=rows,
        scale=np.array([2.0, 2.0]),
        left_by=lambda model: left * model,
    )
    inside = np.arange(150)
    contact: Any = SimpleNamespace(
        added=event(2.15, 3.15),
        rows=(inside >= 18) & (inside < 35),
        before=np.array([7.0, 0.0]),
        after=np.array([np.sqrt(13.0), 1.0]),
    )
    is_drowned, model = event_significance.drowned, 1.0
    assert not is_drowned(evidence, model, contact)
    left[110:120] = 2 * np.sqrt(5.6)
    assert is_drowned(evidence, model, contact)
    # another joint's is none, nor what is accounted for, nor less than twice the baseline
    contact.before, contact.after = contact.before[::-1], contact.after[::-1]
    assert is_drowned(evidence, model, contact)
    left[110:120, 1] = 4.4
    assert not is_drowned(evidence, model, contact)
    contact.before, contact.after = contact.before[::-1], contact.after[::-1]
    left[110:120, 1] = 2 * np.sqrt(5.6)
    assert not is_drowned(evidence, 0.85, contact)
    left[:110] = left[120:] = 3.5
    assert not is_drowned(evidence, model, contact)
    # as long as the event, in one run, and beyond the baseline
    left[:110], left[120:] = 4.4, 4.4
    left[115] = 3.0
    assert not is_drowned(evidence, model, contact)
    # as much of it, but the joint dwells in between: as many samples that count are as long
    left[105:130] = 2 * np.sqrt(5.6)
    rows[105:130:2] = False
    assert is_drowned(evidence, model, contact)
    left[110:120], left[95:105] = 4.4, 2 * np.sqrt(5.6)
    assert not is_drowned(evidence, model, contact)


def test_an_event_is_told_from_a_law_where_a_joint_leaves_twice_what_it_leaves_at_other_times() -> None:
    """RMS, outside of all events, of which the baseline is the least; a joint that never slides obeys no law."""
    left, rows = np.full((40, 2), 0.3), np.ones((40, 2), dtype=bool)
    whole: Any = SimpleNamespace(rows=rows)
    outside = rows.copy()
    outside[:20] = False
    left[:20] = 9.0
    evidence: Any = SimpleNamespace(rows=outside, scale=np.array([0.1, 1.0]), residual=lambda known: left)

    def told(before: float, *shown: int, laws: Any = ()) -> bool:
        contact: Any = SimpleNamespace(shown=frozenset(shown), before=np.array([before, 2.0]))
        return event_significance.told(whole, evidence, contact, laws)

    assert told(0.601, 0) and not told(0.599, 0)
    # nor from a law of its joints, or of the arm, that explains as much
    assert not told(0.601, 0, laws=[effect("joint_spring", 1)]) and told(
        0.601, 0, laws=[effect("joint_spring", 2)]
    )
    assert not told(0.601, 0, laws=[effect("payload", None)])
    assert told(0.0, 1) and told(0.0, 0, 1)
    left[20:, 1] = 1.01
    assert not told(0.0, 1)
    outside[:, 0] = False
    assert not told(9.0, 0)
    rows[:, 0] = False
    assert told(9.0, 0)
