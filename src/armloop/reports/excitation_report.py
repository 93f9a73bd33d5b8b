"""A page on an exciting reference: what it looks like, and what it is worth beside random ones."""

from __future__ import annotations

from typing import TYPE_CHECKING

from armloop.reports.excitation_tables import measures_table, ratio_words, use_table
from armloop.reports.html import Card, Picture, Report, Section, render
from armloop.reports.plots.excitation import data_figure, reference_figure
from armloop.reports.prose import Prose
from armloop.reports.words import number

if TYPE_CHECKING:
    from armloop.experiment.design import DataRatio, Excitation


def excitation_report(result: Excitation, ratio: DataRatio | None) -> str:
    """One HTML page on a designed reference."""
    say = Prose("excitation", result=result, ratio=ratio and ratio_words(ratio, result))
    shown = [Picture(reference_figure(result), say["reference_figure"])]
    sections = [
        Section("The reference", say.paragraphs("reference"), shown, [use_table(result)], notes=result.notes)
    ]
    random = result.to_dict()["random"]["condition"]
    median, low, high = (number(random[key]) for key in ("median", "low", "high"))
    beside = f"random references: {median} ({low} to {high})"
    cards = [Card(number(result.measure.condition), "Condition number", beside)]
    pictures = []
    if ratio is not None:
        pictures.append(Picture(data_figure(ratio, result), say["data_figure"]))
        median = ratio.to_dict()["median"]
        times = number(median, 2) if median else f"> {int(ratio.trajectories[-1])}"
        cards.append(
            Card(f"{times} ×", "Data saved", "as much data a random reference needs for the same error")
        )
    sections.append(
        Section("Beside random references", say.paragraphs("random"), pictures, [measures_table(result)])
    )
    return render(Report(f"Exciting reference for {result.arm.name}", say["lead"], sections, cards))
