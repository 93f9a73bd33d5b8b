"""Uncertainty of a reconstructed model's coefficients: standard errors and covariances."""

from armloop.identification.uncertainty.propagated import torque_errors
from armloop.identification.uncertainty.standard_errors import Errors, Fitted, covariances, standard_errors

__all__ = ["Errors", "Fitted", "covariances", "standard_errors", "torque_errors"]
