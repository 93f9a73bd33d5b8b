"""The configuration of a simulated arm: its joints' friction, its instruments, and the ranges it may move in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from armloop.drake.plant.fault_injection import UndeclaredEffect
from armloop.drake.plant.friction import JointFriction
from armloop.experiment.excitation import MotionRanges
from armloop.robot.arm import Arm
from armloop.util.arrays import Array


@dataclass(frozen=True)
class Instruments:
    """What the arm is measured with.

    encoder_counts : per revolution, and per `prismatic_lead` metres of a sliding joint (its screw); 0 for
        ideal ones
    torque_noise : standard deviation of white noise on the torque, as a part of each joint's RMS in the log
    velocity_half_window : s; v is the central difference of the recorded q over this time to both sides
    """

    encoder_counts: int = 2**19
    prismatic_lead: float = 0.02
    torque_noise: float = 0.01
    velocity_half_window: float = 0.006

    def resolution(self, arm: Arm) -> Array:
        """Return (n,) rad (m) per count, 0 for ideal encoders."""
        travel = np.where(arm.revolute, 2 * np.pi, self.prismatic_lead)
        return travel / self.encoder_counts if self.encoder_counts else 0.0 * travel

    def half_window(self, time_step: float) -> int:
        """Return the steps to each side that a velocity is taken over."""
        return max(1, round(self.velocity_half_window / time_step))

    def encode(self, arm: Arm, q: Array) -> Array:
        """Return positions (N, n) as the encoders read them."""
        step = self.resolution(arm)
        return np.round(q / step) * step if self.encoder_counts else q

    def sense(self, tau: Array, rng: np.random.Generator) -> Array:
        """Return torques (N, n) as the sensors read them."""
        rms = np.sqrt(np.mean(tau**2, axis=0))
        return np.asarray(tau + self.torque_noise * rms * rng.standard_normal(tau.shape))


@dataclass(frozen=True, eq=False)
class PlantConfig:
    """A simulated arm's friction, rotors, instruments and the ranges its data are collected in.

    friction : one per joint; ranges : Tables 1 and 3; time_step : s
    rotor_inertia : of each drive, seen at its joint, kg m² (kg); of none where it is empty: a URDF states none
    """

    friction: tuple[JointFriction, ...]
    ranges: MotionRanges
    instruments: Instruments = field(default_factory=Instruments)
    time_step: float = 1e-3
    rotor_inertia: tuple[float, ...] = ()

    def with_rotors(self, effects: Sequence[UndeclaredEffect] = ()) -> tuple[UndeclaredEffect, ...]:
        """Return what the plant has beside its links: the drives' rotors, and effects."""
        rotors = (
            UndeclaredEffect("rotor_inertia", j, {"inertia": inertia})
            for j, inertia in enumerate(self.rotor_inertia, 1)
            if inertia
        )
        return (*rotors, *effects)
