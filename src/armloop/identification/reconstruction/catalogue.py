"""Forward selection among the catalogue's laws: which of them an arm had all along, found in its training data.

A law that the model lacks is half hidden, for the base parameters that were fitted without it have soaked up part of
it: what is left looks like no law at all. So a law is judged on columns from which the model's own have been projected
out (Frisch and Waugh 1933; Lovell 1963), which is the score test of the nested model and the same as fitting both
together, on blocks left out. One is taken if it lowers the error there by more than chance would, among so many that
were tried; the simplest first. Then friction is chosen anew beside it, and every law asked again whether the others
leave it anything.

Which order a ripple has is read off the spectrum of what the model leaves, over the joint's angle: there are more orders
than can be tried one by one. What the base parameters soaked up may have moved the peak, so the orders next to it are
tried too. A joint may ripple with several orders.

Laws that the model can say already are not asked for: a rotor's inertia is a base parameter, Coulomb friction an
extension of the friction selection. Nor are those that depend on the time: within a run they fit, on another run they fail.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.stats import t as student

from armloop.data.motion import Motion, Samples
from armloop.data.signals import smooth
from armloop.identification.reconstruction import differential
from armloop.identification.reconstruction.companions import accompanied, companions, is_there
from armloop.identification.reconstruction.lines import between, lines
from armloop.identification.reconstruction.projected import CHANCE, Projected, Trial
from armloop.laws.effects import Context, Effect, Estimate, hypotheses
from armloop.model import AddedEffect
from armloop.robot.arm import Arm
from armloop.util.arrays import Array, Mask
from armloop.util.progress import Progress

#: Part of the squared error of the joint it shows on most that a law must remove.
WORTH = 0.05
#: A simpler law that removes so much of what the best one removes is as good.
_AS_GOOD = 0.9
#: Part of a law's column beside all that the model can say, below which it says nothing new.
_NEW = 2e-3
#: What comes and goes: the arm as it was trained carries what it carries.
_OF_A_RUN = ("payload",)
_MOST = 6
#: A shape is refined to first order so many times at most.
_REFINEMENTS = 4
#: A shape that changes by less than this part stays as it is.
_STILL = 1e-3
#: More shapes than these are not tried one by one.
_FEW = 8


@dataclass(frozen=True, eq=False)
class Law:
    """A law of the catalogue that is fitted beside the base parameters.

    Attributes:
        shape: its nonlinear parameter.
        size: number of its coefficients.
        constant: joints (0-based) at which one of its columns is constant.
        gain: part of the squared error that it removes on left-out blocks, of the joint it shows on most.
        among: number of shapes that it could have had, where these are many.
        kept: which of its coefficients it has, where not all of them: the others are zero.
    """

    effect: Effect
    shape: float
    size: int
    constant: tuple[int, ...] = ()
    gain: float = 0.0
    among: int = 1
    kept: tuple[bool, ...] = ()

    @staticmethod
    def found(
        effect: Effect, shape: float, columns: Array, gain: float, among: int = 1, kept: Mask | None = None
    ) -> Law:
        """A law whose unfiltered columns on some motion are (N, n, p)."""
        if kept is not None and not kept.all():
            law = Law.found(effect, shape, columns[:, :, kept], gain, among)
            return replace(law, kept=tuple(kept.tolist()))
        flat = (np.ptp(columns, axis=0) == 0) & columns.any(axis=0)
        constant = tuple(np.flatnonzero(flat.any(axis=1)).tolist())
        return Law(effect, shape, columns.shape[2], constant, gain, among)

    def columns(self, context: Context) -> Array:
        """(N, n, size) torque per unit of each coefficient, unfiltered."""
        columns = self.effect.fixed_columns(context, self.shape)
        return columns[:, :, list(self.kept)] if self.kept else columns

    def estimates(self, arm: Arm, x: Array, covariance: Array) -> dict[str, Estimate]:
        """Named parameters from its coefficients (size,) and their covariance."""
        if self.kept:
            kept = np.array(self.kept)
            every, among = np.zeros(len(kept)), np.zeros((len(kept),) * 2)
            every[kept], among[np.ix_(kept, kept)] = x, covariance
            x, covariance = every, among
        return self.effect.estimates(arm, x, covariance, self.shape)


@dataclass(frozen=True, eq=False)
class Laws:
    """The laws chosen, and what was tried.

    Attributes:
        tried: number of laws that could have been chosen.
    """

    chosen: list[Law] = field(default_factory=list)
    tried: int = 0

    @property
    def count(self) -> int:
        """Number of coefficients of all of them."""
        return sum(law.size for law in self.chosen)

    @property
    def loading(self) -> Array:
        """(p,) one for coefficients of laws that load the joints, else zero."""
        return np.repeat([float(law.effect.load) for law in self.chosen], [law.size for law in self.chosen])

    @property
    def passive(self) -> Mask:
        """(p,) whether each coefficient is negative for no arm, as its law says."""
        return np.repeat(
            [law.effect.passive for law in self.chosen], [law.size for law in self.chosen]
        ).astype(bool)

    def raw(self, arm: Arm, motion: Motion, period: float) -> Array:
        """(N, n, p) torque per unit of each coefficient, unfiltered."""
        context = Context(arm, motion, period=period)
        parts = [law.columns(context) for law in self.chosen]
        return np.concatenate([np.zeros((motion.samples, arm.n, 0)), *parts], axis=2)

    def columns(self, arm: Arm, samples: Samples) -> Array:
        """(N, n, p) columns of all laws through the samples' filter."""
        return smooth(samples, self.raw(arm, samples.motion, samples.period))

    def constant_at(self) -> set[int]:
        """Joints (0-based) at which one of the columns is constant."""
        return {joint for law in self.chosen for joint in law.constant}

    def mass(self, arm: Arm, q: Array) -> Array:
        """(P, n, n, p) what each coefficient adds to M(q) at postures q (P, n)."""
        n, pushed = arm.n, Motion.accelerated(q)
        parts = [np.zeros((len(q), n, n, 0))]
        for law in self.chosen:
            if law.effect.needs_model or law.effect.memory:
                parts.append(np.zeros((len(q), n, n, law.size)))
                continue
            both = [law.columns(Context(arm, motion)) for motion in (pushed, replace(pushed, vdot=pushed.v))]
            added = (both[0] - both[1]).reshape(len(q), n, n, law.size)
            parts.append(added.transpose(0, 2, 1, 3))
        return np.concatenate(parts, axis=3)

    def inertial(self, arm: Arm, q: Array) -> list[bool]:
        """Whether each coefficient adds inertia, which is negative for no arm, to M(q) at postures q (P, n)."""
        return [bool(own.any()) for own in np.moveaxis(self.mass(arm, q), 3, 0)]

    def split(self, theta: Array) -> list[Array]:
        """Each law's coefficients."""
        return list(np.split(theta, np.cumsum([law.size for law in self.chosen])[:-1])) if self.chosen else []

    def added(self, arm: Arm, theta: Array, covariance: Array) -> list[AddedEffect]:
        """The laws as effects of a model: named parameters with their standard errors."""
        found, start = [], 0
        for law, x in zip(self.chosen, self.split(theta), strict=True):
            own = slice(start, start + law.size)
            start += law.size
            parameters = law.estimates(arm, x, covariance[own, own])
            found.append(AddedEffect(law.effect, parameters, "always"))
        return found

    def possible(self, arm: Arm, theta: Array, covariance: Array) -> Laws:
        """Those that an arm can have with such coefficients; none without what it stands beside."""
        pairs = zip(self.chosen, self.added(arm, theta, covariance), strict=True)
        own = [law for law, a in pairs if a.effect.possible(arm, a.parameters)]
        return replace(
            self, chosen=[law for law in own if not law.effect.beside or accompanied(law.effect, own)]
        )

    def notes(self, effects: Sequence[AddedEffect]) -> list[str]:
        """What was found, a line each, with the parameters of the model's effects."""
        return [
            f"always there: {added.effect.sentence(added.parameters)}"
            + (
                ""
                if law.effect.beside
                else f"; fitted together with the rest, it removes {law.gain:.0%} of the squared error of the joint it "
                "shows on most, on left-out blocks"
            )
            for law, added in zip(self.chosen, effects, strict=True)
        ]


def permanent(arm: Arm) -> list[Effect]:
    """Laws that an arm may have had all along and that fit beside others as linear columns.

    A joint's friction is none of them: it has the friction selection, which has had its say.
    """
    listed = [e for e in hypotheses(arm, built_in=True) if not (e.rubs or e.memory or e.name in _OF_A_RUN)]
    return [effect for effect in listed if not effect.beside]


#: An effect, its shapes with which of the coefficients of each it has, its trial, and how many shapes were asked.
_Tried = tuple[Effect, dict[float, Mask | None], Trial, int]


def search(
    arm: Arm,
    samples: Samples,
    bench: Callable[[Sequence[Law]], Projected],
    progress: Progress,
) -> Laws:
    """Forward search over the catalogue, fitted together with the model's own columns.

    Args:
        bench: the regression with the model's own columns and some laws', from which further ones are judged.
    """
    # its coefficients are its free parameters: so it is one of the columns of a regression
    listed = [effect for effect in permanent(arm) if not effect.needs_model]
    chosen: list[Law] = []
    context = Context(arm, samples.motion, period=samples.period)
    shapes = [list(effect.shapes(context)) for effect in listed]
    shapes = [
        all_of if effect.periodic or len(all_of) <= _FEW else []
        for effect, all_of in zip(listed, shapes, strict=True)
    ]
    tried = len(listed)
    while len(chosen) < _MOST:
        own = bench(chosen)
        taken = {law.effect.place for law in chosen}
        trials: list[_Tried] = []
        for effect, all_of in zip(listed, shapes, strict=True):
            if effect.place in taken and not effect.periodic:
                continue
            among = len(all_of) if effect.periodic else 1
            few = _peaks(own, effect, all_of, context) if effect.periodic else all_of
            found = _best_shape(own, effect, few, context, samples)
            if found is not None and is_worth(found[1], tried * among):
                found = _geared(own, effect, *found, context, samples)
                if _plausible(arm, effect, *found):
                    trials.append((effect, {found[0]: None}, found[1], among))
            two = _two_motors(own, effect, all_of, context, samples)
            if two is not None and is_worth(two[1], tried):
                trials.append((effect, *two, among))
        if not trials:
            break
        effect, parts, trial, among = _simplest(trials)
        progress(
            f"{effect.label()}: fitted together with the rest it removes {trial.share:.0%} on left-out blocks"
        )
        chosen += [
            Law.found(effect, shape, effect.fixed_columns(context, shape), trial.share, among, kept)
            for shape, kept in parts.items()
        ]
    for effect in companions(chosen):
        for shape in effect.shapes(context):
            law = Law.found(effect, shape, effect.fixed_columns(context, shape), 0.0)
            if is_there(bench(chosen).trial(Laws([law]).columns(arm, samples), _NEW)):
                progress(f"{effect.label()}: is there beside what was found")
                chosen.append(law)
    return Laws(chosen, tried)


def _simplest(trials: Sequence[_Tried]) -> _Tried:
    """The one of the fewest coefficients of those that remove about as much as the best does."""
    most = max(trial.removed for _, _, trial, _ in trials)
    as_good = [one for one in trials if one[2].removed >= _AS_GOOD * most]
    return min(as_good, key=lambda one: (one[0].complexity * len(one[1]), -one[2].removed))


def pruned(laws: Laws, bench: Callable[[Sequence[Law]], Projected], arm: Arm, samples: Samples) -> Laws:
    """The laws without those to which the others, and the friction chosen beside them, leave nothing."""
    for k in reversed(range(len(laws.chosen))):
        others = laws.chosen[:k] + laws.chosen[k + 1 :]
        own, law = bench(others), laws.chosen[k]
        trial = own.trial(Laws([law]).columns(arm, samples))
        if law.effect.beside:
            stays = accompanied(law.effect, others) and is_there(trial)
        else:
            stays = trial is not None and is_worth(trial, laws.tried * law.among)
        if not stays:
            return pruned(replace(laws, chosen=others), bench, arm, samples)
    return laws


def reshaped(laws: Laws, bench: Callable[[Sequence[Law]], Projected], arm: Arm, samples: Samples) -> Laws:
    """The laws with shapes found anew to first order (Gauss-Newton) beside the others and the friction chosen beside them.

    Of a law that is far from its shape the other parameters are not what they are there.
    """
    chosen, context = list(laws.chosen), Context(arm, samples.motion, period=samples.period)
    for k, law in enumerate(laws.chosen):
        shapes = list(law.effect.shapes(context))
        if law.kept or law.effect.periodic:
            continue
        own = bench(chosen[:k] + chosen[k + 1 :])
        for _ in range(_REFINEMENTS):
            trial = own.trial(Laws([law]).columns(arm, samples))
            finer = law.shape if trial is None else _finer(law.effect, trial, law.shape, shapes)
            if np.isclose(finer, law.shape, rtol=_STILL):
                break
            law = replace(law, shape=finer)
        chosen[k] = law
    return replace(laws, chosen=chosen)


def is_worth(trial: Trial, tried: int) -> bool:
    """Whether a law removes enough, and more than chance would for the best of so many, by blocks and in every fold."""
    # of a single block it is no number, which nothing exceeds
    enough = float(student.isf(CHANCE / tried, trial.blocks - 1))
    return trial.share > WORTH and trial.score > enough and trial.everywhere


def _plausible(arm: Arm, effect: Effect, shape: float, found: Trial) -> bool:
    return effect.plausible(arm, effect.estimates(arm, found.coefficients, found.covariance, shape))


def _peaks(own: Projected, effect: Effect, orders: Sequence[float], context: Context) -> list[float]:
    """Orders at which what the regression leaves of an effect's joint has a line over the angle, and those beside them."""
    assert effect.joint is not None
    sample, left, block = own.left(effect.joint - 1)
    q = context.motion.q[sample, effect.joint - 1]
    peaks = list(lines(q, left, orders, WORTH))
    near = {peak + beside for peak in peaks for beside in (-1.0, 0.0, 1.0)} & set(orders)
    # of a motor behind a gear an order need not be whole
    return sorted(near | {between(q, left, peak, len(np.unique(block))) for peak in peaks})


def _best_shape(
    own: Projected, effect: Effect, shapes: Sequence[float], context: Context, samples: Samples
) -> tuple[float, Trial] | None:
    """The shape that removes most on left-out blocks, refined; None where the effect can say nothing new."""
    best: tuple[float, Trial] | None = None

    def better(shape: float) -> bool:
        nonlocal best
        trial = own.trial(_smoothed(samples, effect.fixed_columns(context, shape)), _NEW, WORTH)
        if trial is None or (best is not None and trial.removed <= best[1].removed):
            return False
        best = shape, trial
        return True

    for shape in shapes:
        better(shape)
    for _ in range(_REFINEMENTS if best else 0):
        assert best is not None
        finer = _finer(effect, best[1], best[0], shapes)
        if finer == best[0] or not better(finer):
            break
    return best


def _geared(
    own: Projected, effect: Effect, shape: float, trial: Trial, context: Context, samples: Samples
) -> tuple[float, Trial]:
    """A shape that an arm may have been built with, with its trial, in place of the usual one if it removes clearly more."""
    best, least = (shape, trial), trial.removed / _AS_GOOD
    for _ in range(2):  # coarsely, then finely around the best
        for other in effect.geared(best[0]):
            found = own.trial(_smoothed(samples, effect.fixed_columns(context, other)), _NEW, WORTH)
            if found is not None and found.removed > least and _plausible(context.arm, effect, other, found):
                best, least = (other, found), found.removed
    return best


def _finer(effect: Effect, trial: Trial, shape: float, shapes: Sequence[float]) -> float:
    """A better shape to first order, within those that are tried if these are several."""
    finer = effect.fixed_refined(trial.coefficients, shape)
    return float(np.clip(finer, min(*shapes, shape), max(*shapes, shape))) if len(shapes) > 1 else finer


def _two_motors(
    own: Projected, effect: Effect, shapes: Sequence[float], context: Context, samples: Samples
) -> tuple[dict[float, Mask | None], Trial] | None:
    """A passive law of two shapes that is there with both: the coefficients of either that are needed; None elsewhere."""
    if not effect.passive or len(shapes) != 2:
        return None
    columns = [_smoothed(samples, effect.fixed_columns(context, shape)) for shape in shapes]
    found = differential.both(own, columns, _NEW, WORTH)
    return None if found is None else (dict(zip(shapes, found[0], strict=True)), found[1])


def _smoothed(samples: Samples, columns: Array) -> Array:
    """A law's columns (N, n, p) through the samples' filter, in place; what acts alike on several joints passes it once."""
    acts = [j for j in range(columns.shape[1]) if columns[:, j].any()]
    like = {j: _ratio(columns[:, j], columns[:, acts[0]]) for j in acts[1:]}
    for j in acts:
        ratio = like.get(j)
        columns[:, j] = smooth(samples, columns[:, j]) if ratio is None else ratio * columns[:, acts[0]]
    return columns


def _ratio(x: Array, y: Array) -> float | None:
    """±1 where x is ±y, else None."""
    return next((r for r in (1.0, -1.0) if np.array_equal(x, r * y)), None)
