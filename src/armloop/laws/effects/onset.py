"""Change point of an effect: an instant of one log since which, or until which, it is there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from armloop.data.motion import Motion
from armloop.util.arrays import Array, Mask

#: Two postures, rad or m, that are the same sample of the same log.
_SAME = 1e-6


def passes(motion: Motion, run: slice, instant: float, posture: Array) -> bool:
    """Whether a run has a sample of this posture (n,) at an instant, s.

    Every log's clock passes the same times, and no two motions measured pass the same numbers.
    """
    time = motion.time[run]
    if not time[0] - _SAME <= instant <= time[-1] + _SAME:
        return False
    at = motion.q[run.start + int(np.argmin(np.abs(time - instant)))]
    return bool(len(at) == len(posture) and np.abs(at - posture).max() <= _SAME)


@dataclass(frozen=True)
class Onset:
    """When an effect begins to be there, or ceases to be.

    Attributes:
        time, error: the instant, by the clock of its log, and its standard error, s.
        until: whether it was there until then, not since then.
        posture: (n,) of the joints at that instant, rad (m), which says in which log.
        elsewhere: whether it is there in the other logs that were judged with this, where clocks do not tell their order.
        log: name of the log.
    """

    time: float
    error: float
    until: bool
    posture: tuple[float, ...]
    elsewhere: bool = False
    log: str = ""

    def there(self, motion: Motion) -> Mask:
        """(N,) samples in which the effect is there; in any other log the arm is as it was at the end of this one."""
        posture = np.asarray(self.posture)
        own = next((run for run in motion.runs() if passes(motion, run, self.time, posture)), None)
        if own is None:
            return np.full(motion.samples, not self.until)
        log = log_of(motion, own)
        rows = np.full(motion.samples, self.elsewhere)
        time = motion.time[log]
        rows[log] = time <= self.time if self.until else time >= self.time
        return rows

    @property
    def word(self) -> str:
        """``since`` or ``until``."""
        return "until" if self.until else "since"

    @property
    def instants(self) -> list[tuple[str, float]]:
        """The instant, s, after its word."""
        return [(self.word, self.time)]

    def words(self) -> str:
        """Such as ``since 31.2 ± 0.4 s of run_1``."""
        places = int(np.clip(-np.floor(np.log10(max(self.error, 1e-3))), 1, 3))
        of = f" of {self.log}" if self.log else ""
        return f"{self.word} {self.time:.{places}f} ± {self.error:.{places}f} s{of}"

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready values, as in ``diagnosis.json``."""
        return {"value": self.time, "std_error": self.error, "unit": "s", "log": self.log}

    def to_model(self) -> dict[str, Any]:
        """The same with what tells the log from others, as in a model's file."""
        return {**self.to_dict(), "posture": list(self.posture), "elsewhere": self.elsewhere}

    @staticmethod
    def from_model(data: Mapping[str, Any], until: bool) -> Onset:
        """Rebuild from :meth:`to_model`."""
        posture = tuple(float(q) for q in data["posture"])
        elsewhere, log = bool(data.get("elsewhere", False)), str(data.get("log", ""))
        return Onset(float(data["value"]), float(data["std_error"]), until, posture, elsewhere, log)


def log_of(motion: Motion, run: slice) -> slice:
    """Samples of the log that a run is of: runs whose clock goes on, in order, which one record or one clock has stamped."""
    back = np.flatnonzero(motion.time[motion.starts[1:]] <= motion.time[motion.starts[1:] - 1]) + 1
    edges = [0, *motion.starts[back].tolist(), motion.samples]
    k = int(np.searchsorted(edges, run.start, side="right"))
    return slice(edges[k - 1], edges[k])
