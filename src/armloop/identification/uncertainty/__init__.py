"""Uncertainty of a reconstructed model's coefficients: standard errors and covariances."""

from armloop.identification.uncertainty.between_logs import (
    between_logs,
    friction_directions,
    friction_spread,
    usual_in_words,
)
from armloop.identification.uncertainty.propagated import torque_errors
from armloop.identification.uncertainty.standard_errors import Errors, Fitted, covariances, standard_errors

__all__ = [
    "Errors",
    "Fitted",
    "between_logs",
    "covariances",
    "friction_directions",
    "friction_spread",
    "standard_errors",
    "torque_errors",
    "usual_in_words",
]
