"""The motion to make next: one that tells what was found from what it may be mistaken for.

A diagnosis lists as alternatives what its run cannot tell from what was found. Here a reference within the arm's limits
is designed on which, whichever of the two is there, the other fits badly (`armloop.design.unexplained`). Without
alternatives it is one that measures what was found better, or, where no law was found, one that shows the joint
over its whole range and at all speeds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armloop.design import (
    CRITERIA,
    Columns,
    Criterion,
    Design,
    Limits,
    Problem,
    Regression,
    Series,
    check_rest,
    random_references,
    sampled,
    unexplained,
)
from armloop.diagnosis.apart import Stage, context_of
from armloop.diagnosis.diagnose import Diagnosis
from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.rivals import Law, Rivalry, found_laws, lookalikes, pairs
from armloop.effects import Effect
from armloop.errors import InputError
from armloop.excitation import FourierReference, MotionRanges
from armloop.library.friction import FrictionTerm
from armloop.model import ReconstructedModel
from armloop.motion import Motion
from armloop.progress import Progress, silent

Array = NDArray[np.float64]

#: s of a period, repeated, and its harmonics: up to 0.4 Hz.
PERIOD, _HARMONICS = 20.0, 8
#: s that a diagnosis needs at least.
_SHORTEST, _LONGEST = 12.0, 3600.0
#: Random motions that show what is possible within the limits, and s between their samples.
_TYPICAL, _STEP = 8, 0.05
#: Of those, motions on which it is judged whether two effects can be told apart at all.
_STAGES = 2
#: How often a motion is designed anew, with what its rivals turned out to be able to.
_ROUNDS = 2
#: A law of whose torque all those motions together leave less than this part cannot be told from its rival.
_NEVER = 0.03
#: An effect of this many baselines, root mean square, is beyond doubt; what counts from there on is its shape.
_ENOUGH = 5.0
#: Part of the optimiser's usual iterations.
_EFFORT = 0.3
#: A motion that leaves less than this part of a torque will hardly rid the list of the alternative.
FAR_ENOUGH = 0.3


@dataclass(frozen=True)
class Wish:
    """What a user may choose of the motion.

    Attributes:
        ranges: of motion; by default those of the model's training data.
        reserve: part of the effort limits that is kept free.
        duration: s, rounded up to whole periods of 20 s.
        starts, seed: of the optimiser.
    """

    ranges: MotionRanges | None = None
    reserve: float = 0.2
    duration: float = 60.0
    starts: int = 2
    seed: int = 0

    @property
    def whole_duration(self) -> float:
        """Length of the motion, s: whole periods."""
        return PERIOD * float(np.ceil(self.duration / PERIOD - 1e-9))


@dataclass(frozen=True)
class Told:
    """How far an effect and its alternative are apart: part of either's torque that the other cannot stand for.

    ``then`` is None where no motion within the limits tells the two apart.
    """

    found: Effect
    rival: Effect
    now: float
    then: float | None

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready values."""
        places = {
            key: {"effect": e.name, "joint": e.joint, **_other(e)}
            for key, e in (("found", self.found), ("alternative", self.rival))
        }
        return {**places, "apart": {"run": self.now, "next_run": self.then}}


@dataclass(frozen=True, eq=False)
class NextRun:
    """A motion with what it is for.

    Attributes:
        purpose: ``alternatives``, ``precision`` or ``unlisted``.
        told: every alternative, the worst one first.
        sharper: the effects with the factor by which their standard errors fall, where the purpose is precision.
        joint: of the residual without a law, from 1.
        use: (4, n) largest part used of the limits of position, velocity, acceleration and torque.
    """

    purpose: str
    reference: FourierReference
    told: list[Told] = field(default_factory=list)
    sharper: list[tuple[Effect, float]] = field(default_factory=list)
    joint: int | None = None
    use: Array = field(default_factory=lambda: np.zeros((4, 0)))

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready values."""
        names = ("position", "velocity", "acceleration", "torque")
        return {
            "purpose": self.purpose,
            "duration": self.reference.duration,
            "alternatives": [told.to_dict() for told in self.told],
            "std_error_factor": [
                {"effect": e.name, "joint": e.joint, **_other(e), "factor": x} for e, x in self.sharper
            ],
            "joint": self.joint,
            "use": {name: row.tolist() for name, row in zip(names, self.use, strict=True)},
        }


def next_run(diagnosis: Diagnosis, wish: Wish | None = None, progress: Progress = silent) -> NextRun | None:
    """Design the motion to make next; None where nothing was found that a motion could say more about.

    Raises:
        InputError: a choice is out of range, or the limits exclude any motion.
    """
    wish = wish or Wish()
    if not _SHORTEST <= wish.duration <= _LONGEST:
        raise InputError(
            f"next run of {wish.duration:g} s: a diagnosis needs {_SHORTEST:g} s; give up to {_LONGEST:g}"
        )
    if not 0 <= wish.reserve < 1:
        raise InputError(f"reserve {wish.reserve:g}: give a part of the effort limits, from 0 to below 1")
    if not diagnosis.outcome.found and diagnosis.unlisted is None:
        return None
    planner = _Planner.of(diagnosis, wish, progress)
    laws, run = found_laws(diagnosis), Stage.of_run(diagnosis.evidence)
    rivals = pairs(diagnosis, laws, run)
    ways = {id(pair): planner.possible(pair.rivalries()) for pair in rivals}
    if any(ways.values()):
        alike = planner.possible(lookalikes(diagnosis, laws, rivals, run))
        made = planner.alternatives([*(way for pair in rivals for way in ways[id(pair)]), *alike])
        purpose = "alternatives"
    elif diagnosis.unlisted is not None:
        made, purpose = planner.unlisted(diagnosis.unlisted.joint), "unlisted"
    else:
        made, purpose = planner.precision(laws), "precision"
    reference = planner.whole(made)
    then = Stage.of_reference(diagnosis.evidence, reference)
    told = [
        Told(
            pair.found.effect,
            pair.rival.effect,
            min(way.left(run) for way in ways[id(pair)] or pair.rivalries()),
            min((way.left(then) for way in ways[id(pair)]), default=None),
        )
        for pair in rivals
    ]
    told.sort(key=lambda each: (each.then is None, each.now))
    sharper = _sharper(run, then, laws) if purpose == "precision" else []
    joint = diagnosis.unlisted.joint if purpose == "unlisted" and diagnosis.unlisted is not None else None
    use = planner.limits.use(sampled(made.reference, planner.fine_step))
    return NextRun(purpose, reference, told, sharper, joint, use)


def training_ranges(model: ReconstructedModel) -> MotionRanges:
    """Where a model knows its arm: the ranges of its training data, within the arm's limits.

    The arm's own where the model's file does not say (`MotionRanges.of`).
    """
    arm = model.arm
    if "range" not in model.history:
        return MotionRanges.of(arm)
    half, speed, pull, centre = np.array(model.history["range"], dtype=float)
    low, high, fastest = (
        np.array([getattr(joint, key) for joint in arm.joints]) for key in ("lower", "upper", "velocity")
    )
    least = 1e-6  # a joint that rested while the model was trained has next to no range
    lower = np.clip(centre - np.maximum(half, least), low, high - least)
    upper = np.clip(centre + np.maximum(half, least), lower + least, high)
    return MotionRanges(lower, upper, np.minimum(np.maximum(speed, least), fastest), np.maximum(pull, least))


@dataclass(frozen=True, eq=False)
class _Planner:
    """What every design of a diagnosis shares."""

    evidence: Evidence
    limits: Limits
    typical: list[Motion]
    stages: list[Stage]
    wish: Wish
    progress: Progress

    @staticmethod
    def of(diagnosis: Diagnosis, wish: Wish, progress: Progress) -> _Planner:
        model = diagnosis.model
        ranges = wish.ranges or training_ranges(model)
        effort = (1 - wish.reserve) * np.array([joint.effort for joint in model.arm.joints])
        limits = Limits(ranges, effort, lambda motion: model.predict(motion, sensors=False))
        check_rest(model.arm, limits)
        drawn = random_references(limits, PERIOD, _TYPICAL, wish.seed)
        if not drawn:
            raise InputError(
                f"{model.arm.name}: hardly any motion keeps within the effort limits; widen them"
            )
        evidence = diagnosis.evidence
        # in their whole length, over which friction may drift
        whole = [replace(each, duration=wish.whole_duration) for each in drawn[:_STAGES]]
        stages = [Stage.of_reference(evidence, each) for each in whole]
        typical = [sampled(each, _STEP) for each in drawn]
        return _Planner(evidence, limits, typical, stages, wish, progress)

    @property
    def series(self) -> Series:
        return Series(len(self.limits.effort), _HARMONICS, PERIOD)

    @property
    def fine_step(self) -> float:
        return PERIOD / (40 * _HARMONICS)

    def possible(self, ways: Sequence[Rivalry]) -> list[Rivalry]:
        """Those of which some motion within the limits shows that the rival is not the law."""
        return [way for way in ways if way.left_on_all(self.stages) > _NEVER]

    def whole(self, design: Design) -> FourierReference:
        """The motion in its full length."""
        return replace(design.reference, duration=self.wish.whole_duration)

    def alternatives(self, ways: Sequence[Rivalry]) -> Design:
        """The motion that leaves most of the torque that a rival explains best.

        A rival's nonlinear parameter is as on the run, at first; where on the motion that results another brings it
        nearer, that one is a rival as well, and the motion is designed anew.
        """
        found = len({id(way.law) for way in ways})
        self.progress(f"designing a motion that tells {found} laws from their rivals")
        rivals, best, made = list(ways), -np.inf, None
        for _ in range(_ROUNDS):
            regression, rivalries = self._regression(rivals)
            design = self._optimised(regression, unexplained(rivalries, _ENOUGH**2))
            stage = Stage.of_reference(self.evidence, self.whole(design))
            least = [way.left(stage) for way in ways]
            # A pair that hardly any motion tells apart must not decide over the others.
            score = float(np.log(np.clip(least, 1e-6, FAR_ENOUGH)).sum())
            if score > best:
                best, made = score, design
            near = [way.hardest(stage) for way, x in zip(ways, least, strict=True) if x <= FAR_ENOUGH]
            known = {(id(way.law), way.rival.effect.place, way.rival.shape) for way in rivals}
            new = [w for w in near if (id(w.law), w.rival.effect.place, w.rival.shape) not in known]
            if not new:
                break
            rivals += new
        assert made is not None
        return made

    def precision(self, laws: Sequence[Law]) -> Design:
        columns = _columns_of(self.evidence, [], laws)
        names = [str(k) for k in range(columns(self.typical[0]).shape[2])]
        self.progress("designing a motion that measures what was found better")
        regression = Regression.of(columns, names, self.evidence.scale, self.typical)
        return self._optimised(regression, CRITERIA["logdet"])

    def unlisted(self, joint: int) -> Design:
        columns, names = _anything(self.limits.ranges, joint - 1)
        self.progress(f"designing a motion that shows joint {joint} at all postures and speeds")
        regression = Regression.of(columns, names, self.evidence.scale[[joint - 1]], self.typical)
        return self._optimised(regression, CRITERIA["logdet"])

    def _optimised(self, regression: Regression, criterion: Criterion) -> Design:
        problem = Problem(self.series, regression, criterion, self.limits)
        design = problem.optimise(self.wish.starts, self.wish.seed, _EFFORT, self.progress)
        if design is None:
            raise InputError("no motion within the limits was found; widen the ranges or the effort")
        return design

    def _regression(self, ways: Sequence[Rivalry]) -> tuple[Regression, list[tuple[int, list[int]]]]:
        """The laws' torques as they are, in baselines, and the rivals' columns, of unit size on typical motion."""
        torques = list({id(way.law): way.law for way in ways}.values())
        parts = list({id(x): x for way in ways for x in (way.rival, *way.others)}.values())
        columns = _columns_of(self.evidence, torques, parts)
        first = self.typical[0]
        context = context_of(self.evidence, first)
        sizes = [part.effect.full_columns(context, part.shape).shape[2] for part in parts]
        edges = len(torques) + np.cumsum([0, *sizes])
        squares = [
            np.mean((columns(m) / self.evidence.scale[:, None]) ** 2, axis=(0, 1)) for m in self.typical
        ]
        size = np.sqrt(len(self.evidence.scale) * np.mean(squares, axis=0))
        size[: len(torques)] = 1.0
        size = np.where(size > 1e-12 * size.max(), size, 1.0)
        kept = np.arange(len(size), dtype=np.intp)
        names = tuple(map(str, kept))
        regression = Regression(columns, names, self.evidence.scale, kept, size)
        at = {id(part): list(range(edges[k], edges[k + 1])) for k, part in enumerate(parts)}
        which = {id(law): k for k, law in enumerate(torques)}
        return regression, [
            (which[id(way.law)], [i for part in (way.rival, *way.others) for i in at[id(part)]])
            for way in ways
        ]


def _columns_of(evidence: Evidence, torques: Sequence[Law], parts: Sequence[Law]) -> Columns:
    """Columns (N, n, p) of any motion: the torques of laws, then the columns of others."""
    effects = [law.effect for law in (*torques, *parts)]

    def columns(motion: Motion) -> Array:
        context = context_of(evidence, motion, effects)
        made = [law.added.torque(context)[:, :, None] for law in torques]
        made += [part.effect.full_columns(context, part.shape) for part in parts]
        return np.concatenate(made, axis=2)

    return columns


def _anything(ranges: MotionRanges, joint: int) -> tuple[Columns, list[str]]:
    """Low-order functions of a joint's motion, and of the others beside it, that a law not listed may be made of."""
    half, centre = 0.5 * (ranges.upper - ranges.lower), 0.5 * (ranges.upper + ranges.lower)
    sign = FrictionTerm("smooth_sign", parameter=float(0.02 * ranges.velocity[joint]))

    def columns(motion: Motion) -> Array:
        # Chebyshev polynomials of the position: even over the whole range, whatever its size
        x = np.clip((motion.q - centre) / half, -1.2, 1.2)
        v, pull = motion.v / ranges.velocity, motion.vdot / ranges.acceleration
        own = x[:, joint]
        places = [np.ones_like(own), own, 2 * own**2 - 1, 4 * own**3 - 3 * own]
        speeds = [np.ones_like(own), v[:, joint], v[:, joint] ** 2, sign.column(motion, joint)]
        made = [a * b for a in places for b in speeds] + [pull[:, joint]]
        for k in range(motion.joints):
            if k != joint:
                made += [
                    x[:, k],
                    2 * x[:, k] ** 2 - 1,
                    v[:, k],
                    v[:, k] ** 2,
                    v[:, k] * v[:, joint],
                    pull[:, k],
                ]
        return np.column_stack(made)[:, None, :]

    return columns, [str(k) for k in range(17 + 6 * (ranges.n - 1))]


def _sharper(run: Stage, then: Stage, laws: Sequence[Law]) -> list[tuple[Effect, float]]:
    """Factor of the standard errors of each effect's coefficients, the geometric mean over them."""
    logs = []
    for stage in (run, then):
        X = np.hstack([stage.columns(law.effect, law.shape) for law in laws])
        scale = np.sqrt((X**2).sum(axis=0))
        inverse = np.linalg.pinv((X / scale).T @ (X / scale), rcond=1e-9)
        logs.append(0.5 * np.log(np.diag(inverse)) - np.log(scale))
    sizes = [run.columns(law.effect, law.shape).shape[1] for law in laws]
    change = np.split(logs[1] - logs[0], np.cumsum(sizes)[:-1])
    return [(law.effect, float(np.exp(part.mean()))) for law, part in zip(laws, change, strict=True)]


def _other(effect: Effect) -> dict[str, int | None]:
    return {"other_joint": effect.other_joint} if effect.pair_wise else {}
