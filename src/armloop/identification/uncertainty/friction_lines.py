"""Coulomb level and viscous coefficient of any friction law: the straight line nearest to it over the speeds trained on.

Laws are sums of elements (directions that fade in, Stribeck falls, roots and powers) whose single coefficients say little,
because neighbouring elements share what the data show. What a data sheet or a simulator asks for, τ = f_c sign(v) + f_v v,
is a linear function of them, so that its standard errors follow from their covariance, correlations included.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from armloop.data.motion import Motion, Samples
from armloop.identification.uncertainty.unknowns import STRIBECK_VELOCITY
from armloop.laws.friction import FADED, FrictionTerm, stribeck_term
from armloop.model import ReconstructedModel
from armloop.util.arrays import Array, Mask

#: Speeds at which a law is compared with its line, and the quantiles of the fitted speeds that they lie between.
_SPEEDS, _BETWEEN = 100, (0.1, 0.95)


def friction_line(
    model: ReconstructedModel,
    joint: int,
    names: Sequence[str],
    error: Callable[[Array], tuple[float, float]],
    samples: Samples,
    rows: Mask,
) -> dict[str, Any]:
    """f_c, f_v of a joint (0-based) with standard errors, and the speeds between which they hold.

    Args:
        names: of p unknowns, those of the joint's friction, ``v_s`` among them, and nothing for others.
        error: standard error and degrees of freedom of their sum with weights (p,).
        rows: (N,) samples fitted.

    Friction that grows with the load is left out: the line is that of the unloaded joint. Empty where there is none.
    """
    terms = [t for t in model.friction.terms[joint] if not t.by_load]
    moving = np.abs(samples.motion.v[rows, joint])
    if not terms or not len(moving):
        return {}
    low, high = np.quantile(moving, _BETWEEN)
    fades = [FADED * t.parameter for t in terms if t.kind == "smooth_sign"]
    low = min(max(low, *fades, 0.0), 0.5 * high) if fades else low
    v = np.linspace(low, high, _SPEEDS)
    columns = np.column_stack([_odd(_column, t, v) for t in terms])
    fit = np.linalg.pinv(np.column_stack([np.ones_like(v), v]))
    line = fit @ columns
    places = {t.name(joint + 1): k for k, t in enumerate(terms)}
    weights = np.zeros((2, len(names)))
    for k, name in enumerate(names):
        if name in places:
            weights[:, k] = line[:, places[name]]
        elif name == STRIBECK_VELOCITY:
            own = stribeck_term(terms)
            assert own is not None
            weights[:, k] = fit @ _odd(lambda term, motion: term.slope(motion, 0), own, v)
    values = line @ [t.coefficient for t in terms]
    pairs = zip(("coulomb", "viscous"), values, weights, strict=True)
    found = {key: {"value": float(x), **entry(*error(own))} for key, x, own in pairs}
    return {**found, "speeds": [float(low), float(high)]}


def entry(error: float, freedom: float) -> dict[str, float]:
    """A standard error as the model file keeps it."""
    return {"std_error": float(error), "degrees_of_freedom": round(float(freedom), 1)}


def _column(term: FrictionTerm, motion: Motion) -> Array:
    """A term's values where speeds have lasted: memory is fully slid."""
    return np.sign(motion.v[:, 0]) if term.kind == "hysteresis" else term.column(motion, 0)


def _odd(of: Callable[[FrictionTerm, Motion], Array], term: FrictionTerm, v: Array) -> Array:
    """Half the difference of both directions: what an offset adds to each is no friction."""
    still, index = np.zeros((len(v), 1)), np.arange(len(v))
    ways = [Motion(index.astype(float), still, way * v[:, None], still, index) for way in (1.0, -1.0)]
    return 0.5 * (of(term, ways[0]) - of(term, ways[1]))
