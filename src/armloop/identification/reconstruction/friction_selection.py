"""Nested model selection of friction: each larger law must earn its place on held-out data; then backward elimination.

The extensions go from what every drive has to what only some show: Coulomb and viscous friction, an offset (beside the
Coulomb level it makes levels that differ with the direction), the Stribeck fall at each joint's own velocity
(:mod:`.stribeck_speed`), a Coulomb level that fades in with the speed, falls at several velocities, nonlinear viscous
friction, viscous friction that differs with the direction, Coulomb friction that grows with the load, and friction with
memory before the joint slides, with and without load. An extension brings a row of elements (widths, speeds, powers), of
which a passive regression keeps few. It is taken for all joints if the error on held-out folds falls by more than its own
scatter over the folds; else for the joints alone for which it falls by more than twice that. In either case held-out data
must be likelier by a factor that chance reaches in one of twenty selections at most (the likelihood ratio of data that
fitted neither exceeds 1/a with a chance of a at most: Wasserman, Ramdas and Balakrishnan, *Universal inference*, PNAS
2020). The Stribeck fall is asked for a second time beside all that was chosen, at the velocities that explain most there:
beside Coulomb and viscous friction alone one stands for whatever else there is, too. What comes of that must be plain. At
the end, each joint hands back the extensions it does not miss, and of the others the elements.

Friction that depends on the position or drifts with time is no extension: within a run it fits, on another run it fails.

A user may restrict the selection to some laws, by the names in :data:`armloop.laws.friction.FRICTION_LAWS`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from armloop.data.motion import Motion
from armloop.identification.reconstruction.design import Design
from armloop.identification.reconstruction.options import Options
from armloop.identification.reconstruction.pooled import Choice, Pooled, Prior, Solution
from armloop.identification.reconstruction.stribeck_speed import stribeck_speeds
from armloop.identification.reconstruction.training import Training
from armloop.laws.friction import FRICTION_LAWS, FrictionTerm, without_spanned
from armloop.robot.arm import Arm
from armloop.util.arrays import TINY, Array
from armloop.util.errors import InputError
from armloop.util.progress import Progress, paced, silent

#: Part of the squared error that an extension must remove, and how often its scatter that must be: for all, for one joint.
_WORTH, _SURE, _SURER = 0.005, 1.0, 2.0
#: Chance that a selection has an extension which nothing calls for.
_LEVEL = 0.05
#: Part of the squared error that Stribeck falls must remove that are asked for a second time.
_PLAIN = 0.05
#: Part of a joint's squared error that an extension must be worth for the joint to keep it.
_KEEP = 0.002
#: Speeds over which the direction fades in, rad/s; presliding widths, rad; a prismatic joint's are a tenth, in m.
_FADES = (0.003, 0.01, 0.03, 0.1)
_WIDTHS = (3e-4, 1e-3, 3e-3, 1e-2, 3e-2)
#: The slowest motion is this quantile of the speeds; it is so much faster than the fade that reaches down to it.
_CREEP, _SHARPER = 0.005, 4.0
#: The element of a Stribeck fall.
_FALL = "stribeck_peak"
#: Stribeck speeds tried, from the slowest to the given part of the fastest speed.
_STRIBECK, _SLOWEST, _PART = 5, 0.02, 0.3


@dataclass(frozen=True)
class Extension:
    """What the larger of two nested friction laws adds: its name, and the elements it brings for each joint."""

    name: str
    elements: list[list[FrictionTerm]]


@dataclass
class Comparison:
    """What the comparison of two nested laws came to.

    Attributes:
        rung: the name of the extension, or of the elimination, as model files have it.
        before, after: held-out nRMSE, mean over the joints.
        refused: held-out nRMSE that it would have led to, where it was not taken.
        joints: those that took it (0-based), or, of the last entry, that dropped extensions.
    """

    rung: str
    before: float
    after: float
    refused: float | None
    joints: list[int]

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready values; joints count from 1."""
        return {**vars(self), "joints": [joint + 1 for joint in self.joints]}


@dataclass(frozen=True, eq=False)
class FrictionSelection:
    """The laws chosen, the prior of the shared coefficients, what each extension brought, all candidates, and the sums."""

    laws: list[list[FrictionTerm]]
    prior: Prior | None
    comparisons: list[Comparison]
    notes: list[str]
    candidates: list[list[FrictionTerm]]
    pooled: Pooled

    def solved(self, held_out: bool = False) -> Solution:
        """Coefficients of the shared columns and of the laws chosen."""
        return self.pooled.solve(self.pooled.choice(self.laws), self.prior, held_out)

    def errors(self, theta: Array) -> Array:
        """(n,) nRMSE of such coefficients on the blocks that judge the model; NaN where a joint does not slide there."""
        return self.pooled.relative_errors(theta, self.pooled.choice(self.laws))


def stribeck_ranges(arm: Arm, motion: Motion) -> list[tuple[float, float]]:
    """The slowest and the fastest Stribeck velocity that each joint may have: it follows the joint's fastest speed."""
    lows = np.where(arm.revolute, 1.0, 0.1) * _SLOWEST
    fastest = np.quantile(np.abs(motion.v), 0.995, axis=0)
    return [(float(low), float(max(_PART * v, 2 * low))) for low, v in zip(lows, fastest, strict=True)]


def extensions(
    arm: Arm, motion: Motion, slowest: Array | None = None, speeds: Sequence[float] = ()
) -> list[Extension]:
    """The nested friction laws of an arm; the Stribeck speeds follow each joint's fastest speed.

    Where a joint creeps, slower than the speed over which the direction fades in fastest, one more speed, for every
    joint, keeps the Coulomb level there.

    Args:
        slowest: (n,) speeds of the slowest motion that is regressed; None for none so slow.
        speeds: (n,) the Stribeck velocity of every joint, which then comes before the row of them, of which it takes
            the place of the nearest; none if empty.
    """
    units = np.where(arm.revolute, 1.0, 0.1)
    stribeck = [np.geomspace(*limits, _STRIBECK) for limits in stribeck_ranges(arm, motion)]
    sharp = units * _FADES[0]
    creep = sharp if slowest is None else np.minimum(sharp, slowest)
    fades = [
        ([c / _SHARPER] if (creep < sharp).any() else []) + [unit * size for size in _FADES]
        for unit, c in zip(units, creep, strict=True)
    ]

    widths = [[unit * size for size in _WIDTHS] for unit in units]

    def same(law: str) -> list[list[FrictionTerm]]:
        return [[FrictionTerm(kind) for kind in FRICTION_LAWS[law]] for _ in units]

    def each(kind: str, sizes: Sequence[Iterable[float]]) -> list[list[FrictionTerm]]:
        return [[FrictionTerm(kind, parameter=float(f"{v:.2g}")) for v in own] for own in sizes]

    levels = each("smooth_sign", fades)
    falls = [Extension("Stribeck", each("stribeck_peak", stribeck))]
    if speeds:
        others = [
            np.delete(row, int(np.argmin(np.abs(np.log(row / own)))))
            for row, own in zip(stribeck, speeds, strict=True)
        ]
        falls = [
            Extension("Stribeck", [[FrictionTerm("stribeck_peak", parameter=own)] for own in speeds]),
            Extension("Stribeck at several velocities", each("stribeck_peak", others)),
        ]
    return [
        Extension("Coulomb and viscous", [[first, FrictionTerm("viscous")] for first, *_ in levels]),
        Extension("offset (levels by direction)", same("offset")),
        falls[0],
        Extension("Coulomb fading in", [rest for _, *rest in levels]),
        *falls[1:],
        Extension("nonlinear viscous", same("nonlinear_viscous")),
        Extension("viscous by direction", same("viscous_by_direction")),
        Extension("Coulomb by load", each("load_smooth_sign", fades)),
        Extension("presliding", each("hysteresis", widths)),
        Extension("presliding by load", each("load_hysteresis", widths)),
    ]


def check_laws(names: Sequence[str] | None) -> None:
    """Raise ``InputError`` unless every name is one of :data:`FRICTION_LAWS`, and there is one; None for all."""
    if names is None:
        return
    for name in names:
        if name not in FRICTION_LAWS:
            raise InputError(f"unknown friction law {name!r}; there are: {', '.join(FRICTION_LAWS)}")
    if not names:
        raise InputError(f"no friction law is named; there are: {', '.join(FRICTION_LAWS)}")


def restricted(nested: list[Extension], names: Sequence[str] | None) -> list[Extension]:
    """The extensions with the elements of some laws alone; all of them for None. Extensions left empty are dropped."""
    if names is None:
        return nested
    kinds = {kind: name for name in names for kind in FRICTION_LAWS[name]}
    kept = []
    for extension in nested:
        fades = extension is not nested[0] and "coulomb_fading" not in names
        elements = [
            [term for term in own if term.kind in kinds and not (fades and term.kind == "smooth_sign")]
            for own in extension.elements
        ]
        whole = elements == extension.elements
        called = list(dict.fromkeys(kinds[term.kind] for own in elements for term in own))
        if called:
            kept.append(extension if whole else Extension(" and ".join(called), elements))
    return kept


def select_friction(
    arm: Arm,
    data: Training,
    design: Design,
    options: Options,
    priors: dict[str, Prior],
    progress: Progress = silent,
) -> FrictionSelection:
    """Choose the prior of the shared coefficients by its evidence, then every joint's friction on held-out folds.

    Args:
        data: what is fitted, and what judges.
        design: shared columns, and the load that friction may depend on.
        options: the friction laws that may be chosen; the first of them is taken anyway.
        priors: what the shared coefficients may be drawn to, by name; none if empty.
    """
    motion, slowest, tell = data.reference.motion, data.slowest(_CREEP), paced(progress)

    def begun(beside: Sequence[list[FrictionTerm]]) -> _State:
        """No extension taken yet; the Stribeck velocities, if there are any, are sought beside some friction."""
        speeds: list[float] = []
        if beside:
            progress("friction: each joint's Stribeck velocity")
            speeds = stribeck_speeds(data, design, list(beside), stribeck_ranges(arm, motion))
        nested = restricted(extensions(arm, motion, slowest, speeds), options.friction)
        candidates = [[term for extension in nested for term in extension.elements[j]] for j in range(arm.n)]
        return _State(data.pooled(design, candidates, options.physical), nested, candidates, priors)

    simplest = restricted(extensions(arm, motion, slowest), options.friction)
    falls = any(term.kind == _FALL for extension in simplest for term in extension.elements[0])
    state = begun(simplest[0].elements if falls else ())
    state.take_in_turn(range(len(state.nested)), data.plenty, tell)
    if data.plenty:
        if state.has_more_than_falls():
            again = begun(state.without_falls())
            again.take_falls_again(state, tell)
            state = again if again.error() ** 2 < (1 - _PLAIN) * state.error() ** 2 else state
        state.eliminate_backward()
        state.drop_elements()
    notes = [] if state.prior_name is None else [f"where the motion tells nothing: {state.prior_name}"]
    if options.friction is not None:
        notes.append(f"friction: nothing but {', '.join(options.friction)} was allowed")
    notes += _notes(state.comparisons)
    return FrictionSelection(
        state.laws(state.taken), state.prior, state.comparisons, notes, state.candidates, state.pooled
    )


class _State:
    """Where the selection stands: the extensions each joint has taken, and the squared errors on the held-out folds.

    Attributes:
        nested: the extensions, the simplest first.
        candidates: the elements of all of them, for each joint.
        comparisons: what was asked so far.
    """

    def __init__(
        self,
        pooled: Pooled,
        nested: Sequence[Extension],
        candidates: list[list[FrictionTerm]],
        priors: dict[str, Prior],
    ) -> None:
        self.pooled, self.nested, self.candidates = pooled, nested, candidates
        self.comparisons: list[Comparison] = []
        ends = np.cumsum([0] + [len(extension.elements[0]) for extension in nested])
        self._places = [list(range(a, z)) for a, z in pairwise(ends.tolist())]
        self._falls = [
            k
            for k, extension in enumerate(nested)
            if {term.kind for term in extension.elements[0]} == {_FALL}
        ]
        self._counts = pooled.counts
        self._squares = np.maximum(pooled.squares.sum(axis=0), TINY)
        self.taken: list[list[int]] = [[] for _ in pooled.candidates]
        self._dropped: list[set[int]] = [set() for _ in pooled.candidates]
        self.prior: Prior | None = None
        self.prior_name: str | None = None
        self._priors = priors
        self._weights, self._errors = self._judged()

    def choice(self, taken: list[list[int]]) -> Choice:
        """Places of the elements of some extensions per joint, without those that were dropped or others span."""
        chosen = [
            [place for level in own for place in self._places[level] if place not in dropped]
            for own, dropped in zip(taken, self._dropped, strict=True)
        ]
        return [
            [places[k] for k in without_spanned([own[place] for place in places])]
            for own, places in zip(self.candidates, chosen, strict=True)
        ]

    def laws(self, taken: list[list[int]]) -> list[list[FrictionTerm]]:
        """The law of each joint that has taken some extensions."""
        return [
            [own[k] for k in places] for own, places in zip(self.candidates, self.choice(taken), strict=True)
        ]

    def error(self) -> float:
        """Held-out nRMSE, mean over the joints."""
        return self._error(self._errors)

    def take_in_turn(self, levels: Iterable[int], one_by_one: bool, tell: Progress, again: str = "") -> None:
        """Take those of some extensions that earn their place, the simplest first."""
        for level in levels:
            tell(f"friction: extension {level + 1} of {len(self.nested)}")
            self.take(level, f"{self.nested[level].name}{again}", one_by_one)

    def has_more_than_falls(self) -> bool:
        """Whether there are Stribeck falls to be asked for beside an extension that came after them."""
        first = min(self._falls, default=len(self.nested))
        return any(k > first and k not in self._falls for own in self.taken for k in own)

    def without_falls(self) -> list[list[FrictionTerm]]:
        """The law of each joint but for its Stribeck falls."""
        return self.laws([[k for k in own if k not in self._falls] for own in self.taken])

    def take_falls_again(self, before: _State, tell: Progress) -> None:
        """Begin with what another selection has taken but for its Stribeck falls, and ask for these."""
        self.taken = [[k for k in own if k not in self._falls] for own in before.taken]
        self.prior, self.prior_name = before.prior, before.prior_name
        self.comparisons = [*before.comparisons]
        self._weights, self._errors = self._judged()
        self.take_in_turn(self._falls, True, tell, ", once more")

    def take(self, level: int, name: str, one_by_one: bool) -> Comparison:
        """Take an extension for all joints or for some if it earns its place; the first, what every drive has, anyway."""
        before = self.error()
        everyone = [sorted([*own, level]) for own in self.taken]
        errors = self._held_out(everyone)
        gain, sure = self._gain(errors, _SURE)
        if level == 0:
            self.taken = everyone
            self._choose_prior()
        elif sure and gain > _WORTH:
            self.taken = everyone
        elif one_by_one:
            self.taken = [
                everyone[j] if self._earns_alone(j, level) else own for j, own in enumerate(self.taken)
            ]
        joints = [j for j, own in enumerate(self.taken) if level in own]
        if joints:
            self._weights, self._errors = self._judged()
        after = self.error()
        refused = None if joints else self._error(errors)
        self.comparisons.append(Comparison(name, before, after, refused, joints))
        return self.comparisons[-1]

    def eliminate_backward(self) -> None:
        """Backward elimination: every joint drops the extensions it does not miss, the last first."""
        before, joints = self.error(), set()
        for level in reversed(range(len(self._places))):
            for j, own in enumerate(self.taken):
                if level in own:
                    shorter = [*self.taken[:j], [k for k in own if k != level], *self.taken[j + 1 :]]
                    errors = self._held_out(shorter)
                    if -self._gain(errors, _SURE, [j])[0] < _KEEP:
                        self.taken, self._errors = shorter, errors
                        joints.add(j)
        self.comparisons.append(
            Comparison("backward elimination", before, self.error(), None, sorted(joints))
        )

    def drop_elements(self) -> None:
        """Backward elimination of elements (widths, speeds, powers) that a joint does not miss together, the last first.

        The simpler and the sharper stay.
        """
        before, joints = self.error(), []
        for j, dropped in enumerate(self._dropped):
            for place in reversed(self.choice(self.taken)[j]):
                dropped.add(place)
                if -self._gain(self._held_out(self.taken), _SURE, [j])[0] >= _KEEP:
                    dropped.remove(place)
            joints += [j] if dropped else []
        self._weights, self._errors = self._judged()
        self.comparisons.append(Comparison("elements dropped", before, self.error(), None, joints))

    def _earns_alone(self, joint: int, level: int) -> bool:
        more = [sorted([*own, level]) if j == joint else own for j, own in enumerate(self.taken)]
        gain, sure = self._gain(self._held_out(more), _SURER, [joint])
        return sure and gain > _WORTH

    def _choose_prior(self) -> None:
        if self._priors:
            choice = self.choice(self.taken)
            weights = self.pooled.solve(choice).weights
            evidence = {name: self.pooled.evidence(choice, weights, p) for name, p in self._priors.items()}
            self.prior_name = max(evidence, key=evidence.__getitem__)
            self.prior = self._priors[self.prior_name]

    def _judged(self) -> tuple[Array, Array]:
        """Weights of the joints, and (folds, n) squared errors on the held-out folds."""
        choice = self.choice(self.taken)
        weights = self.pooled.solve(choice, self.prior).weights
        return weights, self.pooled.held_out(choice, weights, self.prior)

    def _held_out(self, taken: list[list[int]]) -> Array:
        return self.pooled.held_out(self.choice(taken), self._weights, self.prior)

    def _error(self, errors: Array) -> float:
        """Held-out nRMSE, mean over the joints."""
        return float(np.mean(np.sqrt(errors.sum(axis=0) / self._squares)))

    def _gain(self, errors: Array, times: float, joints: list[int] | None = None) -> tuple[float, bool]:
        """Mean log ratio of the squared errors before and after; whether it exceeds its scatter over the folds and chance.

        In ratios, so that no joint and no fold that happens to be hard outweighs the others. ``joints`` are those
        whose errors the gain is a part of.
        """
        ratios = np.log(np.maximum(self._errors, TINY) / np.maximum(errors, TINY))
        whole = max((self._counts if joints is None else self._counts[:, joints]).sum(), 1.0)
        gains = (self._counts * ratios).sum(axis=1) / whole
        scatter = float(gains.std(ddof=1)) * np.sqrt(len(gains)) if len(gains) > 1 else np.inf
        likelihood = 0.5 * whole / self.pooled.repeats * gains.sum()
        questions = len(self._places) * (1 if joints is None else len(self.taken))
        sure = gains.sum() > times * scatter and likelihood > np.log(questions / _LEVEL)
        return float(gains.sum()), bool(sure)


def _notes(comparisons: list[Comparison]) -> list[str]:
    """What each extension brought, in a line each."""
    notes = []
    for one in comparisons:
        who = "joints " + ", ".join(str(joint + 1) for joint in one.joints) if one.joints else "no joint"
        change = f"{one.before:.4g} → {one.after:.4g}"
        if one.refused is not None:
            change = f"{one.before:.4g}, with it {one.refused:.4g}"
        notes.append(f"friction, {one.rung}: {who}; held-out nRMSE {change}")
    return notes
