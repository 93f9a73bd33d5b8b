"""Reversals of a joint: it turns round, passes zero speed, and does not rest."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from armloop.data.blocks import widened
from armloop.data.motion import Motion, Samples
from armloop.util.arrays import Mask

#: A joint that has turned round within so many seconds did not rest; so long before and after belongs to it.
TURN, AROUND = 0.4, 0.1


def passing(samples: Samples) -> Mask:
    """(N, n) samples at which a joint turns round and passes zero speed: what its friction does there, its motion tells.

    One that sticks meanwhile rests, however short: its torque may lie anywhere within its dry friction. The filter shows
    that from its reach on, beside which as much is smeared on either side.
    """
    return turning(samples.motion, samples.moving, min(TURN, 3 * samples.reach))


def turning(motion: Motion, moving: Mask, within: float = TURN) -> Mask:
    """(N, n) samples that do not count as moving although the joint only turns round, within so many seconds."""
    found = np.zeros_like(moving)
    for run in motion.runs():
        for j in range(motion.joints):
            edges = np.flatnonzero(np.diff(moving[run, j].astype(np.int8))) + run.start
            for last, end in pairwise(edges.tolist()):
                back = motion.v[last, j] * motion.v[end + 1, j] < 0
                if moving[last, j] and back and motion.time[end + 1] - motion.time[last] <= within:
                    found[last + 1 : end + 1, j] = True
    return found


def at_reversals(samples: Samples, turns: Mask, counted: Mask) -> Mask:
    """(N, n) samples that belong to a reversal: the joint turns round, or moves and does so within :data:`AROUND`.

    Args:
        turns: (N, n) samples at which a joint turns round (:func:`turning`).
        counted: (N, n) samples of which none but these may belong to one.
    """
    reach = round(AROUND / samples.period)
    return widened(turns, samples.motion, reach) & counted
