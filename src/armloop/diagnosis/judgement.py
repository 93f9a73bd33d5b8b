"""Judging trials: is an effect worth it, and does one do worse than another?"""

from __future__ import annotations

import numpy as np
from scipy.stats import norm
from scipy.stats import t as student

from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.score import Score
from armloop.laws.effects import Effect
from armloop.util.arrays import Array, Mask

#: What is no chance: so many standard errors. An effect must lower the held-out error by as many (over blocks), and,
#: over its joints together, by the energy that the model leaves on the worst tenth of its own baseline: a run may be all
#: of such motion, and a law that fits a model's shortcomings is easily found. It may be less where the model is known to
#: have hardly any that look like this effect.
SIGNIFICANCE = 3.0
#: What is behind by no more than this many standard errors is as good …
CHANCE = 2.0
#: … or on every joint by no more than this part of the baseline's energy, or of what the best removes there: no law is
#: met exactly, and a richer one soaks up both.
ALIKE, NEARLY = 0.4, 0.003
#: Of hypotheses with less freedom and with more, the former is it if the latter explains no more than so much more.
FREEDOM = 0.05
#: What removes at least this part of what another does removes most of it.
MOST = 0.75
#: So many times the baseline is no baseline any more.
MULTIPLE = 2.0
#: More than this part of anything is most of it, and this part is nearly all.
MOSTLY, NEARLY_ALL = 0.5, 0.8
#: Less than this part of a torque, or of a force, is not noticed beside the rest of it.
NOTICEABLE = 0.03


def gain(current: Score, trial: Score) -> float:
    """How much held-out squared error, weighted, a trial removes."""
    return current.error - trial.error


def is_worth(
    evidence: Evidence, current: Score, trial: Score, joints: int = 1, effect: Effect | None = None
) -> bool:
    """Whether the gain is significant over blocks and larger than the model's own shortcomings of so many joints, or than
    what of these looks like the effect.

    A law that ties joints together may take what the model gets wrong of any of them.
    """
    if gain(current, trial) <= 0 or lead(current, trial) <= SIGNIFICANCE:
        return False
    if times_enough(evidence, current, trial) > joints:
        return True
    return effect is not None and exceeds_null(evidence, current, trial, effect)


def exceeds_null(evidence: Evidence, current: Score, trial: Score, effect: Effect) -> bool:
    """Whether an effect removes more than it does of the model's residual on left-out stretches of its training runs.

    Their mean square is known from few: by Student's t of as many degrees of freedom it must be no chance.
    """
    known = evidence.null.get(effect.place)
    if known is None:
        return False
    removed = ((current.energy - trial.energy) / np.maximum(current.rows, 1)).sum()
    usual = (np.asarray(known["removed"]) / evidence.scale**2).sum()
    return bool(removed > student.isf(norm.sf(SIGNIFICANCE), known["stretches"]) ** 2 * usual > 0)


def times_enough(evidence: Evidence, current: Score, trial: Score) -> float:
    """How many times more than the model's own shortcomings a trial removes.

    What a load or a delay changes shows a little on every joint: the joints' parts add up.
    """
    return float(((current.energy - trial.energy) / enough(evidence, current)).sum())


def enough(evidence: Evidence, score: Score) -> Array:
    """(n,) squared error, weighted, of each joint that is more than the model's own shortcomings."""
    return np.asarray(evidence.variation * np.maximum(score.rows, 1))


def much_is_left(score: Score) -> Mask:
    """(n,) joints of which a multiple of the baseline is left."""
    return np.asarray(score.energy >= MULTIPLE**2 * score.rows)


def soaked(current: Score, best: Score) -> Array:
    """(n,) squared error, weighted, of each joint by which what is there may do worse than the best, which soaks up more."""
    return np.maximum(ALIKE * best.rows, NEARLY * (current.energy - best.energy))


def leaves_more(trial: Score, other: Score, least: Array) -> bool:
    """Whether a trial leaves more of some joint, by more than its least (n,), and surely of all that it leaves more of.

    Those joints are judged together, for a law that ties joints may do a little harm to each.
    """
    more = trial.energy - other.energy
    worse = more > 0
    return bool((more > least).any()) and lead(trial.of_joints(worse), other.of_joints(worse)) > SIGNIFICANCE


def lead(worse: Score, better: Score) -> float:
    """By how many standard errors, over blocks, one fit leaves more held-out error than another."""
    blocks = (x.sum(axis=0) for x in (worse.errors, better.errors, worse.counts))
    return max(lead_of(*blocks), _likelier(worse, better))


def lead_of(worse: Array, better: Array, rows: Array) -> float:
    """By how many standard errors one set of blocks' (B,) squared errors exceeds another.

    Of the sum over blocks, or of the sum of each block's part of its own error, whichever is more: where all the
    difference lies in few blocks (friction that fades, a law that bites at speed) its spread over blocks says
    nothing of chance, but how many blocks agree does.
    """
    difference = worse - better
    return max(_standard_errors(difference), _standard_errors(difference / (worse + better + rows)))


def _likelier(worse: Score, better: Score) -> float:
    """Likelihood ratio of two fits' held-out errors as standard errors: sqrt(2 log L).

    They count on top of the baseline's. A law that bites in few blocks, hard, is no chance, though neither the sum's spread
    nor the number of blocks that agree says so.
    """
    own = np.maximum(worse.rows, 1)
    ratio = float((log_likelihood(better, own) - log_likelihood(worse, own)).sum())
    return float(np.sign(ratio) * np.sqrt(2 * abs(ratio)))


def log_likelihood(score: Score, own: Array, most: float = np.inf) -> Array:
    """(n,) log likelihood of each joint's held-out errors, but for a constant of the run.

    They are normal with a variance of each joint's own, and every block of a joint is one observation.

    Args:
        own: (n,) squared error, weighted, on top of which they count: the model's own.
        most: so many observations at most.
    """
    return np.asarray(-0.5 * np.minimum(score.seen, most) * np.log(score.energy + own))


def _standard_errors(differences: Array) -> float:
    """Sum in its standard errors over blocks; of a single block nothing is known of chance."""
    if len(differences) < 2:
        return 0.0
    spread = float(np.sqrt(len(differences)) * differences.std(ddof=1))
    return float(differences.sum()) / max(spread, 1e-12)
