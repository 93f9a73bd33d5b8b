"""What a call of `armloop watch` says on a terminal."""

from typing import Any

from armloop.reports.watch_tables import watch_words
from armloop.watch import Outcome
from armloop.watch.ingest import Counts


def outcome(notes: list[list[str]]) -> Outcome:
    arms: list[dict[str, Any]] = [
        {"arm": f"arm{k}", "hours": 0.5, "notes": own} for k, own in enumerate(notes)
    ]
    return Outcome(Counts(read=len(arms)), arms, [], [], [], 1000.0)


def test_what_the_answer_notes_of_an_arm_is_said() -> None:
    note = "an alarm takes 22 units of operation, there are 3"
    words = watch_words(outcome([[note], []]))
    assert f"arm0: {note}" in words.splitlines() and "arm1" not in words


def test_notes_of_a_large_fleet_fit_a_terminal() -> None:
    words = watch_words(outcome([["it is young"]] * 12))
    assert words.count("it is young") == 10
    assert "… and 2 more notes" in words
