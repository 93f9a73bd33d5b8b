"""Stribeck friction from constant-velocity data: a profile over v_s, against a hundred exponentials.

The law is Eq. (34) of the paper, tau = (f_c + (f_s − f_c) exp(−(v/v_s)²)) sign(v) + f_v v. It is linear in all
but v_s: for every v_s the others follow by least squares, so v_s is found on a line (variable projection, Golub and
Pereyra 1973). The paper instead regresses each direction by itself on a hundred exponentials, v_s = 0.01 … 1 rad/s
(Sect. 4.3), whose columns are all but collinear.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar
from sklearn.exceptions import ConvergenceWarning
from sklearn.linear_model import Lasso

from armloop.laws.friction import stribeck_fall
from armloop.util.arrays import Array
from armloop.util.errors import ExcitationError

#: Samples slower than so many standard deviations of the velocity's noise have no certain direction.
DEAD_ZONE = 4.0
#: The paper's Stribeck velocities, rad/s.
PAPER_SPEEDS = np.linspace(0.01, 1.0, 100)
_GRID = 60


@dataclass(frozen=True)
class Stribeck:
    """Parameters of Eq. (34): levels in N·m (N), v_s in rad/s (m/s), f_v in N·m·s/rad; ``offset`` is a constant."""

    static: float
    coulomb: float
    velocity: float
    viscous: float
    offset: float = 0.0


@dataclass(frozen=True)
class StribeckComparison:
    """What each way recovers from the same data.

    The paper's ways by direction (forward, backward): v_s is where the excess over the constant has fallen to 1/e, the
    static level the curve's at rest.
    """

    profile: Stribeck  # one fit of both directions, by a profile over v_s
    least_squares: tuple[Stribeck, Stribeck]
    lasso: tuple[Stribeck, Stribeck]
    condition: float  # condition number of the paper's columns, scaled to unit norm, forward


def profile_stribeck(velocity: Array, torque: Array, speed_noise: float) -> Stribeck:
    """Eq. (34) by a profile over v_s; raises ``ExcitationError`` for too few speeds in either direction.

    ``velocity`` and ``torque`` (N,) are of one joint at constant velocities, load removed. Samples slower than four
    standard deviations ``speed_noise``, rad/s, are left out; v_s is sought from the slowest left to half the fastest.
    """
    v, tau = _reliable(velocity, torque, speed_noise)
    low, high = np.log(np.abs(v).min()), np.log(0.5 * np.abs(v).max())
    grid = np.linspace(low, high, _GRID)
    best = int(np.argmin([_projected(x, v, tau)[0] for x in grid]))
    bracket = (grid[max(best - 1, 0)], grid[min(best + 1, _GRID - 1)])
    found = minimize_scalar(lambda x: _projected(x, v, tau)[0], bounds=bracket, method="bounded")
    static, change, viscous, offset = _projected(float(found.x), v, tau)[1]
    return Stribeck(static, static + change, float(np.exp(found.x)), viscous, offset)


def compare_stribeck(
    velocity: Array, torque: Array, speed_noise: float, penalty: float = 1e-3
) -> StribeckComparison:
    """The profile and the paper's way (on every sample) on the same data; arguments and errors as :func:`profile_stribeck`.

    ``penalty`` is λ of Eq. (32) on columns of unit mean square.
    """
    profile = profile_stribeck(velocity, torque, speed_noise)
    squares, lasso, condition = [], [], 1.0
    for sign in (1.0, -1.0):
        rows = sign * velocity > 0
        v, tau = sign * velocity[rows], sign * torque[rows]
        X = np.column_stack([np.ones_like(v), v, stribeck_fall(v[:, None], PAPER_SPEEDS)])
        scale = np.sqrt(np.mean(X**2, axis=0))
        if sign > 0:
            condition = float(np.linalg.cond(X / scale))
        squares.append(_of_exponentials(np.linalg.lstsq(X / scale, tau, rcond=None)[0] / scale))
        with warnings.catch_warnings():
            # collinear columns converge slowly; how far the paper's solver came is not known either
            warnings.simplefilter("ignore", ConvergenceWarning)
            fit = Lasso(alpha=penalty, max_iter=20_000).fit((X / scale)[:, 1:], tau)
        lasso.append(_of_exponentials(np.concatenate([[fit.intercept_], fit.coef_ / scale[1:]])))
    return StribeckComparison(profile, (squares[0], squares[1]), (lasso[0], lasso[1]), condition)


def _reliable(velocity: Array, torque: Array, speed_noise: float) -> tuple[Array, Array]:
    rows = np.abs(velocity) > max(DEAD_ZONE * speed_noise, 1e-12)
    for direction, own in (("forward", velocity[rows] > 0), ("backward", velocity[rows] < 0)):
        if own.sum() < 10:
            raise ExcitationError(
                f"{int(own.sum())} samples move {direction} faster than {DEAD_ZONE:g} standard deviations of the "
                "velocity's noise; at least 10 are needed"
            )
    return velocity[rows], torque[rows]


def _projected(log_speed: float, v: Array, tau: Array) -> tuple[float, list[float]]:
    """Squared error of the best law with this v_s, and its f_s, f_c − f_s, f_v and offset."""
    sign = np.sign(v)
    fall = (1.0 - stribeck_fall(v, np.exp(log_speed))) * sign
    X = np.column_stack([sign, fall, v, np.ones_like(v)])
    theta = np.linalg.lstsq(X, tau, rcond=None)[0]
    return float(np.sum((tau - X @ theta) ** 2)), theta.tolist()


def _of_exponentials(theta: Array) -> Stribeck:
    """Constant, viscous and a hundred exponentials read as Eq. (34), in one direction."""
    excess = float(theta[2:].sum())
    speeds = np.linspace(0, 2 * PAPER_SPEEDS[-1], 2000)
    curve = stribeck_fall(speeds[1:, None], PAPER_SPEEDS) @ theta[2:]
    below = np.flatnonzero(np.abs(curve) < abs(excess) / np.e)
    reach = float(speeds[1:][below[0]]) if len(below) else np.inf
    return Stribeck(float(theta[0]) + excess, float(theta[0]), reach, float(theta[1]))
