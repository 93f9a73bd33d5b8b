"""Experiment design for a diagnosis: a motion within limits, for whatever columns and criterion the purpose asks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from armloop.data.blocks import BLOCK_SECONDS
from armloop.data.motion import Motion
from armloop.diagnosis.confounded import Law, Rivalry
from armloop.diagnosis.evidence import FEWEST_BLOCKS, Evidence
from armloop.diagnosis.isolability import Stage, context_of
from armloop.diagnosis.judgement import NOTICEABLE
from armloop.diagnosis.search import ROUNDS
from armloop.diagnosis.verdict import Diagnosis
from armloop.experiment.design import (
    CRITERIA,
    Columns,
    Criterion,
    Design,
    Limits,
    Problem,
    Regression,
    Series,
    check_rest,
    hardly_any_motion,
    random_references,
    sampled,
    unexplained,
)
from armloop.experiment.excitation import FourierReference, MotionRanges
from armloop.laws.friction import FrictionTerm
from armloop.model import ReconstructedModel
from armloop.util.arrays import Array
from armloop.util.errors import InputError
from armloop.util.progress import Progress

#: s of a period, repeated, and its harmonics: up to 0.4 Hz.
PERIOD, _HARMONICS = 20.0, 8
#: s that a diagnosis needs at least, in blocks of their full length, and that an arm is asked to move at most.
_SHORTEST = FEWEST_BLOCKS * BLOCK_SECONDS
_LONGEST = 3600.0
#: Random motions that show what is possible within the limits, and s between their samples.
_TYPICAL, _STEP = 8, 0.05
#: Of those, motions on which it is judged whether two effects can be told apart at all.
_STAGES = 2
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
        starts, seed: of the optimiser; by default 2 starts up to four joints, else one.
    """

    ranges: MotionRanges | None = None
    reserve: float = 0.2
    duration: float = 60.0
    starts: int | None = None
    seed: int = 0

    def check(self, model: ReconstructedModel | None = None) -> None:
        """Raise ``InputError`` where a choice is out of range or, with ``model``, where it leaves no motion."""
        if not _SHORTEST <= self.duration <= _LONGEST:
            raise InputError(
                f"next run of {self.duration:g} s: a diagnosis needs {_SHORTEST:g} s; give up to {_LONGEST:g}"
            )
        if not 0 <= self.reserve < 1:
            raise InputError(f"reserve {self.reserve:g}: give a part of the effort limits, from 0 to below 1")
        if model is not None:
            _typical(model, self)

    @property
    def whole_duration(self) -> float:
        """Length of the motion, s: whole periods."""
        return PERIOD * float(np.ceil(self.duration / PERIOD - 1e-9))


def _typical(model: ReconstructedModel, wish: Wish) -> tuple[Limits, list[FourierReference]]:
    """The limits of the motion, and random motions within them; raises ``InputError`` where there are none."""
    ranges = wish.ranges or training_ranges(model)
    effort = (1 - wish.reserve) * np.array([joint.effort for joint in model.arm.joints])
    limits = Limits(ranges, effort, lambda motion: model.predict(motion, sensors=False))
    check_rest(model.arm, limits)
    drawn = random_references(limits, PERIOD, _TYPICAL, wish.seed)
    if not drawn:
        raise hardly_any_motion(model.arm, limits)
    return limits, drawn


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
class Planner:
    """What every design for a diagnosis shares.

    Attributes:
        evidence: the run that was diagnosed.
        limits: of the motion, and of the torque by the model with what was found.
        typical: random motions within the limits, which scale columns.
        stages: some of them, seen as logs of them would be.
    """

    evidence: Evidence
    limits: Limits
    typical: list[Motion]
    stages: list[Stage]
    wish: Wish
    progress: Progress

    @staticmethod
    def of(diagnosis: Diagnosis, wish: Wish, progress: Progress) -> Planner:
        """Draw the typical motions; raises ``InputError`` where the limits exclude any motion."""
        model = diagnosis.model
        limits, drawn = _typical(model, wish)
        evidence = diagnosis.evidence
        # in their whole length, over which friction may drift
        whole = [replace(each, duration=wish.whole_duration) for each in drawn[:_STAGES]]
        stages = [Stage.of_reference(evidence, each) for each in whole]
        typical = [sampled(each, _STEP) for each in drawn]
        return Planner(evidence, limits, typical, stages, wish, progress)

    @property
    def series(self) -> Series:
        """The family of motions."""
        return Series(len(self.limits.effort), _HARMONICS, PERIOD)

    @property
    def fine_step(self) -> float:
        """s between samples at which the use of limits is told."""
        return PERIOD / (40 * _HARMONICS)

    def possible(self, ways: Sequence[Rivalry]) -> list[Rivalry]:
        """Those of which motions within the limits leave a noticeable part of the law's torque to its rival."""
        return [way for way in ways if way.left_on_all(self.stages) > NOTICEABLE]

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
        for _ in range(ROUNDS):
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
        """The motion that determines the coefficients of laws best, all together."""
        columns = _columns_of(self.evidence, [], laws)
        names = [str(k) for k in range(columns(self.typical[0]).shape[2])]
        self.progress("designing a motion that measures what was found better")
        regression = Regression.of(columns, names, self.evidence.scale, self.typical)
        return self._optimised(regression, CRITERIA["logdet"])

    def unlisted(self, joint: int) -> Design:
        """The motion that shows a joint (from 1) at all postures and speeds, the others apart from it."""
        columns, names = _anything(self.limits.ranges, joint - 1)
        self.progress(f"designing a motion that shows joint {joint} at all postures and speeds")
        regression = Regression.of(columns, names, self.evidence.scale[[joint - 1]], self.typical)
        return self._optimised(regression, CRITERIA["logdet"])

    def _optimised(self, regression: Regression, criterion: Criterion) -> Design:
        problem = Problem(self.series, regression, criterion, self.limits)
        starts = self.wish.starts or (2 if problem.series.joints <= 4 else 1)
        design = problem.optimise(starts, self.wish.seed, _EFFORT, self.progress)
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
