"""Sparse estimators by name; each maps a :class:`Problem` to coefficients, zero where a term is left out.

An :class:`Estimator` of a user's own is found by its name, too: registered for a session, or installed.
"""

from __future__ import annotations

from collections.abc import Callable

from armloop.regression.estimators.adaptive_lasso import adaptive_lasso
from armloop.regression.estimators.debiased_lasso import debiased_lasso
from armloop.regression.estimators.estimator import Estimator, check_estimator
from armloop.regression.estimators.evidence import evidence
from armloop.regression.estimators.lasso import lasso
from armloop.regression.estimators.least_squares import least_squares
from armloop.regression.estimators.problem import Problem, Reduction
from armloop.regression.estimators.sr3 import sr3
from armloop.regression.estimators.stability import stability
from armloop.regression.estimators.stlsq import stlsq
from armloop.regression.estimators.thresholded import thresholded
from armloop.util.arrays import Array
from armloop.util.registry import Registry

__all__ = ["LISTED", "REGISTRY", "Estimator", "Problem", "Reduction", "register_estimator"]


def _listed(choose: Callable[[Problem], Array], **flags: bool) -> type[Estimator]:
    body = {"name": choose.__name__, "choose": staticmethod(choose), "__doc__": choose.__doc__, **flags}
    return type(choose.__name__, (Estimator,), body)


#: The default first.
LISTED: dict[str, type[Estimator]] = {
    kind.name: kind
    for kind in (
        _listed(evidence, least_squares=True, needs_parts=False, has_penalty=False),
        _listed(lasso, shrinks=True),
        _listed(debiased_lasso, least_squares=True),
        _listed(adaptive_lasso, shrinks=True),
        _listed(thresholded, least_squares=True),
        _listed(stlsq),
        _listed(sr3),
        _listed(stability, least_squares=True, has_penalty=False),
        _listed(least_squares, needs_parts=False, keeps_all=True, has_penalty=False),
    )
}
#: All estimators by name; a user's own are installed under the entry points ``armloop.estimators``.
REGISTRY: Registry[type[Estimator]] = Registry("armloop.estimators", "estimator", LISTED, check_estimator)


def register_estimator(kind: type[Estimator]) -> type[Estimator]:
    """Add an estimator for the rest of this session, as in a notebook; usable as a decorator.

    Raises:
        InputError: it is none, or its name is taken.
    """
    REGISTRY.register(kind)
    return kind
