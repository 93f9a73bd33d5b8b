"""Torque ripple of motors and gears, found in what a model leaves of the logs before the low-pass takes it away.

A strain-wave gear ripples a hundred or two hundred times per revolution: at one rad/s that is beyond the corner at which
torques are regressed. So the residual is taken on the unfiltered torque, and its spectrum over the angle (not over time)
is searched for lines (:mod:`reconstruction.lines`), which must keep their phase from block to block, and help on blocks
left out. A strong ripple of low order is none of these: it passes the low-pass, and the base parameters soak part of it
up, so it is one of the laws that are fitted beside them (:mod:`reconstruction.catalogue`).

Beyond the corner the ripple shakes the links, whose inertia takes up a part of it that the model's motion does not show: the
drive shows the rest. Where what it shows below the corner differs, that is the amplitude (Hausman's test: of two estimates
the one that is consistent, if they differ by more than it errs).

Motors cog several times per turn, which behind a gear of one to a hundred is four or eight hundred times per revolution of
the joint: the drive shows that only while the joint creeps. So higher orders are looked for, octave by octave, in samples
so slow that the octave's lowest passes below the corner.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import f, t

from armloop.data.blocks import BLOCK_SECONDS, block_numbers
from armloop.data.log import MotionLog
from armloop.data.motion import Samples
from armloop.data.signals import ShortRunError, Speeds, preprocess
from armloop.identification.reconstruction.inner_folds import FOLDS
from armloop.identification.reconstruction.lines import MOST, between, change, lines, waves
from armloop.identification.reconstruction.projected import CHANCE, block_covariance, block_score
from armloop.laws.effects import Context
from armloop.laws.effects.torque_ripple import TorqueRipple
from armloop.model import AddedEffect, ReconstructedModel
from armloop.util.arrays import Array, Index, Mask

#: The torque is taken up to this part of the sample rate; the model's motion as it is always taken.
_BAND = 0.4
#: Part of the residual that a line must hold.
_WORTH = 0.005
_FEWEST = 500
#: … in so many blocks at least, where an amplitude is of some of the samples.
_BLOCKS = 10
#: Highest orders of the octaves that are looked for in slow samples.
_OCTAVES = (240, 480, 960)


@dataclass(frozen=True, eq=False)
class Residual:
    """What a model leaves of one joint's unfiltered torque, (M,) each, with the block of each sample and its speed."""

    q: Array
    left: Array
    block: Index
    v: Array

    def only(self, rows: Mask) -> Residual:
        """The same of some of the samples."""
        return Residual(self.q[rows], self.left[rows], self.block[rows], self.v[rows])

    def below(self, order: float, corner_hz: float) -> Residual:
        """The same of the samples at which a ripple of an order lies below a corner."""
        return self.only(order * np.abs(self.v) <= 2 * np.pi * corner_hz)

    def tells(self) -> bool:
        """Whether it is of samples enough to tell an amplitude."""
        return len(self.q) >= _FEWEST and len(np.unique(self.block)) >= _BLOCKS


def find_ripple(
    model: ReconstructedModel, logs: Sequence[MotionLog], samples: Samples, held_out: Mask
) -> list[AddedEffect]:
    """Ripples of all joints that turn, strongest first at each.

    Args:
        logs: the training logs, as recorded.
        samples: the same, conditioned for the regression; ``held_out`` (N,) of them are not looked at.
    """
    found: list[AddedEffect] = []
    if samples.cutoff_hz <= 0:
        return found
    residuals, period = _residuals(model, logs, samples, held_out)
    for j, joint in enumerate(model.arm.joints):
        if joint.kind != "revolute" or len(residuals[j].q) < _FEWEST:
            continue
        orders = TorqueRipple(j + 1).shapes(Context(model.arm, samples.motion, period=period))
        own, left = _lines(model, j, residuals[j], np.array(orders), samples.cutoff_hz)
        found += own
        for top in _OCTAVES:
            slow = left.below(top // 2, samples.cutoff_hz)
            if not slow.tells():
                break
            higher, _ = _lines(model, j, slow, np.arange(top // 2 + 1.0, top + 1.0), samples.cutoff_hz)
            found += higher
    return found


def _lines(
    model: ReconstructedModel, joint: int, left: Residual, orders: Array, corner_hz: float
) -> tuple[list[AddedEffect], Residual]:
    """The ripples of a joint (0-based) that have one of the orders, and what they leave."""
    effect, found = TorqueRipple(joint + 1), []
    for _ in range(MOST):
        line = _line(left, orders, model.arm.n)
        if line is None:
            break
        order, x, _ = line
        stated = effect.estimates(model.arm, *_below(left, line, corner_hz), order)
        found.append(AddedEffect(effect, stated, "always"))
        # what is taken off is what the drive shows of it at all speeds, else the rest would be a line again
        left = replace(left, left=left.left - waves(left.q, order) @ x[:2])
    return found, left


def notes(effects: Sequence[AddedEffect]) -> list[str]:
    """What was found, a line each."""
    return [f"always there: {added.effect.sentence(added.parameters)}" for added in effects]


def _line(left: Residual, orders: Array, joints: int) -> tuple[float, Array, Array] | None:
    """Order, coefficients of sine and cosine, and their covariance, of the line that stands out most; or None.

    Of an order between whole ones the third coefficient is a change of it, zero but for its error.
    """
    for order in lines(left.q, left.left, orders.tolist(), _WORTH):
        X, y = waves(left.q, order), left.left
        after, fold = np.array(y), left.block % FOLDS
        for k in range(FOLDS):
            mine = fold == k
            after[mine] -= X[mine] @ np.linalg.lstsq(X[~mine], y[~mine], rcond=None)[0]
        score, blocks = block_score(y**2, after**2, left.block)
        if score > t.isf(CHANCE / (len(orders) * joints), blocks - 1):
            exact = between(left.q, y, order, blocks)
            return exact, *_coefficients(left, exact, exact != order)
    return None


def _coefficients(left: Residual, order: float, moved: bool) -> tuple[Array, Array]:
    """Least-squares coefficients of sine and cosine, and of a change of the order if it was moved; their covariance."""
    X, y = waves(left.q, order), left.left
    x = np.asarray(np.linalg.lstsq(X, y, rcond=None)[0], dtype=float)
    rest = y - X @ x
    if moved:
        X, x = np.column_stack([X, change(left.q, order, x)]), np.append(x, 0.0)
    bread = np.asarray(np.linalg.inv(X.T @ X), dtype=float)
    return x, block_covariance(bread, X * rest[:, None], left.block)


def _below(left: Residual, line: tuple[float, Array, Array], corner_hz: float) -> tuple[Array, Array]:
    """A line's coefficients and covariance, or those below the corner where they differ and enough was recorded there."""
    order, x, covariance = line
    slow = left.below(order, corner_hz)
    blocks = len(np.unique(slow.block))
    if not slow.tells():
        return x, covariance
    own, spread = _coefficients(slow, order, len(x) > 2)
    apart = (own - x)[:2]
    # Hotelling's test: a covariance of few blocks is uncertain itself
    bound = 2 * (blocks - 1) / (blocks - 2) * f.isf(CHANCE, 2, blocks - 2)
    return (own, spread) if apart @ np.linalg.solve(spread[:2, :2], apart) > bound else (x, covariance)


def _residuals(
    model: ReconstructedModel, logs: Sequence[MotionLog], samples: Samples, held_out: Mask
) -> tuple[list[Residual], float]:
    """Per joint, what the model leaves of the unfiltered torque where the joint moves; and the sample period, s."""
    fine = replace(model.conditioning, oversampling=1e9)
    runs = samples.motion.runs()
    collected: list[list[tuple[Array, Array, Index, Array]]] = [[] for _ in range(model.arm.n)]
    following = number = 0
    period = samples.period
    speeds = Speeds.of_all(logs, fine.cutoff_hz)
    for log in logs:
        for part in log.runs():
            one = log.stretch(part)
            try:
                low = preprocess([one], fine, speeds)
            except ShortRunError:
                continue
            period = low.period
            full = preprocess([one], replace(fine, cutoff_hz=_BAND / period), speeds)
            time, known = low.motion.time, samples.motion.time[runs[number]]
            nearest = np.clip(np.searchsorted(known, time), 0, len(known) - 1) + runs[number].start
            number += 1
            tau = np.column_stack([np.interp(time, full.motion.time, x) for x in full.tau.T])
            left = tau - model.predict(low.motion)
            block = following + block_numbers(low.motion, BLOCK_SECONDS)
            following = int(block[-1]) + 1
            fitted = ~held_out[nearest]
            for j in range(model.arm.n):
                rows = fitted & low.moving[:, j]
                collected[j].append(
                    (low.motion.q[rows, j], left[rows, j], block[rows], low.motion.v[rows, j])
                )
    return [
        Residual(*(np.concatenate(column) for column in zip(*own, strict=True))) for own in collected
    ], period
