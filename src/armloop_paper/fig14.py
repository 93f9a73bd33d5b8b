"""Fig. 14: torques predicted after each step, arm with friction."""

from __future__ import annotations

import numpy as np

from armloop.reports.html import Picture, Section
from armloop.reports.plots import torque_figure
from armloop.reports.tables import make_table
from armloop.reports.words import percent
from armloop_paper.context import Context
from armloop_paper.outcome import Outcome
from armloop_paper.spread import in_words, median, spread
from armloop_paper.tracking_study import runs

_STEPS = {"step1": "Step I", "step2": "Step II", "step3": "Step III"}


def run(context: Context) -> Outcome:
    """Predict the torques of a measured run on the paper's reference with each step's model."""
    found = runs(context)
    errors = {step: np.array([one.nrmse[step] for one in found]) for step in _STEPS}
    falls = [
        bool(
            np.all(errors["step2"][:, j] < errors["step1"][:, j])
            and np.all(errors["step3"][:, j] < errors["step2"][:, j])
        )
        for j in range(3)
    ]
    rows = [
        [name, *(in_words([100 * x for x in errors[step][:, j]]) for j in range(3))]
        for step, name in _STEPS.items()
    ]
    last = median(errors["step3"])
    text = [
        "The reference of Fig. 14, one period of 20 s; its k are read in units of 0.1 rad, because plain radians "
        "would turn the joints by more than 430°. Data are collected on the simulated arm with Stribeck friction, "
        "encoder and torque noise, reconstructed with the defaults, and compared with another measured run; "
        f"{len(found)} seeds of the collection.",
        f"The error falls with every step at {sum(falls)} of 3 joints in every collection, as the paper shows; after "
        "Step III it is "
        + " / ".join(percent(x) for x in last)
        + " of the RMS torque. The paper prints no number.",
    ]
    return Outcome(
        {"falls_with_every_step": [True] * 3},
        {"falls_with_every_step": falls},
        "agrees" if all(falls) else "partly" if any(falls) else "differs",
        f"error falls with every step at {sum(falls)} of 3 joints; after Step III "
        + " / ".join(percent(x) for x in last),
        Section(
            "Figure 14: torque prediction step by step",
            text,
            [
                Picture(
                    torque_figure(found[0].model, found[0].samples),
                    "First collection: measured torque and the three predictions.",
                )
            ],
            [
                make_table(
                    ["error / RMS torque [%]", "joint 1", "joint 2", "joint 3"],
                    rows,
                    f"Median (range) of {len(found)} collections",
                )
            ],
        ),
        {"nrmse": {step: spread(values) for step, values in errors.items()}},
    )
