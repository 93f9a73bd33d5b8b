"""Logs that contradict a model as a whole: torques in another unit or of the other sign, joints in another order, angles
in another unit.

No effect on an arm multiplies all torques by one factor far from one, or makes the model right for the columns of other
joints; a diagnosis would name whatever fits such a log least badly.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from armloop.data.log import MotionLog
from armloop.data.motion import Samples
from armloop.data.signals import preprocess, smooth
from armloop.identification.reconstruction.readings import Reading, readings
from armloop.identification.scoring import score_errors
from armloop.model import ReconstructedModel
from armloop.robot.arm import Arm
from armloop.util.arrays import TINY, Array

#: Mean relative error from which on a log is asked; the part of each joint's, at most, that what it may mean must leave; and
#: the samples that other readings are tried on.
_POOR, _BETTER, _SAMPLES = 0.5, 0.3, 20_000
#: A factor that all torques share to this ratio, and that is so far from one, or negative.
_ALIKE, _FAR = 1.3, 3.0
#: What a factor of the torques would be.
_UNITS = {
    1e3: "mN·m",
    1e-3: "kN·m",
    100.0: "N·cm",
    1 / 9.80665: "kgf·m",
    10.1972: "kgf·cm",
    8.85075: "lbf·in",
}


def misrecorded(model: ReconstructedModel, logs: Sequence[MotionLog], samples: Samples) -> str:
    """What is wrong with logs as a whole, and what would be right; empty if nothing is.

    Args:
        samples: of these logs, preprocessed as the model's training logs were.
    """
    predicted = smooth(samples, model.predict(samples.motion))
    left = _relative(samples.tau - predicted, samples)
    if not left.mean() >= _POOR:
        return ""
    gains = _gains(samples, predicted)
    gain = float(np.median(gains))
    same = bool((gains / gain > 1 / _ALIKE).all() and (gains / gain < _ALIKE).all()) if gain else False
    far = gain < 0 or abs(np.log(max(abs(gain), TINY))) > np.log(_FAR)
    if (
        len(gains) > 1
        and same
        and far
        and _far_better(left, _relative(samples.tau - gain * predicted, samples))
    ):
        return _factor(gain)
    some = [log.select(slice(0, _SAMPLES // len(logs))) for log in logs]
    for words, read in _others(model.arm):
        other = preprocess([read(log) for log in some], model.conditioning)
        if _far_better(left, _relative(other.tau - smooth(other, model.predict(other.motion)), other)):
            return words
    return ""


def _relative(error: Array, samples: Samples) -> Array:
    """(n,) error over torque of the joints that slide, root mean squares; 0 of those that do not."""
    nrmse = score_errors(error, samples.tau, samples.moving).moving["nrmse"]
    return np.array([x or 0.0 for x in nrmse])


def _far_better(left: Array, other: Array) -> bool:
    return bool((other <= _BETTER * left).all())


def _gains(samples: Samples, predicted: Array) -> Array:
    """(m,) measured torque per predicted torque of each joint that slides, by least squares."""
    found = []
    for tau, own, moving in zip(samples.tau.T, predicted.T, samples.moving.T, strict=True):
        if moving.any() and own[moving].any():
            found.append(float(tau[moving] @ own[moving] / (own[moving] @ own[moving])))
    return np.array(found)


def _factor(gain: float) -> str:
    if abs(np.log(abs(gain))) <= np.log(_ALIKE):
        return "the sign of all joints' tau is turned: torque must be what the drive does on the joint in the direction of q"
    unit = min(_UNITS, key=lambda factor: abs(np.log(abs(gain) / factor)))
    near = abs(np.log(abs(gain) / unit)) < 0.2
    guess = f", as if tau were in {_UNITS[unit]}" if near else ""
    return f"all torques are about {float(f'{gain:.2g}'):g} times what the model gives{guess}; give tau in N·m (N)"


def _others(arm: Arm) -> Iterator[tuple[str, Callable[[MotionLog], MotionLog]]]:
    """Every other reading of a log in words, and how to read it so; the torques, too, or the motion alone."""
    for reading in readings(arm):
        whole = partial(reading.of, arm=arm)
        if reading.unit:
            yield f"angles seem to be in {reading.unit}; give q in rad and v in rad/s", whole
            continue
        order = f"taken as {', '.join(str(k + 1) for k in reading.order)}, base to tip, the model explains the log"
        yield f"joints are in another order: {order}; number them from the base to the tip", whole
        yield (
            f"q and v are those of other joints than tau: {order}; put all columns in one order",
            partial(_motion, reading, arm),
        )


def _motion(reading: Reading, arm: Arm, log: MotionLog) -> MotionLog:
    return replace(reading.of(log, arm), tau=log.tau)
