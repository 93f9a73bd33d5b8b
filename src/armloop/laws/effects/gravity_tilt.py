"""Base tilt: gravity on an arm whose base does not stand level."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from armloop.laws.effects.base import Array, Body, Context, Effect, Estimate, Parameter, Value, number
from armloop.robot.arm import Arm
from armloop.robot.kinematics import regressor
from armloop.util.errors import ModelError


def base_rotation(roll: float, pitch: float) -> Array:
    """R_WB of a base rolled about x, then pitched about y: R_y R_x."""
    cr, sr, cp, sp = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch)
    return np.array([[cp, sp * sr, sp * cr], [0, cr, -sr], [-sp, cp * sr, cp * cr]])


def tilted_gravity(gravity: Array, roll: float, pitch: float) -> Array:
    """Gravity in the frame of a base rolled about x, then pitched about y: (R_y R_x)ᵀ g."""
    return np.asarray(base_rotation(roll, pitch).T @ gravity)


class GravityTilt(Effect):
    """Gravity acts along another direction than the model took for granted."""

    name = "gravity_tilt"
    scope = "arm"
    parameters = (Parameter("roll", "rad"), Parameter("pitch", "rad"))
    load = True
    needs_inertial = True
    alike: ClassVar = {
        "payload": (
            "both change the gravity load; a run with fast and slow motion at the same postures would tell them apart"
        )
    }

    def columns(self, context: Context, shape: float) -> Array:
        # Torques are linear in gravity, and gravity in products of sines and cosines of the two angles: see embed.
        assert context.inertial is not None
        zero = np.zeros_like(context.motion.q)
        along = np.stack(
            [
                regressor(context.arm, context.motion.q, zero, zero, axis) @ context.inertial
                for axis in np.eye(3)
            ],
            axis=2,
        )
        x, y, z = context.arm.gravity
        parts = [(x, 0, 0), (-z, 0, 0), (0, x, 0), (0, y, 0), (0, z, 0), (0, 0, x), (0, 0, -y), (0, 0, z)]
        return along @ np.array(parts, dtype=float).T

    def start(self, beta: Array) -> Array:
        return np.zeros(2)

    def embed(self, x: Array) -> tuple[Array, Array]:
        """What (R_y R_x)ᵀ g − g is made of, and its derivative."""
        cr, sr, cp, sp = np.cos(x[0]), np.sin(x[0]), np.cos(x[1]), np.sin(x[1])
        beta = np.array([cp - 1, sp, sp * sr, cr - 1, cp * sr, sp * cr, sr, cp * cr - 1])
        roll = np.array([0, 0, sp * cr, -sr, cp * cr, -sp * sr, cr, -cp * sr])
        pitch = np.array([-sp, cp, cp * sr, 0, -sp * sr, cp * cr, 0, -sp * cr])
        return beta, np.column_stack([roll, pitch])

    def body(self, arm: Arm, parameters: Mapping[str, Value], inertial: Array | None) -> Body:
        if inertial is None:
            raise ModelError("effect gravity_tilt: its law needs the model's inertial parameters")
        tilted = tilted_gravity(arm.gravity, number(parameters["roll"]), number(parameters["pitch"]))
        # Gravity torques are linear in gravity: the difference of the two directions is one of them.
        return Body(inertial, tilted - arm.gravity, weight_only=True)

    def torque(self, context: Context, parameters: dict[str, Value]) -> Array:
        q, still = context.motion.q, np.zeros_like(context.motion.q)
        links, gravity, _ = self.body(context.arm, parameters, context.inertial)
        return np.asarray(regressor(context.arm, q, still, still, gravity) @ links)

    def plausible(self, arm: Arm, parameters: dict[str, Estimate]) -> bool:
        return all(abs(number(e.value)) < 0.6 for e in parameters.values())

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        roll, pitch = (np.degrees(number(parameters[key].value)) for key in ("roll", "pitch"))
        return f"the base is not level: rolled {roll:.2f}° about x and pitched {pitch:.2f}° about y"
