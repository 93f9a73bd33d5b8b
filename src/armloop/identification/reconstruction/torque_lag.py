"""Dead time between the torque and the motion of a log: a nuisance parameter, by meta-analysis over the joints.

Controllers record what they command, or what a drive reports some cycles later, beside the position of another instant.
What of it looks like friction and inertia goes into those, until friction drives and M(q) is not positive definite. Here
the torques are regressed on rigid bodies and friction with memory beside their rates, each joint with a lag of its own
(Gauss-Newton steps). A record has one lag, a law that the regression lacks another at every joint: the lag is taken where
the joints agree, by the Bayes factor of a mean of effects that differ by more than their standard errors say, with heavy
tails, for one joint in six may lack much (Baker and Jackson, Statistical Methods in Medical Research 17, 2008). The blocks
that judge the model in the end take no part.

A stiff controller answers to the noise of a coarse encoder, which then is in the torque as well as in the columns, and least
squares take what it makes of one for a lag, or hide one. The same columns of a smoother motion, in which that noise is not,
are instruments: where these contradict least squares (Hausman, Econometrica 46, 1978), they are believed (Janot, Vandanjon
and Gautier, IEEE Transactions on Control Systems Technology 22, 2014). Ripples of the gears are such a noise, too, which the
controller answers to; and where friction has a memory, or falls, as none of the laws here does, that is a lag. Once they are
known they are regressed with the rest.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from scipy.stats import norm
from scipy.stats import t as student

from armloop.data.blocks import block_numbers, block_sums, stretch
from armloop.data.log import MotionLog
from armloop.data.motion import Samples
from armloop.data.pieces import LogSource
from armloop.data.signals import (
    FELT,
    Conditioning,
    ShortRunError,
    as_torque,
    independent_rows,
    later,
    preprocess,
    rate_along,
    smooth,
)
from armloop.features.rigid_body import BaseParameters
from armloop.identification.reconstruction.bandwidth import (
    LEAST,
    SLIDES,
    determined_solution,
)
from armloop.identification.reconstruction.design import Design
from armloop.identification.reconstruction.held_out import within
from armloop.identification.reconstruction.shared import FRICTION, sliding_rows
from armloop.identification.reconstruction.systematic_sample import placed_runs
from armloop.laws.friction import FrictionTerm
from armloop.robot.arm import Arm
from armloop.util.arrays import TINY, Array, Index, Mask

#: Odds of a lag against none, Gauss-Newton steps, and fewest samples of a joint.
_ODDS, _ROUNDS, _FEWEST = 20.0, 4, 200
#: Lags that are asked of, s; what one is expected to be, one standard deviation; and by how much what the regression lacks
#: moves those of the joints apart: scales of Student's t of so many degrees of freedom.
_LAGS, _EXPECTED = np.arange(-2000, 2001) * 5e-5, 0.02
_APART, _TAILS = np.geomspace(1e-4, 5e-3, 9), 3.0
#: At two corners it differs by no more standard errors, or by less than this part of it.
_SURE, _ALIKE = 2.0, 0.5
#: Instruments contradict least squares by more of theirs, and the lower corner the higher by more of their difference's.
_CONTRADICTED = 2.0
#: The lower of the two corners, and that of the motion of which instruments are made, are so much lower.
_SLOWER = 2.0
#: Laws whose torque, where a joint turns round, would else be a lag: dry friction that falls with the speed leads.
_FRICTION = (*FRICTION, *(FrictionTerm("stribeck", parameter=speed) for speed in (0.03, 0.1, 0.3)))

#: Kinds of friction that act where a joint turns round, and ask for no load.
_TURNS = ("hysteresis", "smooth_sign", "stribeck", "stribeck_peak")


@dataclass(frozen=True)
class Beside:
    """What is known of an arm beside its masses.

    Attributes:
        ripples: orders of the torque's ripples by their joints (1-based).
        friction: terms of each joint's friction, if they are known.
    """

    ripples: Mapping[int, Sequence[float]] = field(default_factory=dict)
    friction: Sequence[Sequence[FrictionTerm]] = ()

    def terms(self, n: int) -> list[list[FrictionTerm]]:
        """The friction that is regressed at each of n joints: laws that most have, and what is known of its own."""
        usual = {(term.kind, term.parameter) for term in _FRICTION}
        known = self.friction or [()] * n
        return [
            [*_FRICTION, *(t for t in own if t.kind in _TURNS and (t.kind, t.parameter) not in usual)]
            for own in known
        ]


@dataclass(frozen=True, eq=False)
class TorqueLag:
    """By how much a log's torque is later than its motion.

    Attributes:
        seconds: what is taken; 0 where nothing is clear.
        std_error: of the mean over the joints, s.
        joints: (n,) each joint's own, s; NaN where it tells nothing.
        log_odds: of one of all joints against none.
    """

    seconds: float
    std_error: float
    joints: Array
    log_odds: float = -np.inf

    @property
    def clear(self) -> bool:
        """Whether it is one of all joints."""
        return self.log_odds > np.log(_ODDS)

    def to_dict(self) -> dict[str, Any]:
        """What a model keeps of it."""
        own = [float(x) if np.isfinite(x) else None for x in self.joints]
        return {"seconds": self.seconds, "std_error": self.std_error, "joints": own}

    @staticmethod
    def known(seconds: float, n: int) -> TorqueLag:
        """A lag that somebody has stated of a record of n joints."""
        return TorqueLag(seconds, 0.0, np.full(n, np.nan), np.inf)

    def notes(self) -> list[str]:
        """What was found, or stated, and what is done about it."""
        if not self.seconds:
            return []
        way = "later" if self.seconds > 0 else "earlier"
        if not self.std_error:
            return [
                f"the torque is recorded {1e3 * abs(self.seconds):.3g} ms {way} than the motion, as stated: it is moved "
                "back, here and in logs that the model judges"
            ]
        return [
            f"the torque is recorded {1e3 * abs(self.seconds):.2g} ± {1e3 * self.std_error:.1g} ms {way} than the motion, "
            "at all joints alike: the recording, not the arm. It is moved back, here and in logs that the model judges"
        ]


def torque_lag(
    logs: Sequence[LogSource],
    arm: Arm,
    how: Conditioning,
    aside: Sequence[Array],
    block_seconds: float,
    beside: Beside | None = None,
) -> TorqueLag:
    """The lag of the logs' torque.

    A lag is one at all frequencies; what noise of the motion that a controller answers to looks like is none, and is gone
    below half the corner. Where nothing is known of the arm, one that is not plain at the corner itself is not looked for
    below half of it; beside what is known, where a lag has been taken before, either corner may show it.

    Args:
        logs: of which as many samples are looked at as tell a lag, the same wherever they are kept.
        how: filter.
        aside: per log, (B, 2) intervals that take no part.
        block_seconds: length of pieces whose errors are independent.
        beside: what is known of the arm whose logs have a lag that was taken; nothing by default.
    """
    first, beside = beside is None, beside or Beside()
    placed = placed_runs(logs, how.oversampling * how.cutoff_hz)
    some, left_out = [run for _, run in placed], [aside[k] for k, _ in placed]
    found = _found(some, arm, how, left_out, block_seconds, how.cutoff_hz, beside)
    if first and not (found.clear and abs(found.seconds) * how.cutoff_hz >= FELT):
        return replace(found, seconds=0.0)
    # what a joint that sticks shows before it moves is a lead below any corner: it is kept out twice as far
    slower = replace(how, cutoff_hz=how.cutoff_hz / _SLOWER, smear=2 * how.smear)
    # where v is late, it is as late below half the corner: the torque's own lag alone may differ
    slow = _found(some, arm, slower, left_out, block_seconds, how.cutoff_hz, beside)
    return _agreed(found, slow, how.cutoff_hz)


def _agreed(found: TorqueLag, slow: TorqueLag, cutoff_hz: float) -> TorqueLag:
    """The lag that two corners agree on and either shows plainly; that of the lower one where it contradicts the higher.

    An encoder's noise is faster than the motion: what it makes of a lag, or hides of one, is less below the lower corner.
    """
    apart = abs(found.seconds - slow.seconds)
    same = apart <= max(_SURE * float(np.hypot(found.std_error, slow.std_error)), _ALIKE * abs(found.seconds))
    if not same or not (found.clear or slow.clear):
        return replace(found, seconds=0.0)
    # the errors of the two are not independent (Hausman)
    variance = slow.std_error**2 - found.std_error**2
    taken = slow if apart > _CONTRADICTED * np.sqrt(max(variance, 0.0)) else found
    return taken if abs(taken.seconds) * cutoff_hz >= FELT else replace(taken, seconds=0.0)


def _found(
    logs: Sequence[MotionLog],
    arm: Arm,
    how: Conditioning,
    aside: Sequence[Array],
    block_seconds: float,
    felt_hz: float,
    beside: Beside,
) -> TorqueLag:
    """The lag below one corner; a standard error without bound where too little moves."""
    base = BaseParameters.of_arm(arm, rotors=True)
    design = Design(arm, partial(base.columns, arm), base.count)
    parts, following = [], 0
    for log, intervals in zip(logs, aside, strict=True):
        try:
            samples = preprocess([log], how, felt_hz=felt_hz)
        except ShortRunError:
            continue
        speed = np.abs(samples.motion.v)
        rows = (
            sliding_rows(samples) & (speed > SLIDES * speed.max(axis=0)) & independent_rows(samples)[:, None]
        )
        rows &= ~within(samples.motion.time, intervals, how.reach)[:, None]
        blocks = following + block_numbers(samples.motion, block_seconds)
        following = int(blocks[-1]) + 1
        slower = as_torque(replace(samples, cutoff_hz=how.cutoff_hz / _SLOWER)).motion
        parts.append(
            _Part(
                samples,
                rows.T,
                _columns(design, samples, rows.T, beside),
                _columns(design, replace(samples, motion=slower), rows.T, beside, rates=True),
                np.broadcast_to(blocks, rows.T.shape)[rows.T],
            )
        )
    if not parts or (sum(part.rows.sum(axis=1) for part in parts) < _FEWEST).any():
        return TorqueLag(0.0, np.inf, np.full(arm.n, np.nan))
    plain, by_instruments = (_own(parts, instruments) for instruments in (False, True))
    contradicted = abs(by_instruments.seconds - plain.seconds) > _CONTRADICTED * by_instruments.std_error
    return by_instruments if contradicted else plain


def _columns(design: Design, samples: Samples, rows: Mask, beside: Beside, rates: bool = False) -> Array:
    """(R, p) columns of all coefficients in the rows (n, N) of each joint; with their rates (2, R, p)."""
    n, shared = design.arm.n, design.count
    found: list[list[Array]] = [[] for _ in range(n)]
    friction = beside.terms(n)
    before = np.cumsum([0, *map(len, friction)])
    for part in design.walk(samples, friction):
        now = slice(part.first, part.first + len(part.X))
        inside = rows[part.joint, now]
        where = np.where(part.where < shared, part.where, part.where + before[part.joint])
        both = [part.X] + ([rate_along(stretch(samples, now.start, now.stop), part.X)] if rates else [])
        own = np.zeros((len(both), int(inside.sum()), shared + before[-1]))
        own[:, :, where] = np.stack(both)[:, inside]
        found[part.joint].append(own)
    X = np.concatenate([piece for pieces in found for piece in pieces], axis=1)
    X = np.concatenate(
        [X, *(_rippling(samples, rows, *one, rates) for one in beside.ripples.items())], axis=2
    )
    return X if rates else np.asarray(X[0])


def _rippling(samples: Samples, rows: Mask, joint: int, orders: Sequence[float], rates: bool) -> Array:
    """(1 or 2, R, p) columns of a joint's (1-based) ripples, with their rates, zero in the rows of other joints."""
    angle = samples.motion.q[:, [joint - 1]] * np.asarray(orders)
    own = smooth(samples, np.hstack([np.sin(angle), np.cos(angle)]))
    both = np.stack([own, *([rate_along(samples, own)] if rates else [])])
    found = np.zeros((len(both), int(rows.sum()), own.shape[1]))
    found[:, np.nonzero(rows)[0] == joint - 1] = both[:, rows[joint - 1]]
    return found


@dataclass(frozen=True, eq=False)
class _Part:
    """A log's samples with those of each joint that are regressed (n, N), and of these columns (R, p), instruments with
    their rates (2, R, p), and blocks (R,)."""

    samples: Samples
    rows: Mask
    X: Array
    Z: Array
    blocks: Index

    def torque(self, lag: float) -> Array:
        """(R, 2) torque that is recorded so much later, and its rate."""
        tau = later(self.samples.motion.time, self.samples.tau, lag)
        return np.stack([tau.T, rate_along(self.samples, tau).T], axis=2)[self.rows]


def _own(parts: Sequence[_Part], instruments: bool) -> TorqueLag:
    """Each joint's lag beside the coefficients of all, and their mean, by least squares or by instruments."""
    joint = np.concatenate([np.nonzero(part.rows)[0] for part in parts])
    block = np.concatenate([part.blocks for part in parts])
    X, (Z, along) = (
        np.concatenate(x, axis=-2) for x in zip(*((part.X, part.Z) for part in parts), strict=True)
    )
    p, of_joint = X.shape[1], joint[:, None] == np.arange(len(parts[0].rows))
    found = TorqueLag(0.0, np.inf, np.zeros(0))
    size = _sizes(np.concatenate([part.torque(0.0)[:, 0] for part in parts]), joint)
    for _ in range(_ROUNDS):
        lag = found.seconds
        tau, rate = np.concatenate([part.torque(lag) for part in parts]).T / size[joint]
        unit = size[joint, None]
        A = seen = np.hstack([X / unit, of_joint * rate[:, None]])
        if instruments:
            # Two-stage least squares. The rate's own instrument is that of the torque which the others predict.
            W = Z / unit
            theta = determined_solution(W @ determined_solution(W, A[:, :p]), tau)
            W = np.hstack([W, of_joint * (along / unit @ theta)[:, None]])
            seen = W @ determined_solution(W, A)
        # The rates are freed of all else (Frisch-Waugh-Lovell).
        theta = determined_solution(seen[:, :p], np.column_stack([tau, seen[:, p:]]))
        rates = seen[:, p:] - seen[:, :p] @ theta[:, 1:]
        inverse = np.linalg.pinv(rates.T @ rates)
        steps = -inverse @ (rates.T @ tau)
        before = tau - A[:, :p] @ theta[:, 0]
        left = before + (A[:, p:] - A[:, :p] @ theta[:, 1:]) @ steps
        scores = np.stack([block_sums(column * left, block) for column in rates.T])
        lags, errors = lag + steps, np.sqrt(np.diag(inverse @ scores @ scores.T @ inverse))
        size = np.maximum(size * _sizes(before, joint), LEAST)
        mean, error, odds = _mean(lags, errors)
        found = TorqueLag(mean, error, lags, odds)
    return found


def _sizes(x: Array, joint: Index) -> Array:
    """(n,) root mean square of each joint's rows."""
    return np.sqrt(np.maximum(np.bincount(joint, x**2) / np.bincount(joint), LEAST**2))


def _mean(lags: Array, errors: Array) -> tuple[float, float, float]:
    """Mean of the joints' lags, which differ by more than their errors say, its standard error, and the log odds of one.

    Lags and what moves those of the joints apart are summed over grids.
    """
    scale = np.hypot(_APART[:, None], errors)
    likely = student.logpdf((lags - _LAGS[:, None, None]) / scale, _TAILS) - np.log(scale)
    each = likely.sum(axis=2)
    of_lag = np.exp(each - each.max()).mean(axis=1)
    weight = of_lag * norm.pdf(_LAGS, scale=_EXPECTED)
    mean = float(weight @ _LAGS / weight.sum())
    odds = np.log(weight.sum() * (_LAGS[1] - _LAGS[0])) - np.log(max(of_lag[len(_LAGS) // 2], TINY))
    return mean, float(np.sqrt(weight @ (_LAGS - mean) ** 2 / weight.sum())), float(odds)
