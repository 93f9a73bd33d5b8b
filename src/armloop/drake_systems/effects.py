"""Effects that a plant has and nobody declared, put into the simulated arm itself.

The laws are those of the diagnosis, with its sign: what the drive must supply *in addition* (a spring k (q -
q0) pulls on the plant with -k (q - q0)), or what the sensor says. Nothing here knows how they are found
again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armloop.arm import Arm
from armloop.errors import ScenarioError

_PARAMETERS: dict[str, tuple[str, ...]] = {
    "payload": ("mass", "com"),
    "viscous_friction": ("coefficient",),
    "coulomb_friction": ("level",),
    "joint_spring": ("stiffness", "rest"),
    "torque_ripple": ("amplitude", "order", "phase"),
    "rotor_inertia": ("inertia",),
    "torque_offset": ("offset",),
    "gravity_tilt": ("roll", "pitch"),
}
_WHOLE_ARM = ("payload", "gravity_tilt")
_AT_LEAST_ZERO = ("mass", "coefficient", "level", "inertia")

EFFECTS: tuple[str, ...] = tuple(_PARAMETERS)
"""The effects that can be put into a plant."""


@dataclass(frozen=True)
class UndeclaredEffect:
    """One effect in the plant.

    name : one of `EFFECTS`
    joint : 1-based joint number; None for `payload` and `gravity_tilt`, which belong to the whole arm
    parameters : SI units, by name:
        payload: mass, com (3,) in the frame of the link `tool` (without one, of the last link): a steel ball
        viscous_friction: coefficient c; coulomb_friction: level f (raises f_s and f_c alike)
        joint_spring: stiffness k, rest q0; torque_ripple: A sin(N q + phi) by amplitude, order, phase
        rotor_inertia: inertia I reflected to the joint; torque_offset: offset b, recorded = true + b
        gravity_tilt: roll, pitch of the base against the level: R = R_y(pitch) R_x(roll), g_base = R^T g

    Raises `ScenarioError` for an unknown name, a joint given or missing, or wrong parameters.
    """

    name: str
    joint: int | None
    parameters: Mapping[str, Any]

    def __post_init__(self) -> None:
        if self.name not in _PARAMETERS:
            raise ScenarioError(f"effect {self.name!r} is unknown; the plant can have: {', '.join(EFFECTS)}")
        if (self.joint is None) != (self.name in _WHOLE_ARM):
            needed = "no joint: it belongs to the whole arm" if self.name in _WHOLE_ARM else "a joint, from 1"
            raise ScenarioError(f"effect {self.name}: joint is {self.joint}; it must have {needed}")
        expected = _PARAMETERS[self.name]
        if set(self.parameters) != set(expected):
            given = ", ".join(self.parameters) or "none"
            raise ScenarioError(
                f"effect {self.name}: parameters are {given}; they must be {', '.join(expected)}"
            )
        for key, value in self.parameters.items():
            shape = (3,) if key == "com" else ()
            try:
                number = np.asarray(value, dtype=float)
            except (TypeError, ValueError):
                raise ScenarioError(f"effect {self.name}: {key} is {value!r}; it must be a number") from None
            if number.shape != shape or not np.isfinite(number).all():
                wanted = "three finite numbers" if shape else "one finite number"
                raise ScenarioError(f"effect {self.name}: {key} is {value!r}; it must be {wanted}")
            if key in _AT_LEAST_ZERO and number < 0:
                raise ScenarioError(f"effect {self.name}: {key} is {value!r}; it must not be negative")


@dataclass(frozen=True, eq=False)
class Realisation:
    """The effects as quantities of the plant, n joints.

    viscous, coulomb, rotor_inertia, torque_offset : (n,)
    springs : (S, 3) rows of joint index (from 0), stiffness, rest
    ripples : (S, 4) rows of joint index, amplitude, order, phase
    payloads : pairs of mass and centre of mass (3,) in the last link's frame
    R_WB : (3, 3) rotation of the base in the level world
    """

    viscous: NDArray[np.float64]
    coulomb: NDArray[np.float64]
    rotor_inertia: NDArray[np.float64]
    torque_offset: NDArray[np.float64]
    springs: NDArray[np.float64]
    ripples: NDArray[np.float64]
    payloads: tuple[tuple[float, NDArray[np.float64]], ...] = ()
    R_WB: NDArray[np.float64] = field(default_factory=lambda: np.eye(3))


def realise(arm: Arm, effects: Sequence[UndeclaredEffect]) -> Realisation:
    """Turn effects into what the plant of `arm` must be given; equal effects add up.

    Raises `ScenarioError` when a joint number is not one of the arm's.
    """
    per_joint = {key: np.zeros(arm.n) for key in ("viscous", "coulomb", "rotor_inertia", "torque_offset")}
    springs: list[tuple[float, ...]] = []
    ripples: list[tuple[float, ...]] = []
    payloads: list[tuple[float, NDArray[np.float64]]] = []
    R_WB = np.eye(3)
    for effect in effects:
        if effect.joint is not None and not 1 <= effect.joint <= arm.n:
            raise ScenarioError(
                f"effect {effect.name}: joint {effect.joint}; {arm.name} has joints 1 to {arm.n}"
            )
        j = (effect.joint or 1) - 1
        p = effect.parameters
        match effect.name:
            case "payload":
                com = arm.X_tool[:3, :3] @ np.asarray(p["com"], dtype=float) + arm.X_tool[:3, 3]
                payloads.append((float(p["mass"]), com))
            case "viscous_friction":
                per_joint["viscous"][j] += p["coefficient"]
            case "coulomb_friction":
                per_joint["coulomb"][j] += p["level"]
            case "rotor_inertia":
                per_joint["rotor_inertia"][j] += p["inertia"]
            case "torque_offset":
                per_joint["torque_offset"][j] += p["offset"]
            case "joint_spring":
                springs.append((j, p["stiffness"], p["rest"]))
            case "torque_ripple":
                ripples.append((j, p["amplitude"], p["order"], p["phase"]))
            case "gravity_tilt":
                R_WB = R_WB @ _tilt(float(p["roll"]), float(p["pitch"]))
    return Realisation(
        **per_joint,
        springs=np.array(springs, dtype=float).reshape(-1, 3),
        ripples=np.array(ripples, dtype=float).reshape(-1, 4),
        payloads=tuple(payloads),
        R_WB=R_WB,
    )


def _tilt(roll: float, pitch: float) -> NDArray[np.float64]:
    """Return R_y(pitch) R_x(roll)."""
    cr, sr, cp, sp = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch)
    return np.array([[cp, sp * sr, sp * cr], [0, cr, -sr], [-sp, cp * sr, cp * cr]])
