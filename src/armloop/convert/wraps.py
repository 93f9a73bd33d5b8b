"""Phase unwrapping: angles of joints without end, which encoders of one turn report between -π and π, or 0 and 2π."""

from __future__ import annotations

import numpy as np

from armloop.convert.recording import Array
from armloop.util.arrays import Mask

#: An angle wraps where it changes by whole turns, but for this part of one, from one row to the next.
_WHOLE = 0.2


def unwrapped(q: Array, turns: Mask) -> tuple[Array, list[int]]:
    """Angles without their jumps of whole turns (Itoh, Applied Optics 21, 1982), and at how many rows each jumps.

    From one row to the next a joint moves by far less than half a turn. What it did in a gap nobody knows: where it is
    after one it is the nearest angle, for the arm is in the same posture a whole turn on.

    Args:
        q: (N, n) positions, rad (m).
        turns: (n,) joints that turn; what slides wraps nowhere.
    """
    step = np.diff(q, axis=0) / (2 * np.pi)
    whole = np.round(step) * turns
    whole[np.abs(step - whole) > _WHOLE] = 0.0
    q = q.copy()
    q[1:] -= 2 * np.pi * np.cumsum(whole, axis=0)
    return q, np.count_nonzero(whole, axis=0).tolist()
