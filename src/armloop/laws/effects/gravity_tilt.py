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
    Values,
    number,
    std_errors,
    with_error,
)
from armloop.robot.arm import Arm
from armloop.robot.kinematics import LINK_PARAMETERS, regressor
from armloop.robot.levelling import base_rotation
from armloop.robot.newton_euler import joint_torques
from armloop.util.errors import ModelError

#: An axis turned by less than this from the vertical, rad, is upright.
_UPRIGHT = 1e-3
_MOMENT, _MASS = LINK_PARAMETERS.index("mx"), LINK_PARAMETERS.index("m")
#: What (R_y R_x)ᵀ g − g is made of.
_PARTS = 8
#: So many level slides are told from their motors, at most.
_SLIDES = 3
#: First moment, kg·m, from which on other joints tell a slide's angle.
_TELLS = 1e-6


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


def level_slides(arm: Arm) -> list[int]:
    """Slides (0-based) that carry all the rest, and are level with the base.

    A level arm's motion shows what they move together with their motors, which have no weight.
    """
    down, R_WF, found = arm.gravity / np.linalg.norm(arm.gravity), np.eye(3), list[int]()
    for joint, axis in enumerate(arm.axis):
        R_WF = R_WF @ arm.X_PF[joint, :3, :3]
        if arm.revolute[joint]:
            break
        if abs(R_WF @ axis @ down) < _UPRIGHT:
            found.append(joint)
    return found[:_SLIDES]


class GravityTilt(Effect):
    """Gravity acts along another direction than the model took for granted.

    On an upright first turning axis it pulls at a first moment that a level arm's motion does not show, and that no model
    can have: ``first_moment``, of the link that turns about it, in its frame, is found with the angles there, and is zero
    for what a model knows. So is what of the mass that a level slide moves has no weight, ``weightless``, slide by slide,
    where other joints tell the angle.
    """

    name = "gravity_tilt"
    scope = "arm"
    parameters = (
        Parameter("roll", "rad"),
        Parameter("pitch", "rad"),
        Parameter("first_moment", "kg*m", size=3, default=[0.0, 0.0, 0.0]),
        Parameter("weightless", "kg", size=_SLIDES, default=[0.0] * _SLIDES),
    )
    # the angles; a moment or a mass is nothing without them
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
        slides, lighter = level_slides(arm), []
        for k in slides:
            # along the slide the others must feel gravity, else a lighter slide leans by more
            axis = np.array([each[0, k, _at(k, _MASS)] for each in along])
            told = np.abs(np.delete(own, slides, axis=1) @ axis).max(initial=0.0) > _TELLS
            lighter.append(np.zeros_like(own))
            lighter[-1][:, k] = -axis * told
        return np.concatenate(
            [part @ P for part in (own, unshown[:, :, 0], unshown[:, :, 1], *lighter)], axis=2
        )

    def start(self, beta: Array) -> Array:
        # the angles, a moment across an axis, and a mass of each slide
        return np.zeros(4 + max(len(beta) // _PARTS - 3, 0))

    def embed(self, x: Array) -> tuple[Array, Array]:
        """What (R_y R_x)ᵀ g − g is made of, once and times either moment and every mass, and its derivative."""
        cr, sr, cp, sp = np.cos(x[0]), np.sin(x[0]), np.cos(x[1]), np.sin(x[1])
        turned = np.array([cp - 1, sp, sp * sr, cr - 1, cp * sr, sp * cr, sr, cp * cr - 1])
        roll = np.array([0, 0, sp * cr, -sr, cp * cr, -sp * sr, cr, -cp * sr])
        pitch = np.array([-sp, cp, cp * sr, 0, -sp * sr, cp * cr, 0, -sp * cr])
        # np.kron takes ten times as long for factors so small, and a diagnosis asks thousands of times
        factors = np.array([1.0, *x[2:]])[:, None]
        J = np.zeros((len(factors), len(turned), len(x)))
        J[:, :, 0], J[:, :, 1] = factors * roll, factors * pitch
        for k in range(1, len(factors)):
            J[k, :, k + 1] = turned
        return (factors * turned).ravel(), J.reshape(-1, len(x))

    def alone(self, x: Array) -> slice:
        return slice(2)

    def estimates(self, arm: Arm, x: Array, covariance: Array, shape: float) -> dict[str, Estimate]:
        errors = std_errors(np.eye(len(x))[:2], covariance).tolist()
        found = {
            key: Estimate(float(value), error, "rad")
            for key, value, error in zip(("roll", "pitch"), x, errors, strict=False)
        }
        _, axes = unshown_axes(arm)
        if axes.any():
            errors = std_errors(axes, covariance[2:4, 2:4]).tolist()
            found["first_moment"] = Estimate((axes @ x[2:4]).tolist(), errors, "kg*m")
        errors = std_errors(np.eye(len(x))[4:], covariance).tolist()
        if np.isfinite(errors).any():
            more = [0.0] * (_SLIDES - len(errors))
            found["weightless"] = Estimate([*x[4:].tolist(), *more], [*errors, *more], "kg")
        return found

    def body(self, arm: Arm, parameters: Values, inertial: Array | None) -> Body:
        if inertial is None:
            raise ModelError("effect gravity_tilt: its law needs the model's inertial parameters")
        tilted = tilted_gravity(arm.gravity, number(parameters["roll"]), number(parameters["pitch"]))
        # Gravity torques are linear in gravity: the difference of the two directions is one of them.
        return Body(of_what_leans(arm, inertial, parameters), tilted - arm.gravity, weight_only=True)

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
        return f"the base is not level: rolled {roll} about x and pitched {pitch} about y{_of_slides(parameters)}"


def of_what_leans(arm: Arm, inertial: Array, parameters: Values) -> Array:
    """Link parameters (10 n,) that weigh: with a tilt's first moment of the first turning link, which a level arm does not
    show, and without what of its level slides has no weight.
    """
    links, (link, _) = np.array(inertial, dtype=float), unshown_axes(arm)
    links[_of(link)] += np.asarray(parameters.get("first_moment", 0.0), dtype=float)
    for k, mass in weightless(arm, parameters).items():
        links[_at(k, _MASS)] -= mass
        if k:  # what carries a slide carries its motor
            links[_at(k - 1, _MASS)] += mass
    return links


def weightless(arm: Arm, parameters: Values) -> dict[int, float]:
    """By level slide (0-based) the mass, kg, that it moves and that has no weight, as a motor's."""
    masses = np.asarray(parameters.get("weightless", [0.0] * _SLIDES), dtype=float)
    return dict(zip(level_slides(arm), masses.tolist(), strict=False))


def _of_slides(parameters: Mapping[str, Estimate]) -> str:
    """What is said of masses without weight; nothing where no slide has any."""
    if "weightless" not in parameters:
        return ""
    each = parameters["weightless"]
    pairs = zip(np.ravel(each.value).tolist(), np.ravel(each.std_error).tolist(), strict=True)
    listed = [with_error(value, error) for value, error in pairs if error > 0]
    return f"; of what its level slides move {', '.join(listed)} kg have no weight, as their motors have none"


def _of(link: int) -> slice:
    """Where a link's first moment stands among the parameters of all."""
    first = _at(link, _MOMENT)
    return slice(first, first + 3)


def _at(link: int, parameter: int) -> int:
    """Where a link's parameter stands among those of all."""
    return link * len(LINK_PARAMETERS) + parameter
