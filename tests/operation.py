"""Operation of the three-axis arm for tests of watching it: cheap logs with measured-like error, and what may change.

Torques come from `synthetic`, whose laws are written out there. Added are a friction that differs a little from log to
log, an error of the model that depends on the posture, and a coloured one.
"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from exact_parts import as_it_was
from numpy.typing import NDArray
from scipy.signal import lfilter
from synthetic import (
    fourier_motion,
    friction,
    measured,
    three_axis,
)

from armloop.data.log import MotionLog
from armloop.model import ReconstructedModel
from armloop.robot.kinematics import nominal_parameters, regressor

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Change:
    """What an arm has that its model has not: parts of each joint's friction, and a load, kg at 0.3 m of the last link."""

    friction: Array = field(default_factory=lambda: np.zeros(3))
    mass: float = 0.0


def operate(seed: int, k: int, change: Change | None = None, seconds: float = 20.0) -> MotionLog:
    """Log k of an arm (its seed): a motion of its own each time."""
    change = change or Change()
    rng = np.random.default_rng([seed, k])
    motion, arm = fourier_motion(seconds, 60.0, 100_003 * seed + k), three_axis()
    Y = regressor(arm, motion.q, motion.v, motion.vdot)
    tau = Y @ nominal_parameters(arm)
    if change.mass:
        tau = tau + Y[:, :, 20:] @ (change.mass * np.array([1, 0.3, 0, 0, 0, 0.09, 0.09, 0, 0, 0]))
    wear = (1 + 0.01 * rng.standard_normal(3)) * (1 + change.friction)
    tau = tau + friction(motion.v) * wear + 0.03 * np.sin(2 * motion.q + 1) * [1.0, 2.0, 0.5]
    slow = lfilter([np.sqrt(1 - 0.95**2)], [1, -0.95], rng.standard_normal(tau.shape), axis=0)
    tau = tau + 0.02 * np.sqrt((tau**2).mean(axis=0)) * slow
    return measured(motion, tau, 7 * seed + k, noise=0.01, name=f"log{k:03d}")


def healthy_model() -> ReconstructedModel:
    """The arm as it was, with what it leaves on a log of its own as its baseline."""
    return as_it_was(operate(99, 0))


def contents(store: Path) -> dict[str, bytes]:
    """Every file of a store but its lock, by its path within."""
    files = [path for path in sorted(store.rglob("*")) if path.is_file() and path.name != ".lock"]
    return {str(path.relative_to(store)): path.read_bytes() for path in files}
