"""One noise draw through every method, and the draws of a case: what Figs. 5, 6, 10 and 11 share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armloop.util.arrays import Array
from armloop_paper.context import Context
from armloop_paper.experiments import EXPERIMENTS, Experiment
from armloop_paper.lasso import NotConverged
from armloop_paper.methods import armloop_stepwise, one_shot, stepwise
from armloop_paper.readings import READINGS, Reading, collected

Snr = tuple[float, float, float] | None

#: Terms that are looked through for those that give a printed percentage.
_MOST = 6000

METHODS = {"sindy": "SINDy", "stepwise": "stepwise", "armloop": "armloop"}


@dataclass(frozen=True, eq=False)
class Draw:
    """One draw: per method the active terms of each joint, and its error and torques outside the range.

    `predicted` (N, n) is on `Experiment.beyond_range`.
    """

    active: dict[str, list[int]]
    rmse: dict[str, list[float]]
    predicted: dict[str, Array]


@dataclass(frozen=True)
class Job:
    """What to draw."""

    arm: str
    snr: Snr
    seed: int
    reading: Reading = READINGS[0]
    with_default: bool = True


def draw(job: Job) -> Draw | None:
    """Collect, regress by each method, predict outside the range; None where a Lasso did not converge."""
    experiment = EXPERIMENTS[job.arm]
    logs = collected(experiment, job.snr, job.seed, job.reading)
    try:
        found = {
            "sindy": one_shot(experiment, logs, job.reading),
            "stepwise": stepwise(experiment, logs, job.reading),
        }
    except NotConverged:
        return None
    if job.with_default:
        found["armloop"] = armloop_stepwise(experiment, logs)
    beyond = experiment.beyond_range()
    truth = experiment.torque(beyond)
    active, rmse, predicted = {}, {}, {}
    for name, model in found.items():
        # What armloop keeps it means: no threshold is needed.
        active[name] = model.active(0.0 if name == "armloop" else experiment.threshold)
        predicted[name] = model.predict(beyond)
        rmse[name] = np.sqrt(np.mean((predicted[name] - truth) ** 2, axis=0)).tolist()
    return Draw(active, rmse, predicted)


def case(context: Context, experiment: Experiment, snr: Snr, draws: int) -> list[Draw]:
    """The draws of one case in the default reading; computed once per run."""
    jobs = [Job(experiment.arm_name, snr, seed) for seed in range(draws)]
    what = f"{experiment.arm_name}, SNR {'none' if snr is None else snr}"
    found = context.once((experiment.arm_name, snr), lambda: context.map(draw, jobs, what))
    kept = [one for one in found if one is not None]
    if len(kept) < len(found):
        raise NotConverged(f"{what}: the Lasso converged in {len(kept)} of {len(found)} draws")
    return kept


def readings(
    context: Context, experiment: Experiment, snr: Snr, default: list[Draw]
) -> list[tuple[Reading, list[Draw | None]]]:
    """Draws of every reading; the default's are those there are already."""
    others = READINGS[1:]
    jobs = [
        Job(experiment.arm_name, snr, seed, reading, with_default=False)
        for reading in others
        for seed in range(context.reading_draws)
    ]
    found = context.map(draw, jobs, f"{experiment.arm_name}, readings of the recipe")
    count = context.reading_draws
    rows: list[tuple[Reading, list[Draw | None]]] = [(READINGS[0], list(default))]
    return rows + [(r, found[k * count : (k + 1) * count]) for k, r in enumerate(others)]


def reduction(draws: list[Draw]) -> Array:
    """(d, n) percent by which the stepwise method keeps fewer active terms than SINDy."""
    sindy = np.array([one.active["sindy"] for one in draws], dtype=float)
    other = np.array([one.active["stepwise"] for one in draws], dtype=float)
    return np.where(sindy > 0, 100 * (1 - other / np.maximum(sindy, 1)), 0.0)


def least_counts(percent: float, digits: int) -> tuple[int, int]:
    """The smallest (stepwise, SINDy) numbers of terms whose reduction rounds to the printed percentage.

    A printed figure of four digits tells how many terms there must have been at least. Figures are allowed to be
    rounded or cut off.
    """
    for sindy in range(1, _MOST):
        few = round(sindy * (1 - percent / 100))
        for stepwise_terms in (few - 1, few, few + 1):
            if stepwise_terms >= 0:
                exact = 100 * (1 - stepwise_terms / sindy)
                unit = 10.0**-digits
                if abs(exact - percent) <= 0.5 * unit + 1e-9 or 0 <= exact - percent < unit - 1e-9:
                    return stepwise_terms, sindy
    return 0, _MOST
