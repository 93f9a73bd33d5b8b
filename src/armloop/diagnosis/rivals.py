"""The alternatives of a diagnosis as laws with parameters: which torque may be mistaken for which."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from armloop.diagnosis.apart import Part, Stage, left
from armloop.diagnosis.diagnose import Diagnosis
from armloop.diagnosis.fit import Shape, fit
from armloop.effects import Effect
from armloop.model import AddedEffect

#: Where several motions are looked at, no more values of a nonlinear parameter are tried than this.
_FEW = 20


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


@dataclass(frozen=True, eq=False)
class Pair:
    """What was found and one of its alternatives.

    Whichever of the two is there, the other must be seen not to be: rivalries go both ways. Where one can stand for
    everything that the other does (a spring of no stiffness for an offset), only the other way tells them apart.
    """

    found: Law
    rival: Law
    others: tuple[Law, ...]

    def rivalries(self) -> tuple[Rivalry, Rivalry]:
        """Both ways."""
        return Rivalry(self.found, self.rival, self.others), Rivalry(self.rival, self.found, self.others)


def found_laws(diagnosis: Diagnosis) -> list[Law]:
    """The effects that were found."""
    outcome = diagnosis.outcome
    pairs = zip(outcome.found, outcome.added(), strict=True)
    return [Law(added, found.shape.final) for found, added in pairs]


def pairs(diagnosis: Diagnosis) -> list[Pair]:
    """Every effect found with each of its alternatives, as each would explain the run."""
    run = Stage.of_run(diagnosis.evidence)
    laws = found_laws(diagnosis)
    made = []
    for k, found in enumerate(diagnosis.outcome.found):
        others = tuple(law for i, law in enumerate(laws) if i != k)
        for rival, _ in found.rivals:
            law = _as_fitted(diagnosis, run, laws[k], rival, others)
            if law is not None:
                made.append(Pair(laws[k], law, others))
    return made


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
