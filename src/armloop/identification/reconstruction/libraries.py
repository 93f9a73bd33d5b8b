"""Model selection among the libraries: what a user who asked for none is best served with.

The paper's double feature set needs no geometry and no symmetry, but a data collection does not tell all its terms
apart; the base parameters of the URDF are few and right where its geometry is; the energies are few, need no lengths,
and make M(q) symmetric by construction. Which of them suits a log is seen on blocks of it that none of them was fitted on
and that judge nothing else: of those that pass the checks of physics (:mod:`armloop.dynamics.physics`), the one that
leaves least, or a less complex one where the difference is within its standard error. Complexity counts what was picked
from, too: k of p candidates weigh k (1 + ln(p / k)) (Birgé and Massart, *Gaussian model selection*, J. Eur. Math. Soc.
2001), so that 22 energies of 2,785 are no simpler than 44 base parameters of 44, and do not suit other motions as well.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from armloop.data.signals import Conditioning
from armloop.dynamics.physics import PhysicsChecks, check_physics
from armloop.identification.reconstruction.data import Data
from armloop.identification.reconstruction.found import Found
from armloop.identification.reconstruction.lagrangian import LagrangianLibrary
from armloop.identification.reconstruction.library import Library
from armloop.identification.reconstruction.nearest_regime import Sorter
from armloop.identification.reconstruction.options import Options
from armloop.identification.reconstruction.rigid_body import RigidBodyLibrary
from armloop.identification.reconstruction.shared import motion_range, slowest_sliding
from armloop.identification.reconstruction.stepwise import DoubleFeatureSetLibrary
from armloop.identification.reconstruction.tally import SELECTION, Part, Tally
from armloop.model import ReconstructedModel
from armloop.model.components import Lagrangian, RigidBody, SparseTerms
from armloop.robot.arm import Arm
from armloop.util.arrays import Array
from armloop.util.doubts import warn
from armloop.util.errors import InputError

#: By name, the richest first.
LIBRARIES: dict[str, Library] = {
    one.name: one for one in (DoubleFeatureSetLibrary(), RigidBodyLibrary(), LagrangianLibrary())
}
#: A library that leaves so many times as much as the one taken stays behind, whatever else is found out about the logs.
_FAR = 3.0
#: Blocks from which on a difference has a standard error.
_ENOUGH = 8


def named(name: str) -> Library:
    """The library of a name; raises ``InputError`` where there is none."""
    if name not in LIBRARIES:
        raise InputError(f"unknown library {name!r}; there are: {', '.join(LIBRARIES)}")
    return LIBRARIES[name]


def candidates(arm: Arm, options: Options, method: str = "stepwise") -> list[Library]:
    """Libraries that are compared where the user names none: those asked for by an option, or all that suit the arm."""
    able = [one for one in LIBRARIES.values() if method in one.methods]
    asked = [one for one in able if one.asked(options)]
    if asked:
        return asked
    able = [one for one in able if options.friction is None or not one.own_friction] or able
    return [one for one in able if one.suits(arm)] or able


def check_suits(library: Library, method: str, options: Options) -> None:
    """Raise ``InputError`` where a library knows no such method or laws, and say what it does not use."""
    if method not in library.methods:
        able = ", ".join(one.name for one in LIBRARIES.values() if method in one.methods)
        raise InputError(f"method {method!r} works on the library {able}, not on {library.name!r}")
    if options.friction is not None and library.own_friction:
        others = " or ".join(one.name for one in LIBRARIES.values() if not one.own_friction)
        raise InputError(f"{library.own_friction}; laws are chosen with --library {others}")
    if options.of_double_feature_set and not library.own_friction:
        able = ", ".join(one.name for one in LIBRARIES.values() if one.own_friction)
        warn(
            f"an estimator, its penalty and orders choose among the products of {able}; {library.name} has none, and they "
            "are not used"
        )


@dataclass(frozen=True, eq=False)
class Attempt:
    """What a library found on conditioned logs.

    Attributes:
        margin: seconds from a block's ends within which its samples do not judge.
    """

    library: Library
    conditioning: Conditioning
    data: Data
    found: Found
    margin: float = 0.0

    def tally(self, sorter: Sorter | None, part: Part) -> Tally:
        """Errors on blocks that the model has not seen; per condition where they are sorted."""
        model = self.model()
        return self.data.sum(partial(Tally.of, model=model, sorter=sorter, part=part, margin=self.margin))

    def yardsticks(self, sorter: Sorter | None, seconds: float) -> dict[str, list[float | None]]:
        """RMSE per joint on held-out blocks: that one piece of ``seconds`` in ten exceeds, at turns, and where it creeps.

        Yardsticks of a later run, not errors of this model: also blocks that chose a library show what it leaves, and
        half of them would miss the rarer motion.
        """
        tally = partial(Tally.of, model=self.model(), sorter=sorter, part="all", seconds=seconds)
        return self.data.sum(tally).yardsticks()

    def model(self) -> ReconstructedModel:
        """What was fitted without the held-out blocks: a model that has seen those that judge must choose nothing."""
        reference = self.data.reference.samples
        history = {"range": motion_range(reference.motion), "slowest": slowest_sliding(reference)}
        return self.found.model(conditioning=self.conditioning, history=history)

    def coefficients(self) -> int:
        """Number of coefficients; those that serve all joints count once."""
        return self._beside() + self._kept()

    def complexity(self) -> float:
        """Weight of the coefficients and of their choice; terms of friction and laws, of one ladder, weigh one each."""
        kept, reports = self._kept(), self.found.reports
        of = (
            reports[-1].independent
            if self.library.shared
            else self.found.arm.n * sum(r.independent for r in reports)
        )
        return self._beside() + kept * (1 + np.log(max(of / kept, 1.0))) if kept else self._beside()

    def _beside(self) -> int:
        return sum(len(added.parameters) for added in self.found.effects) + sum(map(len, self.found.friction))

    def _kept(self) -> int:
        return sum(map(_size, self.found.components))


def _size(component: object) -> int:
    if isinstance(component, SparseTerms):
        return int(np.count_nonzero(component.coefficients))
    if isinstance(component, RigidBody):
        return len(component.values)
    assert isinstance(component, Lagrangian)
    return len(component.coefficients)


@dataclass(frozen=True, eq=False)
class Contender:
    """One library in the comparison.

    Attributes:
        attempt: what it found; None if it could not be tried.
        refused: why not; empty if it was.
        nrmse: per joint, on the blocks that choose the library.
        coefficients: their number.
        complexity: of them and their choice.
        checks: of physics, over the joint limits.
        chosen: whether it was taken.
    """

    library: Library
    attempt: Attempt | None = None
    refused: str = ""
    nrmse: tuple[float | None, ...] = ()
    coefficients: int = 0
    complexity: float = 0.0
    checks: PhysicsChecks | None = None
    blocks: Array | None = None
    chosen: bool = False

    @property
    def name(self) -> str:
        """The library's."""
        return self.library.name

    @property
    def error(self) -> float:
        """Mean nRMSE over the joints that move on the blocks; infinite if there is none."""
        known = [x for x in self.nrmse if x is not None]
        return float(np.mean(known)) if known else float("inf")

    @property
    def faults(self) -> int:
        """How many of the checks of physics it does not pass."""
        return self.checks.failed if self.checks is not None else 0

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready values."""
        if self.attempt is None:
            return {"library": self.name, "chosen": False, "refused": self.refused}
        return {
            "library": self.name,
            "chosen": self.chosen,
            "selection_nrmse": list(self.nrmse),
            "coefficients": self.coefficients,
            "physics": self.checks.to_dict() if self.checks else None,
        }


def contender(library: Library, attempt: Callable[[Library], Attempt]) -> Contender:
    """Try a library; one that the logs do not carry is refused with the reason.

    Args:
        attempt: makes the attempt of a library.
    """
    try:
        made = attempt(library)
    except InputError as error:
        return Contender(library, refused=str(error))
    tally = made.tally(None, SELECTION)
    score = tally.score()
    return Contender(
        library,
        made,
        nrmse=tuple(score.moving["nrmse"]),
        coefficients=made.coefficients(),
        complexity=made.complexity(),
        checks=check_physics(made.model()),
        blocks=tally.relative_blocks(),
    )


def choose(tried: Sequence[Contender]) -> list[Contender]:
    """The same, with the best of them chosen.

    Raises:
        InputError: the logs carry none of the libraries.
    """
    made = [one for one in tried if one.attempt is not None]
    if not made:
        reasons = dict.fromkeys(one.refused for one in tried)
        each = (f"{', '.join(o.name for o in tried if o.refused == why)}: {why}" for why in reasons)
        raise InputError("; ".join(each))
    fewest = min(one.faults for one in made)
    eligible = [one for one in made if one.faults == fewest]
    best = min(eligible, key=lambda one: one.error)
    simpler = [one for one in eligible if one.complexity < best.complexity and _no_worse(one, best)]
    taken = min(simpler, key=lambda one: one.complexity, default=best)
    return [replace(one, chosen=one is taken) for one in tried]


def left_behind(tried: Sequence[Contender]) -> list[Contender]:
    """Those of several, one of them chosen, that leave so much more than it that they need not be tried again."""
    (taken,) = [one for one in tried if one.chosen]
    return [one for one in tried if one.attempt is not None and one.error > _FAR * taken.error]


def _no_worse(one: Contender, best: Contender) -> bool:
    """Whether the difference of two errors on the same blocks is within its standard error."""
    if one.blocks is None or best.blocks is None or one.blocks.shape != best.blocks.shape:
        return False
    excess = one.blocks - best.blocks
    excess = excess[np.isfinite(excess)]
    if len(excess) < _ENOUGH:
        return False
    return bool(excess.mean() <= excess.std(ddof=1) / np.sqrt(len(excess)))


def comparison_notes(tried: Sequence[Contender]) -> list[str]:
    """Why the library that was taken was, and what its checks say, a line each."""
    (taken,) = [one for one in tried if one.chosen]
    others = [one for one in tried if not one.chosen]
    parts = [_outcome(one) for one in others]
    if np.isfinite(taken.error):
        reason = f"it leaves {taken.error:.2%} (nRMSE) on the blocks that choose the library"
    elif any(one.attempt for one in others):
        reason = "the logs are too short to judge it by"
    else:
        reason = "the only one that the logs can determine"
    if any(not one.faults and one.error < taken.error for one in others):
        parts.append("the simplest of those that leave as little within the difference's standard error")
    notes = [f"library {taken.name}: {reason}; {', '.join(parts)}"]
    for one in others:
        if one.checks is not None and one.faults and one.error < taken.error:
            notes.append(f"{one.name} leaves less but is no arm: {'; '.join(one.checks.faults())}")
    return notes


def _outcome(one: Contender) -> str:
    """What became of a library that was not taken."""
    if one.attempt is None:
        return f"{one.name} not tried ({one.refused})"
    return f"{one.name} {one.error:.2%}" if np.isfinite(one.error) else f"{one.name} not judged"
