"""Measured logs with a known effect added to their torque: noise and the model's error are those of the rig.

Training logs and runs go into one folder, what was added into another; a part of the runs is as it was measured.
The laws are written out here: nothing of armloop's own is used but the reading of logs.
"""

from __future__ import annotations

import json
import shutil
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, JacobianWrtVariable
from scipy.signal import butter, sosfiltfilt

from armloop.data.log import MotionLog, read_log, write_log

Array = np.ndarray
Effect = dict[str, Any]

SIZES = (0.04, 0.08, 0.2)
#: One case after the other; every fourth log is left as it was measured.
KINDS = ("one", "one", "clean", "one", "event", "one", "unlisted", "one")


@dataclass(frozen=True)
class Source:
    """A measured arm: logs of which all but the judged one train, those that are judged, and gains of currents."""

    folder: str
    training: tuple[str, ...]
    judged: tuple[str, ...]
    gains: tuple[float, ...] = ()


SOURCES = {
    1: Source(
        "ur10e", ("noload_*",), ("noload_20_01_31-unload", "noload_20_02_10-30sec_12harm"),
        (11.75, 11.98, 9.83, 10.75, 10.55, 10.9),
    ),
    2: Source(
        "ur5", ("no1", "no2", "no6*", "no7*_short", "no8*", "no9*_nodist"), ("no9_singularity_free_nodist", "no1"),
        (12.5, 12.5, 12.5, 9.2, 9.2, 9.2),
    ),
    3: Source("double_pendulum", ("sysid_*", "acrobot_clean_0[1-5]"), ("acrobot_clean_06", "acrobot_clean_07")),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Smooth:
    """A run without the noise of its motion: what an effect would have met."""

    time: Array
    q: Array
    v: Array
    vdot: Array

    @staticmethod
    def of(log: MotionLog) -> Smooth:
        """Low-pass of 12 Hz."""
        q, v = (_slow(log.time, x) for x in (log.q, log.v))
        return Smooth(log.time, q, v, np.gradient(v, log.time, axis=0))


def _slow(time: Array, values: Array) -> Array:
    """Low-pass of 12 Hz on an even grid, and back to the log's instants."""
    t = np.linspace(time[0], time[-1], len(time))
    sos = butter(2, 12.0, fs=1 / float(t[1] - t[0]), output="sos")
    even = sosfiltfilt(sos, np.column_stack([np.interp(t, time, x) for x in values.T]), axis=0)
    return np.column_stack([np.interp(time, t, x) for x in even.T])


def generate_measured(seed: int, cases: int, data: Path, logs: Path, answers: Path) -> None:
    """Write the training logs and cases of one measured arm; kinds, places and sizes are drawn from the seed.

    Seeds 1, 2, 3 are the three arms, 4, 5, 6 the same arms with other cases, and so on.
    """
    one = SOURCES[(seed - 1) % len(SOURCES) + 1]
    place = data / one.folder
    folder = logs / (f"measured_{one.folder}" + (f"_{seed}" if seed > len(SOURCES) else ""))
    folder.mkdir(parents=True, exist_ok=True)
    answers.mkdir(parents=True, exist_ok=True)
    urdf = next(place.glob("*.urdf"))
    shutil.copy(urdf, folder / "arm.urdf")
    paths = sorted({path for pattern in one.training for path in place.glob(f"{pattern}.csv")})
    for path in paths:
        if path.stem not in one.judged:
            write_log(folder / f"baseline_{path.stem}.csv", _in_torques(read_log(path), one))
    runs = [_in_torques(read_log(place / f"{name}.csv"), one) for name in one.judged]
    rng = np.random.default_rng([seed, 0x3EA5])
    for case in range(cases):
        # each kind meets each of the runs in turn
        log = runs[(case + case // len(KINDS)) % len(runs)]
        kind, size = KINDS[case % len(KINDS)], SIZES[int(rng.integers(len(SIZES)))]
        effects, tau, law = _drawn(log, Smooth.of(log), urdf, kind, size, rng)
        run = MotionLog(log.time, log.q, log.v, tau, None, name=f"run_{case}")
        write_log(folder / f"run_{case}.csv", run)
        sealed = {
            "measured": one.folder,
            "kind": kind,
            "effects": effects,
            "sizes": [size] * len(effects),
            "law": law,
            "seconds": float(log.time[-1] - log.time[0]),
        }
        (answers / f"{folder.name}_run_{case}.json").write_text(
            json.dumps(sealed, indent=1), encoding="utf-8"
        )


def _in_torques(log: MotionLog, source: Source) -> MotionLog:
    gains = np.array(source.gains or np.ones(log.joints))
    return MotionLog(log.time, log.q, log.v, log.tau * gains, None, name=log.name)


def _drawn(
    log: MotionLog, run: Smooth, urdf: Path, kind: str, size: float, rng: np.random.Generator
) -> tuple[list[Effect], Array, str]:
    """Effects, the torque with them, and the words of an unlisted law."""
    if kind == "clean":
        return [], log.tau, ""
    level = np.sqrt(np.mean(log.tau**2, axis=0))
    moving = np.flatnonzero(np.abs(run.v).max(axis=0) > 0.2 * np.abs(run.v).max())
    j = int(rng.choice(moving))
    k = int(rng.choice([m for m in range(log.joints) if m != j]))
    added = np.zeros_like(log.tau)
    if kind == "unlisted":
        law, words = _LAWS[int(rng.integers(len(_LAWS)))]
        added[:, j] = _of_size(law(run, j, k), size * level[j])[1]
        effect = {"name": "unlisted", "joint": j + 1, "parameters": {}}
        return [effect], log.tau + added, words.replace("_j", str(j + 1)).replace("_k", str(k + 1))
    if kind == "event":
        length = float(rng.uniform(0.4, 1.5))
        start = float(rng.uniform(log.time[0] + 1.5, log.time[-1] - 1.5 - length))
        inside = (log.time >= start) & (log.time <= start + length)
        course = np.sin(np.pi * (log.time - start) / length) ** 2 if rng.random() < 0.5 else 1.0
        height = size * level[j] * (2.0 if isinstance(course, np.ndarray) else 1.0) * rng.choice([-1.0, 1.0])
        added[:, j] = np.where(inside, height * course, 0.0)
        effect = {"name": "external_torque", "joint": j + 1, "start": start, "end": start + length}
        return [{**effect, "parameters": {"torque": height}}], log.tau + added, ""
    name = str(rng.choice([*_OF_JOINT, "torque_gain", "time_delay", "payload", "gravity_tilt"]))
    effect = {"name": name, "joint": j + 1, "parameters": {}}
    if name == "torque_gain":
        gain = 1 + size * float(rng.choice([-1.0, 1.0]))
        tau = log.tau.copy()
        tau[:, j] *= gain
        return [{**effect, "parameters": {"gain": gain}}], tau, ""
    if name == "time_delay":
        # the joint that feels it most by its motion, not by its noise, does so by its size
        slow = _slow(log.time, log.tau)
        share = float((np.sqrt(np.mean((_late(log.time, slow, 0.01) - slow) ** 2, axis=0)) / level).max())
        seconds = round(0.01 * size / share, 3)
        tau = _late(log.time, log.tau, seconds)
        return [{**effect, "joint": None, "parameters": {"seconds": seconds}}], tau, ""
    if name in ("payload", "gravity_tilt"):
        unit = 1.0 if name == "payload" else 0.02
        torque = _difference(urdf, run, **{"mass" if name == "payload" else "tilt": unit})
        share = float((np.sqrt(np.mean(torque**2, axis=0)) / level).max())
        value = unit * size / share
        torque = _difference(urdf, run, **{"mass" if name == "payload" else "tilt": value})
        key = "mass" if name == "payload" else "roll"
        return [{**effect, "joint": None, "parameters": {key: value}}], log.tau + torque, ""
    column, key, rest = _OF_JOINT[name](run, j, rng)
    factor, added[:, j] = _of_size(column, size * level[j])
    return [{**effect, "parameters": {key: factor, **rest}}], log.tau + added, ""


def _late(time: Array, tau: Array, seconds: float) -> Array:
    return np.column_stack([np.interp(time - seconds, time, x) for x in tau.T])


def _of_size(column: Array, rms: float) -> tuple[float, Array]:
    factor = rms / max(float(np.sqrt(np.mean(column**2))), 1e-12)
    return factor, factor * column


def _sign(v: Array) -> Array:
    return np.tanh(v / max(0.005 * float(np.abs(v).max()), 1e-6))


def _stribeck(run: Smooth, j: int, rng: np.random.Generator) -> tuple[Array, str, dict[str, float]]:
    v = run.v[:, j]
    velocity = 0.2 * float(np.abs(v).max())
    return np.exp(-((v / velocity) ** 2)) * _sign(v), "static_excess", {"velocity": velocity}


def _drift(run: Smooth, j: int, rng: np.random.Generator) -> tuple[Array, str, dict[str, float]]:
    seconds = float(run.time[-1] - run.time[0]) * float(rng.uniform(0.2, 0.4))
    fading = np.exp(-(run.time - run.time[0]) / seconds)
    return fading * _sign(run.v[:, j]), "level", {"time_constant": seconds}


def _spring(run: Smooth, j: int, rng: np.random.Generator) -> tuple[Array, str, dict[str, float]]:
    q = run.q[:, j]
    rest = float(np.mean(q) + rng.uniform(-0.5, 0.5) * np.ptp(q))
    return q - rest, "stiffness", {"rest": rest}


def _ripple(run: Smooth, j: int, rng: np.random.Generator) -> tuple[Array, str, dict[str, float]]:
    order, phase = int(rng.integers(4, 9)), float(rng.uniform(-np.pi, np.pi))
    return np.sin(order * run.q[:, j] + phase), "amplitude", {"order": order, "phase": phase}


_OF_JOINT: dict[str, Callable[[Smooth, int, np.random.Generator], tuple[Array, str, dict[str, float]]]] = {
    "viscous_friction": lambda run, j, rng: (run.v[:, j], "coefficient", {}),
    "coulomb_friction": lambda run, j, rng: (_sign(run.v[:, j]), "level", {}),
    "quadratic_drag": lambda run, j, rng: (run.v[:, j] * np.abs(run.v[:, j]), "coefficient", {}),
    "rotor_inertia": lambda run, j, rng: (run.vdot[:, j], "inertia", {}),
    "torque_offset": lambda run, j, rng: (np.ones(len(run.time)), "offset", {}),
    "stribeck_friction": _stribeck,
    "friction_drift": _drift,
    "joint_spring": _spring,
    "torque_ripple": _ripple,
}

_LAWS: tuple[tuple[Callable[[Smooth, int, int], Array], str], ...] = (
    (lambda run, j, k: np.cos(2 * run.q[:, j]) * run.v[:, j], "c cos(2 q_j) v_j"),
    (lambda run, j, k: np.sin(3 * run.q[:, j]) * run.v[:, j] ** 2, "c sin(3 q_j) v_j^2"),
    (lambda run, j, k: run.v[:, j] * run.v[:, k], "c v_j v_k"),
    (lambda run, j, k: np.cos(run.q[:, k]) * _sign(run.v[:, j]), "c cos(q_k) sign(v_j)"),
)


def _difference(urdf: Path, run: Smooth, mass: float = 0.0, tilt: float = 0.0) -> Array:
    """(N, n) torques of a point mass 0.1 m out on the last link, or of gravity turned about the base's x, by Drake."""
    plant = MultibodyPlant(0.0)
    (arm,) = Parser(plant).AddModelsFromString(_bare(urdf), "urdf")
    base = plant.get_body(plant.GetBodyIndices(arm)[0])
    if '<parent link="world"' not in _bare(urdf):
        plant.WeldFrames(plant.world_frame(), base.body_frame())
    plant.Finalize()
    context = plant.CreateDefaultContext()
    g = plant.gravity_field().gravity_vector()
    turned = np.array([0.0, np.sin(tilt) * g[2], np.cos(tilt) * g[2]]) - g  # as a base that is rolled sees it
    point = np.array([0.1, 0.0, 0.0])
    joints = [plant.get_joint(i) for i in plant.GetJointIndices(arm)]
    moving = [joint for joint in joints if joint.num_velocities() == 1]
    where = [joint.velocity_start() for joint in moving]
    last, world = moving[-1].child_body(), plant.world_frame()
    out = np.zeros_like(run.q)
    for i in range(len(run.time)):
        q, v = np.zeros(plant.num_positions()), np.zeros(plant.num_velocities())
        q[[joint.position_start() for joint in moving]], v[where] = run.q[i], run.v[i]
        plant.SetPositions(context, q)
        plant.SetVelocities(context, v)
        if tilt:
            out[i] = -_weight(plant, context, turned)[where]
            continue
        at = (context, JacobianWrtVariable.kV, last.body_frame(), point, world, world)
        J = plant.CalcJacobianTranslationalVelocity(*at)
        bias = plant.CalcBiasTranslationalAcceleration(*at)
        a = J[:, where] @ run.vdot[i] + bias[:, 0]
        out[i] = mass * (J[:, where].T @ (a - g))
    return out


def _bare(urdf: Path) -> str:
    """The description without the meshes, which nobody has here."""
    tree = ET.parse(urdf).getroot()
    for link in tree.findall("link"):
        for part in (*link.findall("visual"), *link.findall("collision")):
            link.remove(part)
    return ET.tostring(tree, encoding="unicode")


def _weight(plant: MultibodyPlant, context: Any, field: Array) -> Array:
    """(nv,) generalized forces of a field of gravity on all bodies."""
    total = np.zeros(plant.num_velocities())
    for index in range(1, plant.num_bodies()):
        body = plant.get_body(BodyIndex(index))
        com = body.CalcCenterOfMassInBodyFrame(context)
        J = plant.CalcJacobianTranslationalVelocity(
            context, JacobianWrtVariable.kV, body.body_frame(), com, plant.world_frame(), plant.world_frame()
        )
        total += J.T @ (body.get_mass(context) * field)
    return total
