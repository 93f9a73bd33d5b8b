"""A diagnosis in sentences, for a terminal and for a report alike."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from armloop.diagnosis.remedies import remedy
from armloop.diagnosis.whereabouts import whereabouts
from armloop.reports.words import counted, effect_label, effect_name, listed, number, percent, unit

if TYPE_CHECKING:
    from armloop.diagnosis import Diagnosis
    from armloop.model import AddedEffect


def headline(diagnosis: Diagnosis) -> str:
    """The verdict in a few words."""
    found = [effect_label(f.effect) for f in diagnosis.outcome.found]
    if diagnosis.contacts:
        found.append(counted(len(diagnosis.contacts), "event"))
    if diagnosis.unlisted is not None:
        found.append(f"unlisted effect, joint {diagnosis.unlisted.joint}")
    return listed(found) or ("cannot tell" if diagnosis.verdict == "cannot_tell" else "no effect")


def findings(diagnosis: Diagnosis) -> list[str]:
    """What was found, a sentence each, strongest first; what to do where a sensor is at fault."""
    sentences = [
        f"Found: {unit(added.effect.sentence(added.parameters))}. It removes {percent(found.share)} of what can be "
        "explained."
        for found, added in zip(diagnosis.outcome.found, diagnosis.outcome.added(), strict=True)
    ]
    if len(diagnosis.contacts) == 1:
        (contact,) = diagnosis.contacts
        sentences.append(
            f"Found: {contact.added.effect.sentence(contact.added.parameters)}. It explains "
            f"{percent(contact.share)} of the burst; its samples are kept out of everything else."
        )
    elif diagnosis.contacts:
        sentences.append(
            f"Found: {len(diagnosis.contacts)} {_events(diagnosis)}, listed below; their samples are kept out of "
            "everything else."
        )
    if diagnosis.contacts and not diagnosis.judged:
        sentences.append("Apart from that the joints hardly move: nothing else could be looked for.")
    unlisted = diagnosis.unlisted
    if unlisted is not None:
        u = unit(diagnosis.model.arm.joints[unlisted.joint - 1].torque_unit)
        where = whereabouts(diagnosis.evidence, diagnosis.outcome.after, unlisted.joint - 1)
        law = (
            f"follows {unlisted.form}, which would leave {number(unlisted.rmse_with_form)} {u}"
            if unlisted.form
            else "follows no law that both halves of the run agree on"
        )
        sentences.append(
            f"Joint {unlisted.joint} keeps a residual of {number(unlisted.rmse)} {u} (baseline "
            f"{number(unlisted.baseline)} {u}) that no listed effect accounts for; it {law}; "
            f"{unit(where.words())}."
        )
        if diagnosis.adopted:
            sentences.append(
                "The law is adopted: the augmented model and its feedforward have it where the run has been, and it fades "
                "outside of that."
            )
        elif unlisted.parameters:
            sentences.append("--adopt puts the law into the augmented model and its feedforward.")
    return sentences or [_nothing(diagnosis)]


def _events(diagnosis: Diagnosis) -> str:
    """What all events of a run were, in words."""
    forces = all(contact.added.effect.joint is None for contact in diagnosis.contacts)
    links = any("link" in contact.added.parameters for contact in diagnosis.contacts)
    return "events" if not forces else "pushes on the arm" if links else "pushes at the tool"


def _nothing(diagnosis: Diagnosis) -> str:
    """What can be said where nothing was found, with its number."""
    if not diagnosis.evidence.rows.any():
        return "Nothing can be said of this run: no joint moves in it long enough."
    errors = diagnosis.errors()
    ratio = np.asarray(errors["before"], dtype=float) / np.asarray(errors["noise_floor"], dtype=float)
    most = float(np.nanmax(ratio)) if np.isfinite(ratio).any() else 0.0
    size = f"At its largest the residual is {number(most, 2)} times the baseline"
    if diagnosis.verdict == "cannot_tell":
        return (
            f"{size}; whether the arm has changed this model cannot tell by this run, for the reasons given."
        )
    return f"{size}, and no listed effect nor a law accounts for more of it than for the model's own shortcomings."


def reasons(diagnosis: Diagnosis) -> list[str]:
    """What a reader must know before relying on the verdict, as sentences."""
    return [f"{words[:1].upper()}{words[1:]}." for words in diagnosis.reasons]


def blame(diagnosis: Diagnosis) -> list[str]:
    """Where sensors are at fault: that it is they and not the arm, what that means, and what to do; else nothing."""
    added = diagnosis.outcome.added()
    faulty = [a for a in added if a.effect.sensor]
    if not faulty:
        return []
    arm = [effect_label(a.effect) for a in added if not a.effect.sensor]
    what = "recording" if all(a.effect.name == "time_delay" for a in faulty) else "sensor"
    who = f"{listed([effect_label(a.effect) for a in faulty])}: the {what} is at fault, not the arm."
    apart = (
        " The augmented model keeps this apart from the dynamics: it predicts what is recorded, and its "
        "feedforward, inertia and gravity are those of the arm"
    )
    apart += f" with {listed(arm)}." if arm else ", unchanged."
    return [who[:1].upper() + who[1:] + apart, *(f"{unit(remedy(a))}." for a in faulty)]


def rivals(diagnosis: Diagnosis) -> list[tuple[str, list[tuple[str, str]]]]:
    """For each effect found: what this motion cannot tell from it, with its share, and why and which motion could."""
    return [
        (
            _label(effect),
            [(f"{_label(r)} ({percent(r['share'])})", str(r["why"])) for r in effect["alternatives"]],
        )
        for effect in diagnosis.to_dict()["effects"]
        if effect["alternatives"]
    ]


def alternatives(diagnosis: Diagnosis) -> list[str]:
    """The same as sentences of their own."""
    return [
        f"Not told apart from {found}: {rival}. {why[:1].upper()}{why[1:]}."
        for found, alike in rivals(diagnosis)
        for rival, why in alike
    ]


def nothing_to_supply(added: list[AddedEffect]) -> str:
    """Why a controller with the augmented model does what it did before."""
    reasons = list(dict.fromkeys(_why_not(a) for a in added)) or ["the model is what it was"]
    return f"The controller adds nothing: {'; '.join(reasons)}."


def _why_not(added: AddedEffect) -> str:
    if added.effect.sensor:
        return "a sensor's fault is no torque that the arm needs"
    if added.effect.event:
        return "what pushed the arm was an event of this run"
    if added.effect.name == "friction_drift":
        return "friction that fades is gone once the joint is warm"
    return f"{effect_label(added.effect)} asks for none along this motion"


def _label(effect: dict[str, object]) -> str:
    joint, other = effect.get("joint"), effect.get("other_joint")
    return effect_name(
        str(effect["effect"]),
        joint if isinstance(joint, int) else None,
        other if isinstance(other, int) else None,
    )
