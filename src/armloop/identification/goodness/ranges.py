"""Extrapolation: how much of a motion lies where a model was never fitted."""

from __future__ import annotations

from typing import Any

import numpy as np

from armloop.data.motion import Motion
from armloop.util.arrays import Array

#: How far beyond its range, in parts of it, a quantity still counts as inside: ranges leave out the rarest samples.
_MARGIN = 0.05


def outside_trained_range(motion: Motion, ranges: Any) -> Array:
    """(n,) part of the samples in which a joint's q, v or vdot lies beyond what the model was fitted on.

    Args:
        ranges: half ranges of q, v and vdot, then the centre of q, (4, n), as the model's history keeps them;
            None where it keeps none, which counts as inside.
    """
    if ranges is None:
        return np.zeros(motion.joints)
    q, v, vdot, centre = np.asarray(ranges, dtype=float)
    outside = np.abs(motion.q - centre) > (1 + _MARGIN) * q
    for x, most in ((motion.v, v), (motion.vdot, vdot)):
        outside |= np.abs(x) > (1 + _MARGIN) * most
    return np.asarray(outside.mean(axis=0))
