"""Beyond the paper: how often the stated intervals of coefficients cover the truth."""

from __future__ import annotations

from armloop.reports.html import Section
from armloop.reports.tables import make_table
from armloop_paper.context import Context
from armloop_paper.coverage import coverage_study
from armloop_paper.outcome import Outcome


def run(context: Context) -> Outcome:
    """Simulate ten logs per noise draw."""
    study = coverage_study(10 * context.draws, progress=context.progress)
    rows = [
        [covered.disturbance, kind, count, f"{covered.blocks[kind]:.0%}", f"{covered.independent[kind]:.0%}"]
        for covered in study.results
        for kind, count in covered.coefficients.items()
    ]
    text = (
        f"Part of the intervals at {study.nominal:.0%} that cover the true coefficient, {study.simulations} simulated logs "
        "per disturbance: from blocks of samples, and with samples taken as independent, as textbooks have it."
    )
    section = Section(
        "Beyond the paper: intervals that cover",
        [text],
        tables=[
            make_table(["disturbance", "coefficients", "number", "blocks", "independent"], rows, left=(0, 1))
        ],
    )
    return Outcome(
        {"results": None}, {"results": study.to_dict()["results"]}, "beyond", text.split(":")[0], section
    )
