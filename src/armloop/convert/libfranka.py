"""CSV of libfranka's ``logToCSV``: one header and some rows for each control exception, one below the other.

Time is in ms; q in rad, dq in rad/s, tau_J in N·m (measured at the link side). Older versions call the columns
``duration, success rate, q[0]`` and write one cell more than they name; newer ones ``time,success_rate,state.q[0]``.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from armloop.convert.mapping import Mapping, QuantityMap, TimeMap
from armloop.convert.recording import Recording
from armloop.convert.text import read_text
from armloop.util.errors import LogError

_PREFIXES = ("state.", "")


def is_libfranka(header: list[str]) -> bool:
    """Whether the columns are those of a log of libfranka."""
    return any({f"{p}q[0]", f"{p}dq[0]", f"{p}tau_J[0]"} <= set(header) for p in _PREFIXES)


def read_libfranka(path: Path) -> Recording:
    """Read one log; each repeated header starts a run. Raises ``LogError`` where the time is missing."""
    table = read_text(path)
    columns = table.columns
    prefix = next(p for p in _PREFIXES if f"{p}q[0]" in columns)
    # Each column counts: a joint whose position alone cannot be read is not to get lost.
    n = sum(any(f"{prefix}{stem}[{k}]" in columns for stem in ("q", "dq", "tau_J")) for k in range(12))
    clocks = [name for name in ("time", "duration", "state.time") if name in columns]
    if not clocks:
        raise LogError(f"{path}: has no column time or duration; libfranka's logToCSV writes one, in ms")

    def quantity(field: str, unit: str) -> QuantityMap:
        return QuantityMap([f"{prefix}{field}[{k}]" for k in range(n)], unit)

    steps = np.diff(columns[clocks[0]])
    # The arm runs at 1 kHz: rows that are a thousandth apart are in seconds, written by somebody's own code.
    rising = steps[steps > 0]
    unit = "s" if len(rising) and np.median(rising) < 0.1 else "ms"
    mapping = Mapping(
        TimeMap(clocks[0], unit), quantity("q", "rad"), quantity("tau_J", "N*m"), quantity("dq", "rad/s")
    )
    notes = [f"{len(table.starts)} logs below each other"] if len(table.starts) > 1 else []
    notes += [f"{clocks[0]} is in {unit}", *table.left_out()]
    return Recording(
        path, "libfranka log", columns, mapping, starts=table.starts, notes=notes, lines=table.lines
    )
