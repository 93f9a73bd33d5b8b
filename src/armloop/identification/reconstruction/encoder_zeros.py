"""Encoder zeros that differ from log to log: a mixed model with random effects, by expectation maximisation.

An incremental encoder counts from where the arm was put when it was switched on, and a hand, or friction, puts it a
little elsewhere every time. Every log then belongs to an arm whose gravity acts at slightly other angles, which no model
of one arm can follow. Here the zeros are regressed beside base parameters and plain friction, each with a normal prior
whose variance, one a joint, is estimated with them (Laird and Ware, Biometrics 38(4), 1982). They are taken only where
they predict blocks that they were not regressed on, clearly, and neither as many offsets of the torque nor springs of the
joints, which no rigid body is and every log has, predict these clearly better: an arm with absolute encoders keeps its own.
The blocks that judge the model in the end take no part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np

from armloop.data.log import MotionLog
from armloop.data.signals import Conditioning
from armloop.features.rigid_body import BaseParameters
from armloop.features.springs import spring_columns
from armloop.identification.reconstruction.bandwidth import LEAST, Table, table_at
from armloop.identification.reconstruction.projected import RIDGE
from armloop.regression.embedded import ITERATIONS
from armloop.robot.arm import Arm
from armloop.util.arrays import TINY, Array, Index, Mask

#: Fewer logs than this say nothing of how zeros are spread.
FEWEST_LOGS = 3
#: The zeros must leave at most this part of the error that is left without them, on blocks that did not regress them …
_LESS = 0.9
#: … by so many standard errors of the difference over blocks.
_SURE = 3.0
#: The spread that expectation maximisation begins with, rad (m).
_BEGIN = 0.05
#: A joint's zeros are known where the data leave less than this part of their variance open.
_KNOWN = 0.5
#: Half the step of the derivative by q, rad (m).
_STEP = 0.01


@dataclass(frozen=True, eq=False)
class EncoderZeros:
    """What the encoders of each log read too much.

    Attributes:
        zeros: (L, n) per log, rad (m); zero throughout where they do not differ.
        spread: (n,) their standard deviation from log to log; zero where they do not differ.
        errors: mean nRMSE on blocks left out: without zeros, with them, and with offsets of the torque or springs instead.
    """

    zeros: Array
    spread: Array
    errors: dict[str, float] = field(default_factory=dict)

    @property
    def found(self) -> bool:
        """Whether the zeros differ."""
        return bool(self.spread.any())

    def corrected(self, logs: Sequence[MotionLog]) -> list[MotionLog]:
        """The logs as encoders with one zero would have recorded them."""
        pairs = zip(logs, self.zeros, strict=True)
        return [replace(log, q=log.q - zero) if zero.any() else log for log, zero in pairs]

    def to_dict(self, logs: Sequence[MotionLog]) -> dict[str, Any]:
        """What a model keeps of them."""
        each = [{"log": log.name, "zeros": zero.tolist()} for log, zero in zip(logs, self.zeros, strict=True)]
        return {"spread": self.spread.tolist(), "logs": each, "errors": self.errors}

    def notes(self, arm: Arm) -> list[str]:
        """What was found, and against what."""
        if not self.found:
            return []
        spreads = ", ".join(
            f"joint {j + 1} ± {x:.2g} {joint.position_unit}"
            for j, (x, joint) in enumerate(zip(self.spread, arm.joints, strict=True))
            if x
        )
        tried = ", ".join(f"{name} {error:.3f}" for name, error in self.errors.items())
        return [
            f"encoder zeros differ from log to log ({spreads}), as where a zero is set by hand: each log's own was "
            f"regressed; nRMSE on blocks left out: {tried}. Of a new log it is not known before it has been diagnosed"
        ]


def encoder_zeros(
    logs: Sequence[MotionLog], arm: Arm, cutoff_hz: float, aside: Sequence[Array], correlation: float
) -> EncoderZeros:
    """The zeros of each log's encoders, where they differ.

    Args:
        logs: runs of one arm, in memory.
        cutoff_hz: corner of the low-pass.
        aside: per log, (B, 2) intervals that take no part.
        correlation: how long a plain model's residual remembers, s.
    """
    none = EncoderZeros(np.zeros((len(logs), arm.n)), np.zeros(arm.n))
    if len(logs) < FEWEST_LOGS or cutoff_hz <= 0:
        return none
    base = BaseParameters.of_arm(arm, rotors=True)
    table = table_at(list(logs), arm, base, Conditioning(), cutoff_hz, [cutoff_hz], aside)
    if table is None or len(table.motion.starts) < len(logs):
        return none  # a log is too short
    period = table.stride * float(np.median([log.period for log in logs]))
    model = _Mixed.of(table, arm, base, max(1.0, correlation / period))
    left = {name: model.left_out(kind) for name, kind in _KINDS.items()}
    scale, slide = table.sizes(table.tau, table.moving), [j for j, _ in model.judged]
    errors = {
        name: float(np.exp(np.mean(np.log(table.sizes(x, table.moving)[slide] / scale[slide]))))
        for name, x in left.items()
    }
    plain, zeros, *others = left.values()
    less = errors["with zeros"] <= _LESS * errors["without"]
    if not less or not _clearly(model, plain, zeros) or any(_clearly(model, zeros, x) for x in others):
        return none
    found, spread = model.solve("zeros", np.ones(len(table.blocks), dtype=bool))[1:]
    return EncoderZeros(found, spread, errors)


#: What is regressed of each log, or, of springs, of all.
_KINDS = {
    "without": "",
    "with zeros": "zeros",
    "with offsets of the torque instead": "offsets",
    "with springs instead": "springs",
}


def _clearly(model: _Mixed, before: Array, after: Array) -> bool:
    """Whether blocks left out have less error, by several standard errors of the mean."""
    names, block = np.unique(model.table.blocks, return_inverse=True)
    gain = np.zeros(len(names))
    for j, own in model.judged:
        weight = 1 / max(float(np.mean(before[own, j] ** 2)), TINY)
        np.add.at(gain, block[own], weight * (before[own, j] ** 2 - after[own, j] ** 2))
    return bool(gain.mean() > _SURE * gain.std(ddof=1) / np.sqrt(len(gain)))


@dataclass(frozen=True, eq=False)
class _Mixed:
    """Torques at a few instants, with what they change by as a log's encoders read more.

    Attributes:
        slopes: (n, N, n, p) change of the base parameters' columns per rad (m) that encoder k reads too much.
        log: (N,) log of each instant; ``logs`` of them.
        repeats: neighbouring instants that tell no more than one does.
        scale: (n,) what a plain regression leaves of each joint on blocks left out.
        judged: joints with their instants (N,) that slide.
    """

    table: Table
    slopes: Array
    log: Index
    logs: int
    repeats: float
    scale: Array
    judged: list[tuple[int, Mask]]

    @staticmethod
    def of(table: Table, arm: Arm, base: BaseParameters, repeats: float) -> _Mixed:
        motion = table.motion
        slopes = []
        for k in range(arm.n):
            sides = []
            for step in (-_STEP, _STEP):
                q = motion.q.copy()
                q[:, k] += step
                sides.append(base.columns(arm, replace(motion, q=q)))
            slopes.append((sides[0] - sides[1]) / (2 * _STEP))
        log = np.searchsorted(motion.starts, np.arange(motion.samples), side="right").astype(np.intp) - 1
        judged = [(j, own) for j, own in enumerate(table.moving.T) if own.any()]
        sizes = table.sizes(table.tau, table.moving)
        scale = np.where(sizes > 0, sizes, 1.0)
        found = _Mixed(table, np.array(slopes), log, len(motion.starts), repeats, scale, judged)
        for _ in range(2):  # joints weigh by their torques first, then by what is left of them
            sizes = np.maximum(table.sizes(found.left_out(""), table.moving), LEAST)
            found = replace(found, scale=np.where(table.moving.any(axis=0), sizes, scale))
        return found

    def left_out(self, kind: str) -> Array:
        """(N, n) what is left on every other block by what was regressed on the others, both ways round."""
        if kind == "springs":
            q = self.table.motion.q
            # K q − c, of springs of the joints and between any two of them
            each = [spring_columns(q), np.broadcast_to(np.eye(q.shape[1]), (*q.shape, q.shape[1]))]
            columns = np.concatenate([self.table.columns, *each], axis=2)
            return replace(self, table=replace(self.table, columns=columns)).left_out("")
        left = np.zeros_like(self.table.tau)
        odd = (self.table.blocks % 2).astype(bool)
        for judged in (odd, ~odd):
            theta, found, _ = self.solve(kind, ~judged)
            rest = self.table.tau - self.table.columns @ theta
            if kind:
                rest = rest - np.einsum("njk,nk->nj", self._per_log(kind, theta), found[self.log])
            left[judged] = rest[judged]
        return left

    def solve(self, kind: str, used: Mask) -> tuple[Array, Array, Array]:
        """Coefficients (P,), random effects (L, n) of the logs and their spread (n,), from some instants (N,)."""
        n, P = len(self.scale), self.table.columns.shape[2]
        rows = used[:, None] & self.table.moving
        X, y, joint = self.table.weighed(self.table.tau, rows, self.scale)
        instant = np.nonzero(rows.T)[1]
        A, b = X.T @ X, X.T @ y
        ridge = np.diag(RIDGE * np.maximum(np.diag(A), 1e-12))
        theta: Any = np.linalg.solve(A + ridge, b)
        found, spread = np.zeros((self.logs, n)), np.full(n, _BEGIN)
        variances = np.zeros(n)
        if not kind:
            return theta, found, spread
        log = self.log[instant]
        order = np.argsort(log, kind="stable")
        edges = np.searchsorted(log[order], np.arange(self.logs + 1))
        parts = [order[first:end] for first, end in pairwise(edges)]
        for _ in range(ITERATIONS):
            Z = self._per_log(kind, theta)[instant, joint] / self.scale[joint, None]
            G, g = np.zeros((P, P)), np.zeros(P)
            solved = []
            for part in parts:
                inverse = np.linalg.inv(
                    Z[part].T @ Z[part] / self.repeats + np.diag(1 / np.maximum(spread, 1e-9) ** 2)
                )
                cross, own_y = Z[part].T @ X[part] / self.repeats, Z[part].T @ y[part] / self.repeats
                G += cross.T @ inverse @ cross
                g += cross.T @ inverse @ own_y
                solved.append((inverse, cross, own_y))
            theta = np.linalg.solve(A / self.repeats - G + ridge, b / self.repeats - g)
            found = np.array([inverse @ (own_y - cross @ theta) for inverse, cross, own_y in solved])
            variances = np.mean([np.diag(inverse) for inverse, _, _ in solved], axis=0)
            spread = np.sqrt(np.mean(found**2, axis=0) + variances)
        # a joint whose zero no torque feels keeps the variance that it began with
        known = variances < _KNOWN * spread**2
        return theta, np.where(known, found, 0.0), np.where(known, spread, 0.0)

    def _per_log(self, kind: str, theta: Array) -> Array:
        """(N, n, n) change of the torque of joint j per unit of a log's effect k."""
        n = len(self.scale)
        if kind == "offsets":
            return np.broadcast_to(np.eye(n), (len(self.table.tau), n, n))
        p = self.slopes.shape[3]
        return np.moveaxis(self.slopes @ theta[:p], 0, 2)
