"""Solving a model's estimating equations for its coefficients, the terms being given."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from armloop.data.motion import Samples
from armloop.features.rigid_body import BaseParameters
from armloop.identification.uncertainty.standard_errors import (
    Assembled,
    Errors,
    Fitted,
    covariances,
    gauss_newton_steps,
)
from armloop.identification.uncertainty.unknowns import STRIBECK_VELOCITY, Unknown
from armloop.laws.friction import FrictionLaw, stribeck_term
from armloop.model import ReconstructedModel
from armloop.model.components import Lagrangian, RigidBody, SparseTerms
from armloop.robot.kinematics import nominal_parameters
from armloop.util.arrays import Array

#: Part of the misfit that another iteration must remove to be worth one more.
_WORTHWHILE = 1e-3


def solve_given_terms(
    model: ReconstructedModel, samples: Samples, fitted: Sequence[Fitted], iterations: int
) -> tuple[ReconstructedModel, list[Errors]]:
    """Least squares, step by step, over a model's own terms; Gauss-Newton for v_s.

    Returns:
        The model at the solution, and the errors of its coefficients.
    """
    for _ in range(iterations):
        model = moved(model, gauss_newton_steps(model, samples, fitted))
    return model, covariances(model, samples, fitted)[0]


def solve(
    model: ReconstructedModel, assembled: Callable[[ReconstructedModel], Assembled], iterations: int = 4
) -> tuple[ReconstructedModel, bool]:
    """The best of several Gauss-Newton iterates, and whether it fits better than the model given.

    Args:
        assembled: the estimating equations at a model, summed over all samples.

    Better is a smaller sum over joints of squared residual relative to the squared torque, every sample by the
    last regression that used it.

    Raises:
        numpy.linalg.LinAlgError: the terms cannot be told apart.
    """
    best, equations = model, assembled(model)
    error = start = equations.misfit()
    for _ in range(iterations):
        model = moved(model, equations.steps())
        equations = assembled(model)
        new, gained = equations.misfit(), error - equations.misfit()
        if new < error:
            best, error = model, new
        if gained < _WORTHWHILE * start:
            break
    return best, error < start


def moved(model: ReconstructedModel, steps: Sequence[tuple[list[Unknown], Array]]) -> ReconstructedModel:
    """The model with a step (p,) added to every problem's unknowns; v_s changes by half at most."""
    values: dict[tuple[str, int | None, str], float] = {}
    for unknowns, step in steps:
        for unknown, change in zip(unknowns, step, strict=True):
            value = unknown.value + float(change)
            if unknown.name == STRIBECK_VELOCITY:
                value = float(np.clip(value, 0.5 * unknown.value, 1.5 * unknown.value))
            values[unknown.kind, unknown.joint, unknown.name] = value
    components = tuple(_component(model, component, values) for component in model.components)
    friction = tuple(
        tuple(
            replace(
                term,
                coefficient=values["friction", j, term.name(j + 1)],
                parameter=values["friction", j, STRIBECK_VELOCITY]
                if term is stribeck_term(law)
                else term.parameter,
            )
            for term in law
        )
        for j, law in enumerate(model.friction.terms)
    )
    return replace(model, components=components, friction=FrictionLaw(friction))


def _component(
    model: ReconstructedModel, component: object, values: dict[tuple[str, int | None, str], float]
) -> SparseTerms | RigidBody | Lagrangian:
    if isinstance(component, SparseTerms):
        coefficients = component.coefficients.copy()
        for j in range(model.arm.n):
            used = np.flatnonzero(coefficients[:, j])
            names = [name for _, _, name in component.terms(model.arm, j)]
            coefficients[used, j] = [values["joints", j, name] for name in names]
        return replace(component, coefficients=coefficients)
    if isinstance(component, RigidBody):
        rotors = len(component.parameters) == 11 * model.arm.n
        base = BaseParameters.of_arm(model.arm, rotors=rotors)
        own = np.array([values["shared", None, name] for name in component.names])
        nominal = np.concatenate([nominal_parameters(model.arm), np.zeros(model.arm.n if rotors else 0)])
        return replace(component, values=own, parameters=base.to_full(own, nominal))
    assert isinstance(component, Lagrangian)
    return replace(
        component, coefficients=np.array([values["shared", None, name] for name in component.energy.names])
    )
