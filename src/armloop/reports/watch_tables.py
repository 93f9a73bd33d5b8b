"""Alarms and logs set aside by a monitoring run, in words and tables for a terminal."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from armloop.reports.prose import Prose
from armloop.reports.tables import Table, make_table
from armloop.reports.words import counted, place, wrapped

if TYPE_CHECKING:
    from armloop.watch import Outcome

#: A terminal shows so many notes, and so many logs set aside; a fleet may have hundreds.
_LISTED = 10


def moment(when: float) -> str:
    """A time, UTC, to the minute."""
    return datetime.fromtimestamp(when, UTC).strftime("%Y-%m-%d %H:%M")


def named(alarm: dict[str, Any]) -> str:
    """The effect that an alarm was traced to; what showed it where it was traced to none."""
    if alarm["effects"]:
        return place(alarm["effects"][0])
    return f"not named (shown by {place(alarm['shown_by'])})"


def alarms_table(alarms: list[dict[str, Any]], title: str | None = None) -> Table:
    """Alarms with what they were traced to."""
    rows = [
        [
            alarm["arm"],
            moment(alarm["since"]),
            moment(alarm["when"]),
            named(alarm),
            Prose("watch", alarm=alarm)["course"],
            f"{alarm['delay']['units']} ({60 * alarm['delay']['operation_hours']:.3g} min)",
        ]
        for alarm in alarms
    ]
    headers = ["arm", "since", "alarm", "what", "how", "logs until found"]
    return make_table(headers, rows, title, left=(0, 1, 2, 3, 4, 5))


def aside_table(aside: list[dict[str, Any]]) -> Table:
    """Logs that were set aside and why."""
    rows = [[item["arm"] or None, item["reason"]] for item in aside]
    return make_table(["arm", "why"], rows, left=(0, 1))


def alarm_words(alarm: dict[str, Any]) -> list[str]:
    """What one alarm means, in sentences."""
    return Prose("watch", alarm=alarm).paragraphs("meaning")


def _aside(item: dict[str, Any]) -> str:
    return f"{item['arm']}: {item['reason']}" if item["arm"] else str(item["reason"])


def watch_words(outcome: Outcome) -> str:
    """The whole answer for a terminal."""
    counts = outcome.counts
    lines = [
        f"{counted(counts.read, 'new log')} read, {counts.known} known before, {counts.aside} set aside; "
        f"{counted(len(outcome.arms), 'arm')}, {sum(a['hours'] for a in outcome.arms):.3g} h of operation in the store"
    ]
    new = [alarm for alarm in outcome.alarms if alarm["id"] in outcome.new]
    if new:
        lines.append("\n" + str(alarms_table(new, "New alarms")))
        for alarm in new:
            lines.append(f"\n{alarm['arm']}:")
            lines += [wrapped(text, "  ") for text in alarm_words(alarm)]
    else:
        lines.append("no new alarm")
    before = [alarm for alarm in reversed(outcome.alarms) if alarm["id"] not in outcome.new]
    if before:
        newest = "; ".join(
            f"{alarm['arm']}: {named(alarm)} since {moment(alarm['since'])}" for alarm in before[:3]
        )
        lines.append(wrapped(f"told before ({len(before)}): {newest}{'; …' if len(before) > 3 else ''}"))
    for alarm in outcome.alarms:
        if alarm["id"] in outcome.diagnosed:
            lines.append(f"\n{alarm['arm']}, alarm of {moment(alarm['when'])}, diagnosed now:")
            lines += [wrapped(text, "  ") for text in alarm_words(alarm)]
    notes = [f"{arm['arm']}: {note}" for arm in outcome.arms for note in arm["notes"]]
    if notes:  # "no new alarm" is no comfort where none was possible
        lines.append("")
        lines += [wrapped(note) for note in notes[:_LISTED]]
        if len(notes) > _LISTED:
            lines.append(f"… and {len(notes) - _LISTED} more notes (--json, --report)")
    if outcome.aside:
        lines.append("\nSet aside:")
        lines += [wrapped(_aside(item), "  ") for item in outcome.aside[:_LISTED]]
        if len(outcome.aside) > _LISTED:
            lines.append(f"… and {len(outcome.aside) - _LISTED} more (--json, --report)")
    lines.append(
        f"\npromise: a mean time of at least {outcome.hours:g} h of operation between false alarms of one whole arm"
    )
    return "\n".join(lines)
