"""A reconstructed model as equations of motion: mass matrix, bias, gravity, friction, forward dynamics."""

from armloop.dynamics.arrays import (
    Dynamics,
    coefficients,
    nearest_rigid_body,
    require_mass_matrix,
    training_range,
    viscous_coefficients,
    with_mass_matrix,
)
from armloop.dynamics.effects import EffectLaw, effect_law
from armloop.dynamics.model import ModelEquations
from armloop.dynamics.physics import PhysicsChecks, check_physics

__all__ = [
    "Dynamics",
    "EffectLaw",
    "ModelEquations",
    "PhysicsChecks",
    "check_physics",
    "coefficients",
    "effect_law",
    "nearest_rigid_body",
    "require_mass_matrix",
    "training_range",
    "viscous_coefficients",
    "with_mass_matrix",
]
