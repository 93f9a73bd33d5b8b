"""Base tilt: gravity on an arm whose base does not stand level."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from armloop.laws.effects.base import (
    Array,
    Body,
    Context,
    Effect,
    Estimate,
    Parameter,
    Value,
    number,
    std_errors,
)
from armloop.robot.arm import Arm
from armloop.robot.kinematics import LINK_PARAMETERS, regressor
from armloop.util.errors import ModelError

#: A first axis turned by less than this from the vertical, rad: level gravity shows no first moment about it.
_UPRIGHT = 1e-3
_FIRST_MOMENT = slice(LINK_PARAMETERS.index("mx"), LINK_PARAMETERS.index("mz") + 1)


def base_rotation(roll: float, pitch: float) -> Array:
    """R_WB of a base rolled about x, then pitched about y: R_y R_x."""
    cr, sr, cp, sp = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch)
    return np.array([[cp, sp * sr, sp * cr], [0, cr, -sr], [-sp, cp * sr, cp * cr]])


def tilted_gravity(gravity: Array, roll: float, pitch: float) -> Array:
    """Gravity in the frame of a base rolled about x, then pitched about y: (R_y R_x)ᵀ g."""
    return np.asarray(base_rotation(roll, pitch).T @ gravity)


def unshown_axes(arm: Arm) -> Array:
    """(3, 2) axes in link 1's frame along which no motion above a level base shows its first moment; zeros without such.

    About a vertical first axis the arm's first moments that turn with link 1 alone enter neither level gravity nor M(q).
    """
    first = arm.axis[0]
    axis, down = arm.X_PF[0, :3, :3] @ first, arm.gravity / np.linalg.norm(arm.gravity)
    if not arm.revolute[0] or np.linalg.norm(np.cross(axis, down)) > _UPRIGHT:
        return np.zeros((3, 2))
    across = np.eye(3) - np.outer(first, first)
    one = across[:, int(np.argmin(np.abs(first)))]
    one = one / np.linalg.norm(one)
    return np.column_stack([one, np.cross(first, one)])


class GravityTilt(Effect):
    """Gravity acts along another direction than the model took for granted.

    On a vertical first axis it pulls at a first moment that a level arm's motion does not show, and that no model can
    have: ``first_moment``, of link 1 in its frame, is found with the angles there, and is zero for what a model knows.
    """

    name = "gravity_tilt"
    scope = "arm"
    parameters = (
        Parameter("roll", "rad"),
        Parameter("pitch", "rad"),
        Parameter("first_moment", "kg*m", size=3, default=[0.0, 0.0, 0.0]),
    )
    # the angles; a moment is nothing without them
    complexity = 2
    nested = 2
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
        arm, q = context.arm, context.motion.q
        zero = np.zeros_like(q)
        along = [regressor(arm, q, zero, zero, axis) for axis in np.eye(3)]
        own = np.stack([each @ context.inertial for each in along], axis=2)
        unshown = np.stack([each[:, :, _FIRST_MOMENT] @ unshown_axes(arm) for each in along], axis=3)
        x, y, z = arm.gravity
        parts = [(x, 0, 0), (-z, 0, 0), (0, x, 0), (0, y, 0), (0, z, 0), (0, 0, x), (0, 0, -y), (0, 0, z)]
        P = np.array(parts, dtype=float).T
        return np.concatenate([own @ P, *(unshown[:, :, k] @ P for k in range(2))], axis=2)

    def start(self, beta: Array) -> Array:
        return np.zeros(4)

    def embed(self, x: Array) -> tuple[Array, Array]:
        """What (R_y R_x)ᵀ g − g is made of, once and times either moment, and its derivative."""
        cr, sr, cp, sp = np.cos(x[0]), np.sin(x[0]), np.cos(x[1]), np.sin(x[1])
        turned = np.array([cp - 1, sp, sp * sr, cr - 1, cp * sr, sp * cr, sr, cp * cr - 1])
        roll = np.array([0, 0, sp * cr, -sr, cp * cr, -sp * sr, cr, -cp * sr])
        pitch = np.array([-sp, cp, cp * sr, 0, -sp * sr, cp * cr, 0, -sp * cr])
        moments = np.array([1.0, x[2], x[3]])
        J = np.kron(np.eye(3)[:, 1:], turned[:, None])
        slopes = (np.kron(moments, each) for each in (roll, pitch))
        return np.kron(moments, turned), np.column_stack([*slopes, J])

    def estimates(self, arm: Arm, x: Array, covariance: Array, shape: float) -> dict[str, Estimate]:
        errors = std_errors(np.eye(4)[:2], covariance).tolist()
        found = {
            key: Estimate(float(value), error, "rad")
            for key, value, error in zip(("roll", "pitch"), x, errors, strict=False)
        }
        axes = unshown_axes(arm)
        if axes.any():
            errors = std_errors(axes, covariance[2:, 2:]).tolist()
            found["first_moment"] = Estimate((axes @ x[2:]).tolist(), errors, "kg*m")
        return found

    def body(self, arm: Arm, parameters: Mapping[str, Value], inertial: Array | None) -> Body:
        if inertial is None:
            raise ModelError("effect gravity_tilt: its law needs the model's inertial parameters")
        tilted = tilted_gravity(arm.gravity, number(parameters["roll"]), number(parameters["pitch"]))
        # Gravity torques are linear in gravity: the difference of the two directions is one of them.
        return Body(with_first_moment(inertial, parameters), tilted - arm.gravity, weight_only=True)

    def torque(self, context: Context, parameters: dict[str, Value]) -> Array:
        q, still = context.motion.q, np.zeros_like(context.motion.q)
        links, gravity, _ = self.body(context.arm, parameters, context.inertial)
        return np.asarray(regressor(context.arm, q, still, still, gravity) @ links)

    def plausible(self, arm: Arm, parameters: dict[str, Estimate]) -> bool:
        return all(abs(number(parameters[key].value)) < 0.6 for key in ("roll", "pitch"))

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        roll, pitch = (np.degrees(number(parameters[key].value)) for key in ("roll", "pitch"))
        return f"the base is not level: rolled {roll:.2f}° about x and pitched {pitch:.2f}° about y"


def with_first_moment(inertial: Array, parameters: Mapping[str, Value]) -> Array:
    """Link parameters (10 n,) with a tilt's first moment of link 1, which a level arm does not show."""
    links = np.array(inertial, dtype=float)
    links[_FIRST_MOMENT] += np.asarray(parameters.get("first_moment", 0.0), dtype=float)
    return links
