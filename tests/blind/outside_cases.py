"""What is hidden in runs of arms from outside: effects of random kind and place, of a given size.

A size is the RMS torque of the effect over the joint's RMS torque, on the joint where that is largest, and is set by
simulating twice. Nothing here, nor in the engine, is part of armloop.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import mujoco
import numpy as np
from outside.references import OutsideReference

Effect = dict[str, Any]

#: The names of ``diagnosis.json`` that MuJoCo can be given, and events.
KINDS = (
    "payload",
    "viscous_friction",
    "coulomb_friction",
    "stribeck_friction",
    "friction_asymmetry",
    "load_dependent_friction",
    "quadratic_drag",
    "friction_drift",
    "joint_spring",
    "torque_ripple",
    "presliding_hysteresis",
    "transmission_coupling",
    "rotor_inertia",
    "torque_gain",
    "torque_offset",
    "encoder_offset",
    "time_delay",
    "gravity_tilt",
    "external_contact",
    "external_torque",
)
#: Springs on one side, which are hidden in runs of their own.
STOPS = ("upper_end_stop", "lower_end_stop")
TENDONS = ("coupling_spring", "elastic_cable")
#: Parameters that are proportional to the torque of an effect.
_LINEAR = {
    "payload": ("mass",),
    "viscous_friction": ("coefficient",),
    "coulomb_friction": ("level",),
    "stribeck_friction": ("static_excess",),
    "friction_asymmetry": ("level",),
    "load_dependent_friction": ("coefficient",),
    "quadratic_drag": ("coefficient",),
    "friction_drift": ("level",),
    "joint_spring": ("stiffness",),
    **dict.fromkeys(STOPS, ("stiffness",)),
    "torque_ripple": ("amplitude",),
    "presliding_hysteresis": ("level",),
    "transmission_coupling": ("inertia", "viscous", "coulomb"),
    "rotor_inertia": ("inertia",),
    "torque_offset": ("offset",),
    "encoder_offset": ("offset",),
    "time_delay": ("seconds",),
    "gravity_tilt": ("roll", "pitch"),
    **dict.fromkeys(TENDONS, ("stiffness",)),
    "external_contact": ("force",),
    "external_torque": ("torque",),
}
#: Laws that no list has, with their words; ``c`` is set by the size.
_LAWS: dict[str, Callable[[float, np.ndarray, np.ndarray, int, int], float]] = {
    "c cos(2 q_j) v_j": lambda t, q, v, j, k: np.cos(2 * q[j]) * v[j],
    "c sin(3 q_j) v_j^2": lambda t, q, v, j, k: np.sin(3 * q[j]) * v[j] ** 2,
    "c v_j v_k": lambda t, q, v, j, k: v[j] * v[k],
    "c v_j^3": lambda t, q, v, j, k: v[j] ** 3,
    "c cos(q_k) sign(v_j)": lambda t, q, v, j, k: np.cos(q[k]) * np.tanh(v[j] / 0.01),
}


@dataclass(frozen=True)
class HiddenCase:
    """What is hidden: ``one``, ``two``, ``clean``, ``unlisted``, ``event``, ``carried``, ``stop``, ``tendon``; effects with
    their sizes, and words.
    """

    kind: str
    effects: list[Effect] = field(default_factory=list)
    sizes: list[float] = field(default_factory=list)
    law: str = ""

    def sealed(self) -> dict[str, Any]:
        """JSON-ready values: functions left out."""
        plain = [{k: v for k, v in e.items() if k != "law"} for e in self.effects]
        return {"kind": self.kind, "effects": plain, "sizes": self.sizes, "law": self.law}


def draw_case(arm: Any, reference: OutsideReference, seed: int, kind: str, size: float) -> HiddenCase:
    """Effects of random kind and place, each of the given size on this reference."""
    rng = np.random.default_rng([seed, 0xCA5E])
    if kind == "clean":
        return HiddenCase(kind)
    short = OutsideReference(reference.step, *(x[: int(12 / reference.step)] for x in _parts(reference)))
    bare = _torque(arm, short, [])
    if kind == "unlisted":
        words = str(rng.choice(list(_LAWS)))
        j = int(rng.integers(arm.joints))
        k = (j + 1 + int(rng.integers(max(arm.joints - 1, 1)))) % arm.joints
        law = _LAWS[words]

        def made(c: float) -> Effect:
            return {"name": "unlisted", "joint": j + 1, "law": lambda t, q, v: c * law(t, q, v, j, k)}

        scale = size / _share(arm, short, bare, made(0.1)) * 0.1
        return HiddenCase(
            kind, [made(scale)], [size], words.replace("_j", str(j + 1)).replace("_k", str(k + 1))
        )
    if kind == "carried":
        load = None
        while load is None:
            load = _sized(arm, short, bare, _draw(arm, "payload", reference.seconds, rng) or {}, size)
        intervals = _cycles(reference.seconds, rng)
        return HiddenCase(kind, [{**load, "name": "carried_load", "intervals": intervals}], [size])
    own = {"event": ("external_contact", "external_torque"), "stop": STOPS, "tendon": TENDONS}
    names = own.get(kind, KINDS[:-2])
    effects: list[Effect] = []
    while len(effects) < (2 if kind == "two" else 1):
        name = str(rng.choice(names))
        effect = (
            _cable(arm, short, rng) if name == "elastic_cable" else _draw(arm, name, reference.seconds, rng)
        )
        if effect is None or any(effect["name"] == other["name"] for other in effects):
            continue
        sized = _sized(arm, short, bare, effect, size)
        if sized is not None:
            effects.append(sized)
    return HiddenCase(kind, effects, [size] * len(effects))


def _cycles(seconds: float, rng: Any) -> list[tuple[float, float]]:
    """Intervals of equal length, over and over, in which a load is carried; a run may begin and end with it."""
    period, duty = float(rng.uniform(4.0, 9.0)), float(rng.uniform(0.3, 0.7))
    first = float(rng.uniform(0.0, period)) - period
    each = [(first + k * period, first + (k + duty) * period) for k in range(int(seconds / period) + 2)]
    return [(max(a, 0.0), min(b, seconds)) for a, b in each if b > 0.5 and a < seconds - 0.5]


def _parts(reference: OutsideReference) -> tuple[np.ndarray, ...]:
    return reference.q, reference.v, reference.vdot


def _torque(arm: Any, reference: OutsideReference, effects: list[Effect]) -> np.ndarray:
    log = arm.simulate(reference, effects, clean=True, rate=200)
    return np.column_stack([log[f"tau{j + 1}"] for j in range(arm.joints)])


def _share(arm: Any, short: OutsideReference, bare: np.ndarray, effect: Effect) -> float:
    """RMS torque of an effect over that of the joint, the largest of the joints; of an event, while it lasts."""
    if "start" in effect:
        effect = {**effect, "start": -1.0, "end": 1e9, "smooth": False}
    tau = _torque(arm, short, [effect]) - bare
    # The joints that stick shake a little: what the effect adds is seen after the first half second.
    return float((np.sqrt(np.mean(tau[100:] ** 2, axis=0)) / np.sqrt(np.mean(bare**2, axis=0))).max())


def _sized(arm: Any, short: OutsideReference, bare: np.ndarray, effect: Effect, size: float) -> Effect | None:
    if effect["name"] == "torque_gain":
        return {**effect, "gain": 1 + size * float(np.sign(effect["gain"] - 1))}
    for _ in range(2):
        share = _share(arm, short, bare, effect)
        if share < 1e-6:
            return None
        scaled = {k: np.multiply(effect[k], size / share).tolist() for k in _LINEAR[effect["name"]]}
        effect = {**effect, **scaled}
    return None if effect["name"] == "payload" and effect["mass"] > 20 else effect


def _cable(arm: Any, short: OutsideReference, rng: Any) -> Effect:
    """A cable to a link beyond the first, from somewhere around it, that is slack for up to half of a run, or never."""
    link = int(rng.integers(2, arm.joints + 1))
    model = mujoco.MjModel.from_xml_string(arm.mjcf(1e-3))
    data, attached = mujoco.MjData(model), rng.uniform(-0.15, 0.15, 3)
    points = []
    for q in short.q[:: max(len(short.q) // 200, 1)]:
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        points.append(data.xpos[link] + data.xmat[link].reshape(3, 3) @ attached)
    anchor = np.mean(points, axis=0) + rng.uniform(0.3, 0.9) * (d := rng.normal(size=3)) / np.linalg.norm(d)
    slack = float(np.quantile(np.linalg.norm(points - anchor, axis=1), rng.uniform(0.0, 0.5)))
    return {
        "name": "elastic_cable",
        "joint": None,
        "stiffness": 10.0,
        "slack_length": slack * float(rng.choice([1.0, 1.0, 0.5])),
        "anchor": anchor.tolist(),
        "attached": attached.tolist(),
        "link": link,
    }


def _draw(arm: Any, name: str, seconds: float, rng: Any) -> Effect | None:
    """An effect with typical parameters; the size is set later."""
    n = arm.joints
    j = int(rng.integers(n))
    link, e = arm.links[j], {"name": name, "joint": j + 1}
    level = max(link.frictionloss, 0.05)
    sign = float(rng.choice([-1.0, 1.0]))
    start = float(rng.uniform(0.2, 0.6) * seconds)
    if name == "payload":
        last = arm.links[-1]
        com = last.com + rng.uniform(-0.03, 0.03, 3)
        return {"name": name, "joint": None, "mass": 0.3 * last.mass, "com": com.tolist(), "radius": 0.03}
    if name == "gravity_tilt":
        roll, pitch = rng.uniform(-0.05, 0.05, 2)
        return {"name": name, "joint": None, "roll": float(roll), "pitch": float(pitch)}
    if name == "time_delay":
        return {"name": name, "joint": None, "seconds": 0.01}
    if name == "transmission_coupling":
        k = int(rng.integers(n))
        if k == j or arm.links[j].slides or arm.links[k].slides:
            return None
        j, k = min(j, k), max(j, k)
        both = {"joint": j + 1, "other_joint": k + 1, "ratio": sign}
        return {
            "name": name,
            **both,
            "inertia": 0.3 * link.armature,
            "viscous": 0.3 * link.damping,
            "coulomb": level / 3,
        }
    if name == "coupling_spring":
        k = int(rng.integers(n))
        if k == j or arm.links[j].slides or arm.links[k].slides:
            return None
        both = {
            "joint": min(j, k) + 1,
            "other_joint": max(j, k) + 1,
            "ratio": sign * float(rng.uniform(0.5, 2.0)),
        }
        return {"name": name, **both, "stiffness": level, "rest": float(rng.uniform(-0.5, 0.5))}
    if name == "torque_ripple":
        order = int(rng.integers(6, 25))
        return (
            None
            if link.slides
            else {**e, "amplitude": level, "order": order, "phase": float(rng.uniform(-3, 3))}
        )
    if name == "stribeck_friction":
        return {**e, "static_excess": level, "velocity": float(rng.uniform(0.1, 0.3) * link.speed)}
    if name == "presliding_hysteresis":
        return {**e, "level": level, "width": float(rng.uniform(0.004, 0.02) * link.reach)}
    if name == "friction_drift":
        return {**e, "level": level, "time_constant": float(rng.uniform(0.2, 0.5) * seconds)}
    if name == "joint_spring":
        return {**e, "stiffness": level, "rest": float(rng.uniform(-0.5, 0.5) * link.reach)}
    if name in STOPS:
        return {**e, "stiffness": level, "begins": float(rng.uniform(-0.4, 0.4) * link.reach)}
    if name == "external_contact":
        long = float(np.exp(rng.uniform(np.log(0.3), np.log(3.0))))
        return {
            "name": name,
            "joint": None,
            "body": int(rng.integers(1, n + 1)),
            "force": (10 * rng.normal(size=3)).tolist(),
            "start": start,
            "end": start + long,
            "smooth": bool(rng.random() < 0.6),
        }
    if name == "external_torque":
        long = float(np.exp(rng.uniform(np.log(0.3), np.log(2.0))))
        return {
            **e,
            "torque": sign * level,
            "start": start,
            "end": start + long,
            "smooth": bool(rng.random() < 0.6),
        }
    values = {
        "viscous_friction": ("coefficient", link.damping),
        "coulomb_friction": ("level", level),
        "friction_asymmetry": ("level", sign * level),
        "load_dependent_friction": ("coefficient", 0.05),
        "quadratic_drag": ("coefficient", link.damping),
        "rotor_inertia": ("inertia", link.armature),
        "torque_gain": ("gain", 1 + 0.1 * sign),
        "torque_offset": ("offset", sign * level),
        "encoder_offset": ("offset", 0.03 * sign),
    }
    key, value = values[name]
    return {**e, key: value}
