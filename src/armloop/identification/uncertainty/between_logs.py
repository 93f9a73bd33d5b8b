"""Random effects of a joint's friction: by how much its dry level and its viscous coefficient differ from log to log.

A drive that warms up, another load of grease: within a log nothing shows it, and so no held-out block and no standard error
does. Of what the model leaves, each log tells a level and a slope along its joint's direction; how far those lie apart, more
than blocks of one log do, is the variance between logs (EM; Laird and Ware, Biometrics 38, 1982). What those of measured
arms show is its prior, worth a few logs: one log tells nothing of it, and friction differs all the same.

Few logs tell the variance of one joint poorly, but the drives of an arm are alike: as parts of each joint's friction all
joints tell one variance together, and that of each is its posterior mean about it, how unlike joints are being chosen by the
marginal likelihood (empirical Bayes; Efron and Morris, J. American Statistical Association 70, 1975). Where logs do not
differ by more than chance it is zero (one-way analysis of variance, of all joints together).

A log that keeps to few speeds, as slow sweeps do, has no say: what a model gets wrong within them has a slope, too, and its
line would be drawn out to speeds at which nobody saw it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.stats import f as f_distribution
from scipy.stats import norm, t

from armloop.data.motion import Motion, Samples
from armloop.data.signals import smooth
from armloop.model import ReconstructedModel
from armloop.util.arrays import TINY, Array, Index, Mask

#: (2, 2) of a joint's dry level, N·m (N), and viscous coefficient, N·m·s/rad (N·s/m).
Covariance = list[list[float]]

#: Where a run begins earlier than the one before it ended, or more than so many s later, another log does.
_PAUSE = 60.0
#: Fewest logs, and blocks with samples of a joint in each, that tell anything of the variance; and of all joints together
#: so many logs beyond the first.
_LOGS, _BLOCKS, _DIFFERENCES = 2, 3, 2
#: How many times as much as that of all joints the variance of one may be: its logarithm is normal, of a mean of one time,
#: with one of these standard deviations.
_TIMES, _UNLIKE = np.exp(np.linspace(-12.0, 4.0, 161)), (0.0, 0.5, 1.0, 2.0, 4.0)
#: So many times as far off, at most, a log's line may be over the speeds of all logs as it is over its own, by the errors
#: of a least-squares line: one determined by few speeds says nothing of others.
_FARTHER = 3.0
#: Probability that logs which do not differ are taken to.
_CHANCE = 0.001
#: What friction is expected to differ by, one standard deviation, dry and viscous, as parts of it: what eight logs of a
#: UR10e tell; those of a UR5 tell three to five times as much. It counts as much as so many logs that differ from another.
USUAL, _WORTH = (0.005, 0.011), 2.0
_ITERATIONS = 200
#: Degrees of freedom, at most, of the distribution of logs: its tails are heavy, however many logs tell its variance.
_TAILS = 3.0


@dataclass(frozen=True, eq=False)
class _Lines:
    """What each of G logs tells of a joint.

    Attributes:
        b: (G, 2) dry level and viscous coefficient, as parts of the joint's friction.
        S: (G, 2, 2) their covariances by the blocks of all logs.
        freedom: of these.
    """

    b: Array
    S: Array
    freedom: int


def log_numbers(motion: Motion) -> Index:
    """(N,) number of the log that each sample lies in, by the clocks of the runs."""
    runs = list(motion.runs())
    gaps = [motion.time[late.start] - motion.time[early.stop - 1] for early, late in pairwise(runs)]
    numbers = np.cumsum([0, *(gap <= 0 or gap > _PAUSE for gap in gaps)])
    return np.repeat(numbers, [run.stop - run.start for run in runs]).astype(np.intp)


class Between(NamedTuple):
    """How friction differs from log to log.

    Attributes:
        covariances: per joint that of its friction in one more log; None of one without friction, and of logs alike.
        known: ``"assumed"`` where too few logs tell of it, ``"alike"`` where they differ by no more than chance, or
            ``"different"``.
        freedom: degrees of freedom that these covariances have, what is expected of them included.
    """

    covariances: list[Covariance | None]
    known: str
    freedom: float


def between_logs(residual: Array, rows: Mask, motion: Motion, blocks: Index, friction: Array) -> Between:
    """The variance of each joint's friction in one more log, beside the mean of those that were seen.

    Args:
        residual: (N, n) what the model leaves, N·m (N).
        rows: (N, n) samples in which a joint slides.
        blocks: (N,) block of each sample, longer than the residual remembers.
        friction: (n,) the friction of each joint, RMS while it slides, N·m (N).
    """
    logs = log_numbers(motion)
    units = [_units(motion.v[mine, j], float(friction[j])) for j, mine in enumerate(rows.T)]
    lines = [
        _lines(residual[mine, j], motion.v[mine, j], blocks[mine], logs[mine], units[j])
        for j, mine in enumerate(rows.T)
    ]
    told = [each for each in lines if each is not None]
    known, every, freedom = "assumed", np.diag(np.square(USUAL)), sum(len(each.b) - 1 for each in told)
    if freedom >= _DIFFERENCES:
        if _chance(told) > _CHANCE:
            return Between([None] * len(lines), "alike", _WORTH + freedom)
        known, every = "different", _variance(told)
    # one joint is unlike no other
    times = iter(_times(told, every) if len(told) > 1 else np.ones(len(told)))
    found: list[Covariance | None] = []
    for each, own in zip(lines, units, strict=True):
        seen = len(np.unique(logs)) if each is None else len(each.b)
        T = every * (1 if each is None else next(times)) * (1 + 1 / seen) * np.outer(own, own)
        found.append([[float(x) for x in row] for row in T] if own.all() else None)
    return Between(found, known, _WORTH + freedom)


def _lines(left: Array, v: Array, blocks: Index, logs: Index, units: Array) -> _Lines | None:
    """What each log tells of a joint; None of fewer than two, or where there is no friction to compare with.

    Args:
        units: (2,) N·m (N) and N·m·s/rad (N·s/m) that are one part of its friction.
    """
    found, inverses, counts, scores = [], [], [], []
    for log in np.unique(logs):
        own = logs == log
        _, block = np.unique(blocks[own], return_inverse=True)
        count = int(block.max()) + 1
        if count < _BLOCKS or _farther(v[own], v) > _FARTHER:
            continue
        X = np.column_stack([np.sign(v[own]), v[own]]) * units
        G = np.linalg.pinv(X.T @ X)
        b = G @ X.T @ left[own]
        rest = X * (left[own] - X @ b)[:, None]
        # the sums over a log's blocks add to nothing: its own line was fitted to them
        scores.append(
            np.stack([np.bincount(block, weights=x) for x in rest.T], axis=1) * np.sqrt(count / (count - 1))
        )
        found.append(b)
        inverses.append(G)
        counts.append((count, len(left[own])))
    if len(found) < _LOGS or not units.all():
        return None
    # noise is alike in all logs: each has too few blocks to tell its own
    whole = np.concatenate(scores)
    noise = whole.T @ whole / sum(n for _, n in counts)
    S = [n * G @ noise @ G for G, (_, n) in zip(inverses, counts, strict=True)]
    return _Lines(np.array(found), np.array(S), sum(count - 1 for count, _ in counts))


def _chance(told: Sequence[_Lines]) -> float:
    """Probability that logs which do not differ tell as different lines, by all joints together (analysis of variance)."""
    apart = [(_apart(each.b, each.S), each) for each in told]
    Q = sum(float(np.einsum("gi,gij,gj->", d, precise, d)) for (d, precise), _ in apart)
    freedom, noise = (sum(x) for x in zip(*((2 * (len(e.b) - 1), e.freedom) for _, e in apart), strict=True))
    return float(f_distribution.sf(Q / freedom, freedom, noise))


def _variance(told: Sequence[_Lines]) -> Array:
    """(2, 2) variance between logs of several joints together, as parts of their friction: the likeliest a posteriori."""
    logs = _WORTH + sum(len(each.b) for each in told)
    # the model was fitted to the logs themselves: their mean is theirs
    free = (logs - len(told)) / logs
    prior = T = np.diag(np.square(USUAL)) * free
    for _ in range(_ITERATIONS):
        total = _WORTH * prior
        for each in told:
            d, precise = _apart(each.b, T + each.S)
            gain = T @ precise
            m = np.einsum("gij,gj->gi", gain, d)
            total = total + m.T @ m + np.sum(T - gain @ T, axis=0)
        T = total / logs
    return np.asarray(0.5 * (T + T.T) / free)


def _times(told: Sequence[_Lines], every: Array) -> Array:
    """(J,) how many times the variance of all joints that of each is: its posterior mean."""
    likely = np.array([[_log_likelihood(each, times * every) for times in _TIMES] for each in told])
    likely = np.exp(likely - likely.max(axis=1, keepdims=True))
    best, found = -np.inf, np.ones(len(told))
    for unlike in _UNLIKE:
        off = np.log(_TIMES) + 0.5 * unlike**2
        prior = np.exp(-0.5 * (off / unlike) ** 2) if unlike else (np.abs(off) < 1e-9).astype(float)
        weights = likely * prior / prior.sum()
        evidence = float(np.log(np.maximum(weights.sum(axis=1), TINY)).sum())
        if evidence > best:
            best, found = evidence, weights @ _TIMES / np.maximum(weights.sum(axis=1), TINY)
    return np.asarray(found)


def _log_likelihood(own: _Lines, T: Array) -> float:
    """Log likelihood of a joint's lines but for a constant, their mean being unknown (REML; Patterson and Thompson 1971)."""
    d, precise = _apart(own.b, T + own.S)
    sizes = np.linalg.slogdet(precise)[1].sum() - np.linalg.slogdet(precise.sum(axis=0))[1]
    return 0.5 * float(sizes - np.einsum("gi,gij,gj->", d, precise, d))


def _units(v: Array, friction: float) -> Array:
    """(2,) dry level and viscous coefficient that are one part of a joint's friction; none of one that does not slide."""
    return friction / np.array([1.0, float(np.sqrt(np.mean(v**2)))]) if len(v) and v.any() else np.zeros(2)


def _farther(own: Array, v: Array) -> float:
    """How many times as far off a line through one log's speeds (M,) is over those of all (N,), as root mean square.

    By the mean variance of the line's value, 1 + (speed - mean)² / variance in units of the noise's over the samples.
    """
    mine, every = np.abs(own), np.abs(v)
    spread = np.mean((every - mine.mean()) ** 2) / max(float(mine.var()), TINY)
    return float(np.sqrt(0.5 * (1.0 + spread)))


def _apart(b: Array, covariance: Array) -> tuple[Array, Array]:
    """(G, 2) how far each of G estimates lies from their weighted mean, and (G, 2, 2) their precisions."""
    precise = np.linalg.pinv(covariance)
    mean = np.linalg.pinv(precise.sum(axis=0)) @ np.einsum("gij,gj->i", precise, b)
    return np.asarray(b - mean), np.asarray(precise)


def friction_spread(model: ReconstructedModel, samples: Samples) -> Array:
    """(N, n, 2) torque of two independent errors of friction, one standard deviation between logs each.

    The drives of an arm warm up together: it is one error that all joints share, each in its direction in which friction
    grows.
    """
    columns, roots = friction_directions(model, samples)
    return np.asarray(np.einsum("njk,jkl->njl", columns, roots))


def friction_directions(model: ReconstructedModel, samples: Samples) -> tuple[Array, Array]:
    """(N, n, 2) sign of the speed and speed, through the samples' filter, and (n, 2, 2) roots of what friction differs by.

    A root times its transpose is the covariance of a joint's dry level and viscous coefficient. What few logs tell of a
    variance is less than it may be, and a cold morning is none of many alike: three of these standard deviations are
    exceeded as rarely as three of a normal variable (Student's t).
    """
    v = samples.motion.v
    roots = np.zeros((v.shape[1], 2, 2))
    kept = model.uncertainty.get("between_logs") or []
    known = model.uncertainty.get("between_logs_known", "different") != "assumed"
    freedom = min(model.uncertainty.get("between_logs_freedom") or np.inf, _TAILS)
    wider = float(t.isf(norm.sf(3.0), freedom)) / 3.0 if known else 1.0
    for j, T in enumerate(kept):
        if T is not None:
            values, vectors = np.linalg.eigh(np.array(T))
            vectors *= wider * np.where([1.0, np.mean(np.abs(v[:, j]))] @ vectors < 0, -1.0, 1.0)
            roots[j] = vectors * np.sqrt(np.maximum(values, 0.0))
    signs = np.stack([np.sign(v), v], axis=2)
    return smooth(samples, signs) if roots.any() else signs, roots


def usual_in_words() -> str:
    """What friction is taken to differ by where the logs do not tell, in words."""
    dry, viscous = USUAL
    return f"{dry:.1%} (dry) and {viscous:.1%} (viscous)"


def notes(model: ReconstructedModel) -> list[str]:
    """A line on each joint whose friction differs from log to log, or one on what is taken for granted of it."""
    if model.uncertainty.get("between_logs_known") == "assumed":
        return [
            "too few logs to tell by how much friction differs from one to the next, as where drives warm up: taken to be "
            f"{usual_in_words()} of it, as on a measured arm; what a later run shows of it is weighed by that"
        ]
    found = []
    for j, T in enumerate(model.uncertainty.get("between_logs") or []):
        if T is not None:
            joint = model.arm.joints[j]
            unit = model.torque_units[j]
            slope_unit = f"{unit}*s/{joint.position_unit}"
            level, slope = np.sqrt(np.maximum(np.diag(T), 0.0))
            found.append(
                f"joint {j + 1}: friction differs between the logs by more than chance, by a standard deviation of "
                f"{level:.2g} {unit} (dry) and {slope:.2g} {slope_unit} (viscous), as where a drive warms up, or "
                "where its law is not quite the model's and logs differ in speed: what a later run shows is weighed by that"
            )
    return found
