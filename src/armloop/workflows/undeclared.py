"""Blind fault injection of the demonstration: an effect drawn from a seed, sealed until the verdict is out.

Only the simulation is handed what is drawn here. The diagnosis reads a model file and a log; it can import
neither this file nor the simulator (a test forbids it).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from armloop.drake.plant.fault_injection import UndeclaredEffect
from armloop.robot.arm import Arm
from armloop.robot.kinematics import nominal_parameters, regressor

#: What the demonstration draws from.
EFFECTS = (
    "payload",
    "viscous_friction",
    "coulomb_friction",
    "joint_spring",
    "torque_ripple",
    "rotor_inertia",
    "torque_offset",
    "gravity_tilt",
)


def draw(arm: Arm, seed: int) -> UndeclaredEffect:
    """Draw an effect, its joint and its size.

    Every effect of :data:`EFFECTS` is equally likely, at any joint. Sizes are uniform over a range that starts
    where an engineer would begin to care, about five percent of the joint's gravity and inertia torque,
    and ends at four times that.
    """
    rng = np.random.default_rng([seed, 0x5EA1])
    name = str(rng.choice(EFFECTS))
    size = rng.uniform(1.0, 4.0)
    sign = float(rng.choice([-1.0, 1.0]))
    turning = np.flatnonzero(arm.revolute)
    joint = int(rng.choice(turning if name == "torque_ripple" else np.arange(arm.n)))
    level = 0.05 * float(_typical_torque(arm)[joint])
    at = joint + 1
    if name == "payload":
        share = 0.05 * size * float(arm.mass.sum()) / arm.n
        com = arm.com[-1] * rng.uniform(1.2, 2.0) + rng.uniform(-0.03, 0.03, 3)
        tool = np.linalg.inv(arm.X_tool) @ np.append(com, 1.0)
        return UndeclaredEffect(name, None, {"mass": 2 * share, "com": tool[:3].tolist()})
    if name == "gravity_tilt":
        direction = rng.uniform(0, 2 * np.pi)
        angle = np.radians(1.5) * size
        return UndeclaredEffect(
            name, None, {"roll": float(angle * np.cos(direction)), "pitch": float(angle * np.sin(direction))}
        )
    speed, pull = (0.5, 1.0) if arm.joints[joint].kind == "revolute" else (0.05, 0.1)
    parameters: dict[str, dict[str, Any]] = {
        "viscous_friction": {"coefficient": level * size / speed},
        "coulomb_friction": {"level": level * size},
        "joint_spring": {
            "stiffness": 2 * level * size / speed,
            "rest": float(rng.uniform(-0.5, 0.5)) * 2 * speed,
        },
        "torque_ripple": {
            "amplitude": level * size,
            "order": float(rng.integers(5, 21)),
            "phase": float(rng.uniform(-np.pi, np.pi)),
        },
        "rotor_inertia": {"inertia": level * size / pull},
        "torque_offset": {"offset": sign * level * size},
    }
    return UndeclaredEffect(name, at, parameters[name])


def _typical_torque(arm: Arm) -> np.ndarray:
    """(n,) RMS torque of the bare arm over random postures, unit velocities and accelerations."""
    rng = np.random.default_rng(0)
    rates = np.where(arm.revolute, 1.0, 0.1)
    q = rng.uniform(-1.5, 1.5, (500, arm.n)) * np.where(arm.revolute, 1.0, 0.1)
    v, vdot = rng.normal(size=(2, 500, arm.n)) * rates
    torque = regressor(arm, q, v, 2 * vdot) @ nominal_parameters(arm)
    rms = np.sqrt(np.mean(torque**2, axis=0))
    # A joint that carries little (the first, upright one) is still expected to carry part of what the others do.
    return np.asarray(np.where(arm.revolute, np.maximum(rms, 0.3 * rms[arm.revolute].max()), rms))
