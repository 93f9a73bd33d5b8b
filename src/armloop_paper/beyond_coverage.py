"""Beyond the paper: how often the stated intervals of coefficients cover the truth."""

from __future__ import annotations

from dataclasses import asdict

from armloop.reports.html import Section
from armloop.reports.tables import make_table
from armloop_paper.context import Context
from armloop_paper.coverage import NOMINAL, coverage_study
from armloop_paper.outcome import Outcome, beyond


def run(context: Context) -> Outcome:
    """Simulate ten logs per noise draw."""
    simulations = 10 * context.draws
    found = coverage_study(simulations, progress=context.progress)
    rows = [
        [covered.disturbance, kind, count, f"{covered.blocks[kind]:.0%}", f"{covered.independent[kind]:.0%}"]
        for covered in found
        for kind, count in covered.coefficients.items()
    ]
    headline = (
        f"Part of the intervals at {NOMINAL:.0%} that cover the true coefficient, {simulations} simulated logs per "
        "disturbance"
    )
    text = f"{headline}: from blocks of samples, and with samples taken as independent, as textbooks have it."
    table = make_table(["disturbance", "coefficients", "number", "blocks", "independent"], rows, left=(0, 1))
    section = Section("Beyond the paper: intervals that cover", [text], tables=[table])
    return beyond({"results": [asdict(covered) for covered in found]}, headline, section)
