"""Tables and figures of predictions outside the range of the data, which Figs. 6 and 11 share."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armloop.reports.html import Picture
from armloop.reports.tables import Table, make_table
from armloop_paper.experiments import Experiment
from armloop_paper.noise_study import METHODS, Draw
from armloop_paper.plots import beyond_figure
from armloop_paper.spread import in_words


def rmse_table(experiment: Experiment, draws: list[Draw], title: str) -> Table:
    """RMSE per joint and method over the draws, beside the RMS of the torque."""
    rms = beyond_rms(experiment)
    rows = [
        [
            f"joint {j + 1}",
            joint.torque_unit.replace("*", "·"),
            rms[j],
            *(in_words([one.rmse[name][j] for one in draws]) for name in METHODS),
        ]
        for j, joint in enumerate(experiment.arm.joints)
    ]
    return make_table(["", "unit", "RMS torque", *METHODS.values()], rows, title, left=(0, 1))


def beyond_rms(experiment: Experiment) -> NDArray[np.float64]:
    """(n,) root mean square of the torque on the trajectory outside the range."""
    truth = experiment.torque(experiment.beyond_range())
    return np.asarray(np.sqrt(np.mean(truth**2, axis=0)))


def nrmse(experiment: Experiment, draws: list[Draw], method: str) -> NDArray[np.float64]:
    """(d, n) error of each draw relative to the RMS torque."""
    return np.array([one.rmse[method] for one in draws]) / beyond_rms(experiment)


def picture(experiment: Experiment, draws: list[Draw], caption: str) -> Picture:
    """The torque and what each method predicts, of the draw in the middle by SINDy's error."""
    order = np.argsort(nrmse(experiment, draws, "sindy").mean(axis=1))
    shown = draws[int(order[len(order) // 2])]
    motion = experiment.beyond_range()
    units = [joint.torque_unit for joint in experiment.arm.joints]
    predicted = {METHODS[name]: shown.predicted[name] for name in METHODS}
    return Picture(beyond_figure(motion.time, experiment.torque(motion), predicted, units), caption)
