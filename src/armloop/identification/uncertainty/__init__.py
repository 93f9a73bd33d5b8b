"""How far the coefficients of a reconstructed model can be trusted."""

from armloop.identification.uncertainty.standard_errors import Errors, Fitted, covariances, standard_errors

__all__ = ["Errors", "Fitted", "covariances", "standard_errors"]
