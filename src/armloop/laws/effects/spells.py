"""Intermittent effect: intervals of one or more logs in which an effect is there, and is not outside of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from armloop.data.motion import Motion
from armloop.laws.effects.onset import passes
from armloop.util.arrays import Mask


@dataclass(frozen=True)
class Interval:
    """When something is there, s; ``posture`` (n,) of the joints at its start says in which log, of the name ``log``.

    Within ``gap`` s around its ends nothing is known of when it comes, or goes.
    """

    start: float
    end: float
    posture: tuple[float, ...]
    log: str = ""
    gap: float = 0.0


def during_any(motion: Motion, intervals: Iterable[Interval]) -> Mask:
    """(N,) samples within one of some intervals."""
    rows = np.zeros(motion.samples, dtype=bool)
    for own in intervals:
        for run in motion.runs():
            if passes(motion, run, own.start, np.asarray(own.posture)):
                rows[run] |= (motion.time[run] >= own.start) & (motion.time[run] <= own.end)
    return rows


@dataclass(frozen=True)
class Spells:
    """When an effect is there; what comes and goes was an event of its run, which no controller supplies.

    Attributes:
        intervals: when, by the clocks of their logs.
        error: standard error of their ends, s.
    """

    intervals: tuple[Interval, ...]
    error: float
    until: ClassVar[bool] = True
    word: ClassVar[str] = "during"

    def there(self, motion: Motion) -> Mask:
        """(N,) samples in which the effect is there; in any other log it is not."""
        return during_any(motion, self.intervals)

    @property
    def instants(self) -> list[tuple[str, float]]:
        """The instants, s, each after what happens then."""
        return [pair for own in self.intervals for pair in (("from", own.start), ("to", own.end))]

    def words(self) -> str:
        """Such as ``from 11.3 to 19.0 s and from 28.1 to 36.0 s of run_7``; of several logs each with its own."""
        last = [i.log for i in self.intervals[1:]]
        said = [i.log != after for i, after in zip(self.intervals, [*last, ""], strict=True)]
        each = zip(self.intervals, said, strict=True)
        return " and ".join(f"from {i.start:.1f} to {i.end:.1f} s" + f" of {i.log}" * say for i, say in each)

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready values, as in ``diagnosis.json``."""
        keys = {key: [getattr(own, key) for own in self.intervals] for key in ("start", "end", "log")}
        return {**keys, "std_error": self.error, "unit": "s"}

    def to_model(self) -> dict[str, Any]:
        """The same with what tells the log from others, as in a model's file."""
        return {**self.to_dict(), "posture": [list(own.posture) for own in self.intervals]}

    @staticmethod
    def from_model(data: Mapping[str, Any]) -> Spells:
        """Rebuild from :meth:`to_model`."""
        logs = data.get("log") or [""] * len(data["start"])
        each = zip(data["start"], data["end"], data["posture"], logs, strict=True)
        found = (Interval(float(a), float(b), tuple(float(x) for x in q), str(log)) for a, b, q, log in each)
        return Spells(tuple(found), float(data["std_error"]))
