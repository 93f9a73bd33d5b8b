"""Tables of a cross-validation: errors per log and joint, the ladder of friction laws, physical consistency."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from armloop.reports.tables import Table, make_table, mean_nrmse
from armloop.reports.words import MISSING, number, percent

if TYPE_CHECKING:
    from armloop.identification.validation import CrossValidation, PhysicalComparison


_DEGREES = {
    "physical": "physical unless contradicted",
    "insisted": "physical in any case",
    "free": "free",
}


def crossvalidation_tables(result: CrossValidation) -> list[Table]:
    """nRMSE per log and joint of moving samples, with the means; then RMSE at standstill."""
    n = len(result.per_joint)
    joints = [f"joint {j + 1}" for j in range(n)]
    rows: list[list[object]] = [
        [f.name, *map(number, f.score.moving["nrmse"]), number(mean_nrmse(f.score)), f.score.samples]
        for f in result.files
    ]
    rows.append(["mean", *map(number, result.per_joint), number(result.mean), ""])
    what = "each log" if result.leave_out == "file" else f"alternating blocks of {result.block_seconds:g} s"
    moving = make_table(
        ["log", *joints, "mean", "samples"], rows, f"nRMSE of the moving joints on data left out: {what}"
    )
    still = [[f.name, *f.score.standstill["rmse"]] for f in result.files]
    standstill = make_table(["log", *joints], still, "RMSE at standstill [N·m, N or A], not in the means")
    return [moving, standstill]


def ladder_table(result: CrossValidation) -> Table | None:
    """What each rung of the friction ladder brought on held-out folds of the training data; None without one.

    Errors are means over the reconstructions, joints count if most reconstructions took the rung for them.
    """
    ladders = [fit.model.history.get("friction_ladder") for _, fit in result.results]
    compared: list[list[dict[str, Any]]] = [ladder for ladder in ladders if ladder]
    if not compared:
        return None
    rows: list[list[object]] = []
    for name in dict.fromkeys(one["rung"] for ladder in compared for one in ladder):
        same = [one for ladder in compared for one in ladder if one["rung"] == name]
        before, after = (float(np.mean([one[key] for one in same])) for key in ("before", "after"))
        refused = [one["refused"] for one in same if one["refused"] is not None]
        taken = [joint for one in same for joint in one["joints"]]
        usual = [j for j in sorted(set(taken)) if 2 * taken.count(j) > len(same)]
        joints = ", ".join(map(str, usual)) or MISSING
        would_be = number(float(np.mean(refused))) if refused else MISSING
        rows.append([name, number(before), number(after), would_be, joints])
    return make_table(
        ["rung", "before", "after", "where refused", "joints"],
        rows,
        "Friction ladder: nRMSE on inner held-out folds, mean over joints",
        left=(0, 4),
    )


def physical_table(comparison: PhysicalComparison) -> Table:
    """Held-out error, constraints and mass matrix with different degrees of physical consistency."""
    rows: list[list[object]] = []
    for degree, run in comparison.runs.items():
        within, beyond = comparison.within[degree], comparison.beyond[degree]
        rows.append(
            [
                _DEGREES[degree],
                number(run.mean, 4),
                number(comparison.constraints[degree]),
                number(within.least),
                percent(within.share_negative),
                number(beyond.least),
                percent(beyond.share_negative),
            ]
        )
    headers = [
        "coefficients",
        "nRMSE left out",
        "constraints",
        "least eigenvalue of M, within",
        "not positive",
        "beyond",
        "not positive",
    ]
    return make_table(
        headers, rows, "Physical consistency (M at random postures within and beyond the motion)"
    )
