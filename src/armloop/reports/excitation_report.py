"""A page on an exciting reference: what it looks like, and what it is worth beside random ones."""

from __future__ import annotations

from typing import TYPE_CHECKING

from armloop.reports.excitation_tables import measures_table, ratio_words, use_table
from armloop.reports.html import Card, Picture, Report, Section, render
from armloop.reports.plots.excitation import data_figure, reference_figure
from armloop.reports.words import number

if TYPE_CHECKING:
    from armloop.experiment.design import DataRatio, Excitation

_REFERENCE = (
    "One period, each quantity in parts of its limit (dashed). The motion starts and ends at rest, so that it can be "
    "repeated and averaged. The torque is predicted; part of the effort is kept in reserve for what is not."
)
_DATA = (
    "Root mean square error of the coefficients, in units in which each column has the size of the torque noise on typical "
    "motion. The dashed line is the error after one optimised period."
)


def excitation_report(result: Excitation, ratio: DataRatio | None) -> str:
    """One HTML page on a designed reference."""
    settings, timing = result.settings, result.timing
    text = [
        f"The reference was chosen among Fourier series of {timing.harmonics} harmonics of {number(1 / timing.period)} Hz, "
        f"within the ranges of position, velocity, acceleration and torque of {result.arm.name}, so that a regression of "
        f"the library {settings.library} determines its {result.regression.count} coefficients well (criterion "
        f"{settings.criterion}). Columns are scaled by their size on random motions, so that units do not matter.",
    ]
    sections = [
        Section(
            "The reference",
            text,
            [Picture(reference_figure(result), _REFERENCE)],
            [use_table(result)],
            notes=result.notes,
        ),
    ]
    cards = [Card(number(result.measure.condition), "Condition number", _beside(result))]
    worth, pictures = ["Random references fill the same limits."], []
    if ratio is not None:
        worth.append(
            ratio_words(ratio, result)
            + ". Torques were simulated with white noise at the level of each joint."
        )
        pictures.append(Picture(data_figure(ratio, result), _DATA))
        median = ratio.to_dict()["median"]
        shown = number(median, 2) if median else f"> {int(ratio.trajectories[-1])}"
        cards.append(
            Card(f"{shown} ×", "Data saved", "as much data a random reference needs for the same error")
        )
    sections.append(Section("Beside random references", worth, pictures, [measures_table(result)]))
    lead = "A motion that makes the arm show its dynamics."
    return render(Report(f"Exciting reference for {result.arm.name}", lead, sections, cards))


def _beside(result: Excitation) -> str:
    random = result.to_dict()["random"]["condition"]
    return (
        f"random references: {number(random['median'])} ({number(random['low'])} to {number(random['high'])})"
    )
