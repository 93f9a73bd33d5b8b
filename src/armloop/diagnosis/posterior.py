"""Posterior of a set of effects: the likelihood of blocks that were not fitted, and prior odds against every parameter."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.judgement import log_likelihood
from armloop.diagnosis.score import Score
from armloop.laws.effects import Effect, hypotheses

#: Log prior odds against every further parameter of an effect, beside its being one of many hypotheses.
LOG_ODDS = 1.5
#: So many blocks of a joint tell of it at most: what a model gets wrong comes back with the motion, and more of the same
#: motion tells no more of that.
TELLING = 20
#: An effect of which at least this posterior odds are left, beside the one named in its place, is its alternative.
ALTERNATIVE = 0.05


def log_posterior(evidence: Evidence, score: Score, effects: Sequence[Effect]) -> float:
    """Log posterior of a set of effects, but for a constant of the run."""
    return log_prior(evidence, effects) + told(score)


def told(score: Score) -> float:
    """Log likelihood of what is left, on top of what the model leaves on its baseline, but for a constant of the run."""
    return float(log_likelihood(score, np.maximum(score.rows, 1), TELLING).sum())


def log_prior(evidence: Evidence, effects: Sequence[Effect]) -> float:
    """Log prior odds of a set of effects against none."""
    odds = np.log(len(hypotheses(evidence.model.arm)))
    return -float(sum(odds + LOG_ODDS * (effect.complexity - 1) for effect in effects))
