"""Effects that a plant has and nobody declared, put into the simulated arm itself.

The laws are those of the diagnosis, with its sign: what the drive must supply *in addition* (a spring k (q -
q0) pulls on the plant with -k (q - q0)), or what the sensor says. Nothing here knows how they are found
again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armloop.arm import Arm
from armloop.drake_systems.own_effects import Law, check_own, own_law
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
    "stribeck_friction": ("static_excess", "velocity"),
    "friction_asymmetry": ("level",),
    "load_dependent_friction": ("coefficient",),
    "quadratic_drag": ("coefficient",),
    "friction_drift": ("level", "time_constant"),
    "presliding_hysteresis": ("level", "width"),
    "transmission_coupling": ("inertia", "viscous", "coulomb", "ratio"),
    "torque_gain": ("gain",),
    "encoder_offset": ("offset",),
    "time_delay": ("seconds",),
    "external_contact": ("start", "end", "force"),
}
_WHOLE_ARM = ("payload", "gravity_tilt", "time_delay", "external_contact")
_VECTORS = ("com", "force")
_AT_LEAST_ZERO = (
    "mass",
    "coefficient",
    "inertia",
    "static_excess",
    "viscous",
    "coulomb",
    "gain",
    "start",
)
_ABOVE_ZERO = ("velocity", "time_constant", "width")

EFFECTS: tuple[str, ...] = tuple(_PARAMETERS)
"""The listed effects, all of which can be put into a plant; a user's own can, too."""


@dataclass(frozen=True)
class UndeclaredEffect:
    """One effect in the plant.

    name : one of `EFFECTS`, or an effect of the user's own (`armloop.effects.register`), whose parameters are its own
    joint : 1-based joint number; None for what belongs to the whole arm
    other_joint : the other joint of a `transmission_coupling`, else None
    parameters : SI units, by name:
        payload: mass, com (3,) in the frame of the link `tool` (without one, of the last link): a steel ball
        viscous_friction: coefficient c; coulomb_friction: level f (raises f_s and f_c alike)
        stribeck_friction: static_excess d, velocity v_s; friction_asymmetry: level a, either way
        load_dependent_friction: coefficient mu of the torque that passes the joint
        quadratic_drag: coefficient of v |v|; friction_drift: level f, time_constant T
        joint_spring: stiffness k, rest q0; torque_ripple: A sin(N q + phi) by amplitude, order, phase
        presliding_hysteresis: level f, width w of an elasto-plastic element
        transmission_coupling: inertia, viscous, coulomb of a motor that turns with v_j + ratio v_k, ratio +-1
        rotor_inertia: inertia I reflected to the joint; torque_offset: offset b, recorded = true + b
        torque_gain: gain g, recorded = g true; encoder_offset: offset d, recorded q = true q + d
        time_delay: seconds that the torque is recorded late
        gravity_tilt: roll, pitch of the base against the level: R = R_y(pitch) R_x(roll), g_base = R^T g
        external_contact: force (3,) in the base frame at the tool's origin, from start to end, s

    Raises `ScenarioError` for an unknown name, a joint given or missing, or wrong parameters.
    """

    name: str
    joint: int | None
    parameters: Mapping[str, Any]
    other_joint: int | None = None

    def __post_init__(self) -> None:
        if self.name not in _PARAMETERS:
            check_own(self.name, self.joint, self.other_joint)
            return
        if (self.joint is None) != (self.name in _WHOLE_ARM):
            needed = "no joint: it belongs to the whole arm" if self.name in _WHOLE_ARM else "a joint, from 1"
            raise ScenarioError(f"effect {self.name}: joint is {self.joint}; it must have {needed}")
        if (self.other_joint is not None) != (self.name == "transmission_coupling"):
            raise ScenarioError(
                f"effect {self.name}: other_joint is {self.other_joint}; only couplings have one"
            )
        expected = _PARAMETERS[self.name]
        if set(self.parameters) != set(expected):
            given = ", ".join(self.parameters) or "none"
            raise ScenarioError(
                f"effect {self.name}: parameters are {given}; they must be {', '.join(expected)}"
            )
        for key, value in self.parameters.items():
            shape = (3,) if key in _VECTORS else ()
            try:
                number = np.asarray(value, dtype=float)
            except (TypeError, ValueError):
                raise ScenarioError(f"effect {self.name}: {key} is {value!r}; it must be a number") from None
            if number.shape != shape or not np.isfinite(number).all():
                wanted = "three finite numbers" if shape else "one finite number"
                raise ScenarioError(f"effect {self.name}: {key} is {value!r}; it must be {wanted}")
            asymmetric = self.name == "friction_asymmetry"  # its level has a direction
            if key in (*_AT_LEAST_ZERO, *(() if asymmetric else ("level",))) and number < 0:
                raise ScenarioError(f"effect {self.name}: {key} is {value!r}; it must not be negative")
            if key in _ABOVE_ZERO and number <= 0:
                raise ScenarioError(f"effect {self.name}: {key} is {value!r}; it must be above 0")
        if abs(float(self.parameters.get("ratio", 1.0))) != 1:
            raise ScenarioError(
                f"effect {self.name}: ratio is {self.parameters['ratio']!r}; it must be 1 or -1"
            )
        if self.name == "external_contact" and self.parameters["end"] <= self.parameters["start"]:
            raise ScenarioError(f"effect {self.name}: end must come after start")


@dataclass(frozen=True, eq=False)
class DryFriction:
    """What effects add to a joint's dry friction.

    level : N*m (N); constant : of it, what acts alike in both directions, N*m (N)
    stribeck : pairs of excess and velocity; by_load : part of the load; fading : pairs of level and time constant
    """

    level: float = 0.0
    constant: float = 0.0
    stribeck: tuple[tuple[float, float], ...] = ()
    by_load: float = 0.0
    fading: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True, eq=False)
class Realisation:
    """The effects as quantities of the plant, n joints.

    viscous, quadratic, rotor_inertia : (n,); dry : one per joint
    torque_offset, torque_gain, encoder_offset : (n,), torque_delay : s, faults of the instruments
    springs : (S, 3) rows of joint index (from 0), stiffness, rest
    ripples : (S, 4) rows of joint index, amplitude, order, phase
    presliding : (S, 3) rows of joint index, level, width
    couplings : (S, 6) rows of both joint indices, ratio, inertia, viscous, coulomb
    contacts : (S, 5) rows of start, end, force in the base frame
    payloads : pairs of mass and centre of mass (3,) in the last link's frame
    R_WB : (3, 3) rotation of the base in the level world
    own : laws of the user's own effects
    """

    viscous: NDArray[np.float64]
    quadratic: NDArray[np.float64]
    rotor_inertia: NDArray[np.float64]
    torque_offset: NDArray[np.float64]
    torque_gain: NDArray[np.float64]
    encoder_offset: NDArray[np.float64]
    torque_delay: float
    dry: tuple[DryFriction, ...]
    springs: NDArray[np.float64]
    ripples: NDArray[np.float64]
    presliding: NDArray[np.float64]
    couplings: NDArray[np.float64]
    contacts: NDArray[np.float64]
    payloads: tuple[tuple[float, NDArray[np.float64]], ...] = ()
    R_WB: NDArray[np.float64] = field(default_factory=lambda: np.eye(3))
    own: tuple[Law, ...] = ()


def realise(arm: Arm, effects: Sequence[UndeclaredEffect]) -> Realisation:
    """Turn effects into what the plant of `arm` must be given; equal effects add up.

    Raises `ScenarioError` when a joint number is not one of the arm's.
    """
    sums = {
        key: np.zeros(arm.n)
        for key in ("viscous", "quadratic", "rotor_inertia", "torque_offset", "encoder_offset")
    }
    gain, delay = np.ones(arm.n), 0.0
    dry = [DryFriction() for _ in arm.joints]
    rows: dict[str, list[tuple[float, ...]]] = {key: [] for key in _ROWS}
    payloads: list[tuple[float, NDArray[np.float64]]] = []
    R_WB = np.eye(3)
    own: list[Law] = []
    for effect in effects:
        for joint in (effect.joint, effect.other_joint):
            if joint is not None and not 1 <= joint <= arm.n:
                raise ScenarioError(
                    f"effect {effect.name}: joint {joint}; {arm.name} has joints 1 to {arm.n}"
                )
        j, k = (effect.joint or 1) - 1, (effect.other_joint or 1) - 1
        p = effect.parameters
        match effect.name:
            case "payload":
                com = arm.X_tool[:3, :3] @ np.asarray(p["com"], dtype=float) + arm.X_tool[:3, 3]
                payloads.append((float(p["mass"]), com))
            case "viscous_friction":
                sums["viscous"][j] += p["coefficient"]
            case "quadratic_drag":
                sums["quadratic"][j] += p["coefficient"]
            case "rotor_inertia":
                sums["rotor_inertia"][j] += p["inertia"]
            case "torque_offset" | "encoder_offset":
                sums[effect.name][j] += p["offset"]
            case "torque_gain":
                gain[j] *= p["gain"]
            case "time_delay":
                delay += float(p["seconds"])
            case "coulomb_friction":
                dry[j] = replace(dry[j], level=dry[j].level + float(p["level"]))
            case "friction_asymmetry":
                dry[j] = replace(dry[j], constant=dry[j].constant + float(p["level"]))
            case "stribeck_friction":
                more = (float(p["static_excess"]), float(p["velocity"]))
                dry[j] = replace(dry[j], stribeck=(*dry[j].stribeck, more))
            case "load_dependent_friction":
                dry[j] = replace(dry[j], by_load=dry[j].by_load + float(p["coefficient"]))
            case "friction_drift":
                more = (float(p["level"]), float(p["time_constant"]))
                dry[j] = replace(dry[j], fading=(*dry[j].fading, more))
            case "joint_spring":
                rows["springs"].append((j, p["stiffness"], p["rest"]))
            case "torque_ripple":
                rows["ripples"].append((j, p["amplitude"], p["order"], p["phase"]))
            case "presliding_hysteresis":
                rows["presliding"].append((j, p["level"], p["width"]))
            case "transmission_coupling":
                rows["couplings"].append((j, k, p["ratio"], p["inertia"], p["viscous"], p["coulomb"]))
            case "external_contact":
                rows["contacts"].append((p["start"], p["end"], *p["force"]))
            case "gravity_tilt":
                R_WB = R_WB @ _tilt(float(p["roll"]), float(p["pitch"]))
            case _:
                own.append(own_law(arm, effect.name, effect.joint, effect.other_joint, p))
    return Realisation(
        **sums,
        torque_gain=gain,
        torque_delay=delay,
        dry=tuple(dry),
        **{key: np.array(rows[key], dtype=float).reshape(-1, width) for key, width in _ROWS.items()},
        payloads=tuple(payloads),
        R_WB=R_WB,
        own=tuple(own),
    )


_ROWS = {"springs": 3, "ripples": 4, "presliding": 3, "couplings": 6, "contacts": 5}


def _tilt(roll: float, pitch: float) -> NDArray[np.float64]:
    """Return R_y(pitch) R_x(roll)."""
    cr, sr, cp, sp = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch)
    return np.array([[cp, sp * sr, sp * cr], [0, cr, -sr], [-sp, cp * sr, cp * cr]])
