"""Creep of a joint: it moves so slowly that its dry friction is known but in part."""

from __future__ import annotations

import numpy as np

from armloop.data.motion import Samples
from armloop.util.arrays import Array, Mask

#: A joint creeps below this part of the speed that its model was trained at.
CREEPING = 0.05
#: A joint slower than this, rad/s or m/s, may stick, or be shaken by others.
STICKING = 0.01


def may_stick(fastest: Array) -> Array:
    """(n,) speeds below which joints may stick, rad/s (m/s), by the largest that they go at: some joints never go fast."""
    return np.minimum(STICKING, CREEPING * fastest)


def creeping(samples: Samples, speeds: Array) -> Mask:
    """(N, n) moving samples slower than a part of the largest speeds (n,) of the training, rad/s (m/s)."""
    return np.asarray(samples.moving & (np.abs(samples.motion.v) < CREEPING * speeds))
