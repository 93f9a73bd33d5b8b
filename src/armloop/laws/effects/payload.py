"""Payload: a rigid body fixed to the last link, a load or a tool; or one that has been taken off it."""

from __future__ import annotations

from dataclasses import replace
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
from armloop.robot.kinematics import regressor
from armloop.robot.newton_euler import joint_torques

_FOUR = np.eye(4)
#: A centre farther out than a load can be, by no more than so many standard errors, is one that the motion hides.
_HIDDEN = 3.0
_TENSOR = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


class Payload(Effect):
    """A compact body of mass m with centre c on the last link: M(q), bias and gravity of a rigid body.

    Its torques are linear in ten parameters (m, m c, inertia about the link's origin). Of these a compact
    body has five free ones: m, m c and one inertia about its own centre, equal in all directions; so a
    motion that hides some of the ten cannot turn them into an impossible body. ``com`` is given in the
    frame of the link ``tool`` if the URDF has one fixed to the last moving link, else in that link's frame.
    What the model has and the arm has no longer, a tool that was taken off, has a negative mass and own inertia.
    """

    name = "payload"
    scope = "arm"
    parameters = (
        Parameter("mass", "kg", least=0.0),
        Parameter("com", "m", size=3),
        Parameter("own_inertia", "kg*m^2", least=0.0, default=0.0),
    )
    needs_model = False
    complexity = 5
    load = True
    #: Whether the model may have had it, and the arm lacks it.
    removable: ClassVar[bool] = True

    def _mass(self, x: Array) -> tuple[float, float]:
        """The mass, kg, never nothing, and its sign."""
        mass = float(x[0])
        sign = -1.0 if self.removable and mass < 0 else 1.0
        return sign * max(sign * mass, 1e-3), sign

    def columns(self, context: Context, shape: float) -> Array:
        motion = context.motion
        return regressor(context.arm, motion.q, motion.v, motion.vdot, links=[context.arm.n - 1])

    def start(self, beta: Array) -> Array:
        mass, _ = self._mass(beta)
        return np.array([mass, *beta[1:4], 1e-4 * mass])

    def embed(self, x: Array) -> tuple[Array, Array]:
        # Asked for thousands of times a diagnosis: plain floats are twenty times faster than small arrays.
        mass, sign = self._mass(x)
        own = sign * max(sign * float(x[4]), 0.0)
        square, (a, b, c) = float(x[1:4] @ x[1:4]), x[1:4].tolist()
        point = [(square - a * a) / mass, (square - b * b) / mass, (square - c * c) / mass]
        point += [-a * b / mass, -a * c / mass, -b * c / mass]
        beta = np.array([mass, a, b, c, *(p + own for p in point[:3]), *point[3:]])
        J = np.zeros((10, 5))
        J[:4, :4] = _FOUR
        J[4:, 0] = [-p / mass for p in point]
        a, b, c = a / mass, b / mass, c / mass
        J[4:, 1:4] = [
            [0, 2 * b, 2 * c],
            [2 * a, 0, 2 * c],
            [2 * a, 2 * b, 0],
            [-b, -a, 0],
            [-c, 0, -a],
            [0, -c, -b],
        ]
        J[4:7, 4] = 1.0
        return beta, J

    def body(self, arm: Arm, parameters: Values, inertial: Array | None) -> Body:
        return Body(np.concatenate([np.zeros(10 * (arm.n - 1)), link_parameters(arm, parameters)]))

    def torque(self, context: Context, parameters: dict[str, Value]) -> Array:
        arm, motion = context.arm, context.motion
        return joint_torques(
            arm, self.body(arm, parameters, None).parameters, motion.q, motion.v, motion.vdot
        )

    def estimates(self, arm: Arm, x: Array, covariance: Array, shape: float) -> dict[str, Estimate]:
        mass, sign = self._mass(x)
        com = x[1:4] / mass
        J = np.hstack([-com[:, None] / mass, np.eye(3) / mass])
        R, p = arm.X_tool[:3, :3], arm.X_tool[:3, 3]
        mass_error, own_error = std_errors(np.eye(5), covariance)[[0, 4]].tolist()
        errors = std_errors(R.T @ J, covariance[:4, :4])
        return {
            "mass": Estimate(mass, mass_error, "kg"),
            "com": Estimate(_within(R.T @ (com - p), errors, reach(arm)).tolist(), errors.tolist(), "m"),
            "own_inertia": Estimate(sign * max(sign * float(x[4]), 0.0) + 0.0, own_error, "kg*m^2"),
        }

    def plausible(self, arm: Arm, parameters: dict[str, Estimate]) -> bool:
        # The centre of a body lies where something bolted to the flange can reach.
        mass, com = number(parameters["mass"].value), np.asarray(parameters["com"].value)
        return (mass > 0 or (self.removable and mass < 0)) and float(np.linalg.norm(com)) < reach(arm)

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        mass, com = parameters["mass"], parameters["com"]
        known = np.isfinite(np.broadcast_to(com.std_error, 3))
        each = zip(np.asarray(com.value), np.broadcast_to(com.std_error, 3), known, strict=True)
        at = ", ".join(Estimate(x, e, "1").words(3) if one else "not determined" for x, e, one in each)
        what = "a body" if number(mass.value) > 0 else "no longer a body that the model has,"
        heavy = replace(mass, value=abs(number(mass.value)))
        # the words know no arm, so they say by which rule its link is chosen
        return (
            f"{what} of {heavy.words()} on the last link, centre at ({at}) m in the frame of the link tool (of the last "
            "moving link if the URDF has no tool)"
        )


def reach(arm: Arm) -> float:
    """Distance from the flange, m, within which the centre of a load lies."""
    chain = float(np.linalg.norm(arm.X_PF[:, :3, 3], axis=1).sum())
    # The last link's own length is not in the chain; a link reaches twice as far as its centre, and a load beyond.
    return max(0.15, 0.5 * chain, 2.5 * float(np.linalg.norm(arm.com[-1])))


def _within(com: Array, errors: Array, farthest: float) -> Array:
    """The centre (3,) of a load nearest to one that was found, in its standard errors, that lies so far away, m, at most.

    A motion that hides a component of it leaves that to noise. One that is surely farther away stays.
    """
    from scipy.optimize import brentq

    known = np.isfinite(errors)
    found, spread = np.where(known, com, 0.0), np.where(known, errors, 0.0)
    if np.linalg.norm(found) < farthest:
        return com

    def pulled(strength: float) -> Array:
        return np.asarray(found / (1 + strength * spread**2))

    # the multiplier of the constraint: the stronger, the nearer to the flange
    strongest = 1e9 / max(float(spread.max()), 1e-9) ** 2
    if np.linalg.norm(pulled(strongest)) > 0.999 * farthest:
        return com
    near = pulled(brentq(lambda x: float(np.linalg.norm(pulled(x))) - 0.999 * farthest, 0.0, strongest))
    off = (near - found)[spread > 0] / spread[spread > 0]
    return near if np.linalg.norm(off) <= _HIDDEN else com


def link_parameters(arm: Arm, parameters: Values) -> Array:
    """(10,) parameters about the last link's origin, in its frame."""
    mass, com_tool = number(parameters["mass"]), np.asarray(parameters["com"], dtype=float)
    com = arm.X_tool[:3, :3] @ com_tool + arm.X_tool[:3, 3]
    own = number(parameters.get("own_inertia", 0.0))
    tensor = mass * (float(com @ com) * np.eye(3) - np.outer(com, com)) + own * np.eye(3)
    return np.concatenate([[mass], mass * com, [tensor[i] for i in _TENSOR]])
