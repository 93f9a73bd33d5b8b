"""Indicators: how much an arm moves and how much it accelerates, one number each per sample."""

from __future__ import annotations

import numpy as np
from scipy.stats import chi, norm
from sklearn.cluster import KMeans

from armloop.data.regimes.kmeans import fitted
from armloop.util.arrays import TINY, Array

#: Size that counts as exactly zero, relative to the largest.
_NOTHING = 1e-6
_ROUNDS = 3
#: A joint whose RMS is this part of the largest is not enlarged further: it rests, and its signal is noise.
_AT_REST = 0.02


def paper_indicator(a: Array, h: float, weight: float) -> Array:
    """Relative activation indicator of the paper for the vectors a (N, n): Eqs. (5) and (6).

    The printed fraction of Eq. (6) is used; it equals tanh(h‖a‖₁/2), not the tanh(h‖a‖₁) beside it.
    """
    size = np.abs(a).sum(axis=1)
    return np.tanh(0.5 * h * size) + weight * size * np.sign(a.sum(axis=1))


def robust_indicator(a: Array, weight: float = 0.2) -> Array:
    """Indicator whose switch sits just above the noise and whose level has no sign, for vectors a (N, n).

    The paper's switch saturates on measured noise, its sign term splits clusters where velocities cancel, and
    beside a joint of large numbers one of small ones (a prismatic one, in m/s) is not seen. Here the switch is
    x⁸/(1 + x⁸) of x = size/limit with :func:`size` and :func:`limit`, and the level term is ``weight``·size/max, so
    that the switch dominates, as the paper's remark asks.
    """
    total = size(a)
    x = np.minimum(total / limit(total, a.shape[1]), 1e6) ** 8
    return np.asarray(x / (1 + x) + weight * total / max(float(total.max()), TINY))


def size(a: Array) -> Array:
    """(N,) Euclidean norm of a (N, n), every joint in units of its own noise (:func:`units`)."""
    return np.asarray(np.linalg.norm(a / units(a), axis=1))


def units(a: Array) -> Array:
    """(n,) noise of every joint in a (N, n).

    The noise is that of the quiet samples, which are known once the size is: three rounds. The first is in units
    of each joint's RMS, so that joints of small numbers are seen; if a joint at rest then drowns the others in its
    noise and there seems to be no quiet part, it is in units common to all joints. The upper quartile, not the
    RMS, because some motion may pass for noise in the first round. Where there is no quiet part at all, the common
    units stand.
    """
    rms = np.sqrt(np.mean(a**2, axis=0))
    least = max(_NOTHING * float(rms.max(initial=0.0)), TINY)
    own = np.maximum(rms, max(least, _AT_REST * float(rms.max(initial=0.0))))
    for unit in (own, np.full_like(own, own.max())):
        total = np.linalg.norm(a / unit, axis=1)
        if noise_floor(total) is not None:
            break
    else:
        return own
    still = np.ones(len(a), dtype=bool)
    for _ in range(_ROUNDS):
        # What has once been motion does not become quiet because another joint is quieter still.
        still &= total <= limit(total, a.shape[1])
        quiet = np.abs(a[still & (total > _NOTHING * total.max())])
        if len(quiet) == 0:
            break
        noise = np.quantile(quiet, 0.75, axis=0) / norm.ppf(0.875)
        unit = np.maximum(noise, least)
        total = np.linalg.norm(a / unit, axis=1)
    return np.asarray(unit)


def limit(total: Array, joints: int) -> float:
    """Size above which a signal of so many joints counts as present.

    It is what white noise, as strong in every joint relative to its motion, exceeds once in a thousand (χ).
    Where there is no quiet part, one sample in a hundred counts as quiet.
    """
    joints = max(1, joints)
    floor = noise_floor(total)
    if floor is None:
        return float(np.quantile(total, 0.01)) or TINY
    return floor * float(chi.ppf(0.999, joints) / chi.median(joints))


def noise_floor(total: Array) -> float | None:
    """Median size of the quiet samples among sizes (N,); None where there is no quiet part.

    Two-means on the logarithm separates quiet from active samples however few the quiet ones are, if the two
    means are a factor of ten apart, or of three if the groups are narrow (Ashman's D above 4). Exact zeros say
    nothing about noise; they are the quiet part only if nothing else is.
    """
    least = _NOTHING * max(float(total.max(initial=0.0)), TINY)
    level = np.log10(total[total > least])
    if len(level) > 1 and np.ptp(level) > 0:
        thin = level[:: max(1, len(level) // 4000)]
        split = fitted(KMeans(2, n_init=1, init=np.array([[thin.min()], [thin.max()]])), thin[:, None])
        low, high = np.sort(split.cluster_centers_[:, 0])
        below = level < 0.5 * (low + high)
        distinct = np.sqrt(2) * (high - low) > 4 * np.hypot(level[below].std(), level[~below].std())
        if high - low > 1 or (high - low > 0.5 and distinct):
            return float(10 ** np.median(level[below]))
    return least if len(level) < len(total) else None
