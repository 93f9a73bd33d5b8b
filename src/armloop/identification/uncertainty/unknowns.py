"""A model's coefficients as the unknowns of regressions, with the columns that multiply them.

Sparse terms belong to one joint each, so there is one problem per joint. Base parameters and terms of the
energies serve all joints: one problem, in which every joint's samples count by the size of its residual. The
Stribeck velocity v_s is an unknown too; it enters by its derivative (delta method). Columns pass the filter that
the torque has passed: friction steps where a joint reverses, and so must its column. Laws that were fitted beside shared
coefficients, such as a balancer's spring beside the weight that it carries, are unknowns of the same problem, each parameter
by the derivative of its torque: what one takes of the other is an error of both.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from armloop.data.motion import Motion, Samples
from armloop.data.signals import smooth
from armloop.features.double_feature_set import products
from armloop.features.rigid_body import BaseParameters, rotor_names
from armloop.laws.effects.base import number
from armloop.laws.friction import FrictionTerm, stribeck_term
from armloop.model import AddedEffect, ReconstructedModel
from armloop.model.components import Lagrangian, RigidBody, SparseTerms
from armloop.util.arrays import Array, Index

#: Part of its error by which a law's parameter is moved for the derivative.
_STEP = 0.1
#: Name of the unknown v_s beside the friction terms of a joint.
STRIBECK_VELOCITY = "v_s"


@dataclass(frozen=True)
class Unknown:
    """One coefficient.

    Attributes:
        kind: ``"joints"`` (a sparse term), ``"friction"``, ``"shared"`` or ``"effects"`` (a law's parameter's error).
        joint: 0-based; None where all joints share it.
        name: as the model prints it.
        value: the estimate.
        step: which found it.
        linear: whether value times column is part of the torque; not so for a derivative's column.
    """

    kind: str
    joint: int | None
    name: str
    value: float
    step: int
    linear: bool = True


@dataclass(frozen=True, eq=False)
class Design:
    """Columns of one joint: X (N, k) belong to the unknowns ``where`` (k,)."""

    joint: int
    where: Index
    X: Array


@dataclass(frozen=True, eq=False)
class Problem:
    """Unknowns that are regressed together.

    Attributes:
        unknowns: p of them.
        weighted: whether several joints' samples enter, each weighted by its residual.
        designs: the columns on some samples, one design per joint that enters.
    """

    unknowns: list[Unknown]
    weighted: bool
    designs: Callable[[Samples], list[Design]]


def problems(model: ReconstructedModel) -> list[Problem]:
    """The regressions whose solution the model is.

    Effects that a diagnosis added are left aside, and so are all beside terms that joints have of their own.
    """
    bodies = [component for component in model.components if isinstance(component, RigidBody | Lagrangian)]
    if bodies:
        return [_shared(model, *bodies)]
    return [_sparse(model, joint) for joint in range(model.arm.n)]


def _sparse(model: ReconstructedModel, joint: int) -> Problem:
    found = [c for c in model.components if isinstance(c, SparseTerms)]
    used = [np.flatnonzero(component.coefficients[:, joint]) for component in found]
    unknowns = [
        Unknown("joints", joint, name, value, step)
        for component in found
        for step, value, name in component.terms(model.arm, joint)
    ]
    law = model.friction.terms[joint]
    unknowns += _friction_unknowns(law, joint)
    where = np.arange(len(unknowns), dtype=np.intp)

    def designs(samples: Samples) -> list[Design]:
        motion = samples.motion
        load = model.rigid_body(motion) if any(term.by_load for term in law) else None
        parts = [
            products(c.factors.evaluate(motion), c.index[rows]) for c, rows in zip(found, used, strict=True)
        ]
        X = np.column_stack(
            [np.zeros((motion.samples, 0)), *parts, *_friction_columns(law, motion, joint, load)]
        )
        return [Design(joint, where, smooth(samples, X))]

    return Problem(unknowns, False, designs)


def _shared(model: ReconstructedModel, body: RigidBody | Lagrangian) -> Problem:
    if isinstance(body, RigidBody):
        base = BaseParameters.of_arm(model.arm, rotors=len(body.parameters) == 11 * model.arm.n)
        # in the order of their columns: a file may list them in another
        names, known = base.names, dict(zip(body.names, body.values.tolist(), strict=True))
        values = np.array([known.get(name, 0.0) for name in names])
    else:
        base, names, values = None, body.energy.names, body.coefficients
    unknowns = [Unknown("shared", None, name, float(c), 1) for name, c in zip(names, values, strict=True)]
    r = len(unknowns)
    # what rotors need does not pass the joints
    passing = np.where([name in rotor_names(model.arm.n) for name in names], 0.0, values)
    wheres = []
    for joint, law in enumerate(model.friction.terms):
        own = _friction_unknowns(law, joint)
        wheres.append(np.concatenate([np.arange(r), len(unknowns) + np.arange(len(own))]).astype(np.intp))
        unknowns += own
    laws = list(_parameters(model))
    wheres = [np.concatenate([where, len(unknowns) + np.arange(len(laws))]) for where in wheres]
    unknowns += [
        Unknown("effects", None, f"{key} of {added.effect.label()}", 0.0, 1) for added, key, _ in laws
    ]

    def designs(samples: Samples) -> list[Design]:
        motion = samples.motion
        slopes = smooth(samples, _slopes(model, motion, laws)) if laws else np.zeros((*motion.v.shape, 0))
        columns = base.columns(model.arm, motion) if base is not None else body.energy.columns(motion)  # type: ignore[union-attr]
        load = columns @ passing
        columns = smooth(samples, columns)
        found = []
        for joint, law in enumerate(model.friction.terms):
            friction = [smooth(samples, x) for x in _friction_columns(law, motion, joint, load)]
            X = np.column_stack([columns[:, joint], *friction, slopes[:, joint]])
            found.append(Design(joint, wheres[joint], X))
        return found

    return Problem(unknowns, True, designs)


def _parameters(model: ReconstructedModel) -> Iterator[tuple[AddedEffect, str, float]]:
    """Laws that the model was fitted with, with the name of each of their numbers that has an error, and that."""
    for added in model.effects:
        for key, estimate in added.parameters.items():
            value, error = estimate.value, estimate.std_error
            if added.when == "always" and isinstance(value, float) and isinstance(error, float):
                if np.isfinite(error) and error > 0:
                    yield added, key, error


def _slopes(
    model: ReconstructedModel, motion: Motion, laws: Sequence[tuple[AddedEffect, str, float]]
) -> Array:
    """(N, n, q) derivative of laws' torque by their parameters, by central differences of a part of their errors."""
    context = model.context(motion, [added.effect for added, *_ in laws])
    found = []
    for added, key, error in laws:
        step = _STEP * error
        high, low = (
            added.effect.torque(context, {**added.values, key: number(added.values[key]) + sign * step})
            for sign in (1, -1)
        )
        found.append((high - low) / (2 * step))
    return np.stack(found, axis=2)


def _friction_unknowns(law: Sequence[FrictionTerm], joint: int) -> list[Unknown]:
    found, own = [], stribeck_term(law)
    for term in law:
        found.append(Unknown("friction", joint, term.name(joint + 1), term.coefficient, term.step))
        if term is own:
            found.append(
                Unknown("friction", joint, STRIBECK_VELOCITY, term.parameter, term.step, linear=False)
            )
    return found


def _friction_columns(
    law: Sequence[FrictionTerm], motion: Motion, joint: int, load: Array | None
) -> list[Array]:
    columns, own = [], stribeck_term(law)
    for term in law:
        columns.append(term.column(motion, joint, load))
        if term is own:
            columns.append(term.slope(motion, joint))
    return columns
