"""CSV that Universal Robots' RTDE recorder writes (``record.py``, ur_rtde): ``timestamp, actual_q_0, …``.

Units are those of the interface's guide: s, rad, rad/s, and A for ``actual_current``; ``actual_current_as_torque``
and ``actual_joint_torque`` are in N·m. ``target_…`` columns are what the controller wanted and are kept as such.
"""

from __future__ import annotations

from pathlib import Path

from armloop.convert.mapping import Mapping, QuantityMap, TimeMap
from armloop.convert.recording import Recording
from armloop.convert.text import read_text
from armloop.util.errors import LogError

_TORQUES = (("actual_current_as_torque", "N*m"), ("actual_joint_torque", "N*m"), ("actual_current", "A"))


def is_rtde(header: list[str]) -> bool:
    """Whether the columns are those of an RTDE recording."""
    return "timestamp" in header and "actual_q_0" in header


def read_rtde(path: Path) -> Recording:
    """Read one recording; raises ``LogError`` where it lacks what a log needs."""
    table = read_text(path)
    columns = table.columns
    # Each column counts: a joint whose position alone cannot be read is not to get lost.
    stems = ("actual_q", "actual_qd", *(stem for stem, _ in _TORQUES))
    n = sum(any(f"{stem}_{k}" in columns for stem in stems) for k in range(12))

    def names(stem: str) -> list[str]:
        return [f"{stem}_{k}" for k in range(n)]

    def has(stem: str) -> bool:
        return all(name in columns for name in names(stem))

    measured = [(stem, unit) for stem, unit in _TORQUES if not columns.keys().isdisjoint(names(stem))]
    measured.sort(key=lambda each: not has(each[0]))
    if not measured:
        raise LogError(
            f"{path}: has no column actual_current_0: neither currents nor torques were recorded; "
            "add actual_current to the recorder's configuration"
        )
    stem, unit = measured[0]
    v = QuantityMap(names("actual_qd"), "rad/s") if has("actual_qd") else None
    mapping = Mapping(
        TimeMap("timestamp", "s"), QuantityMap(names("actual_q"), "rad"), QuantityMap(names(stem), unit), v
    )
    notes = [f"tau is {stem}", *table.left_out()]
    return Recording(
        path, "UR RTDE recording", columns, mapping, starts=table.starts, notes=notes, lines=table.lines
    )
