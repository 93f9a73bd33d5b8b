"""Friction at reversals: what a joint does while it turns around, judged by itself.

The torque of a joint at rest is not determined by its motion, so standstill is kept out of training, baseline and
search, with as much around it as the filter smears. A joint that turns around is not at rest, but it passes zero
speed, and so its reversals are kept out, too. There alone does friction with memory differ from a step of the
direction: among samples that slide it can hardly be seen, and no model's baseline says anything of it. A joint that
sticks while it turns around does rest.

So they are judged after the search, as a condition of their own. As no fit has seen them, what is named must be plain: it
at least halves the joint's error there, on blocks that were not fitted, and what it removes is a noticeable torque. The
drives of an arm are alike: what is plain at one joint needs less at the others. A record that is late shows wherever a
joint turns, and little elsewhere: it is named if at most joints it is as good as what is of them alone. What the model
leaves at the reversals of its training logs, too, it has lacked all along, memory where its friction has none; the rest
has changed since. Of a joint that never turned round in them nothing is said: a program that goes from point to point may
rest at each. Nor of one whose friction has memory in the model, where the search found more dry friction: laws turn with
the direction at once, but friction that rises keeps its memory, and what shows where the joint turns is that.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.stats import norm, t

from armloop.data.blocks import block_sums, widened
from armloop.data.motion import Samples
from armloop.data.reversals import at_reversals, passing
from armloop.data.signals import independent_rows
from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.fit import Fit, Shape
from armloop.diagnosis.judgement import MOSTLY, MULTIPLE, NEARLY, NOTICEABLE, SIGNIFICANCE
from armloop.diagnosis.outcomes import Found, Outcome, clear
from armloop.diagnosis.score import mean_by_joint
from armloop.diagnosis.trials import Known
from armloop.laws.effects import Effect, hypotheses
from armloop.laws.friction import FrictionLaw
from armloop.robot.arm import Arm
from armloop.util.arrays import TINY, Array, Index, Mask, filled
from armloop.util.progress import Progress

#: An effect must remove this part of a joint's squared error at reversals, so that it was a multiple of what remains;
#: where the effect was found at another joint, most of it.
PLAIN = 1 - 1 / MULTIPLE**2
#: That must be a noticeable part of the joint's torque, both root mean square, and the log ratio of the errors in the
#: blocks must be positive with the chance of error of a normal variable: in ratios, so that no fast reversal outweighs the
#: others, of errors beside the least noticeable one, so that none does at which there is nothing to remove; by Student's
#: t, for they may be few.
_CHANCE = float(norm.sf(SIGNIFICANCE))
#: A simpler effect that leaves no more of the squared error than this part of it is as good; others that remove this part
#: of what it removes are its alternatives.
ALIKE, _ALTERNATIVE = 0.1, 0.94
#: Fewest blocks with a reversal of a joint that tell anything of it.
_FEWEST = 4


@dataclass(frozen=True, eq=False)
class AtReversals:
    """What was found at reversals.

    Attributes:
        found: effects, in the order in which they were found; ``share`` is the part of the squared error at the
            reversals of the joint that gains most.
        outcome: all effects, fitted together; reversals are among its rows.
        evidence: the run with reversals among the rows.
        before, after: (n,) held-out RMS error at reversals without these effects and with them, N·m (N); NaN for
            joints without reversals.
    """

    found: list[Found]
    outcome: Outcome
    evidence: Evidence
    before: Array
    after: Array


def judge_reversals(
    evidence: Evidence, outcome: Outcome, kept: Mask, progress: Progress
) -> AtReversals | None:
    """Search for what the effects found so far leave at reversals; None if nothing plain is there.

    Args:
        evidence: the run as the search has seen it.
        outcome: what the search has found.
        kept: (N, n) samples that may count: not those of contacts, nor of joints that nothing may be named on.
    """
    samples = evidence.samples
    turns = passing(_as_in_training(evidence)) & kept & independent_rows(samples)[:, None]
    turns &= ~(_never_seen(evidence) | _remembering(evidence, outcome))
    own = evidence.only(evidence.rows | turns)
    judged = at_reversals(samples, turns, own.rows & kept)
    start = known = Known.of(own, outcome.after.effects, outcome.after.shapes)
    view = _View.of(own, start.fit, judged)
    found: list[Found] = []
    gains = _Gains({}, {}, set())
    changed = set(view.suspects(start.fit))
    while changed and len(found) < 2 * samples.motion.joints:
        for effect in _concerned(evidence.model.arm, changed, known.fit):
            of_joints = view.gains(known.fit, known.trial(effect))
            gains.take(effect, _news(evidence.model.friction, effect, of_joints))
        best = _of_the_record(view, known, evidence.model.arm, gains) or gains.best()
        if best is None:
            break
        trial = known.trial(best.effect)
        if trial is None:
            # beside what was found since it was asked it is none
            gains.take(best.effect, {})
            changed = set(best.effect.indices)
            continue
        found.append(replace(best, shape=trial.shapes[-1]))
        progress(f"found {best.effect.label()}: removes {best.share:.0%} of the error at its reversals")
        changed = set(best.effect.indices or view.suspects(known.fit))
        known = replace(known, fit=trial)
        gains.forget(best.effect, changed)
    if not found:
        return None
    after = Known.of(own, known.fit.effects, known.fit.shapes).fit
    every = Outcome([*outcome.found, *found], Known.of(own).fit, after, outcome.masked)
    whole = clear(own, every, settled=len(outcome.found), alike=True)
    found = whole.found[len(outcome.found) :]
    if not found:
        return None
    before, left = (np.sqrt(view.mean_squares(fit)) * own.scale for fit in (start.fit, whole.after))
    return AtReversals(found, whole, own, before, left)


def _as_in_training(evidence: Evidence) -> Samples:
    """The run with dead zones no narrower than those of the training logs, which may have been noisier.

    What turns round so slowly was at rest by those, and how the model errs there, nobody knows.
    """
    samples, noise = evidence.samples, evidence.model.history.get("velocity_noise")
    if noise is None or samples.cutoff_hz <= 0:
        return samples
    how = evidence.model.conditioning
    still = np.abs(samples.motion.v) <= how.dead_zone * np.asarray(noise)
    smeared = widened(still, samples.motion, round(how.smear / (samples.cutoff_hz * samples.period)))
    return replace(samples, moving=samples.moving & ~smeared)


def _never_seen(evidence: Evidence) -> Mask:
    """(n,) joints that turned round nowhere in the training logs: how the model errs there, nobody knows."""
    left = evidence.model.baseline.get("reversals")
    return np.array([x is None for x in left]) if left else np.zeros(evidence.rows.shape[1], dtype=bool)


def _remembering(evidence: Evidence, outcome: Outcome) -> Mask:
    """(n,) joints in which dry friction was found, and whose friction has memory in the model: so has what was added."""
    remembering, friction = np.zeros(evidence.rows.shape[1], dtype=bool), evidence.model.friction
    for one in outcome.added():
        law = one.placed() if one.effect.rubs else None
        if law is not None and any(t.element.dry and t.element.way != "memory" for t in law.terms):
            remembering[law.along.joint] = friction.remembers(law.along.joint)
    return remembering


def _news(friction: FrictionLaw, effect: Effect, gains: dict[int, _Gain]) -> dict[int, _Gain]:
    """What an effect gains but for memory of a joint whose friction has some, where the model always lacked so much.

    What that memory lacks of its shape is no effect of its own.
    """
    if not (effect.rubs and effect.memory and friction.remembers(effect.index)):
        return gains
    return {j: gain for j, gain in gains.items() if not gain.always}


def _concerned(arm: Arm, joints: set[int], current: Fit) -> list[Effect]:
    """Effects in some joints that were not found yet.

    A sensor's fault, a load or a tilt is there while a joint slides, too, where the search has asked for it.
    """
    taken = {effect.place for effect in current.effects}
    return [
        e
        for e in hypotheses(arm)
        if e.place not in taken and not e.sensor and not joints.isdisjoint(e.indices)
    ]


def _of_the_record(view: _View, known: Known, arm: Arm, gains: _Gains) -> Found | None:
    """A fault of the whole record, such as a delay; None if there is none.

    At most joints, two at the least, more is left than the model always leaves, and it removes more than half of that and as
    much as any effect in one of them does. Where the joints slide it does no harm.
    """
    current, taken = known.fit, {effect.place for effect in known.fit.effects}
    errors = np.nan_to_num(view.mean_squares(current))
    for effect in (e for e in hypotheses(arm) if e.sensor and not e.indices and e.place not in taken):
        trial = known.trial(effect)
        if trial is None or view.sliding(trial) > (1 + NEARLY) * view.sliding(current):
            continue
        of_joints = view.gains(current, trial)
        told = [
            j
            for j, gain in of_joints.items()
            if errors[j] > view.usual[j]
            and gain.news > MOSTLY
            and gain.share >= max(gains.most(j) - ALIKE, TINY)
        ]
        if len(told) < 2 or 2 * len(told) <= len(view.joints):
            continue
        if _positive(np.concatenate([of_joints[j].ratios for j in told])):
            return Found(effect, Shape.fixed(0.0), max(of_joints[j].share for j in told))
    return None


@dataclass(frozen=True, eq=False)
class _View:
    """The rows at reversals of stacked rows (R,), and per joint (n,) the least mean square that is noticeable, and the one
    that the model leaves at the reversals of its training logs; zero where nobody knows it.
    """

    rows: Mask
    joint: Index
    block: Index
    noticeable: Array
    usual: Array

    @staticmethod
    def of(evidence: Evidence, fit: Fit, judged: Mask) -> _View:
        samples, rows = evidence.samples, evidence.rows
        torque = np.sqrt(np.sum(samples.tau**2, axis=0, where=rows) / np.maximum(rows.sum(axis=0), 1))
        left = filled(evidence.model.baseline.get("reversals"), len(torque), 0.0)
        noticeable, usual = ((x / evidence.scale) ** 2 for x in (NOTICEABLE * torque, left))
        return _View(judged[rows], fit.stacked.joint, fit.stacked.block, noticeable, usual)

    def mean_squares(self, fit: Fit) -> Array:
        """(n,) mean held-out squared error at reversals, weighted; NaN where there is none."""
        return mean_by_joint(self.joint[self.rows], fit.stacked.joints, fit.held_out[self.rows] ** 2)

    def sliding(self, fit: Fit) -> float:
        """Sum of the held-out squared errors, weighted, of all other rows."""
        return float((fit.held_out[~self.rows] ** 2).sum())

    def suspects(self, current: Fit) -> list[int]:
        """Joints (0-based) with enough reversals and an error there that an effect could noticeably lower."""
        errors = np.nan_to_num(self.mean_squares(current))
        return [j for j in np.flatnonzero(errors > self.noticeable).tolist() if j in self.joints]

    @cached_property
    def joints(self) -> list[int]:
        """Joints (0-based) with enough reversals."""
        turns = [len(np.unique(self.block[self.rows & (self.joint == j)])) for j in range(len(self.usual))]
        return [j for j, count in enumerate(turns) if count >= _FEWEST]

    def gains(self, current: Fit, trial: Fit | None) -> dict[int, _Gain]:
        """Per suspect joint what a trial gains at its reversals; nothing if the run as a whole does not gain."""
        if trial is None or (trial.held_out**2).sum() >= (current.held_out**2).sum():
            return {}
        return {j: self._gain(current, trial, j) for j in self.suspects(current)}

    def _gain(self, current: Fit, trial: Fit, j: int) -> _Gain:
        mine = self.rows & (self.joint == j)
        before, after = current.held_out[mine] ** 2, trial.held_out[mine] ** 2
        gain = float(before.sum() - after.sum())
        least = max(self.noticeable[j], TINY)
        sums = [block_sums(x + least, self.block[mine]) for x in (before, after)]
        noticeable, usual = (x * mine.sum() for x in (self.noticeable[j], self.usual[j]))
        share = gain / float(before.sum()) if gain >= noticeable else 0.0
        always, news = bool(MOSTLY * gain <= usual), gain / max(usual, TINY)
        return _Gain(share, np.log(sums[0] / sums[1]), always, news)


@dataclass(frozen=True, eq=False)
class _Gain:
    """Part of a joint's squared error at reversals that is removed, zero if hardly anything; log ratio per block; whether
    the model leaves most of it at those of its training logs, too; what is removed in parts of what it leaves there.
    """

    share: float
    ratios: Array
    always: bool = False
    news: float = 0.0


@dataclass(frozen=True, eq=False)
class _Gains:
    """What every effect gains at the suspects, what each kind gains at its own joints, and the kinds found."""

    by_effect: dict[Effect, dict[int, _Gain]]
    by_kind: dict[str, dict[int, _Gain]]
    found: set[str]

    def take(self, effect: Effect, gains: dict[int, _Gain]) -> None:
        """Note what an effect gains."""
        self.by_effect[effect] = gains
        if effect.joint is not None and not effect.pair_wise and effect.joint - 1 in gains:
            self.by_kind.setdefault(effect.name, {})[effect.joint - 1] = gains[effect.joint - 1]

    def forget(self, found: Effect, joints: set[int]) -> None:
        """Drop the effect that was found, and what depends on joints (0-based) where something was found."""
        self.found.add(found.name)
        for effect in list(self.by_effect):
            own = effect.indices
            if effect.place == found.place or not own or not joints.isdisjoint(own):
                del self.by_effect[effect]

    def _sure(self, effect: Effect, j: int) -> bool:
        """Whether it is no chance: at this joint alone, or at all suspects if each has an effect of this kind.

        Drives of an arm are alike; few reversals of one joint tell little.
        """
        alone = self.by_effect[effect][j].ratios
        alike = [gain.ratios for gain in self.by_kind.get(effect.name, {}).values()]
        return _positive(alone) or (len(alike) > 1 and _positive(np.concatenate(alike)))

    def most(self, j: int) -> float:
        """The largest part of the squared error at a joint's (0-based) reversals that an effect removes."""
        return max((own[j].share for own in self.by_effect.values() if j in own), default=0.0)

    def best(self) -> Found | None:
        """The effect that removes most at some joint, the simplest of equals; None if none is worth naming."""
        shares = {}
        for effect, own in self.by_effect.items():
            least = MOSTLY if effect.name in self.found else PLAIN
            shares[effect] = {
                j: g.share for j, g in own.items() if g.share >= least and self._sure(effect, j)
            }
        most = [(share, j) for own in shares.values() for j, share in own.items()]
        if not most:
            return None
        largest, joint = max(most)
        there = {effect: own[joint] for effect, own in shares.items() if joint in own}
        equals = [effect for effect, share in there.items() if share >= largest - ALIKE]
        best = min(equals, key=lambda effect: (effect.complexity, -there[effect]))
        enough = _ALTERNATIVE * there[best]
        rivals = [(e, share) for e, share in there.items() if e is not best and share >= enough]
        # of what acts while a joint slides as well, how much is left where joints turn round says nothing of the past
        always = best.rubs and self.by_effect[best][joint].always
        return Found(best, Shape.fixed(0.0), there[best], rivals, always)


def _positive(ratios: Array) -> bool:
    """Whether the mean of few values is positive by more than chance."""
    error = float(ratios.std(ddof=1)) / np.sqrt(len(ratios))
    return bool(ratios.mean() > t.isf(_CHANCE, len(ratios) - 1) * error)
