"""Reading logs, one or many."""

from __future__ import annotations

import glob
from collections.abc import Iterable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

from armloop.data.log import MotionLog
from armloop.data.log import read_log as read_file
from armloop.data.repeats import require_different
from armloop.model import ReconstructedModel
from armloop.robot.arm import Arm, load_arm
from armloop.util.errors import ArmError, InputError, LogError


def read_log(
    path: str | Path,
    arm: Arm | str | Path | None = None,
    *,
    tau_unit: str = "N*m",
    drive_gains: Sequence[float] | None = None,
) -> MotionLog:
    """Read a motion log, CSV or Parquet.

    Args:
        arm: whose log it is: one of :func:`armloop.load_arm`, a built-in name or the path of a URDF; its number of
            joints is checked. None takes what the file has.
        tau_unit: what the columns tau hold, "N*m" or "A" (motor current).
        drive_gains: (n,) N·m/A (N/A): currents become torques.

    Returns:
        The log, SI units, (N, n) arrays.

    Raises:
        LogError: one line that names the file, the column or row, what is wrong and what would be right.
    """
    joints = None if arm is None else as_arm(arm).n
    unit = "A" if drive_gains is not None else tau_unit
    return read_file(path, joints=joints, tau_unit=unit, drive_gains=drive_gains)


def read_logs(
    paths: str | Path | Iterable[str | Path],
    arm: Arm | str | Path | None = None,
    *,
    tau_unit: str = "N*m",
    drive_gains: Sequence[float] | None = None,
) -> list[MotionLog]:
    """Read several logs: paths, or a pattern such as ``"logs/*.csv"`` (in the order of their names).

    Arguments and errors as of :func:`read_log`; no path, and a pattern that matches nothing, raise ``LogError``.
    """
    if isinstance(paths, str | Path):
        pattern = str(paths)
        found: list[str | Path] = [*sorted(glob.glob(pattern))] if glob.has_magic(pattern) else [pattern]
        if not found:
            raise LogError(f"{pattern}: matches no file; give the paths of CSV or Parquet motion logs")
    else:
        try:
            found = list(paths)
        except TypeError:
            raise LogError(
                f"paths of logs must be text, a pathlib.Path or a list of them; it is of type {type(paths).__name__}"
            ) from None
        if not found:
            raise LogError("paths of logs: there is none; give one at least")
    arm = None if arm is None else as_arm(arm)
    return [read_log(path, arm, tau_unit=tau_unit, drive_gains=drive_gains) for path in found]


def as_arm(arm: Arm | str | Path) -> Arm:
    """The arm itself, or the one of a name or URDF."""
    if not isinstance(arm, Arm | str | PathLike):
        raise ArmError(
            "the arm must be an Arm, a built-in name or the path of a URDF; it is of type "
            f"{type(arm).__name__}"
        )
    return arm if isinstance(arm, Arm) else load_arm(arm)


def require_some(logs: Sequence[MotionLog]) -> None:
    """Raise ``InputError`` where there is no log, or one twice."""
    if not logs:
        raise InputError("there is no log; give one at least")
    require_different(logs)


def as_logs(logs: MotionLog | Sequence[MotionLog]) -> list[MotionLog]:
    """One log or several, as a list; raises ``InputError`` for what is none."""
    # a data frame and a dict are one of their kind, although they give the names of their columns one by one
    alone = isinstance(logs, MotionLog | str | Mapping) or hasattr(logs, "columns")
    several: list[Any] = [logs] if alone or not isinstance(logs, Iterable) else list(logs)
    for log in several:
        if not isinstance(log, MotionLog):
            raise InputError(
                "a log must be a MotionLog, such as of armloop.read_log or, of a data frame, MotionLog.from_frame; this is "
                f"of type {type(log).__name__}"
            )
    return several


def require_model(model: Any) -> None:
    """Raise ``InputError`` for what is no model."""
    if not isinstance(model, ReconstructedModel):
        raise InputError(
            f"a model must be one, such as of armloop.load_model; this is of type {type(model).__name__}"
        )
