"""Bonferroni screening of what is left unnamed: which law would explain it, where that is too little to be stated.

A law is stated if it removes more than the model leaves on the worst tenth of its own training data. Where that is much, and
mostly noise, smaller changes are plain beside it: over the blocks of the run no chance, though as many laws were asked, and
more than what a regression could predict of what the model leaves there. What a model gets wrong of a motion that it does
not know well may look the same, so it is said, and no verdict.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm
from scipy.stats import t as student

from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.judgement import MOST, SIGNIFICANCE, gain, lead, times_enough
from armloop.diagnosis.outcomes import Found
from armloop.diagnosis.posterior import log_posterior
from armloop.diagnosis.trials import Known
from armloop.laws.effects import Effect, hypotheses
from armloop.util.arrays import TINY, Array


@dataclass(frozen=True)
class Suspected:
    """A law that is no chance in a run, and not stated.

    Attributes:
        joints: those (0-based) at which nothing is named.
        share: part of what is left there beyond the baseline that it explains.
        small: whether that is no more than the model leaves on the worst tenth of its training data.
        errors: by how many of its stated errors it is clear of nothing.
    """

    effect: Effect
    joints: tuple[int, ...]
    share: float
    small: bool
    errors: float


def suspected(evidence: Evidence, found: Sequence[Found], joints: Sequence[int]) -> list[Suspected]:
    """Laws that are the likeliest of joints (0-based) that nothing is named at; none where what they explain is not most of
    what is left there, or may be chance.

    Of several joints a law of all of them is asked, too, and goes first if it is the likeliest: a delay is none of a joint.

    Args:
        found: effects that are stated.
        joints: those of which more is left than the baseline, and predictable.
    """
    there = [f.effect for f in found]
    bare = [j for j in joints if not any(e.joint is not None and j in e.indices for e in there)]
    places = {effect.place for effect in there}
    alone = [e for e in hypotheses(evidence.model.arm) if e.indices in {(j,) for j in bare}]
    tied = [e for e in hypotheses(evidence.model.arm) if e.joint is None and e.place not in places]
    asked = alone + (tied if len(bare) > 1 else [])
    if not asked:
        return []
    known = Known.of(evidence, there, [f.shape for f in found])
    current, n = known.fit.score, len(evidence.scale)
    trials = [(effect, trial) for effect in asked if (trial := known.trial(effect)) is not None]
    blocks = len(np.unique(evidence.blocks))
    surely = float(student.isf(norm.sf(SIGNIFICANCE) / len(asked), max(blocks - 1, 1)))
    least = _shortcomings(evidence)
    said: list[Suspected] = []
    while bare:
        # a law of the whole arm lists no joints
        mine = [(e, trial) for e, trial in trials if e.joint is None or set(e.indices) & set(bare)]
        if not mine:
            break
        effect, trial = max(mine, key=lambda each: log_posterior(evidence, each[1].score, [each[0]]))
        score = trial.score
        of = tuple(j for j in bare if effect.joint is None or j in effect.indices)
        some = np.isin(np.arange(n), of)
        before, after = current.of_joints(some), score.of_joints(some)
        more = gain(before, after) > float((least * current.rows)[some].sum())
        part = gain(before, after) / max(float(np.maximum(before.excess, 0.0).sum()), TINY)
        if more and part >= MOST and lead(before, after) > surely:
            small = times_enough(evidence, current, score) <= 1
            said.append(Suspected(effect, of, min(part, 1.0), small, trial.clear[-1]))
            bare = [j for j in bare if j not in of]
        else:
            trials = [each for each in trials if each[0] is not effect]
    return said


def _shortcomings(evidence: Evidence) -> Array:
    """(n,) squared error, weighted, a row, of each joint that could be predicted of what the model leaves on the worst tenth
    of its training data; all of it where that was not asked."""
    parts = np.ones(len(evidence.scale))
    for j, joint in enumerate(evidence.model.baseline.get("joints") or []):
        left, error, noise = (joint.get(key) for key in ("predictable_left", "std_error", "noise"))
        if None not in (left, error, noise):
            parts[j] = min((left + SIGNIFICANCE * error) / max(left + noise, TINY), 1.0)
    return np.asarray(parts * evidence.variation)
