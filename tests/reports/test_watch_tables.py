"""What a call of `armloop watch` says on a terminal."""

from collections.abc import Sequence
from typing import Any

from armloop.reports.prose import Prose
from armloop.reports.watch_tables import watch_words
from armloop.watch import Outcome
from armloop.watch.ingest import Counts


def outcome(notes: list[list[str]], aside: Sequence[dict[str, Any]] = ()) -> Outcome:
    arms: list[dict[str, Any]] = [
        {"arm": f"arm{k}", "hours": 0.5, "notes": own} for k, own in enumerate(notes)
    ]
    return Outcome(Counts(read=len(arms)), arms, [], [], list(aside), 1000.0)


def test_what_the_answer_notes_of_an_arm_is_said() -> None:
    note = "an alarm takes 22 units of operation, there are 3"
    words = watch_words(outcome([[note], []]))
    assert f"arm0: {note}" in words.splitlines() and "arm1" not in words


def test_notes_of_a_large_fleet_fit_a_terminal() -> None:
    words = watch_words(outcome([["it is young"]] * 12))
    assert words.count("it is young") == 10
    assert "… and 2 more notes" in words


def test_why_a_log_was_set_aside_fits_a_terminal() -> None:
    reason = "logs/arm1/today.csv: " + "the header lacks what it must have; " * 8
    words = watch_words(outcome([[]], [{"arm": "arm1", "log": "logs/arm1/today.csv", "reason": reason}]))
    assert "arm1: logs/arm1/today.csv" in words
    assert max(map(len, words.splitlines())) <= 120


def test_units_of_a_drift_are_spelled_as_elsewhere() -> None:
    course = {"form": "drift", "per_day": 0.0139}
    alarm = {"course": course, "effects": [{"parameters": {"level": {"unit": "N*m"}}}]}
    assert Prose("watch", alarm=alarm)["course"] == "a drift of 0.0139 N·m per day"
