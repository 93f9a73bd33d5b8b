"""A base that does not stand level."""

from __future__ import annotations

import numpy as np

from armloop.arm import Arm
from armloop.effects.base import Array, Context, Effect, Estimate, Pointwise, Value, number
from armloop.kinematics import regressor
from armloop.newton_euler import inverse_dynamics


def tilted_gravity(gravity: Array, roll: float, pitch: float) -> Array:
    """Gravity in the frame of a base rolled about x, then pitched about y: (R_y R_x)ᵀ g."""
    cr, sr, cp, sp = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch)
    R_WB = np.array([[cp, sp * sr, sp * cr], [0, cr, -sr], [-sp, cp * sr, cp * cr]])
    return R_WB.T @ gravity


class GravityTilt(Effect):
    """Gravity acts along another direction than the model took for granted."""

    name = "gravity_tilt"
    joint_wise = False
    complexity = 2
    load = True
    needs_inertial = True

    def _gravity_torque(self, context: Context, gravity: Array) -> Array:
        assert context.inertial is not None
        zero = np.zeros_like(context.motion.q)
        return regressor(context.arm, context.motion.q, zero, zero, gravity) @ context.inertial

    def columns(self, context: Context, shape: float) -> Array:
        # Torques are linear in gravity, and gravity in products of sines and cosines of the two angles: see embed.
        along = np.stack([self._gravity_torque(context, axis) for axis in np.eye(3)], axis=2)
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

    def torque(self, context: Context, parameters: dict[str, Value]) -> Array:
        g = context.arm.gravity
        tilted = tilted_gravity(g, number(parameters["roll"]), number(parameters["pitch"]))
        return self._gravity_torque(context, tilted) - self._gravity_torque(context, g)

    def pointwise(self, arm: Arm, parameters: dict[str, Value], inertial: Array | None) -> Pointwise:
        assert inertial is not None
        tilted = tilted_gravity(arm.gravity, number(parameters["roll"]), number(parameters["pitch"]))
        # Gravity torques are linear in gravity: the difference of the two directions is one of them.
        change = inverse_dynamics(arm, inertial, tilted - arm.gravity)
        rest = np.zeros(arm.n)
        return lambda q, v, vdot: change(q, rest, rest)

    def estimates(self, arm: Arm, x: Array, covariance: Array, shape: float) -> dict[str, Estimate]:
        errors = np.sqrt(np.diag(covariance))
        return {
            name: Estimate(float(b), float(e), "rad")
            for name, b, e in zip(("roll", "pitch"), x, errors, strict=True)
        }

    def plausible(self, arm: Arm, parameters: dict[str, Estimate]) -> bool:
        return all(abs(number(e.value)) < 0.6 for e in parameters.values())

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        roll, pitch = (np.degrees(number(parameters[key].value)) for key in ("roll", "pitch"))
        return f"the base is not level: rolled {roll:.2f}° about x and pitched {pitch:.2f}° about y"
