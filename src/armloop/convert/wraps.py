"""Phase unwrapping: angles of joints without end, which encoders of one turn report between -π and π, or 0 and 2π."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from armloop.convert.recording import Array

#: An angle wraps where it changes by whole turns, but for this part of one, from one row to the next.
_WHOLE = 0.2


def unwrapped(q: Array, starts: Sequence[int] = ()) -> tuple[Array, list[int]]:
    """Angles without their jumps of whole turns (Itoh, Applied Optics 21, 1982), and at how many rows each jumps.

    From one row to the next a joint moves by far less than half a turn. What it did between two runs nobody knows: each
    begins with the angle that its source says.

    Args:
        q: (N, n) positions, rad (m); no joint slides by metres from one row to the next.
        starts: rows at which another run begins.
    """
    step = np.diff(q, axis=0) / (2 * np.pi)
    whole = np.round(step)
    whole[np.abs(step - whole) > _WHOLE] = 0.0
    inner = [start for start in sorted(starts) if 0 < start < len(q)]
    whole[[start - 1 for start in inner]] = 0.0
    q = q.copy()
    for first, last in pairwise([0, *inner, len(q)]):
        q[first + 1 : last] -= 2 * np.pi * np.cumsum(whole[first : last - 1], axis=0)
    return q, np.count_nonzero(whole, axis=0).tolist()
