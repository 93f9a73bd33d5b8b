"""Creep of a joint: it moves so slowly that its dry friction is known but in part."""

from __future__ import annotations

import numpy as np

from armloop.data.motion import Samples
from armloop.util.arrays import Array, Mask

#: A joint creeps below this part of the speed that its model was trained at.
CREEPING = 0.05
#: A joint slower than this, rad/s or m/s, may stick, or be shaken by others.
STICKING = 0.01
#: A joint that travels less than this part of half its range (rad or m, where that is unknown) has not slid.
TRAVEL = 2e-3


def may_stick(fastest: Array) -> Array:
    """(n,) speeds below which joints may stick, rad/s (m/s), by the largest that they go at: some joints never go fast."""
    return np.minimum(STICKING, CREEPING * fastest)


def creeping(samples: Samples, speeds: Array) -> Mask:
    """(N, n) moving samples slower than a part of the largest speeds (n,) of the training, rad/s (m/s)."""
    return np.asarray(samples.moving & (np.abs(samples.motion.v) < CREEPING * speeds))


def held_speed(samples: Samples) -> Array:
    """(N, n) largest speed within the low-pass's reach of each sample, rad/s (m/s).

    What the filter mixes with faster motion tells of that: a joint that only passes through a slow speed, as it starts,
    stops or turns round, shows next to nothing of its friction there.
    """
    # what refuses a command for want of a file comes by here, and has no need of it
    from scipy.ndimage import maximum_filter1d

    speed = np.abs(samples.motion.v)
    width = 2 * round(samples.reach / samples.period) + 1
    for run in samples.motion.runs() if width > 1 else ():
        speed[run] = maximum_filter1d(speed[run], width, axis=0, mode="nearest")
    return speed
