"""The report of a diagnosis: what the model lacked on a run, how sure that is, and what is left."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armloop.diagnosis import Closing, Diagnosis
from armloop.laws.effects.events import ends
from armloop.model import ReconstructedModel
from armloop.reports.diagnosis_tables import compensation_tables, found_tables
from armloop.reports.findings import (
    all_added,
    alternatives,
    at_fault,
    blame,
    findings,
    headline,
    judged_apart,
    nothing_to_supply,
    reasons,
)
from armloop.reports.html import Card, Picture, Report, Section, render
from armloop.reports.plots import (
    feedforward_figure,
    residual_shape_figure,
    residual_time_figure,
    shares_figure,
)
from armloop.reports.prose import Prose
from armloop.reports.residuals import moving_joints
from armloop.reports.tables import formulas
from armloop.reports.words import effect_label, number, percent, unit, with_error

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
    seconds = samples.motion.seconds
    logs, blocks = list(log_names), len(np.unique(diagnosis.evidence.blocks))
    floor, *levels = (
        np.asarray(diagnosis.errors()[key], dtype=float) for key in ("noise_floor", "before", "after")
    )
    before, after = (level / floor for level in levels)
    given = {"logs": logs, "seconds": seconds, "blocks": blocks, "before": before, "after": after}
    say = Prose("diagnosis", diagnosis=diagnosis, **given)
    accused = " ".join(blame(diagnosis))
    verdict = Section(
        "Diagnosis",
        [*say.paragraphs("method"), *findings(diagnosis)],
        [Picture(shares_figure(diagnosis), say["shares"])] if diagnosis.outcome.found else [],
        found_tables(diagnosis),
        notes=[*reasons(diagnosis), *([accused] if accused else []), *alternatives(diagnosis)],
    )
    pictures = [Picture(residual_time_figure(diagnosis), say["time"])]
    if moving_joints(diagnosis):
        pictures.append(Picture(residual_shape_figure(diagnosis), say["shape"]))
    if diagnosis.outcome.found:
        left = residual_shape_figure(diagnosis, what_is_left=True)
        pictures.append(Picture(left, say["left"], "What is left, on its own scale"))
    return [verdict, Section("Residual", say.paragraphs("residual"), pictures)]


def compensation_section(diagnosis: Diagnosis, compensation: Closing) -> Section:
    """What a controller now adds, and the errors on whole runs that were not fitted."""
    changes = bool(compensation.feedforward.largest.any())
    say = Prose(
        "diagnosis",
        compensation=compensation,
        same=[f"{j + 1}" for j in np.flatnonzero(compensation.feedforward.largest == 0)],
        nothing_to_supply=None if changes else nothing_to_supply(all_added(diagnosis)),
    )
    return Section(
        "What it changes",
        say.paragraphs("compensation"),
        [Picture(feedforward_figure(diagnosis, compensation), say["feedforward"])] if changes else [],
        compensation_tables(diagnosis, compensation),
    )


def diagnosis_report(
    diagnosis: Diagnosis,
    model: ReconstructedModel,
    compensation: Closing | None = None,
    jobs: int | None = None,
) -> str:
    """One HTML page on a diagnosis; ``model`` is the model before, without the effects, ``jobs`` as of :func:`render`."""
    found = [one.effect for one in diagnosis.outcome.found]
    say = Prose(
        "diagnosis",
        diagnosis=diagnosis,
        name=diagnosis.model.arm.name,
        sensors_alone=found and all(e.sensor for e in found) and not diagnosis.contacts,
        what=at_fault([type(e) for e in found]),
        model=model,
        found=len(found),
    )
    folded = [("The model as formulas, one per joint", formulas(model))]
    models = Section("The model", say.paragraphs("model"), formulas=folded)
    sections = diagnosis_sections(diagnosis, diagnosis.logs)
    if compensation is not None:
        sections.append(compensation_section(diagnosis, compensation))
    for other in diagnosis.apart:
        sections.append(
            Section(judged_apart(other), findings(other), tables=found_tables(other), notes=reasons(other))
        )
    return render(
        Report(
            f"Diagnosis: {headline(diagnosis)}",
            say["lead"],
            [*sections, models],
            diagnosis_cards(diagnosis),
        ),
        jobs,
    )


def diagnosis_cards(diagnosis: Diagnosis) -> list[Card]:
    """Verdict, size of the effect, error before and after."""
    errors = diagnosis.errors()
    j = strongest_joint(diagnosis)
    u = unit(errors["unit"][j])
    before, after, floor = (errors[key][j] for key in ("before", "after", "noise_floor"))
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
    title = key.replace("_", " ").capitalize()
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
            f"{title} [{unit(estimate.unit)}]" if unit(estimate.unit) else title,
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


def _contact_card(diagnosis: Diagnosis, k: int) -> Card:
    added = diagnosis.contacts[k].added
    start, end = (number(second) for second in ends(added.parameters))
    what = added.parameters["force" if added.effect.joint is None else "torque"]
    size = float(np.linalg.norm(np.asarray(what.value)))
    where = (
        "mean force on the arm"
        if added.effect.joint is None
        else f"mean torque on joint {added.effect.joint}"
    )
    return Card(f"{number(size, 2)} {unit(what.unit)}", f"Event {k + 1}, {start} to {end} s", where, "accent")
