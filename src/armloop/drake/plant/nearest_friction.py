"""Stribeck friction, Eq. (34), fitted to that of a reconstructed model: what a simulated plant of the arm is given."""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

from armloop.drake.plant.friction import JointFriction
from armloop.dynamics import ModelEquations, training_range
from armloop.laws.friction import stribeck_fall
from armloop.model import AddedEffect, ReconstructedModel
from armloop.util.arrays import Array
from armloop.util.functions import NUMPY

_SPEEDS = 60
_VELOCITIES = np.geomspace(0.005, 1.0, 40)  # v_s tried, as parts of the largest speed
_EXACT = {"sign", "smooth_sign", "stribeck", "stribeck_peak", "viscous"}
_POSTURES = 20


def nearest_friction(model: ReconstructedModel) -> tuple[JointFriction, ...]:
    """The Stribeck law of each joint, (n,), that follows from a model's friction.

    A law of that form is taken as it is. Of any other the mean over both directions, over postures within the
    training range (for friction that grows with the load) and fully slid, is fitted by variable projection: v_s from a
    grid, the levels by non-negative least squares over speeds up to the largest of the training.
    """
    found: list[JointFriction] = []
    curves: tuple[Array, Array] | None = None
    for j, terms in enumerate(model.friction.terms):
        effects = [a for a in model.effects if j in a.effect.indices and _rubs(a)]
        p = model.friction.stribeck_parameters(j)
        if p and {t.kind for t in terms} <= _EXACT and not effects:
            static, coulomb = max(p["static"], 0.0), max(p["coulomb"], 0.0)
            speed = p.get("stribeck_velocity", 0.1)
            found.append(JointFriction(max(static, coulomb), coulomb, speed, max(p.get("viscous", 0.0), 0.0)))
            continue
        curves = curves or _curves(model)
        found.append(_fitted(curves[0][:, j], curves[1][:, j]))
    return tuple(found)


def _rubs(added: AddedEffect) -> bool:
    law = added.placed()
    return law is not None and any(term.element.part == "friction" for term in law.terms)


def _curves(model: ReconstructedModel) -> tuple[Array, Array]:
    """Speeds (K, n) and the mean friction at them, (K, n), of each joint that turns alone."""
    n = model.arm.n
    speeds = np.geomspace(1e-3, 1.0, _SPEEDS)[:, None] * np.maximum(model.ranges[1], 1e-2)
    lower, upper = training_range(model)
    q = np.random.default_rng(0).uniform(lower, upper, (_POSTURES, n))
    equations = ModelEquations(model, NUMPY)
    still = [np.zeros(_POSTURES)] * n
    load = equations.load([q[:, j] for j in range(n)], still, still)
    sizes = [np.abs(np.broadcast_to(x, (_POSTURES,))).mean() for x in load]
    postures, curves = [q[:, j] for j in range(n)], np.zeros((_SPEEDS, n))
    for j in range(n):
        for way in (1.0, -1.0):
            v = [way * speeds[:, [j]] if k == j else np.zeros((_SPEEDS, 1)) for k in range(n)]
            rubs = equations.friction(v, sizes, 1e300, postures)[j]
            curves[:, j] += 0.5 * way * np.broadcast_to(rubs, (_SPEEDS, _POSTURES)).mean(axis=1)
    return speeds, curves


def _fitted(v: Array, friction: Array) -> JointFriction:
    tried = [
        (v_s, *nnls(np.column_stack([stribeck_fall(v, v_s), np.ones_like(v), v]), friction))
        for v_s in _VELOCITIES * v.max()
    ]
    v_s, (excess, coulomb, viscous), _ = min(tried, key=lambda each: each[2])
    return JointFriction(float(excess + coulomb), float(coulomb), float(v_s), float(viscous))
