"""A recorded motion as plain arrays, and what checks find in it: columns, rows and a sentence."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import wraps
from typing import Any, TypeVar

from armloop.util.arrays import Array, Mask

Answer = TypeVar("Answer")


@dataclass(frozen=True)
class Finding:
    """What is wrong, or doubtful, with some columns of a log; a sentence with ``columns`` as its subject.

    Attributes:
        columns: such as ``"column v2"``.
        text: what is wrong and what would be right.
        row: index of the row from 0, or None where no single row is at fault.
    """

    columns: str
    text: str
    row: int | None = None


@dataclass(frozen=True, eq=False)
class Recorded:
    """A recorded motion of n joints at N instants in runs without gaps, and what the checks share.

    time (N,), q, v, tau (N, n), vdot (N, n) or None; ``derived``: v was differentiated from q; ``lost`` (N, n): samples
    whose torque is known to be no measurement, None where there are none.
    """

    time: Array
    q: Array
    v: Array
    tau: Array
    vdot: Array | None
    runs: Sequence[slice]
    derived: bool = False
    lost: Mask | None = None
    _known: dict[str, Any] = field(default_factory=dict, init=False, repr=False)

    def keep(self, function: str, answer: Any) -> None:
        """Take it as known what a function of the record (:func:`once`) comes to."""
        self._known[function] = answer


def once(function: Callable[[Recorded], Answer]) -> Callable[[Recorded], Answer]:
    """Memoization: what a function of a record came to is kept with the record, and asked for again is not sought anew."""

    def known(log: Recorded) -> Answer:
        if function.__name__ not in log._known:
            log._known[function.__name__] = function(log)
        answer: Answer = log._known[function.__name__]
        return answer

    return wraps(function)(known)
