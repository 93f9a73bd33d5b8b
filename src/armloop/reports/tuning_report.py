"""A page on PID gains: what the scenario's own and the proposed ones are worth, by the linear loop and in simulation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from armloop.reports.html import Card, Picture, Report, Section, render
from armloop.reports.plots.loops import bode_figure, step_figure
from armloop.reports.prose import Prose
from armloop.reports.tuning_tables import gains_table, margins_table, missed_notes, verified_table
from armloop.reports.words import number

if TYPE_CHECKING:
    from armloop.drake.tuning.tuned_loop import TunedLoop, Tuning


def tuning_report(tuning: Tuning) -> str:
    """One HTML page on a tuning."""
    arm = tuning.scenario.plant.arm.name
    say = Prose("tuning", tuning=tuning, wanted=tuning.bandwidth / (2 * np.pi))
    margins = Section(
        "Loops",
        say.paragraphs("loops"),
        [Picture(bode_figure(tuning), say["bode"])],
        [gains_table(tuning), margins_table(tuning)],
        notes=missed_notes(tuning),
    )
    verified = Section(
        "On the simulated arm",
        say.paragraphs("verified"),
        [Picture(step_figure(tuning), say["step"])],
        [verified_table(tuning)],
        notes=say.paragraphs("unstable"),
    )
    cards = [_card("The scenario's gains", tuning.present), _card("Proposed gains", tuning.proposed)]
    return render(Report(f"PID gains for {arm}", say["lead"], [margins, verified], cards))


def _card(title: str, loop: TunedLoop) -> Card:
    if not loop.stable:
        return Card("unstable", title, "in a posture of the reference")
    phase, peak = (float(x) for x in (np.min(loop.worst[0]), np.max(loop.worst[1])))
    return Card(
        f"{number(phase)} deg",
        title,
        f"least phase margin along the reference; highest sensitivity {number(peak)}",
    )
