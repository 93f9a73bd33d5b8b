"""Seconds of a single least-squares calculation, one-shot and stepwise, in one run with one BLAS thread.

Processor time is taken: what else the machine does must not show in the ratio."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from armloop.data.motion import Motion
from armloop.experiment.sampling import CONDITIONS, inverse_dynamics_samples
from armloop.util.arrays import Array
from armloop_paper.context import Context
from armloop_paper.experiments import EXPERIMENTS, STEPS, Experiment, as_motion
from armloop_paper.least_squares import least_squares

#: What is counted and timed.
PARTS = ("sindy", *STEPS)


@dataclass(frozen=True)
class Counted:
    """Candidates, samples and seconds of one-shot SINDy (``sindy``) and of each step."""

    candidates: dict[str, int]
    samples: dict[str, int]
    seconds: dict[str, float]  # of numpy.linalg.lstsq
    by_moments: dict[str, float]  # of the same as armloop solves it

    @property
    def stepwise(self) -> int:
        """Candidates of all steps."""
        return sum(self.candidates[step] for step in STEPS)

    @property
    def fewer(self) -> float:
        """Percent fewer candidates in steps."""
        return 100 * (1 - self.stepwise / self.candidates["sindy"])


def counted(context: Context, experiment: Experiment, repeats: int) -> Counted:
    """Count and time, one after the other: two at once would share caches and memory, and the ratio with them."""
    [seconds] = context.map(lstsq_times, [(experiment.arm_name, repeats)], "least squares")
    [by_moments] = context.map(moment_times, [(experiment.arm_name, repeats)], "the same by moments")
    candidates = {part: experiment.library(part).size for part in PARTS}
    samples = dict(zip(PARTS, (sum(experiment.counts), *experiment.counts), strict=True))
    return Counted(candidates, samples, seconds, by_moments)


def ratio(seconds: Mapping[str, float]) -> float:
    """How many times longer one-shot SINDy takes than all steps."""
    return seconds["sindy"] / sum(seconds[step] for step in STEPS)


def lstsq_times(job: tuple[str, int]) -> dict[str, float]:
    """Seconds of ``numpy.linalg.lstsq`` on the paper's libraries: the best of so many repeats.

    The library is built before the clock starts. Steps are timed on the torque itself: what is subtracted before
    does not change the work.
    """
    name, repeats = job
    times = {}
    for part, motion, tau in _parts(name):
        Y = np.ascontiguousarray(EXPERIMENTS[name].library(part).columns(motion))
        times[part] = _best(repeats, partial(np.linalg.lstsq, Y, tau, rcond=None))
    return times


def moment_times(job: tuple[str, int]) -> dict[str, float]:
    """Seconds of the same on angle sums, which span the same functions, as armloop does it: from the samples on.

    Normal equations by table look-up, a Cholesky factor, iterative refinement to the accuracy of lstsq.
    """
    name, repeats = job
    times = {}
    for part, motion, tau in _parts(name):
        times[part] = _best(repeats, partial(least_squares, EXPERIMENTS[name].waves(part), motion, tau))
    return times


def _parts(name: str) -> Iterator[tuple[str, Motion, Array]]:
    """The samples and torques of one-shot SINDy and of each step, by name."""
    experiment = EXPERIMENTS[name]
    logs = inverse_dynamics_samples(experiment.arm, experiment.ranges, experiment.counts, 0)
    yield "sindy", *as_motion(*(logs[condition] for condition in CONDITIONS))
    for step, condition in zip(STEPS, CONDITIONS, strict=True):
        yield step, *as_motion(logs[condition])


def _best(repeats: int, calculate: Callable[[], object]) -> float:
    best = np.inf
    for _ in range(repeats):
        start = time.process_time()
        calculate()
        best = min(best, time.process_time() - start)
    return float(best)
