"""A residual that no listed effect explains: is it real, where is it, and what is its law?

The law is sought with the sparse machinery among waves of the angles and their sums, velocities, their products
and directions, and reported only if both halves of the run choose it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armloop.blocks import block_sums
from armloop.diagnosis.evidence import FOLDS, Evidence
from armloop.diagnosis.fit import Fit
from armloop.library.angle_sums import AngleSums
from armloop.motion import Motion
from armloop.progress import Progress
from armloop.regression.moments import Moments, total
from armloop.regression.sparse import Sparse

Array = NDArray[np.float64]

#: A residual is real if it is this many times what the model leaves on the worst tenth of its baseline, and exceeds
#: that by three standard errors.
EXCESS = 2.0
#: Less than this part of the energy that effects removed from a joint is what they leave because a law is never met
#: exactly, and no further effect.
REMAINDER = 0.03
_MOST_TERMS = 4
_MOST_CANDIDATES = 1500


@dataclass(frozen=True)
class Unlisted:
    """A real residual: its joint, how large it is, and its law (empty if none is stable over the blocks)."""

    joint: int
    rmse: float
    baseline: float
    form: str
    rmse_with_form: float

    def to_dict(self) -> dict[str, Any]:
        """Entry of ``diagnosis.json``."""
        return {
            "effect": "unlisted",
            "joint": self.joint,
            "form": self.form,
            "parameters": {},
            "rmse": {"residual": self.rmse, "with_form": self.rmse_with_form, "baseline": self.baseline},
            "alternatives": [],
        }


def find_law(evidence: Evidence, before: Fit, after: Fit, progress: Progress) -> Unlisted | None:
    """The largest residual left, if it is real, and its law; None if the run looks like the baseline.

    Args:
        before, after: fits without and with the effects found.
    """
    n = evidence.samples.motion.joints
    ratios = np.zeros(n)
    for j in range(n):
        mine = after.stacked.joint == j
        if mine.sum() < 50:
            continue
        error = after.held_out[mine] ** 2
        if error.sum() < REMAINDER * float((before.held_out[mine] ** 2).sum()):
            continue
        sums = block_sums(error - EXCESS**2 * evidence.variation[j], after.stacked.block[mine])
        if sums.sum() > 3 * np.sqrt(len(sums)) * sums.std(ddof=1):
            ratios[j] = np.sqrt(error.mean())
    if not ratios.any():
        return None
    j = int(np.argmax(ratios))
    progress(f"joint {j + 1}: a residual of {ratios[j]:.1f} times the baseline is left; searching its law")
    scale = float(evidence.scale[j])
    form, left = _law(evidence, after, j)
    return Unlisted(j + 1, float(ratios[j]) * scale, scale, form, left * scale)


def _law(evidence: Evidence, after: Fit, j: int) -> tuple[str, float]:
    mine = after.stacked.joint == j
    y = after.held_out[mine]
    rows = np.flatnonzero(evidence.rows[:, j])
    motion = evidence.samples.motion
    moving = Motion(motion.time[rows], motion.q[rows], motion.v[rows], motion.vdot[rows], np.array([0]))
    revolute = tuple(bool(r) for r in evidence.model.arm.revolute)
    libraries = [AngleSums(revolute, N1, 2, "velocity") for N1 in (3, 2, 1)]
    library = next((each for each in libraries if each.size <= _MOST_CANDIDATES), libraries[-1])
    X, direction = library.columns(moving), np.sign(moving.v[:, [j]])
    X = np.hstack([X, X[:, library.order() <= 1] * direction])
    signed = [
        f"{name}*sign(v{j + 1})"
        for name, order in zip(library.names, library.order(), strict=True)
        if order <= 1
    ]
    names = [*library.names, *signed]
    fold = after.stacked.fold[mine]
    parts = [Moments.of(X[fold == k], y[fold == k]) for k in range(FOLDS)]
    whole, none = total(parts), np.zeros(0, dtype=np.intp)
    sparse = Sparse(max_terms=_MOST_TERMS, correlation=20.0)
    supports = [set(sparse.support(whole - part, none).tolist()) for part in parts]
    stable = sorted(set.intersection(*supports))
    if not stable:
        return "", float(np.sqrt(np.mean(y**2)))
    support = np.array(stable, dtype=np.intp)
    error = np.array(y)
    for k, part in enumerate(parts):
        rest = whole - part
        error[fold == k] -= X[np.ix_(fold == k, support)] @ rest.solve(support)
    if (error**2).sum() > 0.5 * (y**2).sum():
        return "", float(np.sqrt(np.mean(y**2)))
    beta = whole.solve(support) * float(evidence.scale[j])
    form = " ".join(f"{b:+.3g}*{names[t]}" for b, t in zip(beta, support, strict=True)).removeprefix("+")
    return form, float(np.sqrt(np.mean(error**2)))
