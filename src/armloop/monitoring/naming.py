"""Fault isolation from sums alone: forward selection of effects on normal equations, judged on units left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from armloop.laws.effects import Effect, Estimate
from armloop.laws.effects.base import Place, entry
from armloop.monitoring.catalogue import Column, groups, stays_nonlinear
from armloop.regression.embedded import Linear, ridge, solve
from armloop.regression.moments import Moments
from armloop.robot.arm import Arm
from armloop.util.arrays import Array, Index

#: Ridges tried of what the model leaves on healthy units: where it is no more than noise, or the motion goes on to others,
#: its weak directions would put more into the window than they take out.
_HEALTHY_RIDGES = (1e-3, 1e-2, 0.1, 1.0, 10.0)
#: An effect must explain twice its standard error over the units, a further one this part of what the others do.
_WORTH = 0.02
#: A column this small beside the largest, squared, is none.
_NOTHING = 1e-20
_MOST = 3


@dataclass(frozen=True, eq=False)
class Normal:
    """Normal equations of U units: gram (U, p, p), moment (U, p), and the residual's energy (U,)."""

    gram: Array
    moment: Array
    energy: Array


@dataclass(frozen=True)
class Named:
    """An effect that appeared.

    Attributes:
        place: effect and joints.
        parameters: named, with standard errors from leaving one unit out at a time (jackknife).
        share: of the energy that the effects together explain on units left out.
        words: a sentence.
        alternatives: what explains as much to within a standard error.
    """

    place: Place
    parameters: dict[str, Estimate]
    share: float
    words: str
    alternatives: tuple[Place, ...]

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready values, as an entry of ``diagnosis.json``."""
        return {
            **entry(*self.place),
            "parameters": {key: e.to_dict() for key, e in self.parameters.items()},
            "share": self.share,
            "words": self.words,
            "alternatives": [entry(*place) for place in self.alternatives],
        }


def name_change(arm: Arm, given: Sequence[Column], healthy: Normal | None, window: Normal) -> list[Named]:
    """The effects that a window shows and the healthy units before it do not, strongest first; empty if none does.

    Args:
        given: what the columns of the normal equations are.

    What the model leaves on healthy units is expressed in the columns and taken out of the window first: it was there
    before, whatever it is.
    """
    moment, energy = window.moment.copy(), window.energy.copy()
    if healthy is not None and len(healthy.gram):
        old = usual(healthy)
        explained = np.einsum("upq,q->up", window.gram, old)
        energy = energy - 2 * (moment @ old) + explained @ old
        moment = moment - explained
    full = Normal(window.gram, moment, energy)
    chosen: list[Place] = []
    alike: list[tuple[Place, ...]] = []
    gains: list[float] = []
    last = np.zeros(len(moment))
    while True:
        columns, rest = _linearised(given, full, chosen)
        if len(chosen) == _MOST:
            break
        places = groups(columns)
        held = {
            place: _held_out(rest, np.concatenate([*(places[c] for c in chosen), index]))
            for place, index in places.items()
            if place not in chosen and _shows(rest, index)
        }
        gain = {place: float((value - last).sum()) for place, value in held.items()}
        best = max(gain, key=lambda place: gain[place], default=None)
        if best is None:
            break
        error = np.sqrt(len(last)) * float(np.std(held[best] - last, ddof=min(1, len(last) - 1)))
        if gain[best] <= max(2.0 * error, _WORTH * sum(gains)):
            break
        equals = []
        for place in gain:
            if _as_good(held[best], held[place]):
                effect, parameters = _estimates(arm, columns, rest, [*chosen, place], place)
                equals += [place] if effect.plausible(arm, parameters) else []
        if not equals:
            # what explains it best cannot be, and nothing explains it as well: it has no name
            break
        # of those that explain as much, the fewest parameters, and a law of the motion alone before one of the load
        pick = min(equals, key=lambda p: (len(places[p]), columns[places[p][0]].effect.needs_model, -gain[p]))
        chosen.append(pick)
        alike.append(tuple(sorted((p for p in equals if p != pick), key=lambda p: -gain[p])))
        gains.append(gain[pick])
        last = held[pick]
    whole = sum(gains)
    found = []
    for place, gained, others in zip(chosen, gains, alike, strict=True):
        effect, parameters = _estimates(arm, columns, rest, chosen, place)
        share = gained / whole if whole > 0 else 0.0
        found.append(Named(place, parameters, share, effect.sentence(parameters), others))
    return found


def usual(healthy: Normal) -> Array:
    """(p,) what the model leaves on healthy units, in the columns: ridge regression, its strength by cross-validation.

    Each unit in turn is left out; where no strength explains anything of those, there is nothing usual. Of a single unit the
    weakest ridge is taken.
    """
    G, b = healthy.gram.sum(axis=0), healthy.moment.sum(axis=0)
    if len(healthy.gram) == 1:
        return ridge(G, b, _HEALTHY_RIDGES[0])

    def explained(part: float) -> float:
        total = 0.0
        for own, moment in zip(healthy.gram, healthy.moment, strict=True):
            beta = ridge(G - own, b - moment, part)
            total += float(2 * beta @ moment - beta @ own @ beta)
        return total

    best, part = max((explained(part), part) for part in _HEALTHY_RIDGES)
    return ridge(G, b, part) if best > 0 else np.zeros(len(b))


def _linearised(
    columns: Sequence[Column], full: Normal, chosen: Sequence[Place]
) -> tuple[list[Column], Normal]:
    """The problem with every law that stays nonlinear (a body's) linearised where the window itself puts it.

    One that was chosen is put there together with the others that were, one that was not in addition to them. A body's
    coefficients grow in proportion with it, so that the linear least squares then have their optimum at the same place
    (Euler's theorem on homogeneous functions), and leaving units out is a jackknife to first order.
    """
    kept: list[Column] = []
    parts: list[Array] = []
    p = len(columns)
    for place, index in groups(columns).items():
        e = columns[index[0]].effect
        if not stays_nonlinear(e, len(index)):
            J = np.eye(len(index))
        else:
            others = [*chosen] if place in chosen else [*chosen, place]
            J = _derivative(columns, full, others, place)
        T = np.zeros((p, J.shape[1]))
        T[index] = J
        parts.append(T)
        kept += [Column(*place, k, columns[index[0]].shape) for k in range(J.shape[1])]
    T = np.hstack(parts)
    return kept, Normal(T.T @ full.gram @ T, full.moment @ T, full.energy)


def _derivative(columns: Sequence[Column], full: Normal, chosen: Sequence[Place], place: Place) -> Array:
    """(p, k) derivative of one effect's coefficients, at the least squares of all that are chosen."""
    places = groups(columns)
    e = columns[places[place][0]].effect
    sizes = [len(places[c]) for c in chosen]
    index = np.concatenate([places[c] for c in chosen])
    G, b = full.gram.sum(axis=0), full.moment.sum(axis=0)
    problem = Moments(G[np.ix_(index, index)], b[index], float(full.energy.sum()), float(len(b)))
    # the columns of the others are those of their free parameters
    _, x, _ = solve(problem, [e if c == place else Linear() for c in chosen], sizes)
    return e.embed(x[list(chosen).index(place)])[1]


def _shows(rest: Normal, index: Index) -> bool:
    """Whether columns are more than rounding errors (what an encoder of a vertical axis would do to the weight)."""
    size = np.einsum("upp->p", rest.gram)
    return bool((size[index] > _NOTHING * size.max(initial=0.0)).any())


def _left_out(rest: Normal, index: Index) -> tuple[Normal, Array]:
    """The problem of some columns, and (U, k) its coefficients with each unit left out (with it where it is alone)."""
    G, b = rest.gram[:, index[:, None], index[None, :]], rest.moment[:, index]
    G_all, b_all = G.sum(axis=0), b.sum(axis=0)
    beta = [ridge(G_all - G[u], b_all - b[u]) for u in range(len(b))] if len(b) > 1 else [ridge(G_all, b_all)]
    return Normal(G, b, rest.energy), np.array(beta)


def _held_out(rest: Normal, index: Index) -> Array:
    """(U,) energy that columns explain on each unit, fitted on all others (on itself if it is alone)."""
    own, beta = _left_out(rest, index)
    return np.einsum("up,up->u", beta, 2 * own.moment - np.einsum("upq,uq->up", own.gram, beta))


def _as_good(best: Array, other: Array) -> bool:
    """Whether another explanation is not worse by more than a standard error over the units, or a fiftieth."""
    less = best - other
    error = np.sqrt(len(less)) * float(np.std(less, ddof=1)) if len(less) > 1 else 0.0
    whole = float(best.sum())
    return float(less.sum()) <= max(min(error, 0.1 * abs(whole)), _WORTH * whole)


def _estimates(
    arm: Arm, columns: Sequence[Column], rest: Normal, chosen: Sequence[Place], place: Place
) -> tuple[Effect, dict[str, Estimate]]:
    """One effect among the chosen, and its parameters with standard errors by the jackknife."""
    places = groups(columns)
    index = np.concatenate([places[c] for c in chosen])
    first = sum(len(places[c]) for c in chosen[: list(chosen).index(place)])
    own = slice(first, first + len(places[place]))
    problem, left = _left_out(rest, index)
    beta = ridge(problem.gram.sum(axis=0), problem.moment.sum(axis=0))[own]
    spread = (left - left.mean(axis=0))[:, own]
    covariance = (len(left) - 1) / len(left) * (spread.T @ spread)
    # of a coordinate that shows nowhere nothing is known (a load's along the only axis that turns)
    size = np.diag(problem.gram.sum(axis=0))[own]
    unseen = np.flatnonzero(size <= _NOTHING * size.max())
    covariance[unseen, unseen] = np.inf
    column = columns[places[place][0]]
    return column.effect, column.effect.estimates(arm, beta, covariance, column.shape)


def later_part(since: int, last: int) -> range:
    """The units of a window that surely lie after its change: the last two thirds.

    When the change began is an estimate, and a healthy unit among few would spoil the parameters.
    """
    return range(since + (last - since + 1) // 3, last + 1)
