"""Fig. 15: tracking error of PID and of PID with the models of Step I and Step III."""

from __future__ import annotations

import numpy as np

from armloop.reports.html import Picture, Section
from armloop.reports.plots import eta_figure, tracking_figure
from armloop.reports.tables import make_table
from armloop.reports.words import controller, numbers
from armloop_paper import paper
from armloop_paper.context import Context
from armloop_paper.outcome import Outcome
from armloop_paper.spread import in_words, median, spread
from armloop_paper.tracking_study import CONTROLLERS, EXACT, runs


def run(context: Context) -> Outcome:
    """Track the paper's reference with each controller, with a model from each collection."""
    found = runs(context)
    eta = {name: np.array([one.eta[name] for one in found]) for name in CONTROLLERS}
    ours = {name: median(eta[name]) for name in paper.ETA_DEG}
    ideal = median(eta[EXACT])
    pid, first, third = (np.array(ours[name]) for name in ("pid", "pid_step1", "pid_step3"))
    ordered = bool(np.all(pid > first) and np.all(first > third))
    alike = all(
        0.5 < a / b < 2
        for name in ("pid", "pid_step1")
        for a, b in zip(ours[name], paper.ETA_DEG[name], strict=True)
    )
    rows = []
    for name, values in eta.items():
        rows.append(
            [
                controller(name),
                *(in_words(values[:, j]) for j in range(3)),
                *paper.ETA_DEG.get(name, [None] * 3),
            ]
        )
    headers = ["controller", "η1 [°]", "η2 [°]", "η3 [°]", "paper η1", "paper η2", "paper η3"]
    worst = float(eta["pid_step3"].max())
    text = [
        "Gains and reference as in the paper (80, 8, 2; k in units of 0.1 rad); the second period of 20 s is "
        f"scored. The model is reconstructed with the defaults from {len(found)} collections of their own seed, with "
        "noise and quantisation.",
        f"The order PID > Step I > Step III {'holds' if ordered else 'does not hold'} at every joint. With Step III "
        f"η is {numbers(third)}° (paper {numbers(paper.ETA_DEG['pid_step3'])}°), at most {worst:.3f}° at any joint "
        "of any collection.",
        "The friction of the simulated arm is chosen so that PID and an ideal Step I come out near the paper's figures; "
        "their agreement shows that the set-up is like the paper's, no more. What is found is Step III: with the plant's "
        f"own inverse dynamics η is {numbers(ideal)}°, so the paper's 0.25° is what its model, sensors or drives leave, "
        "and a good reconstruction on a simulated arm lies far below it.",
    ]
    better = bool(np.all(third <= np.array(paper.ETA_DEG["pid_step3"])))
    return Outcome(
        {"eta_deg": paper.ETA_DEG},
        {"eta_deg": ours},
        "agrees" if ordered and alike and better else "partly" if ordered else "differs",
        f"Step III η {numbers(third, 2)}° (paper {numbers(paper.ETA_DEG['pid_step3'], 2)}°), at most {worst:.3f}° in "
        "any collection",
        Section(
            "Figure 15: tracking with three controllers",
            text,
            [
                Picture(
                    eta_figure({name: found[0].tracking[name] for name in paper.ETA_DEG}, paper=True),
                    "First collection; dashed outlines are the paper's.",
                ),
                Picture(
                    tracking_figure({name: found[0].tracking[name] for name in paper.ETA_DEG}),
                    "The motion behind these numbers, and the error over time.",
                ),
            ],
            [make_table(headers, rows, f"Tracking error η, median (range) of {len(found)} collections")],
        ),
        {"eta_deg": {name: spread(values) for name, values in eta.items()}},
    )
