"""The listed effects' laws in plain arithmetic: what the drive must supply because of them.

The laws are those of :mod:`armloop.effects`, whose columns serve arrays; here they take any kind of number, for
systems that are differentiated or written out as formulas. Sensor effects act on records, not on arms, and have none.
A user's own effect is asked for its torque at samples (:mod:`armloop.dynamics.own_effects`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from armloop.arm import Arm
from armloop.dynamics.equations import Array, BodyEquations, Equations, Numbers, Rows
from armloop.dynamics.own_effects import OwnEffectEquations
from armloop.effects import EFFECTS, effect
from armloop.effects.base import Value, number
from armloop.effects.gravity_tilt import tilted_gravity
from armloop.effects.payload import link_parameters
from armloop.errors import ModelError
from armloop.functions import Functions

#: Speed, rad/s (m/s), below which the dry friction of a shared motor fades.
_SLOW = 0.01
#: (v, sign(v) or its smooth stand-in, load torque, time) of one joint -> its friction.
FrictionOfJoint = Callable[[Any, Any, Any, Any], Any]


@dataclass(frozen=True, eq=False)
class EffectLaw:
    """What one effect adds to the equations of motion.

    Attributes:
        equations: inertia and what depends on q and v smoothly; None where there is none.
        friction: the friction it adds at joint ``joint`` (0-based); None where there is none.
        load: whether its torque loads the joints, so that friction grows with it.
    """

    equations: Equations | None = None
    joint: int = 0
    friction: FrictionOfJoint | None = None
    load: bool = False


class _JointEquations(Equations):
    """An inertia and a law of the angle at one joint."""

    def __init__(self, n: int, joint: int, inertia: float, law: Callable[[Any], Any] | None) -> None:
        self.n, self._joint, self._inertia, self._law = n, joint, inertia, law

    def inertia(self, q: Numbers) -> Rows:
        M: Rows = [[0.0] * self.n for _ in range(self.n)]
        M[self._joint][self._joint] = self._inertia
        return M

    def rest(self, q: Numbers, v: Numbers) -> list[Any]:
        tau: list[Any] = [0.0] * self.n
        if self._law is not None:
            tau[self._joint] = self._law(q[self._joint])
        return tau


class _SharedMotor(Equations):
    """A motor that turns with w = v_j + r v_k: inertia, drag and, smoothed as tanh(w / slow), dry friction."""

    def __init__(self, n: int, joints: tuple[int, int], p: dict[str, float], functions: Functions) -> None:
        self.n, self._joints, self._p, self._functions = n, joints, p, functions

    def inertia(self, q: Numbers) -> Rows:
        M: Rows = [[0.0] * self.n for _ in range(self.n)]
        j, k = self._joints
        ratio, inertia = self._p["ratio"], self._p["inertia"]
        M[j][j], M[k][k] = inertia, ratio * ratio * inertia
        M[j][k] = M[k][j] = ratio * inertia
        return M

    def rest(self, q: Numbers, v: Numbers) -> list[Any]:
        tau: list[Any] = [0.0] * self.n
        (j, k), p = self._joints, self._p
        w = v[j] + p["ratio"] * v[k]
        torque = p["viscous"] * w + p["coulomb"] * self._functions.tanh(w / _SLOW)
        tau[j], tau[k] = torque, p["ratio"] * torque
        return tau


class _PoseEquations(Equations):
    """Links as their weight alone: no inertia, no Coriolis torques."""

    def __init__(self, links: BodyEquations) -> None:
        self.n, self._links = links.n, links

    def inertia(self, q: Numbers) -> Rows:
        return [[0.0] * self.n for _ in range(self.n)]

    def rest(self, q: Numbers, v: Numbers) -> list[Any]:
        return self._links.rest(q, [0.0] * self.n)


def effect_law(
    arm: Arm,
    name: str,
    joint: int | None,
    parameters: Mapping[str, Value],
    functions: Functions,
    inertial: Array | None = None,
    other_joint: int | None = None,
) -> EffectLaw:
    """The law of an effect with given parameters.

    Args:
        joint: 1-based; None for effects of the whole arm.
        other_joint: 1-based, of a ``transmission_coupling``.
        inertial: (10 n,) link parameters of the model, which ``gravity_tilt`` needs.

    Raises:
        ModelError: the effect has no law in this form (a sensor's, or one that is an event in time).
    """
    n, j = arm.n, (joint or 1) - 1
    p = {key: number(value) for key, value in parameters.items() if np.ndim(value) == 0}

    def one_joint(
        inertia: float = 0.0, law: Callable[[Any], Any] | None = None, load: bool = False
    ) -> EffectLaw:
        return EffectLaw(_JointEquations(n, j, inertia, law), j, load=load)

    if name == "payload":
        links = np.concatenate([np.zeros(10 * (n - 1)), link_parameters(arm, dict(parameters))])
        return EffectLaw(BodyEquations(arm, links, functions), load=True)
    if name == "gravity_tilt":
        if inertial is None:
            raise ModelError("effect gravity_tilt: its law needs the model's inertial parameters")
        change = tilted_gravity(arm.gravity, p["roll"], p["pitch"]) - arm.gravity
        # Gravity torques are linear in gravity: the difference of the two directions is one of them.
        return EffectLaw(_PoseEquations(BodyEquations(arm, inertial, functions, change)), load=True)
    if name == "transmission_coupling" and other_joint is not None:
        return EffectLaw(_SharedMotor(n, (j, other_joint - 1), p, functions))
    if name == "rotor_inertia":
        return one_joint(inertia=p["inertia"])
    if name == "joint_spring":
        return one_joint(law=lambda q: p["stiffness"] * (q - p["rest"]), load=True)
    if name == "torque_ripple":
        return one_joint(law=lambda q: p["amplitude"] * functions.sin(p["order"] * q + p["phase"]))
    if name in _FRICTION:
        law = _FRICTION[name]
        return EffectLaw(None, j, lambda v, sign, load, t: law(p, functions, v, sign, load, t))
    if name not in EFFECTS:
        own = effect(name, joint, other_joint)
        return EffectLaw(OwnEffectEquations(arm, own, parameters, inertial), j, load=own.load)
    raise ModelError(
        f"effect {name}: no law of q, v and vdot; those with one are: "
        + ", ".join(["payload", "gravity_tilt", "rotor_inertia", "joint_spring", "torque_ripple", *_FRICTION])
    )


def contact_equations(arm: Arm, force: Value, functions: Functions) -> Equations:
    """What the drives must supply against a force (3,) N in the base frame, pushing at the tool's origin: -J^T force.

    It is the weight of a unit mass there whose gravity is the force.
    """
    links = np.concatenate(
        [np.zeros(10 * (arm.n - 1)), link_parameters(arm, {"mass": 1.0, "com": [0.0, 0.0, 0.0]})]
    )
    return _PoseEquations(BodyEquations(arm, links, functions, np.asarray(force, dtype=float)))


_FRICTION: dict[str, Callable[[dict[str, float], Functions, Any, Any, Any, Any], Any]] = {
    "viscous_friction": lambda p, f, v, sign, load, t: p["coefficient"] * v,
    "coulomb_friction": lambda p, f, v, sign, load, t: p["level"] * sign,
    "stribeck_friction": lambda p, f, v, sign, load, t: (
        p["static_excess"] * f.exp(-(v / p["velocity"]) * (v / p["velocity"])) * sign
    ),
    "friction_asymmetry": lambda p, f, v, sign, load, t: p["level"] * (sign * sign),
    "load_dependent_friction": lambda p, f, v, sign, load, t: p["coefficient"] * abs(load) * sign,
    "quadratic_drag": lambda p, f, v, sign, load, t: p["coefficient"] * v * abs(v),
    "friction_drift": lambda p, f, v, sign, load, t: p["level"] * f.exp(-(t / p["time_constant"])) * sign,
    # As if fully slid: what it is before that depends on the past (see the Drake system of presliding).
    "presliding_hysteresis": lambda p, f, v, sign, load, t: (p["level"] + p.get("level_change", 0.0)) * sign,
}
