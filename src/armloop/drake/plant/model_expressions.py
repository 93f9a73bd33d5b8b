"""A model's mass matrix, bias, gravity and friction in Drake's scalar types, outside of any system."""

from __future__ import annotations

from typing import Any

from pydrake.symbolic import Expression

from armloop.drake.given import require_model
from armloop.drake.scalars import functions_of
from armloop.dynamics import ModelEquations
from armloop.model import ReconstructedModel


def model_equations(model: ReconstructedModel, T: type = Expression, **options: Any) -> ModelEquations:
    """Return a model's equations of motion for float, AutoDiffXd or, by default, as formulas in Expressions.

    `model_equations(model).mass_matrix(q)` with n `Variable` s as q is M(q) written out, a list of n rows;
    `bias(q, v)`, `gravity(q)`, `friction(v)`, `torque(q, v, vdot)` and `acceleration(q, v, tau)` likewise.

    options : `step`, `smoothing`, `symmetric` of `armloop.dynamics.ModelEquations`

    Raises `ModelError` where an effect or a term has no such law.
    """
    require_model(model)
    return ModelEquations(model, functions_of(T), **options)
