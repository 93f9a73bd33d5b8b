"""Refitting: coefficients regressed once more, the terms being chosen, on columns that are filtered like the torque.

Friction steps where a joint reverses, and the filter smears the step in the torque; unless its column is smeared
alike, f_s comes out low and v_s high, most of all where a log holds no slow motion but that around reversals. All
candidates cannot be filtered in reasonable time, the few chosen ones can. v_s leaves its grid here (Gauss-Newton).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from armloop.identification.reconstruction.data import Chunk, Data
from armloop.identification.reconstruction.fitted import step_rows
from armloop.identification.reconstruction.found import Found
from armloop.identification.reconstruction.nearest_regime import Sorter
from armloop.identification.uncertainty.solving import solve
from armloop.identification.uncertainty.standard_errors import Assembled
from armloop.laws.friction import FrictionTerm
from armloop.model import ReconstructedModel
from armloop.model.components import SparseTerms
from armloop.regression.estimators import Estimator

_FARTHEST = 2.5
#: What the user is told of it.
REFITTED = "coefficients regressed once more on columns that are filtered like the torque"


def refit(found: Found, data: Data, estimator: Estimator) -> bool:
    """Replace a stepwise result's coefficients; tell whether it was done.

    It is not done for samples that passed no filter, for estimators that shrink or choose nothing, and where the
    squared error of the fitted samples would not fall; nor for a joint whose v_s would move by more than a factor
    of two and a half.
    """
    if data.reference.samples.cutoff_hz <= 0 or not estimator.least_squares:
        return False
    before = found.model()
    try:
        after, falls = solve(
            before, lambda model: data.sum(partial(_assembled, model=model, sorter=found.regressed_by))
        )
    except np.linalg.LinAlgError:
        return False
    if not falls:
        return False
    good = [_near(old, new) for old, new in zip(before.friction.terms, after.friction.terms, strict=True)]
    found.friction = [
        list(new if ok else old)
        for ok, old, new in zip(good, before.friction.terms, after.friction.terms, strict=True)
    ]
    found.components = [
        replace(new, coefficients=np.where(good, new.coefficients, old.coefficients))
        if isinstance(old, SparseTerms) and isinstance(new, SparseTerms)
        else new
        for old, new in zip(before.components, after.components, strict=True)
    ]
    return any(good)


def _assembled(chunk: Chunk, model: ReconstructedModel, sorter: Sorter | None) -> Assembled:
    return Assembled.of(model, chunk.samples, step_rows(chunk, sorter))


def _near(old: Sequence[FrictionTerm], new: Sequence[FrictionTerm]) -> bool:
    """Whether a joint's v_s stayed near the grid's best: with terms missing it can run away."""
    pairs = [(a.parameter, b.parameter) for a, b in zip(old, new, strict=True) if a.kind == "stribeck"]
    return all(a / _FARTHEST < b < a * _FARTHEST for a, b in pairs)
