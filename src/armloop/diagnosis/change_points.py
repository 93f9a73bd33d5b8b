"""Change-point detection: when an effect begins, or ends, within a run, by the profile likelihood of a step gate.

Quandt's likelihood ratio (J. American Statistical Association 55, 1960) over the instants of a run. That the best of many
is taken is paid for: the blocks of each fold are judged with an instant that the other fold chose.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from armloop.data.blocks import BLOCK_SECONDS
from armloop.data.motion import Motion
from armloop.diagnosis.evidence import FOLDS, Evidence
from armloop.diagnosis.fit import Shape
from armloop.diagnosis.gates import Gates
from armloop.diagnosis.judgement import SIGNIFICANCE, lead
from armloop.diagnosis.posterior import LOG_ODDS, TELLING, log_prior, told
from armloop.diagnosis.score import Score
from armloop.diagnosis.trials import Known
from armloop.laws.effects import Effect
from armloop.laws.effects.encoder_offset import EncoderOffset
from armloop.laws.effects.onset import Onset, log_of
from armloop.laws.effects.spells import Spells
from armloop.util.arrays import TINY, Array, Index, Mask

#: An effect is there, and is not there, for so many blocks at least: both folds have seen either.
_BLOCKS = 4
#: Cuts at which a profile is taken to begin with.
_CUTS = 200
#: Within so many standard errors of its instant nobody knows whether an effect is there.
_SURE = 2.0
#: What a program of motion is like at a time is its mean over so many seconds.
_PROGRAM = 2 * BLOCK_SECONDS

#: An effect with its nonlinear parameter.
Shaped = tuple[Effect, Shape]


@dataclass(frozen=True, eq=False)
class Part:
    """An effect that is there for a part of a log, beside others.

    Attributes:
        log: samples of that log.
        until: whether it is there until the instant, not since.
        elsewhere: whether it is there in other logs.
    """

    effect: Effect
    shape: Shape
    others: tuple[Shaped, ...]
    log: slice
    until: bool
    elsewhere: bool

    @property
    def effects(self) -> list[Effect]:
        """All of them, this one first."""
        return [self.effect, *(effect for effect, _ in self.others)]

    def fitted(self, evidence: Evidence, onset: Onset) -> Known:
        """All of them, fitted together."""
        shapes = [self.shape, *(shape for _, shape in self.others)]
        return Known.of(evidence, [self.effect.within(onset), *self.effects[1:]], shapes)


@dataclass(frozen=True, eq=False)
class Judged:
    """An effect in a part of a log, and how it does with instants that each fold did not choose.

    Attributes:
        cut: how many samples of the log that are kept lie before it.
        known: the fit with the instant that all blocks choose.
        held_out: (R,) what is left of its rows, weighted, with those that each fold did not choose.
    """

    part: Part
    cut: int
    known: Known
    held_out: Array

    @property
    def likely(self) -> float:
        """Log posterior, but for a constant of the run."""
        return self.likely_of(self.known.evidence.rows)

    def likely_of(self, rows: Mask) -> float:
        """The same of some rows (N, n) alone."""
        return told(self.score(rows)) + price(self.known.evidence, self.known.fit.effects)

    def score(self, rows: Mask) -> Score:
        """What judges it, of some rows (N, n) of those that count."""
        stacked, some = self.known.fit.stacked, rows[self.known.evidence.rows]
        return Score.of(0, self.held_out[some], stacked.joint[some], stacked.block[some], stacked.joints)


def price(evidence: Evidence, effects: Sequence[Effect]) -> float:
    """Log prior odds of effects against none, and of each instant within the run: any of its blocks is as likely."""
    instants = sum(len(effect.onset.instants) for effect in effects if effect.onset is not None)
    return log_prior(evidence, effects) - instants * instant_price(evidence)


def instant_price(evidence: Evidence) -> float:
    """Log prior odds against an instant within a run: any of its blocks is as likely."""
    return LOG_ODDS + float(np.log(evidence.blocks.max() + 1))


class ChangePoints:
    """Profiles of effects over the instants of a run.

    Args:
        evidence: the run without what is known of it.
    """

    def __init__(self, evidence: Evidence) -> None:
        self.evidence = evidence
        self._motion, self._kept = evidence.samples.motion, evidence.kept
        self._weight = evidence.rows[self._kept] / evidence.scale
        self._y = evidence.residual([])[self._kept] * self._weight
        self._blocks = evidence.blocks[self._kept]
        self._made: dict[tuple[object, ...], Gates] = {}

    def parts(self, effect: Effect, shape: Shape, others: tuple[Shaped, ...]) -> Iterator[Part]:
        """Every part of the run that begins, or ends, within one log."""
        logs = {log.start: log for log in (log_of(self._motion, run) for run in self._motion.runs())}
        for log in logs.values():
            for until in (False, True):
                for elsewhere in (False, True) if len(logs) > 1 else (False,):
                    yield Part(effect, shape, others, log, until, elsewhere)

    def best(self, part: Part) -> tuple[float, int] | None:
        """The log posterior of the likeliest cut, and that cut; None where the log is too short for any."""
        cuts = self._cuts(part)
        if not len(cuts):
            return None
        coarse = cuts[:: max(1, len(cuts) // _CUTS)]
        near = coarse[int(np.argmax(self._told(part, coarse)))]
        fine = cuts[np.abs(cuts - near) <= max(1, len(cuts) // _CUTS)]
        likely = self._told(part, fine)
        best = int(np.argmax(likely))
        paid = price(self.evidence, [part.effect.within(_SOME), *part.effects[1:]])
        return float(likely[best]) + paid, int(fine[best])

    def judged(self, part: Part, cut: int) -> Judged | None:
        """An effect beside others, with the instant that all blocks choose and without each fold; None if it cannot be."""
        onset = self.onset(part, cut)
        evidence = self.evidence.only(self.evidence.rows & ~self.near(onset)[:, None])
        known = part.fitted(evidence, onset)
        if not known.fit.is_possible(0, evidence.tried(part.effect)):
            return None
        rows = known.fit.stacked
        held_out = np.empty(len(rows.y))
        cuts = self._cuts(part)
        for k in range(FOLDS):
            likely = self._told(part, cuts, self.evidence.fold[self._kept] != k)
            without = part.fitted(evidence, self.onset(part, _middle(cuts, likely)))
            held_out[rows.fold == k] = without.fit.outside[k][rows.fold == k]
        return Judged(part, cut, known, held_out)

    def near(self, onset: Onset | Spells) -> Mask:
        """(N,) samples in which an effect may or may not be there yet: its instant has an error, and the filter a reach."""
        there = onset.there(self._motion)
        rows = np.zeros(len(there), dtype=bool)
        seconds = self.evidence.samples.reach + _SURE * onset.error
        reach = max(1, round(seconds / self.evidence.samples.period))
        for run in self._motion.runs():
            for edge in run.start + 1 + np.flatnonzero(np.diff(there[run].astype(np.int8))):
                rows[max(run.start, edge - reach) : min(run.stop, edge + reach)] = True
        return rows

    def onset(self, part: Part, cut: int) -> Onset:
        """The instant of a cut: the first sample that has the effect, or the last."""
        order = self._order(part)
        row = int(self._kept[order[cut - 1 if part.until else cut]])
        posture = tuple(self._motion.q[row].tolist())
        return Onset(float(self._motion.time[row]), 0.0, part.until, posture, part.elsewhere)

    def error(self, part: Part, cut: int) -> float:
        """Standard error of an instant, s: how far off the profile is worse by what one observation tells.

        Neighbouring samples of what is left are no observations of their own: as many as its correlation lasts are one.
        Where an angle's record steps, the rates and the torques that are made of it ring for as long as two filters reach.
        """
        cuts, order = self._cuts(part), self._order(part)
        squares = self._gates(part).left(order, cuts, part.until, self._fixed(part)).sum(axis=1)
        left = self._gates(part).residual(self._there(part, cut))
        unit = max(float((left**2).sum()) / max(int(np.count_nonzero(self._weight)), 1), 1.0)
        worse = squares - squares[np.searchsorted(cuts, cut)] > unit * _memory(left)
        time, at = self._motion.time[self._kept[order]], int(np.searchsorted(cuts, cut))
        beyond = np.flatnonzero(worse)
        low = cuts[max([0, *beyond[beyond < at]])]
        high = cuts[min([len(cuts) - 1, *beyond[beyond > at]])]
        rings = 2 * self.evidence.samples.reach if isinstance(part.effect, EncoderOffset) else 0.0
        return float(np.hypot(float(time[high] - time[low]) / 2, rings))

    def gradual(self, part: Part, cut: int) -> bool:
        """Whether an effect that grows, or wanes, all along does as well as one that steps: then it has no instant."""
        gates, order, fixed = self._gates(part), self._order(part), self._fixed(part)
        time = self._motion.time[self._kept[order]]
        course = np.zeros((len(fixed), 2))
        course[fixed, 0] = course[order, 0] = 1.0
        course[order, 1] = (time - time[0]) / max(float(time[-1] - time[0]), TINY)
        columns = [gates.gated * along[:, None, None] for along in course.T]
        steady = Gates(np.concatenate(columns, axis=2), gates.beside, gates.y).residual(np.ones_like(fixed))
        step = gates.residual(self._there(part, cut))
        return lead(self._score(steady), self._score(step)) <= SIGNIFICANCE

    def of_motion(self, part: Part, cut: int) -> bool:
        """Whether the effect is as well there from a speed or a posture on, of this or of any joint.

        Where a run's program changes, what a law gets wrong of it changes, too, and at the same time.
        """
        gates, order = self._gates(part), self._order(part)
        mine = self._score(gates.residual(self._there(part, cut)))
        fixed = self._fixed(part)
        for x in courses(self._motion, self._kept):
            sequence = order[np.argsort(x[order], kind="stable")]
            cuts = np.unique(np.linspace(1, len(order) - 1, _CUTS).astype(np.intp))
            for until in (False, True):
                best = int(cuts[int(np.argmax(self._of(gates.left(sequence, cuts, until, fixed))))])
                there = fixed.copy()
                there[sequence[:best] if until else sequence[best:]] = True
                if lead(self._score(gates.residual(there)), mine) <= SIGNIFICANCE:
                    return True
        return False

    def _score(self, left: Array) -> Score:
        samples, joint = np.nonzero(self._weight)
        return Score.of(0, left[samples, joint], joint, self._blocks[samples], left.shape[1])

    def _order(self, part: Part) -> Index:
        """(M,) samples, of those kept, of the part's log."""
        return np.flatnonzero((self._kept >= part.log.start) & (self._kept < part.log.stop))

    def _fixed(self, part: Part) -> Mask:
        """(K,) samples of other logs that have the effect."""
        fixed = np.full(len(self._kept), part.elsewhere)
        fixed[self._order(part)] = False
        return fixed

    def _there(self, part: Part, cut: int) -> Mask:
        """(K,) samples that have the effect."""
        there, order = self._fixed(part), self._order(part)
        there[order[:cut] if part.until else order[cut:]] = True
        return there

    def _cuts(self, part: Part) -> Index:
        """Cuts that leave enough blocks, with samples that show the effect, on either side."""
        order, joints = self._order(part), list(part.effect.indices) or slice(None)
        shows = (self._weight[order][:, joints] > 0).any(axis=1)
        blocks = np.where(shows, self._blocks[order], -1)
        new = np.zeros(len(order), dtype=bool)
        new[np.unique(blocks, return_index=True)[1]] = True
        before = np.concatenate([[0], np.cumsum(new & shows)])
        cuts = np.arange(1, len(order))
        return cuts[(before[cuts] >= _BLOCKS) & (before[-1] - before[cuts] >= _BLOCKS)]

    def _gates(self, part: Part) -> Gates:
        every = ((part.effect, part.shape), *part.others)
        key = tuple((effect.place, effect.onset, shape.final) for effect, shape in every)
        if key not in self._made:
            n = self._weight.shape[1]
            beside = [self._columns(*other) for other in part.others]
            others = np.concatenate([np.zeros((len(self._kept), n, 0)), *beside], axis=2)
            self._made.clear()  # one effect's are asked for again and again
            self._made[key] = Gates(self._columns(part.effect, part.shape), others, self._y)
        return self._made[key]

    def _columns(self, effect: Effect, shape: Shape) -> Array:
        return self.evidence.columns(effect, shape.final) * self._weight[:, :, None]

    def _told(self, part: Part, cuts: Index, among: Mask | None = None) -> Array:
        """(T,) log likelihood of each cut, of all samples (K,) or of some."""
        gates = self._gates(part)
        gates = gates if among is None else gates.only(among)
        return self._of(gates.left(self._order(part), cuts, part.until, self._fixed(part)), among)

    def _of(self, energy: Array, among: Mask | None = None) -> Array:
        """(T,) log likelihood of what is left of each joint (T, n), as :func:`armloop.diagnosis.posterior.told` has it."""
        counts = self._weight > 0 if among is None else (self._weight > 0) & among[:, None]
        seen = np.array([len(np.unique(self._blocks[mine])) for mine in counts.T])
        rows = np.maximum(counts.sum(axis=0), 1)
        return np.asarray(-0.5 * np.log(energy + rows) @ np.minimum(seen, TELLING))


#: An instant that stands for any.
_SOME = Onset(0.0, 0.0, False, ())


def _middle(cuts: Index, likely: Array) -> int:
    """The likeliest cut; of several beside each other that are as likely, for nothing is judged between them, the middle."""
    best = int(np.argmax(likely))
    same = np.flatnonzero(likely < likely[best] - 1e-9)
    after = same[same > best]
    last = int(after[0]) - 1 if len(after) else len(cuts) - 1
    return int(cuts[(best + last) // 2])


def courses(motion: Motion, kept: Index) -> Iterator[Array]:
    """(K,) positions and speeds of every joint at some samples, and what they are like over a while."""
    for j in range(motion.joints):
        for x in (motion.q[:, j], np.abs(motion.v[:, j])):
            yield x[kept]
            yield _averaged(motion, x)[kept]


def _averaged(motion: Motion, x: Array) -> Array:
    """(N,) mean of x (N,) over a while around each sample, run by run."""
    mean = np.empty(len(x))
    for run in motion.runs():
        time, sums = motion.time[run], np.concatenate([[0.0], np.cumsum(x[run])])
        first = np.searchsorted(time, time - _PROGRAM / 2)
        last = np.searchsorted(time, time + _PROGRAM / 2, side="right")
        mean[run] = (sums[last] - sums[first]) / (last - first)
    return mean


def _memory(left: Array) -> float:
    """For how many samples what is left (K, n) resembles itself: its autocorrelation, summed until it is no more."""
    power = float((left**2).sum())
    total = 1.0
    for lag in range(1, len(left)):
        alike = float((left[lag:] * left[:-lag]).sum()) / max(power, TINY)
        if alike <= 0:
            break
        total += 2 * alike
    return total
