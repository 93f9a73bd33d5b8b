"""Unit of a log's tau: torque, or motor current."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from armloop.data.tables import said_of
from armloop.util.errors import LogError

TAU_UNITS = ("N*m", "A")
#: Under which a Parquet file says what its tau holds, where that is no torque.
_UNIT = "tau_unit"


def check_unit(unit: Any, label: Any) -> None:
    """Raise `LogError` for what is no unit of tau."""
    if not isinstance(unit, str) or unit not in TAU_UNITS:
        raise LogError(f"{label}: tau unit {unit!r} is unknown; it must be one of {', '.join(TAU_UNITS)}")


def told_unit(path: Path) -> str | None:
    """Return what a Parquet file whose header has been read says that its tau is in; None where it does not, as a CSV."""
    told = said_of(path, _UNIT)
    if told not in (None, *TAU_UNITS):
        raise LogError(
            f"{path}: says of itself that tau is in {told[:40]!r}; it must be one of {', '.join(TAU_UNITS)}"
        )
    return told


def said_of_unit(unit: str) -> dict[str, str]:
    """Return what a Parquet file of a log has to say beside its columns: that tau is a current, where it is one."""
    return {_UNIT: unit} if unit == "A" else {}
