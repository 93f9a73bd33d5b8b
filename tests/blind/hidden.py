"""What is hidden in a run: effects of random kind, place and size, drawn from a seed."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from armloop.data.motion import Motion
from armloop.drake.plant.fault_injection import EFFECTS as REALISED
from armloop.drake.plant.fault_injection import UndeclaredEffect
from armloop.drake.plant.friction import JointFriction
from armloop.experiment.excitation import Reference
from armloop.laws.effects import EFFECTS, Context, effect
from armloop.robot.arm import Arm
from armloop.robot.kinematics import nominal_parameters, regressor

#: Effects that the plant can have and no run is drawn with: what an arm is built with, and what has cases of its own.
NOT_DRAWN = ("spring_balancer", "counterbalance", "elastic_cable")
KINDS = ("one", "one", "one", "one", "two", "clean", "unlisted")


@dataclass(frozen=True)
class Hidden:
    """Effects with their sizes: RMS torque of each as a share of the torque RMS of the joint it shows on most."""

    kind: str
    effects: list[UndeclaredEffect]
    sizes: list[float]
    law: str = ""
    extra: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Run:
    """The motion on which a size is a size: that of the reference, with the torque the bare arm needs."""

    arm: Arm
    motion: Motion
    tau: np.ndarray
    rigid: np.ndarray

    @staticmethod
    def of(arm: Arm, friction: list[JointFriction], reference: Reference) -> Run:
        """Sample the reference at 50 Hz."""
        t = np.arange(0.0, reference.duration, 0.02)
        q, v, vdot = reference.evaluate(t)
        rigid = regressor(arm, q, v, vdot) @ nominal_parameters(arm)
        rub = np.column_stack([f.force(v[:, j]) for j, f in enumerate(friction)])
        return Run(arm, Motion(t, q, v, vdot, np.array([0])), rigid + rub, rigid)

    def size(self, hidden: UndeclaredEffect) -> float:
        """RMS torque of an effect over the torque RMS, on the joint where that is largest (a contact: while it lasts)."""
        kind = effect(hidden.name, hidden.joint, hidden.other_joint)
        context = Context(
            self.arm, self.motion, nominal_parameters(self.arm), 0.02, self.rigid, self._predict, self.tau
        )
        parameters = {key: np.asarray(value).tolist() for key, value in hidden.parameters.items()}
        tau = kind.torque(context, parameters)
        if hidden.name == "external_contact":
            tau = tau[tau.any(axis=1)]
        rms = np.sqrt(np.mean(tau**2, axis=0)) if len(tau) else np.zeros(self.arm.n)
        return float((rms / np.sqrt(np.mean(self.tau**2, axis=0))).max())

    def _predict(self, motion: Motion) -> np.ndarray:
        return regressor(self.arm, motion.q, motion.v, motion.vdot) @ nominal_parameters(self.arm)


def draw(run: Run, seed: int) -> Hidden:
    """Nothing, one effect, two, or a law that no list has."""
    rng = np.random.default_rng([seed, 0x5EA1ED])
    kind = str(rng.choice(KINDS))
    if kind == "clean":
        return Hidden(kind, [], [])
    if kind == "unlisted":
        return _unlisted(run, rng)
    names: list[str] = []
    effects: list[UndeclaredEffect] = []
    sizes: list[float] = []
    while len(effects) < (2 if kind == "two" else 1):
        name = str(rng.choice([n for n in REALISED if n not in names and n not in NOT_DRAWN]))
        size = float(np.exp(rng.uniform(np.log(0.01), np.log(0.3))))
        found = _sized(run, name, size, rng)
        if found is not None:
            names.append(name)
            effects.append(found)
            sizes.append(run.size(found))
    return Hidden(kind, effects, sizes)


def _unlisted(run: Run, rng: np.random.Generator) -> Hidden:
    """A product of a wave of one joint and a power of another's speed.

    Its size is that of the part which no listed law of the joint can stand for: cos(q) v over a small range of q is
    viscous friction.
    """
    n = run.arm.n
    j, k, m = (int(x) for x in rng.integers(n, size=3))
    wave = int(rng.integers(1, 4))
    power = int(rng.integers(1, 3))
    share = float(np.exp(rng.uniform(np.log(0.05), np.log(0.3))))
    shape = np.cos(wave * run.motion.q[:, k]) * run.motion.v[:, m] ** power
    rms = np.sqrt(np.mean(run.tau[:, j] ** 2))
    a = share * rms / max(float(np.sqrt(np.mean(shape**2))), 1e-9)
    law = f"{a:.4g}*cos({wave}*q{k + 1})*v{m + 1}^{power} at joint {j + 1}"
    q, v, vdot = (x[:, j] for x in (run.motion.q, run.motion.v, run.motion.vdot))
    listed = np.column_stack([np.ones_like(q), q, v, np.sign(v), v * np.abs(v), vdot])
    left = shape - listed @ np.linalg.lstsq(listed, shape, rcond=None)[0]
    size = float(a * np.sqrt(np.mean(left**2)) / rms)
    return Hidden(
        "unlisted", [], [size], law, {"joint": j, "a": a, "wave": wave, "of": k, "speed": m, "power": power}
    )


def _sized(run: Run, name: str, size: float, rng: np.random.Generator) -> UndeclaredEffect | None:
    """An effect of that size at a random place; None where this arm cannot have it at a plausible size."""
    kind = EFFECTS[name]
    n = run.arm.n
    joint = int(rng.integers(n)) if kind.joint_wise else None
    other = None
    if kind.pair_wise:
        if n < 2:
            return None
        joint, other = sorted(int(x) for x in rng.choice(n, 2, replace=False))
        if run.arm.joints[joint].kind != run.arm.joints[other].kind:
            return None
    turns = joint is None or run.arm.joints[joint].kind == "revolute"
    if name == "torque_ripple" and not turns:
        return None
    shape, amount, limits = _drawn(run, name, joint, turns, rng)

    def at(scale: float) -> UndeclaredEffect:
        parameters = {key: float(value) * scale if key in amount else value for key, value in shape.items()}
        if name == "torque_gain":
            parameters["gain"] = 1 + float(shape["gain"]) * scale
        if name == "external_contact":
            parameters["force"] = [scale * x for x in shape["force"]]
        return UndeclaredEffect(
            name, None if joint is None else joint + 1, parameters, None if other is None else other + 1
        )

    low = 1e-3
    unit = run.size(at(low)) / low
    if unit <= 1e-9:
        return None
    scale = size / unit
    key, least, most = limits
    value = abs(float(np.linalg.norm(np.asarray(at(scale).parameters[key])))) if key else 1.0
    if name == "torque_gain":
        value = abs(float(at(scale).parameters["gain"]) - 1)
    return at(scale) if least <= value <= most else None


def _drawn(
    run: Run, name: str, joint: int | None, turns: bool, rng: np.random.Generator
) -> tuple[dict[str, Any], tuple[str, ...], tuple[str, float, float]]:
    """Parameters of unit size, which of them scale, and the range in which one of them is plausible."""
    any_size = ("", 0.0, np.inf)
    sign = float(rng.choice([-1.0, 1.0]))
    if joint is not None:
        speed = float(np.quantile(np.abs(run.motion.v[:, joint]), 0.9))
        travel = float(np.ptp(run.motion.q[:, joint]))
        middle = float(np.mean(run.motion.q[:, joint]))
    match name:
        case "payload":
            tip = run.arm.com[-1] * rng.uniform(1.2, 2.0) + rng.uniform(-0.03, 0.03, 3)
            com = (np.linalg.inv(run.arm.X_tool) @ np.append(tip, 1.0))[:3]
            return {"mass": 1.0, "com": com.tolist()}, ("mass",), ("mass", 0.01, 5.0)
        case "gravity_tilt":
            angle = rng.uniform(0, 2 * np.pi)
            return (
                {"roll": np.cos(angle), "pitch": np.sin(angle)},
                ("roll", "pitch"),
                ("roll", 0.0, 0.25),
            )
        case "joint_spring":
            rest = middle + travel * rng.uniform(-0.4, 0.4)
            return {"stiffness": 1.0, "rest": rest}, ("stiffness",), any_size
        case "lower_end_stop" | "upper_end_stop":
            begins = middle + travel * rng.uniform(-0.25, 0.25)
            return {"stiffness": 1.0, "begins": begins}, ("stiffness",), any_size
        case "coupling_spring":
            return {"stiffness": 1.0, "rest": 0.0, "ratio": sign}, ("stiffness",), any_size
        case "torque_ripple":
            order = float(rng.integers(5, 21))
            return (
                {"amplitude": 1.0, "order": order, "phase": rng.uniform(-np.pi, np.pi)},
                ("amplitude",),
                any_size,
            )
        case "stribeck_friction":
            return (
                {"static_excess": 1.0, "velocity": speed * rng.uniform(0.08, 0.35)},
                ("static_excess",),
                any_size,
            )
        case "friction_drift":
            return {"level": 1.0, "time_constant": rng.uniform(8.0, 30.0)}, ("level",), any_size
        case "presliding_hysteresis":
            return {"level": 1.0, "width": travel * rng.uniform(2e-3, 3e-2)}, ("level",), any_size
        case "transmission_coupling":
            parts = rng.dirichlet([1.0, 1.0, 1.0])
            keys = ("inertia", "viscous", "coulomb")
            return {**dict(zip(keys, parts, strict=True)), "ratio": sign}, keys, any_size
        case "torque_gain":
            return {"gain": sign}, (), ("gain", 0.01, 0.5)
        case "encoder_offset":
            return {"offset": sign}, ("offset",), ("offset", 0.0, 0.3 if turns else 0.05)
        case "torque_drift":
            return {"rate": sign, "time_constant": rng.uniform(8.0, 30.0), "offset": 0.0}, ("rate",), any_size
        case "time_delay" | "torque_delay":
            return {"seconds": 1.0}, ("seconds",), ("seconds", 2e-3, 0.1)
        case "external_contact":
            direction = rng.normal(size=3)
            start = rng.uniform(5.0, 40.0)
            return (
                {
                    "start": start,
                    "end": start + rng.uniform(0.5, 2.0),
                    "force": direction / np.linalg.norm(direction),
                },
                (),
                ("force", 0.5, 500.0),
            )
        case "torque_offset" | "friction_asymmetry":
            key = "offset" if name == "torque_offset" else "level"
            return {key: sign}, (key,), any_size
        case "rotor_inertia":
            return {"inertia": 1.0}, ("inertia",), any_size
        case "coulomb_friction":
            return {"level": 1.0}, ("level",), any_size
        case _:
            return {"coefficient": 1.0}, ("coefficient",), any_size
