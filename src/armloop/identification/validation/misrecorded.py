"""Gross-error check of logs against a model: torques in another unit or of the other sign, joints in another order or
counted in the other direction, angles in another unit, torques without the links' weight.

No effect on an arm multiplies all torques by one factor far from one, or makes the model right for the columns of other
joints; a diagnosis would name whatever fits such a log least badly.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from armloop.data.creep import creeping
from armloop.data.motion import Samples
from armloop.data.signals import smooth
from armloop.identification.reconstruction.plain_fits import AS_GOOD, FAR
from armloop.identification.reconstruction.readings import Reading, readings
from armloop.identification.scoring import residual, score_errors
from armloop.model import ReconstructedModel
from armloop.robot.arm import Arm
from armloop.util.arrays import TINY, Array, filled
from armloop.util.doubts import warn
from armloop.util.errors import InputError

#: A joint's relative error from which on a log is asked, and the part of each joint's, at most, that what it may mean must
#: leave of it, but for what the model leaves on its own data as well: two columns that are exchanged leave others as good.
POOR, _BETTER = 0.3, 0.3
#: Instants at which readings are compared, and how many that do best are asked of all samples.
_SCREENED, _VERIFIED = 2000, 3
#: A factor of all torques is far from one, or negative; one of minus one, to this ratio, is a sign.
_SIGN = 1.3
#: What a factor of torques in N·m would be, if it is as near as this ratio.
_UNITS = {
    1e3: "mN·m",
    1e-3: "kN·m",
    100.0: "N·cm",
    1 / 9.80665: "kgf·m",
    10.1972: "kgf·cm",
    8.85075: "lbf·in",
}
_NEAR = 1.2
#: What torques are that the model's drive gains, to such a power, make right.
_IN_GAINS = {
    1: "tau seems to be motor current: times the model's drive gains it is what the model gives; give it as A",
    -1: "tau seems to be torque already, which the model's drive gains were multiplied with: without them it is what the "
    "model gives; say that it is torque (--tau-unit 'N*m')",
}


def misrecorded(model: ReconstructedModel, samples: Samples) -> str:
    """What is wrong with the logs of samples as a whole, and what would be right; empty if nothing is.

    Args:
        samples: preprocessed as the model's training logs were.
    """
    unexplained = residual(model, samples)
    left = _relative(unexplained, samples)
    if not left.max() >= POOR:
        return ""
    usual = _usual(model, samples)
    predicted = smooth(samples, model.predict(samples.motion))
    if gains := model.recorded["drive_gains"]:
        for power, said in _IN_GAINS.items():
            torques = replace(samples, tau=samples.tau * np.asarray(gains) ** power)
            if _far_better(left, _relative(torques.tau - predicted, torques), _usual(model, torques)):
                return said
    gain = _common_gain(samples, predicted)
    if gain and _far_better(left, _relative(samples.tau - gain * predicted, samples), usual):
        return _factor(gain, "A" if model.in_amperes else "N·m (N)")
    weight = smooth(samples, model.rigid_body(samples.motion, step=1))
    # a joint that carries none is left as it was
    if _far_better(left, _relative(unexplained + weight, samples), np.maximum(usual, left)):
        return (
            "the torques hold no weight, as where the drives compensate it themselves and report the rest: with the weight "
            "of the links added to them the model explains the log; give the whole torque, as in the model's logs"
        )
    for j, k in combinations(np.flatnonzero(left >= POOR), 2):
        order = np.arange(len(left))
        order[[j, k]] = k, j
        swapped = replace(samples, tau=samples.tau[:, order])
        # the other joints are left as they were
        if _far_better(left, _relative(swapped.tau - predicted, swapped), np.maximum(usual, left)):
            return (
                f"columns tau{j + 1} and tau{k + 1} are exchanged: each is what the model gives for the other; put all "
                "columns in one order"
            )
    for words, other in _likely(model, samples):
        if _far_better(left, _relative(residual(model, other), other), _usual(model, other)):
            return words
    return ""


def say_misrecorded(model: ReconstructedModel, samples: Samples, names: Sequence[str]) -> None:
    """Warn of gross errors of the logs that samples are of, as a whole or else joint by joint.

    Args:
        samples, names: what the logs are preprocessed, as the model's training logs were, and the logs' names.

    Raises:
        InputError: every torque is zero.
    """
    if not samples.tau.any():
        raise InputError(
            f"{names[0]}: every tau is zero throughout; give a log that holds the joints' torques"
        )
    whole = misrecorded(model, samples)
    for wrong in [whole] if whole else turned_joints(model, samples):
        warn(f"{', '.join(names)}: {wrong}")


def turned_joints(model: ReconstructedModel, samples: Samples) -> list[str]:
    """Gross errors of single torques, a sentence each: a factor far from one, or negative, of what the model gives.

    To a diagnosis that is a gain of the sensor.
    """
    left, found = _relative(residual(model, samples), samples), []
    predicted = smooth(samples, model.predict(samples.motion))
    for j in np.flatnonzero(left >= POOR):
        moving = samples.moving[:, j]
        tau, own = samples.tau[moving, j], predicted[moving, j]
        gain = float(tau @ own / max(own @ own, TINY))
        rest = np.sqrt(np.mean((tau - gain * own) ** 2) / np.mean(tau**2))
        if not 1 / FAR <= gain <= FAR and rest <= _BETTER * left[j]:
            sign = 1 / _SIGN <= -gain <= _SIGN
            what = "has the other sign than what" if sign else f"is about {float(f'{gain:.2g}'):g} times what"
            found.append(
                f"tau{j + 1} {what} the model gives; check the joint's "
                + ("sign" if sign else "unit and gain")
            )
    return found


def _relative(error: Array, samples: Samples) -> Array:
    """(n,) error over torque of the joints that slide, root mean squares; 0 of those that do not."""
    nrmse = score_errors(error, samples.tau, samples.moving).moving["nrmse"]
    return np.array([x or 0.0 for x in nrmse])


def _usual(model: ReconstructedModel, samples: Samples) -> Array:
    """(n,) what the model leaves of its own baseline data, over torque; 0 where nobody knows.

    As on the worst tenth of them where a joint slides, and of the samples in which it creeps as on those in which it crept.
    """
    n, ranges = samples.motion.joints, model.history.get("range")
    worst, slow = (filled(model.baseline.get(key), n, 0.0) for key in ("worst", "creeping"))
    creeps = creeping(samples, np.asarray(ranges[1]) if ranges else np.zeros(n)).sum(axis=0)
    left = np.sqrt(worst**2 + slow**2 * creeps / np.maximum(samples.moving.sum(axis=0), 1))
    tau = np.sqrt(np.mean(samples.tau**2, axis=0, where=samples.moving | ~samples.moving.any(axis=0)))
    return np.asarray(left / np.maximum(tau, TINY))


def _far_better(left: Array, other: Array, usual: Array) -> bool:
    """Whether what was poor is explained far better, and all else as well as the model's own data if not far better."""
    better = other <= _BETTER * left
    return bool(better[left >= POOR].all() and (better | (other <= usual)).all())


def _common_gain(samples: Samples, predicted: Array) -> float:
    """The factor of the torques (N, n) of the joints that slide, the median of several; 0 if it is not far from one."""
    pairs = zip(samples.tau.T, predicted.T, samples.moving.T, strict=True)
    slid = [(tau[moving], own[moving]) for tau, own, moving in pairs if own[moving].any()]
    gains = np.array([tau @ own / (own @ own) for tau, own in slid])
    gain = float(np.median(gains)) if len(gains) > 1 else 0.0
    return 0.0 if 1 / FAR <= gain <= FAR else gain


def _factor(gain: float, unit: str) -> str:
    if 1 / _SIGN <= -gain <= _SIGN:
        return "the sign of all joints' tau is turned: torque must be what the drive does on the joint in the direction of q"
    known = [name for factor, name in _UNITS.items() if unit != "A" and 1 / _NEAR <= gain / factor <= _NEAR]
    guess = f", as if tau were in {known[0]}" if known else ""
    return f"all torques are about {float(f'{gain:.2g}'):g} times what the model gives{guess}; give tau in {unit}"


def _likely(model: ReconstructedModel, samples: Samples) -> list[tuple[str, Samples]]:
    """The readings that explain about as much as the best does, told at a few instants, the simplest first."""
    every = slice(None, None, max(1, samples.motion.samples // _SCREENED))
    some = replace(
        samples,
        motion=samples.motion.take(every),
        tau=samples.tau[every],
        moving=samples.moving[every],
        spans=None,
        unknown=None,
    )
    asked = list(_read_otherwise(model.arm))
    left = []
    for reading, torques, _ in asked:
        other = _read(some, reading, model.arm, torques)
        relative = _relative(other.tau - model.predict(other.motion), other)
        left.append(float(np.exp(np.mean(np.log(np.maximum(relative, TINY))))))
    near = [one for one, error in zip(asked, left, strict=True) if AS_GOOD * error <= min(left)]
    return [
        (words, _read(samples, reading, model.arm, torques)) for reading, torques, words in near[:_VERIFIED]
    ]


def _read_otherwise(arm: Arm) -> Iterator[tuple[Reading, bool, str]]:
    """Every other reading, whether it is of the torques, too, or of the motion alone; and its words."""
    for reading in readings(arm):
        if reading.against:
            continue  # every set of joints is asked so, below
        if reading.unit:
            yield reading, True, f"angles seem to be in {reading.unit}; give q in rad and v in rad/s"
        elif reading.turned:
            which = reading.which()
            better = "of the other sign the model explains the log; give them as in the model's logs"
            yield reading, True, f"{which} in the direction against the model's: with q, v and tau {better}"
            yield (
                reading,
                False,
                f"{which} in the direction against the model's and tau's: with q and v {better}",
            )
        else:
            order = f"taken as {', '.join(str(k + 1) for k in reading.order)}, base to tip, the model explains the log"
            yield reading, True, f"joints are in another order: {order}; number them from the base to the tip"
            yield (
                reading,
                False,
                f"q and v are those of other joints than tau: {order}; put all columns in one order",
            )


def _read(samples: Samples, reading: Reading, arm: Arm, torques: bool) -> Samples:
    """Filters treat every column alike, so that what passed them can be read otherwise as well as the record."""
    motion, scale, order = samples.motion, reading.scale(arm) * reading.signs, reading.order
    q, v, vdot = (scale * x[:, order] for x in (motion.q, motion.v, motion.vdot))
    return replace(
        samples,
        motion=replace(motion, q=q, v=v, vdot=vdot),
        tau=reading.signs * samples.tau[:, order] if torques else samples.tau,
        moving=samples.moving[:, order],
    )
