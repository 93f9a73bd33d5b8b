"""Physical consistency of a reconstructed model over the joint limits: mass matrix, passivity, invariance to yaw.

What every arm of rigid links with dissipative friction obeys, whatever its parameters are: M(q) is symmetric and
positive definite, friction takes power and never gives any, and turning the whole arm about a vertical axis changes
no torque. A model that was fitted to torques alone need not obey; controllers that invert M(q), and simulations,
need it to, and over all postures that the arm can take, not only those of the training data.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from armloop.data.motion import Motion
from armloop.dynamics.consistent import are_bodies, scales
from armloop.dynamics.definite import MassTerms, Proof, prove_definite
from armloop.features.lagrangian import gravity_sees_first_joint
from armloop.model import ReconstructedModel
from armloop.model.components import Lagrangian, RigidBody
from armloop.robot.arm import Arm
from armloop.robot.kinematics import nominal_parameters
from armloop.util.arrays import TINY, Array

#: Postures drawn over the limits, and from how many of the worst a lower eigenvalue is searched.
_POSTURES, _WORST = 1000, 12
#: Rounds of that search, directions across the joints in each, and postures along a direction.
_ROUNDS, _ACROSS, _ALONG = 8, 3, 7
#: Motions drawn for the power of friction and for yaw, and speeds of a joint that moves alone.
_MOTIONS, _SPEEDS = 400, 60
#: Asymmetry of M and torque by yaw, both relative, that the noise in the coefficients of a good model leaves.
_NOTABLE = 0.01
#: Power that friction may give, relative to that of all torques: round-off.
_ROUND_OFF = 1e-9
#: A mass matrix beside the links' that is the same at so many postures is the same at all.
_FEW = 20
#: What proves M(q) positive definite: of a rigid body, and of the terms of a Lagrangian.
BODIES = "links and rotors that can exist (positive definite pseudo-inertias)"
BOXES = "bounds on boxes of postures that cover the joint limits (branch and bound)"


@dataclass(frozen=True)
class PhysicsChecks:
    """How far a model is from being an arm, over the joint limits.

    Attributes:
        least: smallest eigenvalue found of (M + Mᵀ)/2, kg m² (kg for prismatic joints).
        least_at: (n,) its posture.
        negative: part of the postures drawn at which it is not positive.
        asymmetry: largest ‖M − Mᵀ‖/‖M‖ (Frobenius).
        asymmetry_at: (n,) its posture.
        driving: per joint, the largest torque with which friction pushes along its motion, N·m; 0 where it is passive.
        driving_at: per joint, that speed.
        yaw: root mean square change of the torques by a turn of the first joint, relative to the torques'; None
            where the first axis is not vertical.
        certificate: why M(q) is positive definite at every posture; empty where that is not proven, only tried.
        proven: part of the volume of postures on which it is proven; 1 with a certificate.
    """

    least: float
    least_at: tuple[float, ...]
    negative: float
    asymmetry: float
    asymmetry_at: tuple[float, ...]
    driving: tuple[float, ...]
    driving_at: tuple[float, ...]
    yaw: float | None
    certificate: str = ""
    proven: float = 0.0

    @property
    def definite(self) -> bool:
        """Whether M(q) is positive definite at all postures tried."""
        return self.least > 0

    @property
    def symmetric(self) -> bool:
        """Whether M(q) is symmetric but for a hundredth."""
        return self.asymmetry <= _NOTABLE

    @property
    def passive(self) -> bool:
        """Whether friction never drives."""
        return not any(self.driving)

    @property
    def level(self) -> bool:
        """Whether the torques change by less than a hundredth where the arm is turned about a vertical first axis."""
        return self.yaw is None or self.yaw <= _NOTABLE

    @property
    def failed(self) -> int:
        """How many of these do not hold."""
        return [self.definite, self.symmetric, self.passive, self.level].count(False)

    @property
    def passed(self) -> bool:
        """Whether all of it holds."""
        return not self.failed

    def faults(self) -> list[str]:
        """What does not hold, where, and by how much: a line each."""
        lines = []
        if not self.definite:
            share = f" at {self.negative:.1%} of the postures" if self.negative else " everywhere"
            lines.append(
                f"M(q) is not positive definite{share} within the joint limits: its smallest eigenvalue is "
                f"{self.least:.3g} at q = {_posture(self.least_at)}"
            )
        if not self.symmetric:
            lines.append(
                f"M(q) is asymmetric by up to {self.asymmetry:.0%}, at q = {_posture(self.asymmetry_at)}"
            )
        for joint, (torque, speed) in enumerate(zip(self.driving, self.driving_at, strict=True), start=1):
            if torque:
                lines.append(f"friction drives joint {joint}: by {torque:.3g} at a speed of {speed:.3g}")
        if not self.level:
            lines.append(f"the torques change by {self.yaw:.0%} with q1, though its axis is vertical")
        return lines

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready values."""
        return {
            "passed": self.passed,
            "mass_matrix": {
                "least_eigenvalue": self.least,
                "at": list(self.least_at),
                "certificate": self.certificate or None,
                "share_proven": self.proven,
                "share_not_positive": self.negative,
                "asymmetry": self.asymmetry,
                "asymmetry_at": list(self.asymmetry_at),
            },
            "friction": {"drives_by": list(self.driving), "at_speed": list(self.driving_at)},
            "yaw": self.yaw,
            "faults": self.faults(),
        }


def check_physics(model: ReconstructedModel, seed: int = 0) -> PhysicsChecks:
    """Try a model's mass matrix, friction and yaw at random postures within the joint limits.

    The smallest eigenvalue is searched from the worst postures on, too (:func:`lowest`); where none is found that is not
    positive, it is proven that there is none, if the model is of a kind that lets it
    (:mod:`armloop.dynamics.consistent`, :mod:`armloop.dynamics.definite`). Friction is tried up to the speeds that the
    model was fitted on (one rad/s if it does not say): joint after joint alone, and all joints at once.

    Args:
        seed: of the postures and motions.
    """
    arm, rng = model.arm, np.random.default_rng(seed)
    low, high = joint_limits(arm, model.history.get("range"))
    q = rng.uniform(low, high, (_POSTURES, arm.n))
    M = mass_matrix(model, q)
    least = _least(M)
    tilt = np.linalg.norm(M - M.transpose(0, 2, 1), axis=(1, 2)) / np.maximum(
        np.linalg.norm(M, axis=(1, 2)), TINY
    )

    mass = partial(mass_matrix, model)
    values, postures = lowest(mass, low, high, q, least, rng)
    certificate, proof = _certificate(model, q[:_FEW], M[:_FEW]), None
    if values[0] > 0 and not certificate:
        proof = _proof(model, q[:_FEW], M[:_FEW], low, high)
    if proof is not None and proof.indefinite is not None:
        met = proof.indefinite[None]
        values, postures = lowest(mass, low, high, met, _least(mass(met)), rng)
    elif proof is not None and proof.complete:
        certificate = BOXES
    driving, speeds = _driving(model, low, high, rng)
    return PhysicsChecks(
        least=float(values[0]),
        least_at=tuple(postures[0].tolist()),
        negative=float(np.mean(least <= 0)),
        asymmetry=float(tilt.max()),
        asymmetry_at=tuple(q[int(np.argmax(tilt))].tolist()),
        driving=tuple(driving.tolist()),
        driving_at=tuple(speeds.tolist()),
        certificate=certificate,
        proven=1.0 if certificate else proof.share if proof is not None else 0.0,
        yaw=None if gravity_sees_first_joint(arm) or not arm.revolute[0] else _yaw(model, low, high, rng),
    )


def joint_limits(arm: Arm, trained: Any = None) -> tuple[Array, Array]:
    """(n,) lower and upper positions that are tried: the URDF's, of a revolute joint one turn at most.

    A prismatic joint without limits is tried over twice the range trained on (a metre if that is not known), one with a
    limit on one side as far from that.

    Args:
        trained: half ranges of q first and its centre last, as a model's history keeps them.
    """
    lower, upper = np.array([[j.lower, j.upper] for j in arm.joints]).T
    half = np.full(arm.n, 1.0) if trained is None else 2 * np.array(trained[0], dtype=float)
    centre = np.zeros(arm.n) if trained is None else np.array(trained[-1], dtype=float)
    half, centre = np.where(arm.revolute, np.pi, half), np.where(arm.revolute, 0.0, centre)
    has_lower, has_upper = np.isfinite(lower), np.isfinite(upper)
    whole = has_lower & has_upper & ~(arm.revolute & (upper - lower >= 2 * np.pi))
    centre = np.where(
        has_lower & ~has_upper, lower + half, np.where(has_upper & ~has_lower, upper - half, centre)
    )
    return np.where(whole, lower, centre - half), np.where(whole, upper, centre + half)


def mass_matrix(model: ReconstructedModel, q: Array) -> Array:
    """(P, n, n) mass matrix of a model with its effects at postures q (P, n): torques of unit accelerations at rest."""
    P, n = q.shape
    repeated = np.repeat(q, n + 1, axis=0)
    vdot = np.tile(np.vstack([np.eye(n), np.zeros(n)]), (P, 1))
    tau = _torque(model, repeated, np.zeros_like(repeated), vdot).reshape(P, n + 1, n)
    return (tau[:, :n] - tau[:, n:]).transpose(0, 2, 1)


def lowest(
    mass: Callable[[Array], Array],
    low: Array,
    high: Array,
    q: Array,
    values: Array,
    rng: np.random.Generator,
    starts: int = _WORST,
) -> tuple[Array, Array]:
    """Smallest eigenvalues of a mass matrix and their postures, by a multistart direct search; the least one first.

    From each of the worst postures tried, every joint in turn, and then some directions across them all, are scanned for
    a lower eigenvalue: over the whole range at first, over half as far in each further round. A joint's whole range shows
    the dips that a small step hides.

    Args:
        mass: (P, n) postures -> (P, n, n).
        low, high: (n,) limits of the postures.
        q: (P, n) postures tried, with their smallest eigenvalues ``values`` (P,).
        starts: how many of them to begin at.

    Returns:
        (S,) eigenvalues, rising, and (S, n) their postures.
    """
    n, worst = len(low), np.argsort(values)[:starts]
    q, values = q[worst], values[worst]
    each, reach = np.arange(len(worst)), np.linspace(-1, 1, _ALONG)[:, None] * (high - low)
    for _ in range(_ROUNDS):
        for direction in [*np.eye(n), *rng.normal(scale=1 / np.sqrt(n), size=(_ACROSS, n))]:
            tried = np.clip(q[:, None] + reach * direction, low, high)
            found = _least(mass(tried.reshape(-1, n))).reshape(len(worst), -1)
            best = found.argmin(axis=1)
            better = found[each, best] < values
            q = np.where(better[:, None], tried[each, best], q)
            values = np.where(better, found[each, best], values)
        reach = 0.5 * reach
    order = np.argsort(values)
    return values[order], q[order]


def _certificate(model: ReconstructedModel, q: Array, M: Array) -> str:
    """Why M(q) is positive definite at every posture, by what the links are; empty if they do not show it.

    Kinetic energies add up: of links and rotors that can exist, and of what else has an inertia, the same everywhere.
    """
    n = model.arm.n
    if len(model.components) != 1 or not isinstance(model.components[0], RigidBody):
        return ""
    full = model.components[0].parameters
    own = scales(model.arm, full[: 10 * n], nominal_parameters(model.arm))
    if not are_bodies(np.concatenate([full[: 10 * n] / own, full[10 * n :]]), n):
        return ""
    rest = _same_everywhere(M - mass_matrix(replace(model, effects=()), q), M)
    return BODIES if rest is not None and _least(rest[None])[0] >= -_ROUND_OFF * np.abs(M).max() else ""


def _proof(model: ReconstructedModel, q: Array, M: Array, low: Array, high: Array) -> Proof | None:
    """How much of the limits has a positive definite M(q); None where it is no sum of few functions of the posture."""
    if len(model.components) != 1 or not isinstance(model.components[0], Lagrangian):
        return None
    body = model.components[0]
    rest = _same_everywhere(M - body.mass_matrix(q), M)
    if rest is None:
        return None
    return prove_definite(MassTerms.of(body.energy, body.coefficients, rest), low, high)


def _same_everywhere(rest: Array, M: Array) -> Array | None:
    """(n, n) what is in M (P, n, n) beside the links, if that is the same at all postures."""
    return rest[0] if np.abs(rest - rest[0]).max() <= _ROUND_OFF * np.abs(M).max() else None


def _least(M: Array) -> Array:
    return np.asarray(np.linalg.eigvalsh(0.5 * (M + M.transpose(0, 2, 1)))[:, 0])


def _driving(
    model: ReconstructedModel, low: Array, high: Array, rng: np.random.Generator
) -> tuple[Array, Array]:
    """(n,) the largest torque of each joint's friction along its motion, and that speed.

    Friction is the part of the torque at constant velocity that turns with it: of rigid links' torques none does.
    """
    n, fastest = model.arm.n, np.maximum(model.ranges[1], 1e-6)
    alone = np.kron(np.eye(n), np.linspace(0, 1, _SPEEDS + 1)[1:, None]) * fastest
    v = np.concatenate([alone, rng.uniform(-1, 1, (_MOTIONS, n)) * fastest])
    q = rng.uniform(low, high, v.shape)
    still = np.zeros_like(v)
    forth, back = _torque(model, q, v, still), _torque(model, q, -v, still)
    # Of joints that move together only the sum of the powers must not be negative; those that give any are to blame.
    power = 0.5 * (forth - back) * v
    together = power.sum(axis=1, keepdims=True)
    round_off = _ROUND_OFF * np.sum((np.abs(forth) + np.abs(back)) * np.abs(v), axis=1, keepdims=True)
    given = np.where(together < -round_off, np.maximum(-power, 0.0), 0.0)
    pushing = given / np.maximum(np.abs(v), 1e-12)
    worst = pushing.argmax(axis=0)
    joints = np.arange(n)
    return pushing[worst, joints], np.where(pushing[worst, joints] > 0, v[worst, joints], 0.0)


def _yaw(model: ReconstructedModel, low: Array, high: Array, rng: np.random.Generator) -> float:
    """Part by which the torques of links and friction change with q1; what a named effect does may well depend on it."""
    model = replace(model, effects=())
    n, trained = model.arm.n, model.history.get("range")
    size = np.ones((3, n)) if trained is None else np.array(trained, dtype=float)
    q = rng.uniform(low, high, (_MOTIONS, n))
    v, vdot = rng.uniform(-1, 1, (2, _MOTIONS, n)) * size[1:3, None]
    turned = q.copy()
    turned[:, 0] = rng.uniform(low[0], high[0], _MOTIONS)
    here, there = (_torque(model, x, v, vdot) for x in (q, turned))
    return float(np.sqrt(np.mean((here - there) ** 2) / max(float(np.mean(here**2)), TINY)))


def _torque(model: ReconstructedModel, q: Array, v: Array, vdot: Array) -> Array:
    """(N, n) torques of samples that have nothing to do with each other: each is a run of its own."""
    motion = Motion(np.arange(float(len(q))), q, v, vdot, np.arange(len(q)))
    return model.predict(motion, sensors=False)


def _posture(q: tuple[float, ...]) -> str:
    return "(" + ", ".join(f"{x:.2f}" for x in q) + ")"
