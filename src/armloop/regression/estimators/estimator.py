"""Interface of a sparse estimator."""

from __future__ import annotations

from typing import Any, ClassVar

from armloop.regression.estimators.problem import Problem
from armloop.util.arrays import Array
from armloop.util.registry import check_class


class Estimator:
    """How the terms of a sparse regression are chosen.

    Class attributes:
        name: of the option ``--estimator``.
        least_squares: whether the coefficients are those of least squares on the few terms kept; only these may be
            regressed once more.
        shrinks: whether they are smaller than that.
        needs_parts: whether held-out parts of the data change the estimate.
        keeps_all: whether no term is left out, so that there is no :class:`Problem`.
        has_penalty: whether a penalty, or a threshold, is one of its parameters.
    """

    name: ClassVar[str]
    least_squares: ClassVar[bool] = False
    shrinks: ClassVar[bool] = False
    needs_parts: ClassVar[bool] = True
    keeps_all: ClassVar[bool] = False
    has_penalty: ClassVar[bool] = True

    def choose(self, problem: Problem) -> Array:
        """(p,) coefficients of the problem's columns, zero where a term is left out.

        Raises:
            ArithmeticError: a solver does not converge.
        """
        raise NotImplementedError


def check_estimator(kind: Any, where: str) -> None:
    """Raise ``InputError`` unless ``kind`` is a complete estimator."""
    check_class(kind, where, Estimator, "armloop.regression.estimators.Estimator", ("name", "choose"))
