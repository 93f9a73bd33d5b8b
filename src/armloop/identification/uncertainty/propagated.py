"""Propagation of uncertainty: what the errors of a model's coefficients do to its torque, by their leading directions.

The covariance of the coefficients is kept as the few independent directions that carry nearly all of the torque's variance
on the training samples (principal components in the metric of the torque); a later run asks what they are on its motion.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from armloop.data.motion import Samples
from armloop.data.signals import rate_along, smooth
from armloop.identification.uncertainty.between_logs import friction_spread
from armloop.identification.uncertainty.sensor_drift import drift_spread
from armloop.identification.uncertainty.unknowns import Unknown, problems
from armloop.model import ReconstructedModel
from armloop.util.arrays import Array

#: So many numbers are kept at most, with so many digits: coefficients of columns that are nearly alike cancel.
_NUMBERS, _DIGITS = 2500, 5


def leading(covariance: Array, gram: Array) -> Array:
    """(p, r) lower trapezoidal directions L with L Lᵀ the covariance (p, p), or where that were too many numbers its leading
    principal components, as the torque feels them.

    Args:
        gram: (p, p) products of the columns, summed over the training samples in units of their noise.
    """
    p, known = len(gram), np.isfinite(np.diag(covariance))
    values, vectors = np.linalg.eigh(_symmetric(np.where(known & known[:, None], covariance, 0.0)))
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    turned = np.linalg.eigh(_symmetric(root.T @ gram @ root))[1][:, ::-1]
    r = np.arange(p) + 1
    enough = int(np.count_nonzero(r * (2 * p - r + 1) <= 2 * _NUMBERS))
    return np.asarray(np.linalg.qr((root @ turned[:, :enough]).T)[1].T)


def to_dict(unknowns: Sequence[Unknown], directions: Array) -> dict[str, Any]:
    """What the model file keeps of a problem: its unknowns' names, and what each direction (p, r) changes of them.

    Zeros above the diagonal are left out; the numbers of a row stand in one string, else a line each would be theirs.
    """
    rows = [" ".join(f"{x:.{_DIGITS}g}" for x in row[: k + 1]) for k, row in enumerate(directions)]
    return {"unknowns": [unknown.name for unknown in unknowns], "directions": rows}


def _directions(rows: Sequence[str]) -> Array:
    each = [[float(x) for x in row.split()] for row in rows]
    whole = np.zeros((len(each), max(map(len, each), default=0)))
    for k, row in enumerate(each):
        whole[k, : len(row)] = row
    return whole


def torque_errors(model: ReconstructedModel, samples: Samples, between_logs: bool = True) -> Array:
    """(N, n, r) torque of independent errors of the model, one standard deviation each, through the samples' filter.

    Of its coefficients, of a record of the torque that was out of step, of zeros of torques that differ between logs, and of
    friction where it does, if that is asked for. None (r = 0) of a model that keeps no directions of its unknowns, such as
    one made by hand.
    """
    kept: Sequence[dict[str, Any]] = model.uncertainty.get("torque", [])
    parts = []
    for problem in problems(model) if kept else []:
        # by their names: a file gives a joint's terms back in another order than they were found in, and one from before a
        # fall's velocity or a law's parameters were unknowns tells those of the others
        names = _numbered([unknown.name for unknown in problem.unknowns])
        one = max(kept, key=lambda each: len({*names} & {*_numbered(each["unknowns"])}))
        place = {name: k for k, name in enumerate(_numbered(one["unknowns"]))}
        told = [k for k, name in enumerate(names) if name in place]
        if 2 * len(told) <= len(place):
            continue
        found = _directions(one["directions"])
        directions = np.zeros((len(names), found.shape[1]))
        directions[told] = found[[place[names[k]] for k in told]]
        torque = np.zeros((*samples.motion.q.shape, directions.shape[1]))
        for design in problem.designs(samples):
            torque[:, design.joint] += design.X @ directions[design.where]
        parts.append(torque)
    lag = model.uncertainty.get("torque_lag", 0.0)
    if lag:
        predicted = smooth(samples, model.predict(samples.motion))
        parts.append(lag * rate_along(samples, predicted)[:, :, None])
    parts.append(drift_spread(model, samples))
    if between_logs and (spread := friction_spread(model, samples)).any():
        parts.append(spread)
    return np.concatenate(parts, axis=2) if parts else np.zeros((*samples.motion.q.shape, 0))


def _numbered(names: Sequence[str]) -> list[tuple[str, int]]:
    """Names with how many of the same came before: joints have terms of one name, a constant for example."""
    seen: Counter[str] = Counter()
    found = []
    for name in names:
        found.append((name, seen[name]))
        seen[name] += 1
    return found


def _symmetric(x: Array) -> Array:
    return 0.5 * (x + x.T)
