"""A page on PID gains: what the scenario's own and the proposed ones are worth, by the linear loop and in simulation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from armloop.reports.html import Card, Picture, Report, Section, render
from armloop.reports.plots.loops import bode_figure, step_figure
from armloop.reports.tuning_tables import gains_table, margins_table, verified_table
from armloop.reports.words import number

if TYPE_CHECKING:
    from armloop.drake.tuning.tuned_loop import TunedLoop, Tuning

_BODE = (
    "Open loop of each joint, cut at its drive, and its sensitivity, what feedback makes of a disturbance. Lines: gain 1, "
    "phase -180 deg, sensitivity 2. Up to the Nyquist frequency of the controller."
)
_STEP = (
    "All joints are asked for a small step at once. Grey: the linear loop. Solid: the simulated arm without its dry "
    "friction, which should lie on it. Dotted: with dry friction, which no linear loop knows."
)


def tuning_report(tuning: Tuning) -> str:
    """One HTML page on a tuning."""
    scenario, wanted = tuning.scenario, tuning.bandwidth / (2 * np.pi)
    arm = scenario.plant.arm.name
    margins = Section(
        "Loops",
        [
            "The arm was linearised by Drake at rest where the reference begins, and sampled with the controller's period. "
            "The loop of each joint is judged from frequency responses with the other joints' loops closed; the columns "
            "named worst are the least margin and the highest peak in ten postures along the reference.",
            f"The proposed gains give each joint, the others held still, {number(wanted)} Hz of bandwidth and at least "
            f"{number(tuning.margin)} deg of phase margin. What the joints do to each other shows in the table.",
        ],
        [Picture(bode_figure(tuning), _BODE)],
        [gains_table(tuning), margins_table(tuning)],
    )
    unstable = [
        f"The {name} gains are unstable in a posture of the reference."
        for name, loop in (("scenario's", tuning.present), ("proposed", tuning.proposed))
        if not loop.stable
    ]
    verified = Section(
        "On the simulated arm",
        [
            "How far the simulated arm without dry friction is from the linear loop in a small step, as a part of it, "
            "and the mean tracking error on the scenario's reference by PID alone and with the arm's exact model as "
            "feedforward.",
        ],
        [Picture(step_figure(tuning), _STEP)],
        [verified_table(tuning)],
        notes=unstable,
    )
    cards = [_card("The scenario's gains", tuning.present), _card("Proposed gains", tuning.proposed)]
    lead = f"Gains of {scenario.name}, and gains for {number(wanted)} Hz and {number(tuning.margin)} deg."
    return render(Report(f"PID gains for {arm}", lead, [margins, verified], cards))


def _card(title: str, loop: TunedLoop) -> Card:
    phase, peak = (float(x) for x in (np.min(loop.worst[0]), np.max(loop.worst[1])))
    return Card(
        f"{number(phase)} deg",
        title,
        f"least phase margin along the reference; highest sensitivity {number(peak)}",
    )
