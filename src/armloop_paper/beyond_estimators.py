"""Beyond the paper: which terms every estimator keeps under noise, against the oracle."""

from __future__ import annotations

from dataclasses import asdict

from armloop.reports.html import Section
from armloop_paper.context import Context
from armloop_paper.estimators import estimators_table, study
from armloop_paper.outcome import Outcome, beyond


def run(context: Context) -> Outcome:
    """Run the study on so many draws."""
    rows = study(context.draws, context.progress, jobs=context.processes)
    text = (
        "Active terms, false and missed ones, and the error outside the range over that of least squares on the true "
        f"terms (the oracle); {context.draws} draws of states and noise. The paper uses plain Lasso."
    )
    section = Section("Beyond the paper: estimators under noise", [text], tables=[estimators_table(rows)])
    return beyond({"rows": [asdict(row) for row in rows]}, f"{len(rows)} rows", section)
