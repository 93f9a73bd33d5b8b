"""What each estimator makes of noise in q, v and v̇: terms, false and missed ones, and the error outside the range.

The cases are those of Sects. 4.1 and 4.2 of the paper, and Case III once more with joint 2 of the three-axis arm
free to turn within ±90° instead of ±60°. The default chooses its own orders and profits from the known noise levels;
the others get the paper's orders, a fifth of the data to choose their penalty on, and the steps' inheritance as in
Sect. 3.3. The oracle knows the true terms and regresses them by least squares.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from armloop.regression.sparse import ESTIMATORS
from armloop.reports.tables import Table, make_table
from armloop.util.progress import Progress, silent
from armloop.util.workers import Processes
from armloop_paper.estimator_trials import ORACLE, Case, Trial, draw_trials, true_terms
from armloop_paper.experiments import EXPERIMENTS

CASES = (
    Case("scara", "SCARA", (60.0, 40.0, 20.0)),
    Case("three_axis", "three-axis, Case II", (70.0, 50.0, 30.0), slow=False),
    Case("three_axis", "three-axis, Case III", (60.0, 40.0, 20.0)),
    Case("three_axis", "three-axis, Case III, q2 widened", (60.0, 40.0, 20.0), widened=True, slow=False),
)


@dataclass(frozen=True)
class Row:
    """One estimator over the draws of one case."""

    case: str
    estimator: str
    draws: int
    exact: int  # draws with exactly the true terms
    nearly: int  # draws with all true terms and at most one false one
    terms: float  # mean number, of which are
    false: float
    missed: float
    error: float  # median of the draws' largest RMSE of a joint outside the range over that of the oracle
    worst: float | None  # its maximum over the draws with the exact terms; None if there are none


def study(
    draws: int = 10,
    progress: Progress = silent,
    cases: Sequence[Case] = CASES,
    estimators: Sequence[str] = ESTIMATORS,
    jobs: int | None = None,
) -> list[Row]:
    """All estimators on so many noise draws, seeds from 0, of every case; ``jobs`` processes, by default one per core."""
    rows: list[Row] = []
    for case in cases:
        truth = true_terms(EXPERIMENTS[case.arm])
        draw = partial(draw_trials, case=case, truth=truth, estimators=tuple(estimators))
        trials: list[Trial] = []
        for seed, some in enumerate(Processes(jobs).map(draw, range(draws))):
            progress(f"{case.name}: draw {seed + 1} of {draws}")
            trials += some
        rows += _rows(case, trials)
    return rows


def estimators_table(rows: Sequence[Row]) -> Table:
    """The rows as a table."""
    headers = (
        "case",
        "estimator",
        "draws",
        "exact",
        "≤ 1 false, none missed",
        "terms",
        "false",
        "missed",
        "error / oracle",
        "worst where exact",
    )
    lines = [
        (
            row.case,
            row.estimator,
            row.draws,
            row.exact,
            row.nearly,
            f"{row.terms:.1f}",
            f"{row.false:.1f}",
            f"{row.missed:.1f}",
            f"{row.error:.3g}",
            "–" if row.worst is None else f"{row.worst:.3g}",
        )
        for row in rows
    ]
    return make_table(headers, lines, "Estimators under noise")


def _rows(case: Case, trials: Sequence[Trial]) -> list[Row]:
    oracle = {trial.draw: np.array(trial.error) for trial in trials if trial.estimator == ORACLE}
    rows = []
    for name in dict.fromkeys(trial.estimator for trial in trials):
        mine = [trial for trial in trials if trial.estimator == name]
        ratios = [float(np.max(np.array(t.error) / oracle[t.draw])) for t in mine]
        exact = [t.false == 0 and t.missed == 0 for t in mine]
        rows.append(
            Row(
                case.name,
                name,
                len(mine),
                sum(exact),
                sum(t.false <= 1 and t.missed == 0 for t in mine),
                float(np.mean([t.terms for t in mine])),
                float(np.mean([t.false for t in mine])),
                float(np.mean([t.missed for t in mine])),
                float(np.median(ratios)),
                max((r for r, ok in zip(ratios, exact, strict=True) if ok), default=None),
            )
        )
    return rows
