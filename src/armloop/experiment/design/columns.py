"""The columns of the regressions that a motion can be designed for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armloop.data.motion import Motion
from armloop.experiment.design.information import Columns
from armloop.features.double_feature_set import DoubleFeatureSet
from armloop.features.rigid_body import BaseParameters
from armloop.laws.friction import FrictionTerm
from armloop.robot.arm import Arm
from armloop.util.arrays import Array

#: Friction beside the links: level, offset, viscous and quadratic. Friction with memory is no function of a sample.
_FRICTION = ("offset", "smooth_sign", "viscous", "quadratic")


def rigid_body_columns(arm: Arm, slow: Array) -> tuple[Columns, list[str]]:
    """Base parameters with rotor inertias, shared by all joints, and four friction terms a joint: (N, n, r + 4 n).

    Args:
        slow: (n,) speed below which a joint's direction fades, rad/s (m/s).
    """
    base = BaseParameters.of_arm(arm, rotors=True)
    laws = [[_term(kind, slow[j]) for kind in _FRICTION] for j in range(arm.n)]
    names = [*base.names, *(term.name(j + 1) for j, law in enumerate(laws) for term in law)]

    def columns(motion: Motion) -> Array:
        out = np.zeros((motion.samples, arm.n, base.count + arm.n * len(_FRICTION)))
        out[:, :, : base.count] = base.columns(arm, motion)
        for j, law in enumerate(laws):
            for k, term in enumerate(law):
                out[:, j, base.count + len(_FRICTION) * j + k] = term.column(motion, j)
        return out

    return columns, names


def double_feature_columns(revolute: Sequence[bool], order: int, slow: Array) -> tuple[Columns, list[str]]:
    """Candidates of the three steps at one order N1, and the direction of every joint: (N, 1, T).

    Every joint is regressed on the same candidates, so one row stands for all. The orders are (N1, 0), (N1, 2)
    in velocities and (N1, 1) in accelerations. Which candidates an arm needs is known only afterwards; those of
    a low order are its slowest-varying ones, and what tells them apart moves every joint through its range.
    """
    shape = tuple(bool(turns) for turns in revolute)
    parts = [
        DoubleFeatureSet(shape, order, 2, "velocity"),
        DoubleFeatureSet(shape, order, 1, "acceleration"),
    ]
    # the candidates without velocities and accelerations are in both
    fresh = [name not in set(parts[0].names) for name in parts[1].names]
    signs = [_term("smooth_sign", slow[j]) for j in range(len(shape))]
    names = [
        *parts[0].names,
        *(name for name, new in zip(parts[1].names, fresh, strict=True) if new),
        *(term.name(j + 1) for j, term in enumerate(signs)),
    ]

    def columns(motion: Motion) -> Array:
        dry = np.column_stack([term.column(motion, j) for j, term in enumerate(signs)])
        return np.hstack([parts[0].columns(motion), parts[1].columns(motion)[:, fresh], dry])[:, None, :]

    return columns, names


def _term(kind: str, slow: float) -> FrictionTerm:
    return FrictionTerm(kind, parameter=float(slow) if kind == "smooth_sign" else 0.0)
