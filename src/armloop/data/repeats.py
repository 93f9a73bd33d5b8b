"""Logs of one measurement, found by the rows that they share to the last digit.

What is left out of a regression must not be in it under another name, and nothing counts twice.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from armloop.data.log import MotionLog
from armloop.util.errors import LogError

# Logs that share more of the shorter one's rows are one measurement: an arm at rest may repeat a row, a motion not.
_SHARED_ROWS = 0.5


def require_different(logs: Sequence[MotionLog]) -> None:
    """Raise `LogError` where two logs hold the same measurement, whole or for the most part, whatever their times."""
    digests = [np.unique(log.rows_digest()) for log in logs]
    for k, log in enumerate(logs):
        for j, other in enumerate(logs[:k]):
            if _mostly_shared(digests[j], digests[k]):
                raise LogError(
                    f"{log.name}: holds the measurement of {other.name} once more"
                    f"{_part(digests[k], digests[j])}; give each measurement once"
                )


def require_not_fitted(
    held_out: Sequence[MotionLog], fitted: Sequence[MotionLog], names: Sequence[str]
) -> None:
    """Raise `LogError` where a log that is held out holds a measurement that is fitted, or that of another held out."""
    for k, (log, name) in enumerate(zip(held_out, names, strict=True)):
        for other in fitted:
            if same_measurement(log, other):
                raise LogError(
                    f"{name}: is one of the logs diagnosed (it holds the measurement of {other.name}); held out are runs "
                    "that are not fitted"
                )
        for other in held_out[:k]:
            if same_measurement(log, other):
                raise LogError(f"{name}: holds the measurement of {other.name} once more; give each run once")


def same_measurement(one: MotionLog, other: MotionLog) -> bool:
    """Whether more than half of the shorter log's rows are in the other, to the last digit, whatever the times."""
    return _mostly_shared(np.unique(one.rows_digest()), np.unique(other.rows_digest()))


def _mostly_shared(first: NDArray[np.uint64], second: NDArray[np.uint64]) -> bool:
    return _shared(first, second) > _SHARED_ROWS * min(len(first), len(second))


def _shared(first: NDArray[np.uint64], second: NDArray[np.uint64]) -> int:
    return len(np.intersect1d(first, second, assume_unique=True))


def _part(mine: NDArray[np.uint64], others: NDArray[np.uint64]) -> str:
    """How many of a log's rows are another's, where that is not all of them."""
    shared = _shared(mine, others)
    return "" if shared == len(mine) else f", in {shared} of its {len(mine)} different rows"
