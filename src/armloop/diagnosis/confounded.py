"""Confounded hypotheses of a diagnosis as laws with parameters: which torque may be mistaken for which."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from armloop.diagnosis.fit import Shape, fit
from armloop.diagnosis.isolability import Part, Stage, left
from armloop.diagnosis.verdict import Diagnosis
from armloop.laws.effects import Effect, hypotheses
from armloop.model import AddedEffect

#: Where several motions are looked at, no more values of a nonlinear parameter are tried than this.
_FEW = 20
#: An effect that leaves less than this part of another's torque on a run looks like it there.
_ALIKE = 0.25


@dataclass(frozen=True, eq=False)
class Law:
    """An effect with its parameters on the run, and the nonlinear one among them as its columns take it."""

    added: AddedEffect
    shape: float

    @property
    def effect(self) -> Effect:
        """The effect itself."""
        return self.added.effect


@dataclass(frozen=True, eq=False)
class Rivalry:
    """A law, an effect that may stand for it, and the effects that are fitted beside either."""

    law: Law
    rival: Law
    others: tuple[Law, ...]

    def both_ways(self) -> tuple[Rivalry, Rivalry]:
        """This, and the law as a rival of its rival: whichever of the two is there, the other must be seen not to be.

        Where one can stand for everything that the other does (a spring of no stiffness for an offset), only the other
        way tells them apart.
        """
        return self, replace(self, law=self.rival, rival=self.law)

    def left(self, stage: Stage) -> float:
        """Part of the law's torque on a motion that the rival, at whatever parameters, cannot stand for."""
        return self._nearest(stage)[0]

    def hardest(self, stage: Stage) -> Rivalry:
        """The same with the rival at the nonlinear parameter with which it comes nearest on a motion."""
        return replace(self, rival=replace(self.rival, shape=self._nearest(stage)[1]))

    def left_on_all(self, stages: Sequence[Stage]) -> float:
        """The same part on several motions together."""
        return left(stages, self.law.added, self._rival(stages[0], _FEW), self._beside())[0]

    def _nearest(self, stage: Stage) -> tuple[float, float]:
        return left([stage], self.law.added, self._rival(stage), self._beside())

    def _rival(self, stage: Stage, most: int | None = None) -> Part:
        """The rival with the nonlinear parameter that it had on the run, and those to try on this motion."""
        shapes = [float(x) for x in self.rival.effect.shapes(stage.context)]
        shapes = shapes if most is None or len(shapes) <= most else []
        return Part(self.rival.effect, (self.rival.shape, *shapes))

    def _beside(self) -> list[Part]:
        return [Part(other.effect, (other.shape,)) for other in self.others]


def found_laws(diagnosis: Diagnosis) -> list[Law]:
    """The effects that were found, but for what was carried in that run alone."""
    outcome = diagnosis.outcome
    pairs = zip(outcome.found, outcome.added(), strict=True)
    return [Law(added, found.shape.final) for found, added in pairs if not added.effect.event]


def pairs(diagnosis: Diagnosis, laws: Sequence[Law], run: Stage) -> list[Rivalry]:
    """Every effect found with each of its alternatives, as each would explain the run."""
    made = []
    for k, found in enumerate(f for f in diagnosis.outcome.found if not f.effect.event):
        others = tuple(law for i, law in enumerate(laws) if i != k)
        for rival, _ in found.rivals:
            law = _as_fitted(diagnosis, run, laws[k], rival, others)
            if law is not None:
                made.append(Rivalry(laws[k], law, others))
    return made


def lookalikes(
    diagnosis: Diagnosis, laws: Sequence[Law], listed: Sequence[Rivalry], run: Stage
) -> list[Rivalry]:
    """Effects that are not listed as alternatives, but of whose torque the run would show as little.

    A diagnosis does not list an effect whose parameters would be impossible, or which is not worth its parameters; and
    yet it may be what is there, and a run that told only the listed ones apart would not show it.
    """
    known = {(id(pair.law), pair.rival.effect.place) for pair in listed}
    taken = {law.effect.place for law in laws}
    made = []
    for found in laws:
        others = tuple(law for law in laws if law is not found)
        for rival in hypotheses(diagnosis.model.arm):
            if (
                rival.place in taken
                or (id(found), rival.place) in known
                or not _share_joints(found.effect, rival)
            ):
                continue
            shape = run.best_shape(found.added, rival)
            if shape is None:
                continue
            rivalry = Rivalry(found, Law(AddedEffect(rival, {}), shape), others)
            if rivalry.left_on_all([run]) < _ALIKE:
                made.append(rivalry)
    return made


def _share_joints(one: Effect, other: Effect) -> bool:
    """Whether two effects act on a joint in common; those of the whole arm act on all."""
    return not (one.indices and other.indices) or not set(one.indices).isdisjoint(other.indices)


def _as_fitted(
    diagnosis: Diagnosis, run: Stage, found: Law, rival: Effect, others: tuple[Law, ...]
) -> Law | None:
    """The rival with the parameters that it takes in place of what was found."""
    if any(other.effect.place == rival.place for other in others):
        return None
    shape = run.best_shape(found.added, rival)
    if shape is None:
        return None
    evidence = diagnosis.evidence
    effects = [*(other.effect for other in others), rival]
    shapes = [*(Shape.fixed(other.shape) for other in others), Shape.fixed(shape)]
    fitted = fit(evidence, evidence.residual([]), effects, shapes)
    return Law(AddedEffect(rival, fitted.parameters[-1]), shape)
