"""Whether an arm's units so far make an alarm possible at all (attainable significance), and how many would."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armloop.monitoring.alarms import LONGEST
from armloop.monitoring.ranks import soonest
from armloop.watch.running import Running


@dataclass(frozen=True)
class Attainable:
    """How many units there are since the last alarm, and how many the next one takes, however large the change.

    Attributes:
        there: the number.
        needed: units that the next alarm takes at least, in programmes that recur as they did so far; None where that is
            hundreds.
        programmes: different ones, of the units that are compared, and most: the largest number of units of one.
        again: whether there was an alarm; what comes after it is compared among itself.
    """

    there: int
    needed: int | None
    programmes: int
    most: int
    again: bool

    @property
    def enough(self) -> bool:
        """Whether an alarm is possible."""
        return self.needed is not None and self.needed <= self.there

    def notes(self) -> list[str]:
        """What to say of too few units."""
        if self.enough:
            return []
        takes = "hundreds of" if self.needed is None else str(self.needed)
        alarm, since = ("another alarm", " since the last one") if self.again else ("an alarm", "")
        note = f"{alarm} takes {takes} units of operation, there are {self.there}{since}"
        if self.programmes == 1:
            return [note]
        return [
            f"{note}, in {self.programmes} programmes, at most {self.most} of one; only units of one programme are compared "
            "(each folder below the arm's is taken for one, unless it is named by a date)"
        ]


def attainable(past: Running, healthy: int) -> Attainable:
    """What the units of an arm allow for by now.

    Args:
        healthy: first units, without which nothing is tested where warmth must be learned.
    """
    assert past.history is not None
    since = past.reached.fresh
    own = past.history.units.programme[past.numbers >= since][-LONGEST:]
    counts = np.unique(own, return_counts=True)[1]
    needed = soonest(past.limit, tuple(own.tolist()) or (0,)) if np.isfinite(past.limit) else None
    if needed is not None and past.known is not None:
        needed = max(needed, healthy - since)
    return Attainable(
        past.count - since, needed, max(1, len(counts)), int(counts.max(initial=0)), bool(past.alarms)
    )
