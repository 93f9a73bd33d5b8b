"""The report of a diagnosis: what the model lacked on a run, how sure that is, and what is left."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armloop.diagnosis import Closing, Diagnosis
from armloop.model import ReconstructedModel
from armloop.reports.diagnosis_tables import (
    effects_table,
    errors_table,
    events_table,
    feedforward_table,
    held_out_table,
)
from armloop.reports.findings import alternatives, blame, findings, headline, nothing_to_supply, reasons
from armloop.reports.html import Card, Picture, Report, Section, render
from armloop.reports.plots import (
    feedforward_figure,
    residual_shape_figure,
    residual_time_figure,
    shares_figure,
)
from armloop.reports.residuals import moving_joints
from armloop.reports.tables import formulas
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
    "The same residual against position, velocity and load, where its law shows as the mean line, and its "
    "spectrum, where what comes back shows as a peak. The load is the torque that passes the joint, friction "
    "apart. The grey band is the baseline's level."
)
_LEFT = "What the effects leave, on a scale of its own: a law that shows here is one that was not found."
_ADDS = (
    "The feedforward with the augmented model minus the feedforward with the model before, along the run's "
    "motion. A sensor's fault and a contact are not in it: no controller should supply them."
)
#: Events that have a card of their own.
_MOST_EVENTS = 6


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
    accused = " ".join(blame(diagnosis))
    tables = [effects_table(diagnosis)] if diagnosis.outcome.found or diagnosis.unlisted is not None else []
    tables += [events_table(diagnosis)] if diagnosis.contacts else []
    verdict = Section(
        "Diagnosis",
        [intro, *findings(diagnosis)],
        [Picture(shares_figure(diagnosis), _SHARES)] if diagnosis.outcome.found else [],
        [*tables, errors_table(diagnosis)],
        notes=[*reasons(diagnosis), *([accused] if accused else []), *alternatives(diagnosis)],
    )
    pictures = [Picture(residual_time_figure(diagnosis), _TIME)]
    if moving_joints(diagnosis):
        pictures.append(Picture(residual_shape_figure(diagnosis), _SHAPE))
    if diagnosis.outcome.found:
        left = residual_shape_figure(diagnosis, what_is_left=True)
        pictures.append(Picture(left, _LEFT, "What is left, on its own scale"))
    return [verdict, Section("Residual", [_residual_words(diagnosis)], pictures)]


def closing_section(diagnosis: Diagnosis, closing: Closing) -> Section:
    """What a controller now adds, and the errors on whole runs that were not fitted."""
    arm, changes = diagnosis.model.arm, bool(closing.feedforward.largest.any())
    added = [*diagnosis.outcome.added(), *(contact.added for contact in diagnosis.contacts)]
    if changes:
        same = [f"{j + 1}" for j in np.flatnonzero(closing.feedforward.largest == 0)]
        text = ["With the augmented model as feedforward a controller supplies this in addition."]
        if same:
            text[0] += f" At {'joint' if len(same) == 1 else 'joints'} {listed(same)} nothing changes."
    else:
        text = [nothing_to_supply(added)]
    if closing.held_out:
        text.append(
            f"Beside the blocks held out of the run, {counted(len(closing.held_out), 'whole run')} that no effect was "
            "fitted to went through both models."
        )
    return Section(
        "What it changes",
        text,
        [Picture(feedforward_figure(diagnosis, closing), _ADDS)] if changes else [],
        [
            *([feedforward_table(diagnosis, closing)] if changes else []),
            *([held_out_table(closing, arm)] if closing.held_out else []),
        ],
    )


def diagnosis_report(
    diagnosis: Diagnosis,
    model: ReconstructedModel,
    log_names: Sequence[str],
    closing: Closing | None = None,
) -> str:
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
    sections = diagnosis_sections(diagnosis, log_names)
    if closing is not None:
        sections.append(closing_section(diagnosis, closing))
    return render(
        Report(
            f"Diagnosis: {headline(diagnosis)}",
            _lead(diagnosis),
            [*sections, models],
            diagnosis_cards(diagnosis),
        )
    )


def _lead(diagnosis: Diagnosis) -> str:
    name = diagnosis.model.arm.name
    if diagnosis.verdict == "cannot_tell":
        return f"A run of {name} by which this model cannot tell whether anything has changed."
    if diagnosis.verdict == "no_effect":
        return f"A run of {name} that the model explains as well as its own baseline data."
    if diagnosis.verdict == "unlisted_effect":
        return f"A run of {name} that neither the model nor any listed effect explains."
    found = [f.effect for f in diagnosis.outcome.found]
    if found and all(effect.sensor for effect in found) and not diagnosis.contacts:
        return f"A run of {name} that the model could not explain: the sensor is at fault, not the arm."
    return f"A run of {name} that the model could not explain, and what it takes to explain it."


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
        count = len(diagnosis.contacts)
        shown = count if count <= _MOST_EVENTS else _MOST_EVENTS - 1
        cards = [_contact_card(diagnosis, k) for k in range(shown)]
        if shown < count:
            cards.append(Card(f"{count - shown} more", "Further events", "in the table below"))
        return cards
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
            with_error(estimate.value, estimate.std_error),
            _with_unit(key.replace("_", " ").capitalize(), unit(estimate.unit)),
            "± standard error",
        ),
        Card(
            f"{number(before)} → {number(after)}",
            f"Held-out RMSE, joint {j + 1} [{u}]",
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


def _with_unit(title: str, of: str) -> str:
    return f"{title} [{of}]" if of else title


def _contact_card(diagnosis: Diagnosis, k: int) -> Card:
    added = diagnosis.contacts[k].added
    start, end = (number(float(np.asarray(added.parameters[key].value))) for key in ("start", "end"))
    what = added.parameters["force" if added.effect.joint is None else "torque"]
    size = float(np.linalg.norm(np.asarray(what.value)))
    where = (
        "mean force on the arm"
        if added.effect.joint is None
        else f"mean torque on joint {added.effect.joint}"
    )
    return Card(f"{number(size, 2)} {unit(what.unit)}", f"Event {k + 1}, {start} to {end} s", where, "accent")


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
