"""Scenarios as the simulation takes them, validated; `scenarios` makes them of YAML files."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armloop.drake.control.pid import PidGains
from armloop.drake.plant.config import PlantConfig
from armloop.drake.plant.fault_injection import Effects, UndeclaredEffect
from armloop.experiment.excitation import Reference
from armloop.robot.arm import Arm
from armloop.schemas.scenarios import WearData


@dataclass(frozen=True, eq=False)
class Plant:
    """A named simulated arm, ready to be built."""

    name: str
    arm: Arm
    config: PlantConfig


@dataclass(frozen=True, eq=False)
class Pickup:
    """A payload from `at` s on; the log is diagnosed and the model swapped at `diagnose_at` s."""

    at: float
    diagnose_at: float
    payload: UndeclaredEffect


Wear = WearData
"""How often friction is drawn, and the standard deviation of its parameters' logarithms."""


@dataclass(frozen=True, eq=False)
class TrackingScenario:
    """A tracking experiment, validated.

    score : (start, end) s, the interval that is scored; controllers : names of `controllers.REGISTRY`
    bandwidth : rad/s, of computed torque; None for what makes it as stiff as kp
    rate : (n,) N*m/s (N/s), how fast the drives can change their torques; None for any
    used : share of the drives' limits that `bounded` plans with
    effects : what the plant has and the models may not know
    """

    name: str
    plant: Plant
    gains: PidGains
    reference: Reference
    score: tuple[float, float]
    controllers: tuple[str, ...]
    seed: int
    bandwidth: float | None
    pickup: Pickup | None
    wear: Wear | None
    rate: np.ndarray | None
    used: float
    effects: Effects = ()
