"""Tables of results: aligned text for a terminal, the same cells for a report."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from armloop.reports import paper as published
from armloop.reports.words import (
    MISSING,
    controller,
    from_to,
    number,
    percent,
    unit,
)

if TYPE_CHECKING:  # what makes the results need not be loaded to print them
    from armloop.drake.experiments.tracking import TrackingResult
    from armloop.dynamics import PhysicsChecks
    from armloop.identification.goodness import Parts
    from armloop.identification.reconstruction import StepReport
    from armloop.identification.reconstruction.libraries import Contender
    from armloop.identification.scoring import Score
    from armloop.model import ReconstructedModel
    from armloop.robot.arm import Arm


#: Columns of a terminal that has been given no more.
TERMINAL = 80


@dataclass(frozen=True)
class Table:
    """Cells that are already text. ``str(table)`` aligns them: the first column left, the others right.

    Headers of several words stand on several lines where a terminal would break the rows otherwise.
    """

    headers: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    title: str | None = None
    left: tuple[int, ...] = (0,)

    def __str__(self) -> str:
        cells = [max((len(row[k]) for row in self.rows), default=0) for k in range(len(self.headers))]
        heads = self._heads(cells)
        widths = [max(width, *map(len, head)) for width, head in zip(cells, heads, strict=True)]
        tallest = max(map(len, heads))
        above = zip(*([""] * (tallest - len(head)) + head for head in heads), strict=True)

        def aligned(line: Sequence[str]) -> str:
            cells = [
                cell.ljust(width) if k in self.left else cell.rjust(width)
                for k, (cell, width) in enumerate(zip(line, widths, strict=True))
            ]
            return "  ".join(cells).rstrip()

        rule = "─" * (sum(widths) + 2 * (len(widths) - 1))
        top = [self.title] if self.title else []
        return "\n".join([*top, rule, *map(aligned, above), rule, *map(aligned, self.rows), rule])

    def _heads(self, cells: Sequence[int]) -> list[list[str]]:
        """Lines of every header: one each, or from the widest on as many as the terminal asks for."""
        heads = [[header] for header in self.headers]

        def width(k: int) -> int:
            return max(cells[k], *map(len, heads[k]))

        while sum(width(k) + 2 for k in range(len(heads))) - 2 > TERMINAL:
            wide = [k for k in range(len(heads)) if width(k) > cells[k] and _narrower(heads[k])]
            if not wide:
                break
            k = max(wide, key=width)
            heads[k] = _narrower(heads[k])
        return heads


def _narrower(head: Sequence[str]) -> list[str]:
    """A header on narrower lines; nothing where its longest word is as wide as it is."""
    width = max(map(len, head))
    text = re.sub(
        r"\[.*?\]", lambda unit: unit[0].replace(" ", "\u00a0"), " ".join(head)
    )  # a unit stays together
    lines = textwrap.wrap(text, max(width - 1, 1), break_long_words=False, break_on_hyphens=False)
    return (
        [line.replace("\u00a0", " ") for line in lines] if max(map(len, lines), default=width) < width else []
    )


def table(headers: Sequence[object], rows: Sequence[Sequence[object]], title: str | None = None) -> str:
    """Align cells for a terminal; floats get three significant digits, None a dash."""
    return str(make_table(headers, rows, title))


def make_table(
    headers: Sequence[object],
    rows: Sequence[Sequence[object]],
    title: str | None = None,
    left: tuple[int, ...] = (0,),
) -> Table:
    """Build a table of any cells; raises ``ValueError`` when a row has not one cell per header."""
    for row in rows:
        if len(row) != len(headers):
            raise ValueError(f"a row has {len(row)} cells, the table {len(headers)} columns: {row!r}")
    return Table(tuple(map(_cell, headers)), tuple(tuple(map(_cell, row)) for row in rows), title, left)


def _cell(value: object) -> str:
    if value is None:
        return MISSING
    if isinstance(value, (float, np.floating)):
        return number(float(value))
    return str(value)


def named_eta_table(head: str, results: Mapping[str, TrackingResult], title: str | None) -> Table:
    """Mean absolute tracking error η per joint, a row for each named result."""
    units = next(iter(results.values())).unit
    rows = [[name, *result.eta] for name, result in results.items()]
    return make_table([head, *(f"η{j + 1} [{u}]" for j, u in enumerate(units))], rows, title)


def eta_table(results: Mapping[str, TrackingResult], paper: bool = False) -> Table:
    """Mean absolute tracking error η per controller and joint, beside the paper's where it has one."""
    made = named_eta_table(
        "controller", {controller(name): run for name, run in results.items()}, "Tracking error η"
    )
    if not paper:
        return made
    n = len(made.headers) - 1
    theirs = [published.ETA_DEG.get(name, ()) for name in results]
    beside = [row if len(row) == n else [None] * n for row in theirs]
    rows = [[*own, *other] for own, other in zip(made.rows, beside, strict=True)]
    return make_table([*made.headers, *(f"paper η{j + 1}" for j in range(n))], rows, "Tracking error η")


def steps_table(reports: Sequence[StepReport]) -> Table:
    """Orders, library sizes, terms kept per joint, samples per joint of each step, and the error that chose its orders.

    It is one on blocks that were not fitted, but it is the least of several: no measure of the model.
    """
    rows = []
    for report in reports:
        chosen = [error for orders, error in report.trials if report.orders and orders[0] == report.orders[0]]
        rows.append(
            [
                report.step,
                MISSING if report.orders is None else f"({report.orders[0]}, {report.orders[1]})",
                report.candidates,
                report.independent,
                " / ".join(map(str, report.terms)),
                from_to(report.samples),
                percent(min(chosen)) if chosen else MISSING,
            ]
        )
    headers = [
        "step",
        "(N1, N2)",
        "candidates",
        "independent",
        "terms per joint",
        "samples per joint",
        "error choosing orders",
    ]
    return make_table(headers, rows, "Steps of the reconstruction")


def compared(libraries: Sequence[Contender]) -> bool:
    """Whether two libraries or more were fitted; that one alone could be, the notes say."""
    return sum(one.checks is not None for one in libraries) > 1


def libraries_table(libraries: Sequence[Contender]) -> Table:
    """Error on the blocks that choose the library, number of coefficients, and the checks of physics of each library."""
    rows: list[list[object]] = []
    for one in libraries:
        name = f"{one.name} (taken)" if one.chosen else one.name
        if one.checks is None:
            rows.append([name, *[MISSING] * 6])
            continue
        checks = one.checks
        drives = [str(j + 1) for j, torque in enumerate(checks.driving) if torque]
        rows.append(
            [
                name,
                percent(one.error),
                one.coefficients,
                _least(checks),
                percent(checks.asymmetry),
                f"drives joint {', '.join(drives)}" if drives else "passive",
                MISSING if checks.yaw is None else percent(checks.yaw),
            ]
        )
    headers = [
        "library",
        "nRMSE choosing it",
        "coefficients",
        "least eigenvalue of M",
        "asymmetry of M",
        "friction",
        "torque by yaw",
    ]
    return make_table(headers, rows, "Libraries compared")


def _least(checks: PhysicsChecks) -> str | float:
    """The smallest eigenvalue of M that was found, and how far it is proven that none is negative."""
    if checks.certificate:
        return f"{checks.least:.3g} (proven positive)"
    if checks.definite and checks.proven:
        return f"{checks.least:.3g} (searched; proven positive on {checks.proven:.0%} of the postures)"
    return checks.least


def score_table(
    score: Score, arm: Arm, title: str | None = "Prediction error", units: Sequence[str] | None = None
) -> Table:
    """RMSE and nRMSE per joint, of the moving joint and at standstill; in units, if they are not those of torques."""
    units = units or arm.torque_units
    rows = [
        [
            f"{j + 1}  {joint.name}",
            unit(units[j]),
            score.rms[j],
            score.moving["rmse"][j],
            percent(score.moving["nrmse"][j]),
            score.standstill["rmse"][j],
        ]
        for j, joint in enumerate(arm.joints)
    ]
    headers = ["joint", "unit", "RMS measured", "RMSE moving", "nRMSE moving", "RMSE at rest"]
    return make_table(headers, rows, title, left=(0, 1))


def score_by_log(scores: Sequence[tuple[str, Score]], arm: Arm) -> Table:
    """nRMSE of the moving joints, log by log."""
    rows = [[name, *map(percent, score.moving["nrmse"])] for name, score in scores]
    headers = ["log", *(f"{j + 1}  {joint.name}" for j, joint in enumerate(arm.joints))]
    return make_table(headers, rows, "nRMSE moving, by log", left=(0,))


#: What :func:`score_table` counts of a log, beside what a diagnosis judges of the same.
ALL_COUNT = (
    "Every sample of a joint that moves counts. A diagnosis, which leaves out the ends of a run, events, and what lies far "
    "outside the trained range, has other errors of the same log."
)


def mean_nrmse(score: Score) -> float:
    """Mean over the joints of the nRMSE of moving samples; NaN if no joint moves."""
    values = [x for x in score.moving["nrmse"] if x is not None]
    return float(np.mean(values)) if values else float("nan")


def parts_table(parts: Sequence[Parts], arm: Arm) -> Table:
    """What the model explains of each joint's torque on held-out data, what could be predicted besides, and noise."""
    rows = [
        [
            f"{one.joint}  {joint.name}",
            # nearly all, with as many nines as it has
            MISSING if one.explained is None else f"{100 * one.explained:.2f} %",
            percent(one.predictable_left),
            percent(one.std_error),
            percent(one.noise),
            MISSING if one.correlation_time is None else f"{one.correlation_time:.2g} s",
        ]
        for one, joint in zip(parts, arm.joints, strict=False)
    ]
    headers = [
        "joint",
        "explained",
        "predictable, not explained",
        "± std error",
        "noise",
        "residual's memory",
    ]
    return make_table(headers, rows, "Parts of the torque's energy")


def seconds_table(seconds: Mapping[str, float]) -> Table:
    """Seconds per stage and in all."""
    rows = [[stage.replace("_", " "), f"{value:.1f} s"] for stage, value in seconds.items()]
    return make_table(["stage", "time"], [*rows, ["in all", f"{sum(seconds.values()):.1f} s"]], "Time taken")


def formulas(model: ReconstructedModel, width: int = TERMINAL, most_terms: int | None = None) -> str:
    """The model's formulas, wrapped to a width; with ``most_terms`` long ones are cut and say so."""
    lines = []
    for formula in model.formulas():
        head, _, body = formula.partition(" = ")
        terms = body.replace(" - ", "\n- ").replace(" + ", "\n+ ").split("\n")
        if most_terms is not None and len(terms) > most_terms:
            terms = [*terms[:most_terms], f"… and {len(terms) - most_terms} more terms"]
        lines.append(
            textwrap.fill(f"{head} = {' '.join(terms)}", width, subsequent_indent=" " * (len(head) + 3))
        )
    return "\n".join(lines)
