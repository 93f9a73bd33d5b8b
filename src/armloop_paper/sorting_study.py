"""How well samples are sorted: the paper's and the robust indicator on data whose conditions are known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sklearn.metrics import adjusted_rand_score

from armloop.data.log import MotionLog
from armloop.data.motion import Motion
from armloop.data.regimes.sorting import Condition, sort_samples
from armloop.data.signals import Conditioning, as_torque, preprocess
from armloop.util.arrays import Array
from armloop.util.progress import Progress, silent

Labels = NDArray[np.int_]

#: Signal-to-noise ratios of velocity and acceleration, dB; the paper's Fig. 1 has 60 and 50.
LEVELS = (60.0, 50.0, 40.0, 30.0, 20.0)
CASES = (
    "all joints",  # three joints, each at a speed of its own
    "velocities cancel",  # the second joint mirrors the first, the third rests
    "one joint at a time",  # four joints, the third prismatic: a tenth of the others' numbers, and of their noise
    "measured",  # moves from rest to rest, noisy and rounded velocities, accelerations by differences
)
_COUNTS = (500, 1000, 1000)
#: Of the measured-like log: seconds at rest, of a ramp, at constant velocity; rate in Hz, rounding of v in rad/s.
_REST, _RAMP, _CRUISE, _RATE, _ROUNDING = 0.8, 0.5, 0.7, 250.0, 1e-4


@dataclass(frozen=True)
class Sorted:
    """One case at one noise level with one indicator, mean over the seeds."""

    case: str  # one of CASES
    level: float  # dB
    indicator: str  # paper or robust
    rand: float  # adjusted Rand index against the true conditions; 1 is perfect, 0 is chance
    worst_rand: float  # of the seed with the smallest
    missed: float  # part of the standstill that is sorted elsewhere
    blind: float  # part of the motion that is taken for standstill
    right: float  # part of all samples whose condition is named rightly


def conditions_study(
    seeds: int = 5, levels: Sequence[float] = LEVELS, progress: Progress = silent
) -> list[Sorted]:
    """Sort random data of known conditions with both indicators; so many draws of each case and level."""
    results = []
    for case in CASES:
        for level in levels:
            progress(f"conditions: {case}, {level:g} dB")
            data = [case_data(case, level, seed) for seed in range(seeds)]
            for indicator in ("paper", "robust"):
                rows = np.array([_judge(*one, indicator) for one in data])
                rand, missed, blind, right = rows.mean(axis=0).tolist()
                worst = float(rows[:, 0].min())
                results.append(Sorted(case, level, indicator, rand, worst, missed, blind, right))
    return results


def _judge(motion: Motion, truth: Labels, scored: NDArray[np.bool_], indicator: str) -> list[float]:
    found, truth = sort_samples(motion, indicator).condition[scored], truth[scored]
    at_rest, called = truth == Condition.STATIC, found == Condition.STATIC
    return [
        float(adjusted_rand_score(truth, found)),
        float(np.mean(~called[at_rest])),
        float(np.mean(called[~at_rest])),
        float(np.mean(found == truth)),
    ]


def case_data(case: str, level: float, seed: int) -> tuple[Motion, Labels, NDArray[np.bool_]]:
    """A motion, its true conditions (N,), and the samples to score (N,); ``level`` in dB."""
    rng = np.random.default_rng([seed, CASES.index(case)])
    if case == "measured":
        return _measured(rng, level)
    n = 4 if case == "one joint at a time" else 3
    truth = np.repeat([int(c) for c in Condition], _COUNTS)
    v = rng.uniform(-1.5, 1.5, (len(truth), n)) * (truth > Condition.STATIC)[:, None]
    vdot = rng.uniform(-3.0, 3.0, v.shape) * (truth > Condition.CONSTANT_VELOCITY)[:, None]
    if case == "velocities cancel":
        for x in (v, vdot):
            x[:, 1], x[:, 2] = -x[:, 0], 0.0
    if case == "one joint at a time":
        moving = np.eye(n)[rng.integers(n, size=len(v))] * [1.0, 1.0, 0.1, 1.0]
        v, vdot = v * moving, vdot * moving
    v, vdot = _noisy(v, level, rng), _noisy(vdot, level, rng)
    motion = Motion(np.arange(float(len(v))), np.zeros_like(v), v, vdot)
    return motion, truth, np.ones(len(v), dtype=bool)


def _noisy(x: Array, level: float, rng: np.random.Generator) -> Array:
    """Noise of each joint's signal power; a joint at rest gets that of the quietest one that moves."""
    rms = np.sqrt(np.mean(x**2, axis=0))
    rms = np.where(rms > 0, rms, rms[rms > 0].min())
    return np.asarray(x + 10 ** (-level / 20) * rms * rng.normal(size=x.shape))


def _measured(rng: np.random.Generator, level: float) -> tuple[Motion, Labels, NDArray[np.bool_]]:
    """A log of moves from rest to rest; samples within 0.15 s of a change of condition are not scored."""
    knots, moves = np.cumsum([_REST, _RAMP, _CRUISE, _RAMP]), 12
    time = np.arange(0, moves * knots[-1], 1 / _RATE)
    phase, move = time % knots[-1], np.minimum((time / knots[-1]).astype(int), moves - 1)
    shape = np.interp(phase, np.concatenate([[0.0], knots]), [0.0, 0.0, 1.0, 1.0, 0.0])
    v = shape[:, None] * rng.uniform(-1.2, 1.2, (moves, 3))[move]
    truth = np.array([1, 3, 2, 3])[np.searchsorted(knots[:-1], phase, side="right")]
    q = np.cumsum(v, axis=0) / _RATE
    noisy = np.round(_noisy(v, level, rng) / _ROUNDING) * _ROUNDING
    log = MotionLog(time, q, noisy, np.ones_like(q), name="moves")
    samples = as_torque(preprocess([log], Conditioning()))
    index = np.clip(np.rint(samples.motion.time * _RATE).astype(int), 0, len(time) - 1)
    reach = int(0.15 * _RATE)
    changes = np.flatnonzero(np.diff(truth))
    near = np.zeros(len(time), dtype=bool)
    for shift in range(-reach, reach + 1):
        near[np.clip(changes + shift, 0, len(time) - 1)] = True
    return samples.motion, truth[index], ~near[index]
