"""Constraints of a designed motion: ranges of motion, and the torque that it is predicted to take."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from armloop.data.motion import Motion
from armloop.experiment.excitation import FourierReference, MotionRanges, static_poses
from armloop.robot.arm import Arm
from armloop.robot.kinematics import nominal_parameters
from armloop.robot.newton_euler import joint_torques
from armloop.util.arrays import Array
from armloop.util.errors import InputError

TorqueLaw = Callable[[Motion], Array]
"""Predicted joint torques (N, n) of a motion, N*m (N)."""

#: What is limited, in the order of `Limits.use`.
LIMITED = ("position", "velocity", "acceleration", "torque")
#: Steps in which a motion is made smaller until its torque fits.
_SHRINK = 0.97
_SMALLEST = 0.02
#: What is left to every limit when a motion is made to fit: less than a measuring system sees, more than round-off.
_MARGIN = 1e-4


@dataclass(frozen=True, eq=False)
class Limits:
    """Ranges of position, velocity and acceleration, and of the predicted torque.

    Attributes:
        ranges: position, velocity, acceleration.
        effort: (n,) N*m (N) that the drives may be asked for; infinite where nothing is known.
        torque: predicts it.
    """

    ranges: MotionRanges
    effort: Array
    torque: TorqueLaw

    def use(self, motion: Motion) -> Array:
        """(4, n) the largest part of the limits of position, velocity, acceleration and torque that is used; 1 is all."""
        half, centre = self.travel
        return np.array(
            [
                np.abs((motion.q - centre) / half).max(axis=0),
                np.abs(motion.v / self.ranges.velocity).max(axis=0),
                np.abs(motion.vdot / self.ranges.acceleration).max(axis=0),
                np.abs(self.torque(motion) / self.effort).max(axis=0),
            ]
        )

    @property
    def travel(self) -> tuple[Array, Array]:
        """(n,) half the travel of each joint, and its centre."""
        return 0.5 * (self.ranges.upper - self.ranges.lower), 0.5 * (self.ranges.upper + self.ranges.lower)

    def fitted(self, reference: FourierReference, step: float) -> FourierReference | None:
        """The reference, made smaller and moved just so far that every limit holds at each `step` seconds.

        Each joint alone gives way to its limits of motion; all together, about their centres, to the torque's.
        None if the arm cannot even rest at the centre.
        """
        shift, size = self._kinematic(reference, step)
        fitted = _scaled(reference, size, shift)
        if not np.isfinite(self.effort).any():
            return fitted
        # Torques grow with the motion: the least number of steps that does is found by halving.
        tried: dict[int, FourierReference | None] = {}

        def at(steps: int) -> FourierReference | None:
            if steps not in tried:
                smaller = _scaled(fitted, np.full(len(size), _SHRINK**steps), np.zeros(len(size)))
                fits = np.all(np.abs(self.torque(_motion(smaller, step))) <= self.effort)
                tried[steps] = smaller if fits else None
            return tried[steps]

        most = int(np.log(_SMALLEST) / np.log(_SHRINK))
        if at(0) is None and at(most) is not None:
            return at(bisect_left(range(most), True, key=lambda steps: at(steps) is not None))
        return at(0)

    def _kinematic(self, reference: FourierReference, step: float) -> tuple[Array, Array]:
        """(n,) shift of the centre and factor of the amplitude that make each joint keep its range."""
        motion = _motion(reference, step)
        low, high = (motion.q - reference.offset).min(axis=0), (motion.q - reference.offset).max(axis=0)
        used = self.ranges.used(motion.q, motion.v, motion.vdot)
        size = (1 - _MARGIN) / np.maximum(used, 1 - _MARGIN)
        inside = 0.4 * _MARGIN * (self.ranges.upper - self.ranges.lower)
        lowest, highest = self.ranges.lower + inside - size * low, self.ranges.upper - inside - size * high
        return np.clip(reference.offset, lowest, highest) - reference.offset, size


def _scaled(reference: FourierReference, size: Array, shift: Array) -> FourierReference:
    return replace(
        reference,
        offset=reference.offset + shift,
        cosine=reference.cosine * size[:, None],
        sine=reference.sine * size[:, None],
    )


def _motion(reference: FourierReference, step: float) -> Motion:
    # the end belongs to the motion: a ramp, or a duration that is no whole period, may end at its extreme
    t = np.append(np.arange(0.0, reference.duration, step), reference.duration)
    return Motion(t, *reference.evaluate(t))


def nominal_torque(arm: Arm) -> TorqueLaw:
    """Inverse dynamics with the inertias that the URDF states; no friction."""
    parameters = nominal_parameters(arm)
    return lambda motion: joint_torques(arm, parameters, motion.q, motion.v, motion.vdot)


def check_rest(arm: Arm, limits: Limits) -> None:
    """Raise ``InputError`` if a drive is too weak to hold the arm still anywhere in its ranges."""
    need = _at_rest(limits)
    if np.any(np.all(need <= limits.effort, axis=1)):
        return
    short = np.argmax((need / limits.effort).min(axis=0))
    joint = arm.joints[short]
    raise InputError(
        f"{arm.name}: no motion is within the limits: resting anywhere takes at least {need[:, short].min():.3g} "
        f"{joint.torque_unit} at joint {joint.name!r}, its drive may give {limits.effort[short]:.3g}; widen the effort "
        "limits or the ranges"
    )


def hardly_any_motion(arm: Arm, limits: Limits) -> InputError:
    """What to say where random motions do not fit: the joint that most often is too weak to hold the arm at rest."""
    need = _at_rest(limits)
    share = (need > limits.effort).mean(axis=0)
    worst = int(np.argmax(share))
    joint = arm.joints[worst]
    where = ""
    if share[worst] > 0:
        where = (
            f": joint {joint.name!r} may give {limits.effort[worst]:.3g} {joint.torque_unit}, and rest alone takes more in "
            f"{100 * share[worst]:.0f} % of the ranges, up to {need[:, worst].max():.3g}"
        )
    return InputError(
        f"{arm.name}: hardly any motion keeps within the effort limits{where}; widen them, or narrow the ranges around "
        "postures that the drives can hold"
    )


def _at_rest(limits: Limits) -> Array:
    """Torques (400, n) that random postures within the ranges take, N*m (N)."""
    poses = static_poses(limits.ranges, 400, 0)
    still = np.zeros_like(poses)
    return np.abs(limits.torque(Motion(np.arange(float(len(poses))), poses, still, still)))
