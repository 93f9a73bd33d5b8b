"""The quadratic program behind `bounded_feedforward`: deviations from a motion, with torques linear in them (OSQP).

Unknown at K knots, h apart: the deviation d and its derivatives d', d'', and s, the part of the torque that dry friction
takes where its sign is open.

    min  sum |d_k|^2 / L^2 + w |d'_k - d'_k,last|^2 / (L/s)^2 + |(s_k - s0_k) / level_k|^2
    subject to   u_k = offset_k + J_q d_k + J_v d'_k + J_a d''_k + s_k,
                 |u_k| <= limit,  |u_k - s_k| <= reserve_k,  |u_k - u_k-1| <= h rate,
                 |s_k| <= level_k where the sign is open, s_k = s0_k elsewhere,

The second term, of the proximal point algorithm (Rockafellar 1976), lets rounds end whose torques are far from linear in
d', and costs nothing where they do. d'' is linear between knots, so that d is a cubic, and d = d' = 0 at the start.
Solver: Stellato et al., OSQP, 2020.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import osqp
from scipy import sparse

from armloop.util.arrays import Array

_UNIT, _TIME = 0.01, 0.1
"""rad (m), L above, and s: in them deviations and their derivatives are of the size of 1, as torques are in their limits."""
TOLERANCE = 1e-4
"""Of a limit, by which an answer may exceed it."""


@dataclass(frozen=True, eq=False)
class Answer:
    """d : (3, K, n) deviation and its derivatives; torque : (K, n) N*m (N)."""

    d: Array
    torque: Array


@dataclass(frozen=True, eq=False)
class Program:
    """One program of K knots and n joints.

    h : s; offset : (K, n) torque without the deviation and dry friction; J : three of (K, n, n), by d, d', d''
    limit : (n,) N*m (N); rate : (n,) N*m/s (N/s), inf for none
    dry : (K, n), s0; level : (K, n) of friction whose sign is open, 0 elsewhere
    reserve : (K, n), what dry friction leaves of the limit, looked at where its sign is open
    last : (K, n), d' of the round before; near : w, 0 for any d'
    """

    h: float
    offset: Array
    J: list[Array]
    limit: Array
    rate: Array
    dry: Array
    level: Array
    reserve: Array
    last: Array
    near: float

    def solve(self) -> Answer | None:
        """Return the answer, None when no deviation keeps the limits."""
        K, n = self.offset.shape
        size, scale = K * n, np.tile(self.limit, K)
        same = sparse.identity(size, format="csr")
        ahead = sparse.eye_array(size, k=n, format="csr")[:-n]
        now, h = same[:-n], self.h / _TIME
        open_ = np.flatnonzero(self.level.ravel())
        level, reserve = (x.ravel()[open_] / scale[open_] for x in (self.level, self.reserve))
        rubbing = sparse.identity(len(open_), format="csr")
        dry = self.dry.ravel() / scale
        fixed = dry.copy()
        fixed[open_] = 0.0
        known = self.offset.ravel() / scale + fixed
        # columns: d, d', d'' in their units, then s where the sign is open; torques in units of the limits
        units = [_UNIT / _TIME**order for order in range(3)]
        moving = [
            sparse.diags_array(unit / scale) @ sparse.block_diag(list(J), format="csr")
            for unit, J in zip(units, self.J, strict=True)
        ]
        torque = sparse.hstack([*moving, same[:, open_]], format="csr")
        slewing = np.tile(np.isfinite(self.rate), K - 1)
        step = (ahead - now)[slewing]
        slew = np.tile(self.h * self.rate / self.limit, K - 1)[slewing]
        rows = [
            _row(now - ahead, h * now, h**2 * (now / 3 + ahead / 6), open_=len(open_)),
            _row(None, now - ahead, 0.5 * h * (now + ahead), open_=len(open_)),
            _row(same[:n], None, None, open_=len(open_)),
            _row(None, same[:n], None, open_=len(open_)),
            torque,
            _row(*(x[open_] for x in moving), open_=len(open_)),
            step @ torque,
            sparse.hstack([sparse.csr_array((len(open_), 3 * size)), rubbing]),
        ]
        gaps, middle = np.zeros(2 * (size - n) + 2 * n), known[open_]
        low = [gaps, -1 - known, -reserve - middle, -slew - step @ known, -level]
        high = [gaps, 1 - known, reserve - middle, slew - step @ known, level]
        price, near = 1 / level**2, np.full(size, max(self.near, 1e-9))
        solver = osqp.OSQP()
        solver.setup(
            sparse.csc_matrix(
                sparse.diags_array(np.concatenate([np.ones(size), near, np.full(size, 1e-9), price]))
            ),
            np.concatenate(
                [np.zeros(size), -near * self.last.ravel() / units[1], np.zeros(size), -price * dry[open_]]
            ),
            sparse.csc_matrix(sparse.vstack(rows)),
            np.concatenate(low),
            np.concatenate(high),
            verbose=False,
            rho=10.0,  # twice to five times fewer steps than with its default
            eps_abs=TOLERANCE,
            eps_rel=1e-5,
            max_iter=20_000,
            polishing=True,
        )
        answer = solver.solve(raise_error=False)
        if answer.info.status != "solved":
            return None
        x = np.asarray(answer.x)
        u = (torque @ x + known) * scale
        return Answer(x[: 3 * size].reshape(3, K, n) * np.array(units)[:, None, None], u.reshape(K, n))


def _row(*blocks: Any, open_: int) -> Any:
    """Return a row of blocks of d, d', d'', None for zeros, with nothing for the open friction."""
    height, width = next(block.shape for block in blocks if block is not None)
    filled = [sparse.csr_array((height, width)) if block is None else block for block in blocks]
    return sparse.hstack([*filled, sparse.csr_array((height, open_))])
