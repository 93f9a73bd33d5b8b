"""Block length of cross-validation: several correlation times of the residual, so that blocks say something new.

A sample that lies next to fitted ones, nearer than the residual's correlation, has half of its error in common with
them; an error on such samples is one on data that were fitted. How long the residual remembers is seen on that of a
plain regression, base parameters with Coulomb and viscous friction, on a part of the samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from armloop.data.blocks import stretch
from armloop.data.motion import Samples
from armloop.data.pieces import LogSource
from armloop.data.signals import Conditioning, ShortRunError, preprocess, smooth
from armloop.features.rigid_body import BaseParameters
from armloop.identification.reconstruction.inner_folds import SHORTEST
from armloop.identification.reconstruction.shared import PLAIN_FRICTION, sticking
from armloop.identification.uncertainty.blocking import correlation_time
from armloop.regression.moments import Moments, total
from armloop.robot.arm import Arm

#: Samples of the plain regression, from so many logs at most.
_SAMPLES, _LOGS = 8000, 16
#: A block's length in distances at which samples do not judge, and the fewest blocks held out.
_LENGTH, FEWEST_BLOCKS = 4.0, 4


@dataclass(frozen=True)
class Blocks:
    """Blocks in which data are held out.

    Attributes:
        seconds: their length at most.
        margin: seconds from their ends within which samples do not judge.
        correlation: the residual's correlation time, s.
    """

    seconds: float
    margin: float
    correlation: float

    def within(self, seconds: float) -> Blocks:
        """The same distances in blocks of another length, as far as they go in."""
        return replace(self, seconds=seconds, margin=min(self.margin, seconds / _LENGTH))

    @property
    def too_short(self) -> bool:
        """Whether the data are too short for blocks that say something new."""
        return self.margin < self.correlation

    def notes(self) -> list[str]:
        """What the user should know of them."""
        if not self.too_short:
            return []
        return [
            f"the residual remembers for {self.correlation:.2g} s, and the logs are too short for held-out blocks of more "
            f"than {self.seconds:.2g} s: the held-out error may be too good"
        ]


def independent_blocks(
    arm: Arm, logs: Sequence[LogSource], how: Conditioning, seconds: float, folds: int
) -> Blocks:
    """Blocks at least ``seconds`` long, longer where the residual remembers for longer, if the data are long enough.

    Args:
        logs: read anew, a few of them where there are many, so that the answer is the same wherever they are kept.
        folds: every so many blocks one is held out.
    """
    if how.cutoff_hz <= 0:
        return Blocks(seconds, 0.0, 0.0)
    some = [logs[k] for k in np.unique(np.linspace(0, len(logs) - 1, _LOGS).astype(int))]
    parts, covered = [], 0.0
    for log in some:
        try:
            samples = preprocess([log.read()], how)
        except ShortRunError:
            continue
        covered += samples.motion.samples * samples.period
        parts.append(_middle(samples, _SAMPLES // len(some)))
    if not parts:
        return Blocks(seconds, how.reach, 0.0)
    covered *= len(logs) / len(some)
    correlation = _correlation(arm, parts)
    margin = max(how.reach, correlation)
    longest = max(covered / (folds * FEWEST_BLOCKS), SHORTEST / how.cutoff_hz)
    length = min(max(seconds, _LENGTH * margin), longest)
    return Blocks(length, min(margin, length / _LENGTH), correlation)


def _correlation(arm: Arm, parts: Sequence[Samples]) -> float:
    """The longest correlation time of the joints' residuals, s."""
    base, period = BaseParameters.of_arm(arm, rotors=True), parts[0].period
    columns = [smooth(part, base.columns(arm, part.motion)) for part in parts]
    times = []
    for j in range(arm.n):
        problems = []
        for part, shared in zip(parts, columns, strict=True):
            own = [term.column(part.motion, j) for term in PLAIN_FRICTION]
            X = np.hstack([shared[:, j], smooth(part, np.column_stack(own))])
            problems.append((part, X, np.abs(part.motion.v[:, j]) > sticking(part)[j]))
        fit = total(Moments.of(X[rows], part.tau[rows, j]) for part, X, rows in problems)
        if fit.count < 10 * len(fit.b):
            continue
        beta = fit.solve()
        found = [
            correlation_time(part.tau[:, j] - X @ beta, rows, part.motion, period)
            for part, X, rows in problems
            if rows.sum() > 100
        ]
        times.append(float(np.median(found)) if found else period)
    return max(times, default=period)


def _middle(samples: Samples, length: int) -> Samples:
    """The middle of a motion, so many samples."""
    N = samples.motion.samples
    first = max(0, (N - length) // 2)
    return stretch(samples, first, min(N, first + length))
