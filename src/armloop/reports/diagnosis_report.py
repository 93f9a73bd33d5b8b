"""The report of a diagnosis: what the model lacked on a run, how sure that is, and what is left."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armloop.diagnosis import Diagnosis
from armloop.model import ReconstructedModel
from armloop.reports.html import Card, Picture, Report, Section, render
from armloop.reports.plots import residual_shape_figure, residual_time_figure, shares_figure
from armloop.reports.tables import effects_table, errors_table, formulas
from armloop.reports.words import counted, effect_label, listed, number, numbers, percent, unit, with_error

_SHARES = (
    "How much of the residual energy above the model's own baseline each effect removes on blocks it was "
    "not fitted to. Thin bars are effects that this motion cannot tell from the one found."
)
_TIME = (
    "The residual, measured minus predicted torque, while the joint slides. Each value comes from "
    "parameters fitted on other blocks. The grey band is what the model leaves on its own baseline data: a "
    "residual inside it means nothing."
)
_SHAPE = (
    "The same residual against position and velocity, where its law shows as the mean line, and its "
    "spectrum, where a ripple shows as a peak. The grey band is the baseline's level."
)


def headline(diagnosis: Diagnosis) -> str:
    """The verdict in a few words."""
    found = [effect_label(f.effect) for f in diagnosis.outcome.found]
    if diagnosis.contacts:
        found.append(counted(len(diagnosis.contacts), "external contact"))
    if found:
        return listed(found)
    return (
        "no effect"
        if diagnosis.verdict == "no_effect"
        else f"unlisted effect, joint {_unlisted_joint(diagnosis)}"
    )


def strongest_joint(diagnosis: Diagnosis) -> int:
    """The joint (0-based) whose residual exceeds its baseline most."""
    errors = diagnosis.errors()
    ratio = np.asarray(errors["before"]) / np.asarray(errors["noise_floor"])
    return 0 if np.isnan(ratio).all() else int(np.nanargmax(ratio))


def diagnosis_sections(diagnosis: Diagnosis, log_names: Sequence[str]) -> list[Section]:
    """Verdict and evidence, residuals, and what cannot be told apart."""
    samples = diagnosis.samples
    seconds = sum(float(np.ptp(samples.motion.time[run])) for run in samples.motion.runs())
    intro = (
        f"The model predicted the torque of {listed(list(log_names))} ({number(seconds)} s of motion, "
        f"{counted(len(np.unique(diagnosis.evidence.blocks)), 'block')}). What is left was compared with "
        "what the model leaves on its own baseline data, and every listed effect at every joint was tried "
        "on blocks of data it had not been fitted to; of equals, the simplest stands."
    )
    text = [intro, *(_capital(sentence) for sentence in _findings(diagnosis))]
    verdict = Section(
        "Diagnosis",
        text,
        [Picture(shares_figure(diagnosis), _SHARES)] if diagnosis.outcome.found else [],
        [*([effects_table(diagnosis)] if diagnosis.verdict != "no_effect" else []), errors_table(diagnosis)],
        notes=_alternatives(diagnosis),
    )
    residual = Section(
        "Residual",
        [_residual_words(diagnosis)],
        [
            Picture(residual_time_figure(diagnosis), _TIME),
            Picture(residual_shape_figure(diagnosis), _SHAPE),
        ],
    )
    return [verdict, residual]


def diagnosis_report(diagnosis: Diagnosis, model: ReconstructedModel, log_names: Sequence[str]) -> str:
    """One HTML page on a diagnosis; ``model`` is the model before, without the effects."""
    count = len(diagnosis.outcome.found)
    text = [
        f"The model of {model.arm.name} was made with the method {model.history.get('method', 'unknown')} "
        f"from {counted(len(model.history.get('logs', [])), 'log')}."
    ]
    if count:
        text.append(
            f"The augmented model adds {counted(count, 'effect')} to it and goes wherever a model goes: "
            "prediction, evaluation and feedforward control."
        )
    models = Section("The model", text, formulas=[("The model as formulas, one per joint", formulas(model))])
    lead = (
        f"A run of {model.arm.name} that the model could not explain, and what it takes to explain it."
        if diagnosis.verdict != "no_effect"
        else f"A run of {model.arm.name} that the model explains as well as its own baseline data."
    )
    return render(
        Report(
            f"Diagnosis: {headline(diagnosis)}",
            lead,
            [*diagnosis_sections(diagnosis, log_names), models],
            diagnosis_cards(diagnosis),
        )
    )


def diagnosis_cards(diagnosis: Diagnosis) -> list[Card]:
    """Verdict, size of the effect, error before and after."""
    errors = diagnosis.errors()
    j = strongest_joint(diagnosis)
    u, before, after, floor = (
        unit(errors["unit"][j]),
        errors["before"][j],
        errors["after"][j],
        errors["noise_floor"][j],
    )
    found = diagnosis.outcome.found
    if not found and diagnosis.contacts:
        return [_contact_card(diagnosis, k) for k in range(min(4, len(diagnosis.contacts)))]
    if not found:
        tone = "good" if diagnosis.verdict == "no_effect" else "bad"
        return [
            Card(
                headline(diagnosis), "Verdict", "judged on blocks of data, against the model's baseline", tone
            ),
            Card(
                f"{number(before / floor, 2)} ×",
                "Residual over baseline",
                f"joint {j + 1}: {number(before)} against {number(floor)} {u}",
            ),
        ]
    added = diagnosis.outcome.added()[0]
    key, estimate = next(iter(added.parameters.items()))
    relative = errors["nrmse"]
    return [
        Card(
            effect_label(found[0].effect),
            "Strongest effect found",
            f"removes {percent(found[0].share)} of the explainable residual",
            "accent",
        ),
        Card(
            f"{with_error(estimate.value, estimate.std_error)} {unit(estimate.unit)}",
            key.replace("_", " ").capitalize(),
        ),
        Card(
            f"{number(before)} → {number(after)} {u}",
            f"Held-out RMSE, joint {j + 1}",
            f"the model's own baseline: {number(floor)} {u}",
            "good",
        ),
        Card(
            f"{percent(float(np.nanmean(relative['before'])))} → {percent(float(np.nanmean(relative['after'])))}",
            "Held-out nRMSE",
            "mean of the joints, moving samples",
            "good",
        ),
    ]


def _contact_card(diagnosis: Diagnosis, k: int) -> Card:
    contact = diagnosis.contacts[k]
    start, end, force = (contact.added.parameters[key].value for key in ("start", "end", "force"))
    size = float(np.linalg.norm(np.asarray(force)))
    when = f"{number(float(np.asarray(start)))} to {number(float(np.asarray(end)))} s"
    return Card(f"{number(size, 2)} N", f"Contact {k + 1}, {when}", "mean force on the tool", "accent")


def _findings(diagnosis: Diagnosis) -> list[str]:
    sentences = [
        f"Found: {added.effect.sentence(added.parameters)}. It removes {percent(found.share)} of what can be "
        "explained."
        for found, added in zip(diagnosis.outcome.found, diagnosis.outcome.added(), strict=True)
    ]
    sentences += [
        f"Found: {contact.added.effect.sentence(contact.added.parameters)}. The force explains "
        f"{percent(contact.share)} of the burst; its samples are kept out of everything else."
        for contact in diagnosis.contacts
    ]
    unlisted = diagnosis.unlisted
    if unlisted is not None:
        u = unit(diagnosis.model.arm.joints[unlisted.joint - 1].torque_unit)
        law = (
            f"follows {unlisted.form}"
            if unlisted.form
            else "follows no law that both halves of the run agree on"
        )
        sentences.append(
            f"Joint {unlisted.joint} keeps a residual of {number(unlisted.rmse)} {u} (baseline "
            f"{number(unlisted.baseline)} {u}) that no listed effect accounts for; it {law}."
        )
    return sentences or [
        "The residual is that of the baseline: the model lacks nothing that this run could show."
    ]


def _alternatives(diagnosis: Diagnosis) -> list[str]:
    notes = []
    for effect in diagnosis.to_dict()["effects"]:
        for rival in effect["alternatives"]:
            name = rival["effect"].replace("_", " ") + (
                f" at joint {rival['joint']}" if rival["joint"] else ""
            )
            notes.append(f"Not told apart: {name} ({percent(rival['share'])}). {_capital(rival['why'])}.")
    return notes


def _residual_words(diagnosis: Diagnosis) -> str:
    errors = diagnosis.errors()
    floor = np.asarray(errors["noise_floor"])
    before, after = np.asarray(errors["before"]) / floor, np.asarray(errors["after"]) / floor
    if not diagnosis.evidence.rows.any():
        return "No joint moved long enough to judge anything but the contacts."
    if not diagnosis.outcome.found:
        return f"The residual is {numbers(before, 2)} times the baseline's, joint by joint."
    return (
        f"Before, the residual was {numbers(before, 2)} times the baseline's, joint by joint; with the "
        f"effects added it is {numbers(after, 2)} times. One means that the model explains this run as well "
        "as its own training data."
    )


def _unlisted_joint(diagnosis: Diagnosis) -> int:
    assert diagnosis.unlisted is not None
    return diagnosis.unlisted.joint


def _capital(sentence: str) -> str:
    return sentence[:1].upper() + sentence[1:]
