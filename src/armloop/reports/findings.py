"""A diagnosis in sentences, for a terminal and for a report alike."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from armloop.diagnosis.outcomes import goes_with
from armloop.diagnosis.pushes import FEW
from armloop.diagnosis.whereabouts import whereabouts
from armloop.laws.effects.base import number
from armloop.laws.effects.time_delay import TimeDelay
from armloop.laws.effects.torque_gain import TorqueGain
from armloop.reports.prose import Prose
from armloop.reports.words import counted, effect_label, from_to, listed, percent, place, unit
from armloop.reports.words import joints as of_joints

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from armloop.diagnosis import Diagnosis
    from armloop.diagnosis.outcomes import Found, Outcome
    from armloop.laws.effects import Effect
    from armloop.model import AddedEffect

#: Shares that add up to less than this part of what all effects remove are told as parts of a whole.
_MOSTLY = 0.8


def headline(diagnosis: Diagnosis) -> str:
    """The verdict in a few words."""
    found = [effect_label(f.effect) for f in diagnosis.outcome.found]
    if diagnosis.contacts:
        found.append(counted(len(diagnosis.contacts), "event"))
    joints = [law.joint for law in diagnosis.laws]
    if joints:
        found.append(f"unlisted effect, {of_joints(sorted(joints))}")
    return listed(found) or ("cannot tell" if diagnosis.verdict == "cannot_tell" else "no effect")


def findings(diagnosis: Diagnosis) -> list[str]:
    """What was found, a sentence each, strongest first; what to do where a sensor is at fault."""
    outcome, joints = diagnosis.outcome, diagnosis.model.arm.joints
    turned = [] if diagnosis.reversals is None else diagnosis.reversals.found
    values: dict[str, object] = {
        "effects": [(unit(sentence), found, found in turned) for sentence, found in _sentences(outcome)],
        "together": _together(diagnosis),
        "contacts": diagnosis.contacts,
        "events": _events(diagnosis),
        "toolless": _toolless(diagnosis),
        "few_joints": diagnosis.model.arm.n <= FEW,
        "judged": diagnosis.judged,
        "laws": [
            (
                law,
                unit(joints[law.joint - 1].torque_unit),
                whereabouts(diagnosis.evidence, outcome.after, law.joint - 1).words(),
            )
            for law in diagnosis.laws
        ],
        "stated": sum(bool(law.parameters) for law in diagnosis.laws),
        "adopted": diagnosis.adopted,
    }
    return Prose("findings", **values).paragraphs("findings") or [_nothing(diagnosis)]


def _sentences(outcome: Outcome) -> Iterator[tuple[str, Found]]:
    """What was found, a sentence each; one for all of a joint's friction that has grown as a whole."""
    growths, pairs = outcome.growths(), list(zip(outcome.found, outcome.added(), strict=True))
    for k, (found, added) in enumerate(pairs):
        if added.effect.joint is None or found.shape.proportion is None:
            yield added.sentence(), found
        elif not any(goes_with(found, other) for other, _ in pairs[:k]):
            growth = growths[added.effect.joint]
            times = replace(growth, value=1 + number(growth.value)).words()
            parts = [
                f"{effect_label(each.effect).split(',')[0]} by {next(iter(each.parameters.values())).words()}"
                for other, each in pairs
                if goes_with(found, other)
            ]
            yield (
                f"all friction of joint {added.effect.joint} is {times} times what the model has, {listed(parts)}",
                found,
            )


def _together(diagnosis: Diagnosis) -> float | None:
    """What all effects remove of what can be explained, where that is far more than each does beside the others."""
    outcome = diagnosis.outcome
    apart = sum(found.share for found in outcome.found)
    alike = diagnosis.reversals is None and len(outcome.found) > 1 and apart < _MOSTLY * outcome.together
    return outcome.together if alike else None


def judged_apart(diagnosis: Diagnosis) -> str:
    """The heading of what is said of logs in which the arm was not the same."""
    return f"{listed(diagnosis.logs)}, judged apart: {diagnosis.verdict.replace('_', ' ')}"


def _events(diagnosis: Diagnosis) -> str:
    """What all events of a run were, in words."""
    forces = all(contact.added.effect.joint is None for contact in diagnosis.contacts)
    links = any({"link", "point"} & set(contact.added.parameters) for contact in diagnosis.contacts)
    return "events" if not forces else "pushes on the arm" if links else "pushes at the tool"


def _toolless(diagnosis: Diagnosis) -> bool:
    """Whether a force is said to act on the tool of an arm that has no such link: at its last joint, for want of it."""
    effects = [contact.added for contact in diagnosis.contacts]
    on_tool = any(
        e.effect.name == "external_contact" and not {"link", "point"} & set(e.parameters) for e in effects
    )
    return on_tool and np.array_equal(diagnosis.model.arm.X_tool, np.eye(4))


def _nothing(diagnosis: Diagnosis) -> str:
    """What can be said where nothing was found, with its number."""
    if not diagnosis.evidence.rows.any():
        return Prose("findings", moves=False)["nothing"]
    errors = diagnosis.errors()
    ratio = np.asarray(errors["before"], dtype=float) / np.asarray(errors["noise_floor"], dtype=float)
    known = np.isfinite(ratio)
    most = float(ratio[known].max(initial=0.0))
    judged = [] if known.all() else [str(j + 1) for j in np.flatnonzero(known)]
    return Prose("findings", moves=True, most=most, judged=judged, verdict=diagnosis.verdict)["nothing"]


def reasons(diagnosis: Diagnosis) -> list[str]:
    """What a reader must know before relying on the verdict, as sentences."""
    return [f"{words[:1].upper()}{words[1:]}." for words in diagnosis.reasons]


def blame(diagnosis: Diagnosis) -> list[str]:
    """Where sensors are at fault: that it is they and not the arm, what that means, and what to do; else nothing."""
    added = diagnosis.outcome.added()
    faulty = [a for a in added if a.effect.sensor]
    if not faulty:
        return []
    who = listed([effect_label(a.effect) for a in faulty])
    say = Prose(
        "findings",
        who=who[:1].upper() + who[1:],
        what=at_fault([type(a.effect) for a in faulty]),
        arm=[effect_label(a.effect) for a in added if not a.effect.sensor],
        remedies=[a.remedy() for a in faulty],
    )
    return say.paragraphs("blame")


def at_fault(kinds: Sequence[type[Effect]]) -> str:
    """What is at fault where effects of these kinds are no matter of the arm."""
    if {*kinds} == {TimeDelay}:
        return "recording"
    return (
        "sensor" if TorqueGain not in kinds else "sensor, or the motor where the log holds what it was told,"
    )


def confounded(diagnosis: Diagnosis) -> list[tuple[str, list[tuple[str, str]]]]:
    """For each effect found: what this motion cannot tell from it, with its share, and why and what could.

    Events of one kind with the same alternatives stand together, by their numbers in the table of events.
    """
    alike: dict[object, list[tuple[int, dict[str, Any]]]] = {}
    before = len(diagnosis.outcome.found)
    for k, found in enumerate(diagnosis.to_dict()["effects"]):
        number = k - before + 1 if before <= k < before + len(diagnosis.contacts) else 0
        others = tuple((place(r), r["why"]) for r in found["alternatives"])
        if others:
            alike.setdefault((place(found), others), []).append((number, found))
    return [
        (
            place(each[0][1]) + _numbered([number for number, _ in each if number]),
            [
                (
                    f"{place(r)} ({from_to([one['alternatives'][i]['share'] for _, one in each], percent)})",
                    str(r["why"]),
                )
                for i, r in enumerate(each[0][1]["alternatives"])
            ],
        )
        for each in alike.values()
    ]


def _numbered(events: list[int]) -> str:
    """Events by their numbers, in brackets; nothing of what is no event."""
    return f" (event{'s' * (len(events) > 1)} {listed([str(k) for k in events])})" if events else ""


def alternatives(diagnosis: Diagnosis) -> list[str]:
    """The same as sentences of their own."""
    return [
        f"Not told apart from {found}: {other}. {why[:1].upper()}{why[1:]}."
        for found, alike in confounded(diagnosis)
        for other, why in alike
    ]


def all_added(diagnosis: Diagnosis) -> list[AddedEffect]:
    """Effects and events found, as they join the model."""
    return [*diagnosis.outcome.added(), *(contact.added for contact in diagnosis.contacts)]


def nothing_to_supply(added: list[AddedEffect]) -> str:
    """Why a controller with the augmented model does what it did before."""
    reasons = list(dict.fromkeys(_why_not(a) for a in added)) or ["the model is what it was"]
    return f"The controller adds nothing: {'; '.join(reasons)}."


def _why_not(added: AddedEffect) -> str:
    if added.effect.sensor:
        if isinstance(added.effect, TorqueGain):
            return "a gain of the sensor is no torque that the arm needs, and one of the motor is to be mended there"
        return "a sensor's fault is no torque that the arm needs"
    if added.effect.event:
        return "what pushed the arm, was carried, or came and went, was an event of this run"
    if added.effect.of_time:
        return "friction that fades is gone once the joint is warm"
    return f"{effect_label(added.effect)} asks for none along this motion"
