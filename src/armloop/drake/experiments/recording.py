"""What an arm's own instruments record of a motion: encoders, velocities by differences, torque sensors with noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armloop.data.log import MotionLog, unchecked_log
from armloop.drake.plant.config import Instruments
from armloop.drake.plant.plant import ArmPlant
from armloop.util.arrays import Array


@dataclass(frozen=True, eq=False)
class Recording:
    """What a logger holds of one motion, before the torque sensor's noise: time (N,), q, v, tau (N, n)."""

    time: Array
    q: Array
    v: Array
    tau: Array


def record(
    plant: ArmPlant,
    instruments: Instruments,
    time_step: float,
    time: Array,
    q: Array,
    tau: Array,
    rows: NDArray[np.signedinteger],
) -> Recording:
    """Return what the instruments of a plant hold of a motion at some of its steps.

    time : (N,) s, a step apart; q (N, n) : true positions; tau (M, n), M <= N : the drives' torques
    rows : steps that are recorded, `half_window` or more from both ends

    q is read from the encoders; v is their central difference over `velocity_half_window` to both sides, as an offline
    logger computes it (zero phase). Faults of the sensors are in it.
    """
    half = instruments.half_window(time_step)
    q = instruments.encode(plant.arm, q)
    v = (q[rows + half] - q[rows - half]) / (2 * half * time_step)
    time, q = time[: len(tau)], q[: len(tau)]
    for effect, parameters in plant.effects.faults:
        falsified = effect.falsified(time, q, tau, parameters)
        assert falsified is not None
        q, tau = falsified
    return Recording(time[rows], q[rows], v, tau[rows])


def as_log(
    name: str, recordings: Sequence[Recording], instruments: Instruments, rng: np.random.Generator
) -> MotionLog:
    """Join recordings into one log, one run each, with the torque sensor's noise."""
    period = float(np.median(np.diff(recordings[0].time)))
    time, now = [], 0.0
    for recording in recordings:
        # At least 20 periods apart: longer than the gap that separates runs.
        time.append(now + recording.time)
        now = float(time[-1][-1]) + 20 * period
    q, v, tau = (np.concatenate([getattr(r, key) for r in recordings]) for key in ("q", "v", "tau"))
    tau = instruments.sense(tau, rng)
    # No more digits than the instruments have: the files stay small. Not checked as a measurement is: an unstable loop does
    # what no arm can have done.
    return unchecked_log(
        time=np.concatenate(time).round(6),
        q=np.round(q, 9),
        v=np.round(v, 7),
        tau=np.round(tau, 6),
        name=name,
    )
