"""One page on a watched fleet: evidence at a glance, one arm's trends, what is behind each alarm, what was set aside."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from armloop.reports.html import Card, Picture, Report, Section, render
from armloop.reports.plots.watch import MOST_ARMS, NARROW, heat_figure, trend_figure
from armloop.reports.prose import Prose
from armloop.reports.tables import make_table
from armloop.reports.watch_tables import (
    alarm_words,
    alarms_table,
    aside_table,
    moment,
    named,
)
from armloop.reports.words import effect_name, number, percent, place, unit
from armloop.util.errors import InputError
from armloop.watch import Options, Outcome
from armloop.watch.fleet import find_models, model_and_digest, model_for
from armloop.watch.store import Store
from armloop.watch.verdicts import Tested, examine, whole_history

_SHOWN, _STREAMS = 4, 60


def watch_report(
    outcome: Outcome, models: str | Path, store: str | Path, arm: str | None, how: Options
) -> str:
    """The page of what a call came to.

    Args:
        arm: whose trends are shown; None takes that of the newest alarm, else the one with the most evidence.

    Raises:
        InputError: models or store cannot be read.
    """
    sections, say = [_overview(outcome)], Prose("watch", outcome=outcome)
    if outcome.arms:
        sections.insert(0, _heat(outcome))
        one = _chosen(outcome, arm)
        path = model_for(find_models(models), one["arm"])
        if path is not None:
            history = whole_history(Store(store), one["arm"], one["model"])
            if model_and_digest(path)[1] == one["model"]:
                sections.append(_trends(outcome, one["arm"], examine(history, how.hours, how.healthy)))
    sections += [_alarm(alarm, alarm["id"] in outcome.new) for alarm in reversed(outcome.alarms)]
    if outcome.aside:
        tables = [aside_table(outcome.aside)]
        sections.append(Section("What was set aside", say.paragraphs("aside"), tables=tables))
    return render(
        Report(
            "Arms under watch",
            say["lead"],
            sections,
            _cards(outcome),
        )
    )


def _cards(outcome: Outcome) -> list[Card]:
    hours = sum(arm["hours"] for arm in outcome.arms)
    return [
        Card(str(len(outcome.arms)), "arms", f"{number(hours)} h of operation"),
        Card(
            str(len(outcome.new)),
            "new alarms",
            f"{len(outcome.alarms)} in all",
            "bad" if outcome.new else "good",
        ),
        Card(str(outcome.counts.read), "new logs", f"{outcome.counts.known} known before"),
        Card(str(max(len(outcome.aside), outcome.counts.aside)), "set aside", "broken, or of an unknown arm"),
    ]


def _heat(outcome: Outcome) -> Section:
    def most(arm: dict[str, Any]) -> float:
        return max((item["log_evidence"] or 0.0 for item in arm["evidence"]), default=0.0) / arm["limit"]

    arms = sorted(outcome.arms, key=most, reverse=True)[:MOST_ARMS]
    strength: dict[str, float] = {}
    for arm in arms:
        for item in arm["evidence"]:
            name = place(item)
            strength[name] = max(strength.get(name, 0.0), (item["log_evidence"] or 0.0) / arm["limit"])
    order = list(strength)
    kept = sorted(sorted(order, key=lambda name: -strength[name])[:_STREAMS], key=order.index)
    evidence = np.full((len(arms), len(kept)), np.nan)
    alarmed = np.zeros(evidence.shape, dtype=bool)
    found = {(alarm["arm"], place(item)) for alarm in outcome.alarms for item in alarm["effects"]}
    for a, arm in enumerate(arms):
        for item in arm["evidence"]:
            name = place(item)
            if name in kept and item["log_evidence"] is not None:
                evidence[a, kept.index(name)] = item["log_evidence"]
        alarmed[a] = [(arm["arm"], name) in found for name in kept]
    limit = np.array([arm["limit"] for arm in arms])
    shown = ([arm["arm"] for arm in arms], kept, evidence, limit, alarmed)
    picture = Picture(heat_figure(*shown), Prose("watch")["heat"], narrow=heat_figure(*shown, NARROW))
    notes = [f"{arm['arm']}: {note}" for arm in outcome.arms for note in arm["notes"]]
    if len(outcome.arms) > len(arms):
        notes.append(f"The {len(arms)} arms with the most evidence, of {len(outcome.arms)}.")
    return Section("Evidence", [], [picture], [], [], notes)


def _overview(outcome: Outcome) -> Section:
    if not outcome.alarms:
        young = [
            arm["arm"]
            for arm in outcome.arms
            if arm["units_for_alarm"] is None or arm["units_since_alarm"] < arm["units_for_alarm"]
        ]
        if len(young) == len(outcome.arms):
            return Section("Alarms", ["Of no arm there is enough operation yet for an alarm."])
        but = (
            f", but for {', '.join(young)}, of which there is too little operation yet for an alarm"
            if young
            else ""
        )
        return Section("Alarms", [f"No arm has changed{but}."])
    return Section("Alarms", [], [], [alarms_table(list(reversed(outcome.alarms)))])


def _chosen(outcome: Outcome, arm: str | None) -> dict[str, Any]:
    by_name = {item["arm"]: item for item in outcome.arms}
    if arm is not None:
        if arm not in by_name:
            known = ", ".join(sorted(by_name)[:12]) + (", ..." if len(by_name) > 12 else "")
            raise InputError(f"--arm {arm}: there is no such arm in the store; its arms are {known}")
        return by_name[arm]
    alarms = [alarm for alarm in outcome.alarms if alarm["arm"] in by_name]
    if alarms:
        return by_name[max(alarms, key=lambda alarm: float(alarm["when"]))["arm"]]
    return max(
        outcome.arms, key=lambda item: max((e["log_evidence"] or 0.0 for e in item["evidence"]), default=0.0)
    )


def _trends(outcome: Outcome, arm: str, tested: Tested) -> Section:
    alarms = [alarm for alarm in outcome.alarms if alarm["arm"] == arm]
    wanted = {place(item) for alarm in alarms for item in alarm["effects"]}
    most = tested.watched.evidence.max(axis=0)
    names, values = [effect_name(*stream.place) for stream in tested.listed], tested.adjusted.values
    chosen: dict[str, int] = {}
    for s in sorted(range(len(most)), key=lambda s: (names[s] not in wanted, -most[s])):
        if np.isfinite(values[:, s]).any():
            chosen.setdefault(names[s], s)
    shown = [(name, values[:, s], tested.watched.evidence[:, s]) for name, s in [*chosen.items()][:_SHOWN]]
    history = tested.history
    logs = [history.logs[k].name for k in history.units.log]
    made = trend_figure(history.units.when, logs, shown, float(tested.watched.limits[-1]), alarms)
    return Section(
        f"Trends of {arm}", [], [Picture(made, Prose("watch")["trend"])], [], [], list(tested.notes)
    )


def _alarm(alarm: dict[str, Any], new: bool) -> Section:
    rows: list[list[object]] = []
    for effect in alarm["effects"]:
        for k, (key, e) in enumerate(effect["parameters"].items()):
            value, error = (np.atleast_1d(e[part]) for part in ("value", "std_error"))
            text = ", ".join(f"{v:.4g} ± {s:.2g}" for v, s in zip(value, error, strict=True))
            rows.append(
                [
                    place(effect) if k == 0 else "",
                    key.replace("_", " "),
                    text,
                    unit(e["unit"]),
                    percent(effect["share"]) if k == 0 else "",
                ]
            )
    headers = ["effect", "parameter", "value ± std. error", "unit", "share"]
    tables = [make_table(headers, rows, None, left=(0, 1, 3))] if rows else []
    say = Prose(
        "watch",
        alarm=alarm,
        new=new,
        since=moment(alarm["since"]),
        found=moment(alarm["when"]),
    )
    paragraphs = [*say.paragraphs("alarm"), *alarm_words(alarm)]
    return Section(f"{alarm['arm']}: {named(alarm)} ({moment(alarm['when'])})", paragraphs, [], tables)
