"""Sections and a page on how a model came about and how well it predicts."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

import numpy as np

from armloop.data.blocks import stretch
from armloop.data.log import MotionLog
from armloop.data.motion import Samples
from armloop.data.regimes import Clusters, sort_samples
from armloop.data.signals import as_torque, preprocess
from armloop.identification.goodness import unjudged
from armloop.identification.reconstruction import Reconstruction
from armloop.reports.coefficients import NOTE, coefficients_table, stribeck_table
from armloop.reports.html import Card, Picture, Report, Section, render
from armloop.reports.plots import (
    clusters_figure,
    friction_figure,
    has_trials,
    ladder_figure,
    orders_figure,
    torque_figure,
)
from armloop.reports.prose import Prose
from armloop.reports.residuals import longest_run
from armloop.reports.tables import (
    Table,
    compared,
    formulas,
    libraries_table,
    make_table,
    mean_nrmse,
    parts_table,
    score_table,
    steps_table,
)
from armloop.reports.words import percent


def conditions_section(clusters: Clusters) -> Section:
    """How the samples were sorted into the three working conditions."""
    say = Prose("reconstruction")
    return Section(
        "Sorting the samples",
        say.paragraphs("conditions"),
        [Picture(clusters_figure(clusters), say["clusters"])],
    )


def reconstruction_report(reconstruction: Reconstruction, logs: Sequence[MotionLog]) -> str:
    """One HTML page on a reconstruction from these logs."""
    model = reconstruction.model
    samples = preprocess(logs, model.conditioning)
    run = longest_run(samples.motion)
    sections = reconstruction_sections(reconstruction, stretch(samples, run.start, run.stop))
    if reconstruction.reports[0].orders is not None:
        sections.insert(0, conditions_section(sort_samples(as_torque(samples).motion)))
    error = percent(mean_nrmse(reconstruction.held_out))
    lead = Prose("reconstruction", warnings=reconstruction.warnings)["lead"]
    cards = [Card(error, "Prediction error", "nRMSE on data that no step has seen, mean of the joints")]
    cards += _parts_card(reconstruction)
    return render(Report(f"Reconstruction of {model.arm.name}", lead, sections, cards))


def _parts_card(reconstruction: Reconstruction) -> list[Card]:
    """The joint of which most is left that could be predicted."""
    known = [one for one in reconstruction.parts if one.predictable_left is not None]
    if not known:
        return []
    worst = max(known, key=lambda one: one.predictable_left or 0.0)
    text = f"of the energy of the torque of joint {worst.joint}, the joint with most of it"
    tone = "bad" if reconstruction.warnings else "good"
    return [Card(percent(worst.predictable_left), "Predictable, not explained", text, tone)]


def reconstruction_sections(
    reconstruction: Reconstruction,
    samples: Samples | None = None,
    reference: Reconstruction | None = None,
) -> list[Section]:
    """How the model was reconstructed, what it says, and how well it predicts.

    Args:
        samples: motion to show measured and predicted torque on, conditioned like the model's logs.
        reference: the one-shot reconstruction of the same data, to be compared with.
    """
    model, history = reconstruction.model, reconstruction.model.history
    error = mean_nrmse(reconstruction.held_out)
    other = None if reference is None else mean_nrmse(reference.held_out)
    say = Prose(
        "reconstruction",
        warnings=reconstruction.warnings if reconstruction.parts else [],
        history=history,
        held_out=reconstruction.held_out,
        parts=reconstruction.parts,
        error=error,
        reference=other,
        factor=_factor(error, other),
    )
    pictures = []
    if has_trials(reconstruction.reports):
        trials = orders_figure(reconstruction.reports, reference.reports if reference else ())
        pictures.append(Picture(trials, say["orders"]))
    notes = [*unjudged(reconstruction.parts), *reconstruction.notes]
    if ladder := history.get("friction_ladder"):
        # the notes say the same in a line each, for the terminal
        notes = [
            note for note in notes if not any(note.startswith(f"friction, {r['rung']}:") for r in ladder)
        ]
        pictures.append(Picture(ladder_figure(ladder), say["ladder"]))
    if samples is not None:
        pictures.append(Picture(torque_figure(model, samples), say["torque"]))
        pictures.append(Picture(friction_figure(model, samples), say["friction"]))
    judged = score_table(
        reconstruction.held_out, model.arm, "Prediction error on held-out blocks", model.torque_units
    )
    tables = [steps_table(reconstruction.reports), judged]
    if compared(reconstruction.libraries):
        tables.insert(0, libraries_table(reconstruction.libraries))
    if reconstruction.parts:
        tables.append(parts_table(reconstruction.parts, model.arm))
    if reference is not None:
        tables.append(comparison(reconstruction, reference))
    folded = [("The model as formulas, one per joint", formulas(model))]
    if (stribeck := stribeck_table(model)) is not None:
        tables.append(stribeck)
    if (coefficients := coefficients_table(model, None)) is not None:
        folded.append(("Coefficients with standard errors", f"{coefficients}\n\n{textwrap.fill(NOTE, 110)}"))
    if legend := model.legend():
        folded.append(("What the symbols stand for", "\n".join(legend)))
    return [Section("Reconstruction", say.paragraphs("text"), pictures, tables, folded, notes)]


def comparison(ours: Reconstruction, reference: Reconstruction) -> Table:
    """Held-out nRMSE per joint and number of terms of the model and of the one-shot reference method."""
    rows = []
    for name, made in (("stepwise", ours), ("one-shot SINDy", reference)):
        errors = [percent(x) for x in made.held_out.moving["nrmse"]]
        terms = np.sum([report.terms for report in made.reports], axis=0)
        rows.append([name, *errors, " / ".join(map(str, terms))])
    headers = ["method", *(f"joint {j + 1}" for j in range(ours.model.arm.n)), "terms per joint"]
    return make_table(headers, rows, "Held-out nRMSE of moving samples, same data")


def _factor(error: float, other: float | None) -> float | None:
    """How many times larger the larger of two errors is; None where that cannot be said."""
    if other is None or not np.isfinite(error + other) or min(error, other) <= 0:
        return None
    return max(error, other) / min(error, other)
