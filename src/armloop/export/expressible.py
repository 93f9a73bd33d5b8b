"""Conversion of a model to another tool's description of an arm: links, drives, damping, dry friction, springs, gravity.

A description has one number where a model has a law: what does not fit is named, with what is written in its place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import nnls

from armloop.data.motion import Motion
from armloop.dynamics import ModelEquations, coefficients, training_range, viscous_coefficients
from armloop.dynamics.consistent import ConsistentInertia, consistent_inertia
from armloop.features.rigid_body import full_columns
from armloop.laws.effects.base import number
from armloop.laws.effects.gravity_tilt import of_what_leans, tilted_gravity, weightless
from armloop.laws.effects.payload import link_parameters
from armloop.model import ReconstructedModel
from armloop.model.components import RigidBody
from armloop.robot.arm import Arm
from armloop.robot.kinematics import nominal_parameters, regressor
from armloop.robot.levelling import base_rotation, levelled, roll_and_pitch
from armloop.util.arrays import Array
from armloop.util.errors import ModelError
from armloop.util.functions import NUMPY

_STATES = 600
#: What is left of the rigid torque, relative to its RMS, beyond which a model's terms are no rigid body's.
_NO_BODY = 1e-9


@dataclass(frozen=True, eq=False)
class Said:
    """An arm as descriptions have it, n joints."""

    arm: Arm  # kinematics, names and limits
    links: Array  # (10 n,) inertial parameters of bodies that can exist
    rotors: Array  # (n,) inertias of the drives seen at the joint, kg m² (kg)
    damping: Array  # (n,) viscous coefficients, N m s (N s/m)
    dry: Array  # (n,) levels of dry friction, N m (N)
    stiffness: Array  # (n,) springs at the joints, N m/rad (N/m)
    rest: Array  # (n,) where they are relaxed, rad (m)
    gravity: Array  # (3,) m/s² in the base frame
    missing: list[str] = field(default_factory=list)  # what of the model is in none of these, one line each
    notes: list[str] = field(default_factory=list)  # what was decided on the way

    def torque(self, q: Array, v: Array, vdot: Array, features: frozenset[str]) -> Array:
        """(N, n) torques of the drives by what a target with these features takes in."""
        gravity = self.gravity if "gravity" in features else self.arm.gravity
        tau: Array = regressor(self.arm, q, v, vdot, gravity) @ self.links + self.rotors * vdot
        if "damping" in features:
            tau = tau + self.damping * v
        if "dry" in features:
            tau = tau + self.dry * np.sign(v)
        if "spring" in features:
            tau = tau + self.stiffness * (q - self.rest)
        return tau

    def lost(self, features: frozenset[str]) -> list[str]:
        """What a target with these features does not take in, one line each."""
        lines = []
        for j, joint in enumerate(self.arm.joints):
            if "dry" not in features and self.dry[j]:
                level = f"{self.dry[j]:.4g} {joint.torque_unit}"
                lines.append(f"joint {j + 1}: dry friction, {level}: in the file, but Drake drops it")
            if "spring" not in features and self.stiffness[j]:
                unit = f"{joint.torque_unit}/{joint.position_unit}"
                lines.append(
                    f"joint {j + 1}: a spring, {self.stiffness[j]:.4g} {unit} about {self.rest[j]:.4g}"
                )
        if "gravity" not in features and not np.array_equal(self.gravity, self.arm.gravity):
            lines.append("the base's tilt: turn the base, or gravity, in the simulation")
        return lines + self.missing


def said(model: ReconstructedModel, *, nearest_friction: bool = True) -> Said:
    """What descriptions can say of a model; raises ``ModelError`` where no links with positive masses come near it.

    ``nearest_friction`` puts the nearest damping and dry friction in place of laws that are neither; without it the viscous
    terms alone are damping, and the rest is somebody else's.
    """
    arm = model.arm
    missing: list[str] = []
    notes: list[str] = []
    constants = coefficients(model, "offset") if nearest_friction else np.zeros(arm.n)
    links, rotors, left, constants = rigid_parameters(model, constants)
    if left.max() > _NO_BODY:
        listed = ", ".join(f"{x:.2g}" for x in left)
        missing.append(f"terms that no rigid body has: {listed} of the joints' rigid torque (RMS)")
    stiffness, rest = np.zeros(arm.n), np.zeros(arm.n)
    gravity = arm.gravity
    for added in model.effects:
        p = {key: e.value for key, e in added.parameters.items()}
        name, joint = added.effect.name, (added.effect.joint or 1) - 1
        if name == "payload":
            links[-10:] += link_parameters(arm, p)
        elif name == "rotor_inertia":
            rotors[joint] += number(p["inertia"])
        elif name == "gravity_tilt":
            gravity = tilted_gravity(gravity, number(p["roll"]), number(p["pitch"]))
            links = of_what_leans(arm, links, p)
            for slide, mass in weightless(arm, p).items():
                rotors[slide] += mass
        elif name == "joint_spring":
            k, q0 = number(p["stiffness"]), number(p["rest"])
            total = stiffness[joint] + k
            rest[joint] = (stiffness[joint] * rest[joint] + k * q0) / total if total else 0.0
            stiffness[joint] = total
        elif not added.effect.rubs:
            why = "a fault of the record" if added.effect.sensor else "not in any description"
            missing.append(f"{added.effect.label()}: {why}")
    for j in np.flatnonzero(constants).tolist():
        missing.append(f"joint {j + 1}: a constant torque, {constants[j]:.4g} {arm.joints[j].torque_unit}")
    damping, dry = (
        _friction(model, missing) if nearest_friction else (viscous_coefficients(model), np.zeros(arm.n))
    )
    if (damping < 0).any():
        j = int(np.argmin(damping))
        raise ModelError(
            f"joint {j + 1}: viscous friction is {damping[j]:.3g}, and Drake takes no damping below 0"
        )
    for j in range(arm.n):
        if stiffness[j] < 0:
            missing.append(f"joint {j + 1}: a spring that pushes, {stiffness[j]:.4g}")
            stiffness[j] = 0.0
    # under the gravity that they are in: a base that leans shows more of them
    found = _bodies(replace(arm, gravity=gravity), model, links, rotors, missing, notes)
    level = levelled(arm)
    if level is not arm:
        roll, pitch = roll_and_pitch(arm.gravity)
        turned = base_rotation(roll, pitch) @ gravity
        gravity = level.gravity if np.array_equal(gravity, arm.gravity) else turned
        notes.append(
            f'the base leans: in the file it is level, and the first joint turned (rpy="{roll:.4f} {pitch:.4f} 0")'
        )
    for j in np.flatnonzero(arm.zeros).tolist():
        notes.append(
            f"joint {j + 1} has another zero than in its URDF, by {arm.zeros[j]:.4f} rad: its origin is turned"
        )
    return Said(level, found.links, found.rotors, damping, dry, stiffness, rest, gravity, missing, notes)


def rigid_parameters(model: ReconstructedModel, constants: Array) -> tuple[Array, Array, Array, Array]:
    """Link parameters (10 n,) and rotor inertias (n,) with the model's rigid torques, and what they leave.

    What they leave, (n,) relative to each joint's RMS, is zero for components that are rigid bodies; sparse terms
    and energies are fitted by least squares on random states within the training range. A constant torque that
    stands with friction, (n,), may be the weight on a prismatic joint: what no body needs of it comes last.
    """
    arm, n = model.arm, model.arm.n
    bodies = [c for c in model.components if isinstance(c, RigidBody)]
    full = np.zeros(11 * n)
    for body in bodies:
        full[: len(body.parameters)] += body.parameters
    if len(bodies) == len(model.components):
        return full[: 10 * n], full[10 * n :], np.zeros(n), constants
    motion = random_motion(model, _STATES, seed=0)
    columns = full_columns(arm, motion, rotors=True)
    rest = replace(model, components=tuple(c for c in model.components if not isinstance(c, RigidBody)))
    wanted = rest.rigid_body(motion) + constants
    if constants.any():
        columns = np.concatenate([columns, np.broadcast_to(np.eye(n), (len(columns), n, n))], axis=2)
    scale = np.maximum(np.sqrt(np.mean(wanted**2, axis=0)), 1e-12)
    rows = (columns / scale[:, None]).reshape(-1, columns.shape[2])
    start = np.zeros(rows.shape[1])
    start[: 10 * n] = nominal_parameters(arm)
    size = np.linalg.norm(rows, axis=0)
    # A parameter that moves no joint has a column of rounding errors, which must not be scaled up to count.
    size[size < 1e-9 * size.max()] = np.inf
    change = np.linalg.lstsq(rows / size, (wanted / scale).ravel() - rows @ start, rcond=1e-9)[0] / size
    fitted = start + change
    left = np.sqrt(np.mean((columns @ fitted - wanted) ** 2, axis=0)) / scale
    full += fitted[: 11 * n]
    offsets = np.zeros(n)
    if constants.any():
        offsets = np.where(np.abs(fitted[11 * n :]) > _NO_BODY * scale, fitted[11 * n :], 0.0)
    return full[: 10 * n], full[10 * n :], np.where(left > _NO_BODY, left, 0.0), offsets


def random_motion(model: ReconstructedModel, samples: int, seed: int) -> Motion:
    """Random states within the range that the model was fitted on, as many slow ones in each octave of the speed as fast.

    Dry friction falls with the speed while a joint is slow; no joint stands still.
    """
    n, rng = model.arm.n, np.random.default_rng(seed)
    lower, upper = training_range(model)
    size = model.ranges
    q = rng.uniform(lower, upper, (samples, n))
    v = _SLOWEST ** rng.uniform(0.0, 1.0, q.shape) * rng.choice([-1.0, 1.0], q.shape) * size[1]
    vdot = rng.uniform(-1.0, 1.0, q.shape) * size[2]
    return Motion(np.arange(float(samples)), q, v, vdot)


def _friction(model: ReconstructedModel, missing: list[str]) -> tuple[Array, Array]:
    """Damping and dry friction of every joint.

    Where a joint's law is a sum of the two, they are its coefficients; else those nearest to it over the speeds that
    the model was fitted on, by least squares, and what they leave goes to ``missing``.
    """
    damping, dry = viscous_coefficients(model), coefficients(model, "sign", "coulomb_friction", "level")
    others = _other_laws(model)
    if any(others) or (damping < 0).any() or (dry < 0).any():
        v, torques = friction_torques(model)
        for j in range(model.arm.n):
            unit = model.arm.joints[j].torque_unit
            if not others[j] and damping[j] >= 0 and dry[j] >= 0:
                continue
            columns = np.column_stack([np.sign(v[:, j]), v[:, j], np.ones(len(v)), -np.ones(len(v))])
            (dry[j], damping[j], *_), left = nnls(columns, torques[:, j])
            # A constant is no friction, but may not bend it either.
            total = np.sqrt(np.mean(torques[:, j] ** 2))
            what = "; ".join(dict.fromkeys(others[j])) or "negative friction"
            missing.append(
                f"joint {j + 1}: {what}. The nearest dry and viscous friction is written and leaves "
                f"{left / np.sqrt(len(v)):.3g} of {total:.3g} {unit} (RMS), constants apart"
            )
    return damping, dry


def _other_laws(model: ReconstructedModel) -> list[list[str]]:
    """What each joint's friction has beside Coulomb and viscous terms and a constant, in words."""
    found = [
        [_WORDS.get(t.kind, t.kind) for t in terms if t.kind not in ("sign", "viscous", "offset")]
        for terms in model.friction.terms
    ]
    for added in model.effects:
        name, joint = added.effect.name, added.effect.joint
        if added.effect.rubs and name not in ("viscous_friction", "coulomb_friction") and joint is not None:
            found[joint - 1].append(name.replace("_", " "))
    return found


def friction_torques(model: ReconstructedModel) -> tuple[Array, Array]:
    """Speeds (N, n) within the training range and the friction there, (N, n), fully slid and warm."""
    motion = random_motion(model, _STATES, seed=2)
    kept = tuple(a for a in model.effects if a.effect.rubs)
    equations = ModelEquations(replace(model, effects=kept), NUMPY)
    q, v, vdot = ([x[:, j] for j in range(model.arm.n)] for x in (motion.q, motion.v, motion.vdot))
    friction = equations.friction(v, equations.load(q, v, vdot), _WARM, q)
    return motion.v, np.stack([np.broadcast_to(x, (motion.samples,)) for x in friction], axis=1)


_WARM = 1e300
#: Slowest of these states, in parts of the largest trained speed.
_SLOWEST = 0.02
_WORDS = {
    "smooth_sign": "dry friction that sets in smoothly",
    "hysteresis": "memory (presliding)",
    "load_sign": "friction that grows with the load",
    "load_smooth_sign": "friction that grows with the load",
    "load_hysteresis": "friction that grows with the load, with memory",
    "viscous_forward": "viscous friction that differs by direction",
    "viscous_backward": "viscous friction that differs by direction",
    "root": "friction with the root of the speed",
    "quadratic": "friction with the square of the speed",
    "cubic": "friction with the cube of the speed",
    "stribeck_peak": "Stribeck friction",
    "stribeck": "Stribeck friction",
}


def _bodies(
    arm: Arm, model: ReconstructedModel, links: Array, rotors: Array, missing: list[str], notes: list[str]
) -> ConsistentInertia:
    prior = nominal_parameters(arm)
    if not prior[::10].any():
        notes.append(
            "the URDF gives no masses: what the torques do not reveal of the links is as small as can be"
        )
    for added in model.effects:
        if added.effect.name == "payload":
            prior[-10:] += link_parameters(arm, {key: e.value for key, e in added.parameters.items()})
    found = consistent_inertia(arm, links, rotors, prior)
    if not found.exact:
        motion = random_motion(model, _STATES, seed=1)
        q, v, vdot = motion.q, motion.v, motion.vdot
        wanted = regressor(arm, q, v, vdot) @ links + rotors * vdot
        change = regressor(arm, q, v, vdot) @ found.links + found.rotors * vdot - wanted
        part = np.sqrt(np.mean(change**2, axis=0) / np.maximum(np.mean(wanted**2, axis=0), 1e-24))
        listed = ", ".join(f"{x:.2g}" for x in part)
        missing.append(
            "no bodies with positive masses have the model's base parameters; the nearest change the joints' rigid "
            f"torque by {listed} (RMS over RMS)"
        )
    return found


def body_of(parameters: Sequence[float] | Array) -> tuple[float, Array, Array]:
    """Mass, centre (3,) and inertia about the centre (3, 3) of a link's ten parameters."""
    m, mx, my, mz, xx, yy, zz, xy, xz, yz = (float(x) for x in parameters)
    com = np.array([mx, my, mz]) / m
    about_origin = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return m, com, about_origin - m * (float(com @ com) * np.eye(3) - np.outer(com, com))
