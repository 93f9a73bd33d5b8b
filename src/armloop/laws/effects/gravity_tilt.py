"""Base tilt: gravity on an arm whose base does not stand level."""

from __future__ import annotations

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
    Values,
    number,
    std_errors,
)
from armloop.robot.arm import Arm
from armloop.robot.kinematics import LINK_PARAMETERS, regressor
from armloop.robot.levelling import base_rotation
from armloop.robot.newton_euler import joint_torques
from armloop.util.errors import ModelError

#: An axis turned by less than this from the vertical, rad, is upright.
_UPRIGHT = 1e-3
_MOMENT = LINK_PARAMETERS.index("mx")


def tilted_gravity(gravity: Array, roll: float, pitch: float) -> Array:
    """Gravity in the frame of a base rolled about x, then pitched about y: (R_y R_x)ᵀ g."""
    return np.asarray(base_rotation(roll, pitch).T @ gravity)


def unshown_axes(arm: Arm) -> tuple[int, Array]:
    """A link, and (3, 2) axes in its frame along which no motion above a level base shows its first moment; else zeros.

    About an upright first turning axis, carried by upright slides alone, the first moments that turn with its link alone
    enter neither level gravity nor M(q).
    """
    down, R_WF = arm.gravity / np.linalg.norm(arm.gravity), np.eye(3)
    for link, axis in enumerate(arm.axis):
        R_WF = R_WF @ arm.X_PF[link, :3, :3]
        if np.linalg.norm(np.cross(R_WF @ axis, down)) > _UPRIGHT:
            break
        if arm.revolute[link]:
            across = np.eye(3) - np.outer(axis, axis)
            one = across[:, int(np.argmin(np.abs(axis)))]
            one = one / np.linalg.norm(one)
            return link, np.column_stack([one, np.cross(axis, one)])
    return 0, np.zeros((3, 2))


class GravityTilt(Effect):
    """Gravity acts along another direction than the model took for granted.

    On an upright first turning axis it pulls at a first moment that a level arm's motion does not show, and that no model
    can have: ``first_moment``, of the link that turns about it, in its frame, is found with the angles there, and is zero
    for what a model knows.
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
        link, axes = unshown_axes(arm)
        unshown = np.stack([each[:, :, _of(link)] @ axes for each in along], axis=3)
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
        # np.kron takes ten times as long for factors so small, and a diagnosis asks thousands of times
        moments = np.array([1.0, x[2], x[3]])[:, None]
        J = np.zeros((3, len(turned), 4))
        J[:, :, 0], J[:, :, 1] = moments * roll, moments * pitch
        J[1, :, 2] = J[2, :, 3] = turned
        return (moments * turned).ravel(), J.reshape(-1, 4)

    def estimates(self, arm: Arm, x: Array, covariance: Array, shape: float) -> dict[str, Estimate]:
        errors = std_errors(np.eye(4)[:2], covariance).tolist()
        found = {
            key: Estimate(float(value), error, "rad")
            for key, value, error in zip(("roll", "pitch"), x, errors, strict=False)
        }
        _, axes = unshown_axes(arm)
        if axes.any():
            errors = std_errors(axes, covariance[2:, 2:]).tolist()
            found["first_moment"] = Estimate((axes @ x[2:]).tolist(), errors, "kg*m")
        return found

    def body(self, arm: Arm, parameters: Values, inertial: Array | None) -> Body:
        if inertial is None:
            raise ModelError("effect gravity_tilt: its law needs the model's inertial parameters")
        tilted = tilted_gravity(arm.gravity, number(parameters["roll"]), number(parameters["pitch"]))
        # Gravity torques are linear in gravity: the difference of the two directions is one of them.
        return Body(with_first_moment(arm, inertial, parameters), tilted - arm.gravity, weight_only=True)

    def torque(self, context: Context, parameters: dict[str, Value]) -> Array:
        q, still = context.motion.q, np.zeros_like(context.motion.q)
        links, gravity, _ = self.body(context.arm, parameters, context.inertial)
        return joint_torques(context.arm, links, q, still, still, gravity)

    def plausible(self, arm: Arm, parameters: dict[str, Estimate]) -> bool:
        return all(abs(number(parameters[key].value)) < 0.6 for key in ("roll", "pitch"))

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        def by(angle: Estimate) -> str:
            # as of a roll about the only axis that turns
            hidden = np.isnan(number(angle.std_error))
            return "by what the motion does not show" if hidden else f"{np.degrees(number(angle.value)):.2f}°"

        roll, pitch = (by(parameters[key]) for key in ("roll", "pitch"))
        return f"the base is not level: rolled {roll} about x and pitched {pitch} about y"


def with_first_moment(arm: Arm, inertial: Array, parameters: Values) -> Array:
    """Link parameters (10 n,) with a tilt's first moment of the first turning link, which a level arm does not show."""
    links, (link, _) = np.array(inertial, dtype=float), unshown_axes(arm)
    links[_of(link)] += np.asarray(parameters.get("first_moment", 0.0), dtype=float)
    return links


def _of(link: int) -> slice:
    """Where a link's first moment stands among the parameters of all."""
    first = link * len(LINK_PARAMETERS) + _MOMENT
    return slice(first, first + 3)
