"""Helpers of several commands: checks of what is given, reading of logs and models, progress."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from armloop.commands.arguments import Chain, HeldOut, OfModel, Recorded
from armloop.commands.options import Options, comma_numbers
from armloop.data.header import check_header
from armloop.data.log import GAINS, MotionLog, read_log
from armloop.data.repeats import require_not_fitted
from armloop.data.signals import preprocess
from armloop.data.tables import CSV, PARQUET
from armloop.model import ReconstructedModel, load_model
from armloop.robot.arm import Arm, load_arm
from armloop.util.doubts import said
from armloop.util.errors import InputError, LogError, ModelError
from armloop.util.files import strict
from armloop.util.outputs import take_file
from armloop.util.progress import Progress, silent, with_time_left

#: Ends of names of packed files.
_PACKED = (".gz", ".bz2", ".xz", ".zst", ".zip")


def progress(options: Options) -> Progress:
    """Progress on the terminal; with none, as in a job's log, before the answer: standard error is for faults alone."""
    if getattr(options, "json", False) and not sys.stderr.isatty():
        return silent
    stream = sys.stderr if sys.stderr.isatty() else sys.stdout
    from armloop.reports.words import spelled

    return with_time_left(lambda message: print(f"  … {spelled(message)}", file=stream, flush=True))


def print_json(value: Any) -> None:
    """Print the answer of ``--json``, strict JSON, with what is doubtful about the input as ``warnings``."""
    print(strict({**value, "warnings": said()} if said() else value))


def take_reference(path: str, option: str) -> None:
    """Check the place and the name of a reference that will be written; raises ``InputError``."""
    take_file(path, option)
    if not path.lower().endswith((CSV, PARQUET)):
        raise InputError(f"{option} {path}: a reference ends in {CSV} or {PARQUET}")


def arm_of(options: Chain) -> Arm:
    """The arm of ``--arm`` (or ARM), with what ``--lock`` and ``--tip`` say; raises ``InputError``."""
    lock: dict[str, float] = {}
    for text in options.lock:
        name, equals, value = text.rpartition("=")
        try:
            lock[name] = float(value)
        except ValueError:
            equals = ""
        if not (name and equals):
            raise InputError(f"--lock {text}: give JOINT=VALUE, such as finger_joint=0.02")
        if [other.rpartition("=")[0] for other in options.lock].count(name) > 1:
            raise InputError(f"--lock {text}: joint {name!r} is locked twice; give it once")
    return load_arm(options.arm, lock, options.tip)


def simulated_arm(options: Chain) -> Any:
    """The arm of ``--arm`` (or ARM) for a simulation; its name, where ``--lock`` and ``--tip`` do not change it.

    By its name a built-in arm has its own plant, and a scenario may say what of its arm is locked. None if it is left out.
    """
    arm = stated_arm(options) if options.lock or options.tip else None
    return arm or options.arm


def stated_arm(options: Chain) -> Arm | None:
    """:func:`arm_of` where ``--arm`` is given, else None; raises ``InputError``."""
    if options.arm:
        return arm_of(options)
    for name, value in (("--lock", options.lock), ("--tip", options.tip)):
        if value:
            raise InputError(f"{name} is of the URDF that --arm names: give it, too")
    return None


def drive_gains(text: str | None) -> list[float] | None:
    """The numbers of ``--drive-gains``; raises ``InputError`` for anything else."""
    if text is None:
        return None
    gains = comma_numbers(text, "--drive-gains")
    if not all(GAINS[0] <= g <= GAINS[1] for g in gains):
        against = "; of a drive that turns against its joint turn the column: `sign` in a mapping of armloop convert"
        raise InputError(
            f"--drive-gains {text!r:.60}: every gain must be a positive number of N·m/A, {GAINS[0]:g} to {GAINS[1]:g}"
            + (against if any(g < 0 for g in gains) else "")
        )
    return gains


def recorded_as(options: Recorded, default: dict[str, Any]) -> dict[str, Any]:
    """What the torque columns hold, by the options or else as ``default`` says."""
    gains = drive_gains(options.drive_gains)
    unit = options.tau_unit
    if gains is not None and unit == "N*m":
        raise InputError(
            "--drive-gains turn currents into torques, but --tau-unit says that tau is N*m already"
        )
    if gains is None and unit is None:
        return default
    if gains is not None:
        return {"unit": "A", "drive_gains": gains}
    return {"unit": unit, "drive_gains": default["drive_gains"] if unit == "A" else None}


def read_logs(paths: list[str], arm: Arm | None, recorded: dict[str, Any]) -> list[MotionLog]:
    """The logs, of an arm if one is known, with currents turned into torques where gains are known."""
    check_columns(paths, arm)
    return [read_log(path, tau_unit=recorded["unit"], drive_gains=recorded["drive_gains"]) for path in paths]


def check_columns(paths: list[str], arm: Arm | None) -> None:
    """Refuse logs that are packed, or that are not of an arm's joints, before any is read; raises ``LogError``."""
    for path in paths:
        if path.lower().endswith(_PACKED):
            raise LogError(
                f"{path}: is packed; unpack it first (gzip -d, unzip): a motion log ends in .csv or .parquet"
            )
        n = len(check_header(Path(path))["q"])
        if arm is not None and n != arm.n:
            names = ", ".join(arm.joint_names)
            # of a model's arm there is no URDF in which a joint could be locked
            lock = (
                "; fix those that the log has not with --lock JOINT=VALUE" if arm.urdf and n < arm.n else ""
            )
            raise LogError(
                f"{path}: the columns are those of {n} joints; the arm has {arm.n}: {names}, base to tip{lock}"
            )


TORQUE = {"unit": "N*m", "drive_gains": None}


def model_and_logs(options: OfModel) -> tuple[ReconstructedModel, list[MotionLog]]:
    """The model of a command line and the logs that are to be compared with it."""
    model = load_model(options.model, stated_arm(options))
    recorded = recorded_as(options, model.recorded)
    if recorded["unit"] == "A" and recorded["drive_gains"] is None and model.recorded["unit"] != "A":
        raise ModelError(f"{options.model}: predicts torque in N·m; currents in A need --drive-gains")
    return model, read_logs(options.logs, model.arm, recorded)


def held_out_logs(options: HeldOut, model: ReconstructedModel, fitted: list[MotionLog]) -> list[MotionLog]:
    """The logs of ``--held-out``; raises ``InputError`` for one that is to be fitted, too, or does not fit."""
    logs = read_logs(options.held_out, model.arm, recorded_as(options, model.recorded))
    require_not_fitted(logs, fitted, options.held_out)
    for log in logs:
        preprocess([log], model.conditioning)  # what is wrong with a log is said before the long work
    return logs
