"""The paper's two simulations, Sects. 4.1 and 4.2: arms, ranges, sample counts, orders, noise, trajectories."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from armloop.data.log import MotionLog
from armloop.data.motion import Motion
from armloop.experiment.excitation import MotionRanges
from armloop.features.angle_sums import AngleSums
from armloop.features.double_feature_set import DoubleFeatureSet
from armloop.robot.arm import Arm, load_arm
from armloop.robot.kinematics import nominal_parameters, regressor
from armloop.util.arrays import Array

#: Second feature set of each step, and of one-shot SINDy.
SECOND = {"sindy": "both", "step1": "none", "step2": "velocity", "step3": "acceleration"}
STEPS = ("step1", "step2", "step3")


@dataclass(frozen=True)
class Experiment:
    """One arm of the paper as it is simulated there."""

    arm_name: str
    ranges: MotionRanges  # of q, v and vdot in the data collections (Tables 1 and 3), rad, s, m
    counts: tuple[int, int, int]  # samples of the static, constant-velocity and varying data
    orders: dict[str, tuple[int, int]]  # optimal (N1, N2) of one-shot SINDy and of the steps
    penalty: float  # λ of Eq. (32)
    threshold: float  # from which size a coefficient counts as active
    # centre and amplitude of the trajectory outside the range of the data, q(t) = c + a sin(πt)
    beyond: tuple[tuple[float, ...], tuple[float, ...]]

    @cached_property
    def arm(self) -> Arm:
        """The arm's description."""
        return load_arm(self.arm_name)

    @property
    def revolute(self) -> tuple[bool, ...]:
        """Which joints turn."""
        return tuple(bool(turns) for turns in self.arm.revolute)

    def library(
        self, part: str, orders: tuple[int, int] | None = None, independent: bool = False
    ) -> DoubleFeatureSet:
        """The paper's library of one-shot SINDy or of a step, with or without what sin² + cos² = 1 makes redundant."""
        return DoubleFeatureSet(
            self.revolute, *(orders or self.orders[part]), SECOND[part], independent=independent
        )

    def waves(self, part: str, orders: tuple[int, int] | None = None) -> AngleSums:
        """The same functions as angle sums, without redundancy."""
        return AngleSums(self.revolute, *(orders or self.orders[part]), SECOND[part])

    def torque(self, motion: Motion) -> Array:
        """(N, n) exact torques."""
        return regressor(self.arm, motion.q, motion.v, motion.vdot) @ nominal_parameters(self.arm)

    def beyond_range(self) -> Motion:
        """The trajectory outside the range of the data (captions of Figs. 6 and 11), two periods of it."""
        t = np.linspace(0.0, 4.0, 801)
        centre, amplitude = (np.array(part) for part in self.beyond)
        q = centre + np.outer(np.sin(np.pi * t), amplitude)
        v = np.pi * np.outer(np.cos(np.pi * t), amplitude)
        return Motion(t, q, v, -(np.pi**2) * np.outer(np.sin(np.pi * t), amplitude))


def as_motion(*logs: MotionLog) -> tuple[Motion, Array]:
    """The samples of logs that bring their accelerations, one after the other, and their torques."""
    q, v, vdot, tau = (
        np.concatenate([np.asarray(getattr(log, key)) for log in logs]) for key in ("q", "v", "vdot", "tau")
    )
    return Motion(np.arange(float(len(q))), q, v, vdot), tau


_QUARTER = np.pi / 4
_HALF = np.pi / 2

SCARA = Experiment(
    "scara",
    MotionRanges(
        np.array([-_HALF, -_HALF, 0.0, -_HALF]),
        np.array([_HALF, _HALF, 0.2, _HALF]),
        np.array([_QUARTER, _QUARTER, 0.1, _QUARTER]),
        np.array([_HALF, _HALF, 0.2, _HALF]),
    ),
    (2000, 4000, 4000),
    {"sindy": (1, 2), "step1": (1, 0), "step2": (1, 2), "step3": (1, 1)},
    0.02,
    0.001,
    ((_HALF, _HALF, 0.2, _HALF), (np.pi / 12, np.pi / 12, 0.05, np.pi / 12)),
)

THREE_AXIS = Experiment(
    "three_axis",
    MotionRanges(
        np.array([-_HALF, -np.pi / 3, -np.pi]),
        np.array([_HALF, np.pi / 3, np.pi]),
        np.full(3, _HALF),
        np.full(3, np.pi),
    ),
    (1000, 10000, 10000),
    {"sindy": (4, 2), "step1": (2, 0), "step2": (4, 2), "step3": (4, 1)},
    1.0,
    0.01,
    ((_HALF, -_HALF, _HALF), (np.pi / 3, np.pi / 6, np.pi / 3)),
)

EXPERIMENTS = {experiment.arm_name: experiment for experiment in (SCARA, THREE_AXIS)}
