"""A page on a model's prediction error on logs."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from armloop.identification.scoring import Score
from armloop.reports.html import Card, Picture, Report, Section, render
from armloop.reports.plots.style import BLUE, annotate, figure, panels, polish
from armloop.reports.prose import Prose
from armloop.reports.tables import ALL_COUNT, mean_nrmse, score_table
from armloop.reports.words import percent
from armloop.robot.arm import Arm


def score_figure(score: Score, arm: Arm) -> Figure:
    """A bar per joint: RMSE over the RMS of the measured torque, of moving samples; none for a joint that rests."""
    made = figure(max(5.0, 1.5 + 0.9 * arm.n), 3.4)
    axes = panels(made, legend_row=False)[0, 0]
    for j, error in enumerate(score.moving["nrmse"]):
        if error is not None:
            axes.bar(j, 100 * error, 0.6, color=BLUE)
            annotate(axes, percent(error), (j, 100 * error), (0, 4), ha="center")
    polish(axes, "", "nRMSE while moving [%]", grid="y")
    axes.set_xticks(range(arm.n), [f"joint {j + 1}" for j in range(arm.n)])
    axes.margins(y=0.15)
    return made


def score_report(score: Score, arm: Arm, units: Sequence[str] = ()) -> str:
    """One HTML page on a score, in units, if they are not those of torques."""
    say = Prose("score", score=score, what_counts=ALL_COUNT)
    picture = Picture(score_figure(score, arm), say["errors"])
    section = Section(
        "Prediction error", say.paragraphs("text"), [picture], [score_table(score, arm, units=units)]
    )
    card = Card(percent(mean_nrmse(score)), "Prediction error", "nRMSE while moving, mean of the joints")
    return render(
        Report(f"A model of {arm.name}, evaluated", "Predicted and measured torques.", [section], [card])
    )
