"""One run of an arm in MuJoCo under a controller of its own, with effects of all kinds, and the log it leaves.

Effects are plain dictionaries, named as in ``diagnosis.json``, joints from 1:

    {"name": "coulomb_friction", "joint": 2, "level": 0.8}
    {"name": "external_contact", "body": 2, "start": 3.0, "end": 4.5, "force": [0, 20, 0], "smooth": True}
    {"name": "external_torque", "joint": 1, "start": 3.0, "end": 3.4, "torque": 2.0, "smooth": True}
    {"name": "carried_load", "mass": 1.0, "com": [0, 0, 0.1], "intervals": [(3.0, 8.0), (12.0, 15.0)]}
    {"name": "unlisted", "joint": 2, "law": lambda t, q, v: 0.5 * np.cos(2 * q[0]) * v[1]}

MuJoCo's own where it has one (``frictionloss``, ``damping``, ``armature``, ``stiffness``, tendons, ``xfrc_applied``);
``qfrc_applied`` else. Laws are what the drive must supply in addition, so they act with the opposite sign.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

Array = np.ndarray
Effect = dict[str, Any]

#: Fields of MuJoCo's model that an effect changes before the run: effect, its parameter, the model's array.
_FIELDS = {
    "viscous_friction": ("coefficient", "dof_damping"),
    "coulomb_friction": ("level", "dof_frictionloss"),
    "rotor_inertia": ("inertia", "dof_armature"),
}
_SENSORS = ("torque_gain", "torque_offset", "encoder_offset", "time_delay", "torque_noise")


class Diverged(RuntimeError):
    """A simulation that was thrown off its path."""


def simulate(
    arm: Any,
    reference: Any,
    effects: Sequence[Effect] = (),
    seed: int = 0,
    *,
    rate: float = 500.0,
    controller: str = "computed_torque",
    noise: float = 0.01,
    velocity_noise: float = 1e-3,
    encoder_bits: int = 17,
    clean: bool = False,
) -> dict[str, Array]:
    """Move an arm along a reference and record it.

    Args:
        rate: samples per second of the log.
        controller: ``"computed_torque"`` with the arm's own model, or ``"pd"`` with gravity compensated.
        noise: standard deviation of the torque's noise, part of each joint's RMS torque.
        velocity_noise: of v, part of each joint's fastest speed.
        encoder_bits: counts per revolution (per metre for a joint that slides); 0 for exact angles.
        clean: leave out all noise and quantisation.

    Returns:
        Columns ``time, q1.., v1.., tau1..`` of a log, with ``vdot1..`` as MuJoCo has it.
    """
    rng = np.random.default_rng([seed, 0x51])
    dt = 5e-4
    every = round(1 / (rate * dt))
    n = arm.joints
    tendons = [
        {
            "joint": e["joint"],
            "other_joint": e["other_joint"],
            "ratio": e.get("ratio", 1.0),
            "damping": e.get("viscous", 0.0),
            "frictionloss": e.get("coulomb", 0.0),
            "armature": e.get("inertia", 0.0),
        }
        for e in effects
        if e["name"] == "transmission_coupling"
    ]
    nominal = mujoco.MjModel.from_xml_string(arm.mjcf(dt))
    model = mujoco.MjModel.from_xml_string(arm.mjcf(dt, tendons))
    for e in effects:
        _built_in(model, e)
    data, mirror = mujoco.MjData(model), mujoco.MjData(nominal)
    data.qpos[:], data.qvel[:] = reference.q[0], reference.v[0]
    acting = [_Acting(model, e) for e in effects if e["name"] not in _SENSORS]
    steps = int(reference.seconds / dt)
    at = np.arange(steps) * dt / reference.step
    low = np.minimum(at.astype(int), len(reference.q) - 2)
    part = (at - low)[:, None]
    q_d, v_d, a_d = (
        x[low] * (1 - part) + x[low + 1] * part for x in (reference.q, reference.v, reference.vdot)
    )
    friction = np.array([link.frictionloss for link in arm.links])
    stiff = 15.0 if controller == "computed_torque" else 12.0
    M, tau = np.zeros((n, n)), np.zeros(n)
    mujoco.mj_forward(nominal, mirror)
    mujoco.mj_fullM(nominal, mirror, M)
    size = np.maximum(np.diag(M).copy(), 0.02)
    kept: list[Array] = []
    for k in range(steps):
        mirror.qpos[:], mirror.qvel[:] = data.qpos, data.qvel
        mujoco.mj_fwdPosition(nominal, mirror)
        mujoco.mj_fwdVelocity(nominal, mirror)
        pull = stiff**2 * (q_d[k] - data.qpos) + 2 * stiff * (v_d[k] - data.qvel)
        if controller == "computed_torque":
            mujoco.mj_mulM(nominal, mirror, tau, a_d[k] + pull)
            tau += mirror.qfrc_bias - mirror.qfrc_passive + friction * np.tanh(v_d[k] / 0.02)
        else:
            tau = size * pull + mirror.qfrc_bias
        data.qfrc_applied[:] = tau
        data.xfrc_applied[:] = 0.0
        for one in acting:
            one.apply(data, data.time)
        mujoco.mj_forward(model, data)
        if k % every == 0:
            kept.append(np.concatenate([[data.time], data.qpos, data.qvel, data.qacc, tau]))
        mujoco.mj_Euler(model, data)
    log = np.array(kept)
    time, (q, v, vdot, tau) = log[:, 0], (log[:, 1 + k * n : 1 + (k + 1) * n] for k in range(4))
    if not np.isfinite(log).all():
        raise Diverged(f"{arm.name}: the simulation diverged")
    q, tau = _sensed(effects, time, q, tau, rng)
    if not clean:
        tau = tau + noise * np.sqrt(np.mean(tau**2, axis=0)) * rng.normal(size=tau.shape)
        v = v + velocity_noise * np.array([link.speed for link in arm.links]) * rng.normal(size=v.shape)
        if encoder_bits:
            count = np.array([1.0 if link.slides else 2 * np.pi for link in arm.links]) / 2**encoder_bits
            q = np.round(q / count) * count
    columns = {"time": time}
    for name, values in (("q", q), ("v", v), ("vdot", vdot), ("tau", tau)):
        columns |= {f"{name}{j + 1}": values[:, j] for j in range(n)}
    return columns


def _built_in(model: Any, e: Effect) -> None:
    """What MuJoCo's model itself can be given."""
    name, j = e["name"], e.get("joint", 0) - 1 if e.get("joint") else 0
    if name in _FIELDS:
        parameter, field = _FIELDS[name]
        getattr(model, field)[j] += e[parameter]
    elif name == "joint_spring":
        model.jnt_stiffness[j], model.qpos_spring[j] = e["stiffness"], e["rest"]
    elif name == "gravity_tilt":
        (cr, cp), (sr, sp) = np.cos([e["roll"], e["pitch"]]), np.sin([e["roll"], e["pitch"]])
        R = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]]) @ np.array(
            [[1, 0, 0], [0, cr, -sr], [0, sr, cr]]
        )
        model.opt.gravity[:] = R.T @ model.opt.gravity
    elif name == "payload":
        _load(model, e["mass"], np.asarray(e["com"], dtype=float), float(e.get("radius", 0.03)))


def _load(model: Any, mass: float, com: Array, radius: float) -> None:
    """A ball on the last link; ``com`` in the link's frame."""
    b = model.nbody - 1
    R = np.zeros(9)
    mujoco.mju_quat2Mat(R, model.body_iquat[b])
    R = R.reshape(3, 3)
    m0, c0, I0 = model.body_mass[b], model.body_ipos[b].copy(), R @ np.diag(model.body_inertia[b]) @ R.T
    m, c = m0 + mass, (m0 * c0 + mass * com) / (m0 + mass)
    total = 0.4 * mass * radius**2 * np.eye(3)
    for each, at in ((m0, c0), (mass, com)):
        d = at - c
        total += each * (d @ d * np.eye(3) - np.outer(d, d))
    values, vectors = np.linalg.eigh(total + I0)
    vectors[:, 0] *= np.sign(np.linalg.det(vectors))
    model.body_mass[b], model.body_ipos[b], model.body_inertia[b] = m, c, values
    mujoco.mju_mat2Quat(model.body_iquat[b], vectors.ravel())
    mujoco.mj_setConst(model, mujoco.MjData(model))


def _last_body(model: Any) -> tuple[Any, ...]:
    """Mass, centre, principal inertia and axes of the last link."""
    fields = (model.body_mass, model.body_ipos, model.body_inertia, model.body_iquat)
    return tuple(np.array(field[-1]) for field in fields)


class _Acting:
    """An effect that acts step by step."""

    def __init__(self, model: Any, e: Effect) -> None:
        self.e, self.model = e, model
        self.j = (e.get("joint") or 1) - 1
        self.dry = float(model.dof_frictionloss[self.j])
        self.z, self.last = 0.0, None
        self.loaded = False
        if e["name"] == "carried_load":
            self.bodies = [_last_body(model)]
            _load(model, e["mass"], np.asarray(e["com"], dtype=float), float(e.get("radius", 0.03)))
            self.bodies.append(_last_body(model))
            self._carry(False)

    def _carry(self, loaded: bool) -> None:
        fields = ("body_mass", "body_ipos", "body_inertia", "body_iquat")
        for field, value in zip(fields, self.bodies[loaded], strict=True):
            getattr(self.model, field)[-1] = value
        mujoco.mj_setConst(self.model, mujoco.MjData(self.model))
        self.loaded = loaded

    def apply(self, data: Any, t: float) -> None:
        e, j, v = self.e, self.j, float(data.qvel[self.j])
        name = e["name"]
        if name == "external_contact":
            data.xfrc_applied[int(e.get("body", self.model.nbody - 1)), :3] += _course(e, t) * np.asarray(
                e["force"]
            )
        elif name == "external_torque":
            data.qfrc_applied[j] -= _course(e, t) * e["torque"]
        elif name == "quadratic_drag":
            data.qfrc_applied[j] -= e["coefficient"] * v * abs(v)
        elif name == "torque_ripple":
            data.qfrc_applied[j] -= e["amplitude"] * np.sin(e["order"] * data.qpos[j] + e["phase"])
        elif name in ("upper_end_stop", "lower_end_stop"):
            within = np.maximum if name == "upper_end_stop" else np.minimum
            data.qfrc_applied[j] -= e["stiffness"] * within(data.qpos[j] - e["begins"], 0.0)
        elif name == "coupling_spring":
            k = e["other_joint"] - 1
            tension = e["stiffness"] * (data.qpos[j] + e["ratio"] * data.qpos[k] - e["rest"])
            data.qfrc_applied[j] -= tension
            data.qfrc_applied[k] -= e["ratio"] * tension
        elif name == "elastic_cable":
            b = int(e["link"])
            point = data.xpos[b] + data.xmat[b].reshape(3, 3) @ np.asarray(e["attached"])
            away = point - np.asarray(e["anchor"])
            length = float(np.linalg.norm(away))
            force = -e["stiffness"] * max(length - e["slack_length"], 0.0) / length * away
            mujoco.mj_applyFT(self.model, data, force, np.zeros(3), point, b, data.qfrc_applied)
        elif name == "friction_asymmetry":
            # A dry friction of f + a forward and f - a backward is one of f beside a constant, at rest, too.
            data.qfrc_applied[j] -= e["level"]
        elif name == "stribeck_friction":
            self.model.dof_frictionloss[j] = self.dry + e["static_excess"] * np.exp(
                -((v / e["velocity"]) ** 2)
            )
        elif name == "load_dependent_friction":
            self.model.dof_frictionloss[j] = self.dry + e["coefficient"] * abs(self._load(data))
        elif name == "friction_drift":
            self.model.dof_frictionloss[j] = self.dry + e["level"] * np.exp(-t / e["time_constant"])
        elif name == "presliding_hysteresis":
            q = float(data.qpos[j])
            moved = 0.0 if self.last is None else q - self.last
            self.z, self.last = float(np.clip(self.z + moved, -e["width"], e["width"])), q
            data.qfrc_applied[j] -= e["level"] * self.z / e["width"]
        elif name == "carried_load":
            loaded = any(a <= t < b for a, b in e["intervals"])
            if loaded != self.loaded:
                self._carry(loaded)
        elif name == "unlisted":
            data.qfrc_applied[j] -= float(e["law"](t, data.qpos, data.qvel))

    def _load(self, data: Any) -> float:
        """Rigid-body torque of the joint at the accelerations of the step before."""
        inertial = np.zeros(self.model.nv)
        mujoco.mj_rne(self.model, data, 1, inertial)
        return float(inertial[self.j])


def _course(e: Effect, t: float) -> float:
    """1 within the interval, 0 outside; half a sine squared where the push is smooth."""
    if not e["start"] <= t <= e["end"]:
        return 0.0
    return float(np.sin(np.pi * (t - e["start"]) / (e["end"] - e["start"])) ** 2) if e.get("smooth") else 1.0


def _sensed(effects: Sequence[Effect], time: Array, q: Array, tau: Array, rng: Any) -> tuple[Array, Array]:
    """What faulty sensors make of angles and torques, in the order in which a signal passes them."""
    q, tau = q.copy(), tau.copy()
    for e in effects:
        j = (e.get("joint") or 1) - 1
        if e["name"] == "encoder_offset":
            q[:, j] += e["offset"]
        elif e["name"] == "torque_gain":
            tau[:, j] *= e["gain"]
        elif e["name"] == "torque_offset":
            tau[:, j] += e["offset"]
        elif e["name"] == "torque_noise":
            tau[:, j] += e["size"] * rng.normal(size=len(time))
        elif e["name"] == "time_delay":
            tau = np.column_stack([np.interp(time - e["seconds"], time, x) for x in tau.T])
    return q, tau
