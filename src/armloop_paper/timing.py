"""Seconds of a single least-squares calculation, one-shot and stepwise, in one run with one BLAS thread.

Processor time is taken: what else the machine does must not show in the ratio."""

from __future__ import annotations

import time

import numpy as np

from armloop.experiment.sampling import CONDITIONS, inverse_dynamics_samples
from armloop_paper.experiments import EXPERIMENTS, STEPS, as_motion
from armloop_paper.least_squares import least_squares


def lstsq_times(job: tuple[str, int]) -> dict[str, float]:
    """Seconds of ``numpy.linalg.lstsq`` on the paper's libraries: the best of so many repeats.

    The library is built before the clock starts. Steps are timed on the torque itself: what is subtracted before
    does not change the work.
    """
    name, repeats = job
    experiment = EXPERIMENTS[name]
    logs = inverse_dynamics_samples(experiment.arm, experiment.ranges, experiment.counts, 0)
    parts = {"sindy": tuple(CONDITIONS), **{s: (c,) for s, c in zip(STEPS, CONDITIONS, strict=True)}}
    times = {}
    for part, conditions in parts.items():
        motion, tau = as_motion(*(logs[condition] for condition in conditions))
        Y = np.ascontiguousarray(experiment.library(part).columns(motion))
        best = np.inf
        for _ in range(repeats):
            start = time.process_time()
            np.linalg.lstsq(Y, tau, rcond=None)
            best = min(best, time.process_time() - start)
        times[part] = float(best)
    return times


def moment_times(job: tuple[str, int]) -> dict[str, float]:
    """Seconds of the same on angle sums, which span the same functions, as armloop does it: from the samples on.

    Normal equations by table look-up, a Cholesky factor, iterative refinement to the accuracy of lstsq.
    """
    name, repeats = job
    experiment = EXPERIMENTS[name]
    logs = inverse_dynamics_samples(experiment.arm, experiment.ranges, experiment.counts, 0)
    parts = {"sindy": tuple(CONDITIONS), **{s: (c,) for s, c in zip(STEPS, CONDITIONS, strict=True)}}
    times = {}
    for part, conditions in parts.items():
        motion, tau = as_motion(*(logs[condition] for condition in conditions))
        library = experiment.waves(part)
        best = np.inf
        for _ in range(repeats):
            start = time.process_time()
            least_squares(library, motion, tau)
            best = min(best, time.process_time() - start)
        times[part] = float(best)
    return times
