"""Options that several commands share."""

from __future__ import annotations

import argparse
from typing import Any

from armloop.commands.options import Check, Options, argument, flag, option, several, within

_LOG_HELP = "motion logs, CSV or Parquet: time,q1..qn,v1..vn,tau1..taun (SI units; joints base to tip)"
ARM_HELP = "a built-in arm (three_axis, scara) or the path of a URDF"

MAX_ORDER = within(1, 6, "give an order from 1 to 6")
CUTOFF = Check(
    lambda hz: hz == 0 or 1e-3 <= hz < 1e4, "give a frequency of 0.001 Hz or more, or 0 for no filter"
)
REFUSE_OTHERS = "refuse the model unless it was made for this arm"
METHOD_HELP = "stepwise, or sindy: one regression of everything, the reference method (%(default)s)"
CUTOFF_HELP = "low-pass in Hz, 0 for none (default: by held-out error, at most 10)"
MAX_ORDER_HELP = "largest truncation order N1 tried (%(default)s)"


class Logs(Options):
    """One log or more."""

    logs: list[str] = argument("LOG", _LOG_HELP, nargs="+")


class Chain(Options):
    """The arm, and how a URDF with a gripper or branches becomes a serial one."""

    arm: Any  # str, or None where it may be left out
    lock: list[str] = several(
        "fix this joint of the URDF at a position (rad, m), such as a gripper's; may be given several times",
        "JOINT=VALUE",
    )
    tip: str | None = option(
        "the arm's last link: moving joints off the way to it are fixed at zero, their links keep their masses",
        metavar="LINK",
    )


def tau_unit(help: str) -> Any:
    """What the torque columns hold."""
    return option(help, choices=("N*m", "A"))


def drive_gains(help: str) -> Any:
    """The drives' gains."""
    return option(help, metavar="K1,..,KN")


class Recorded(Options):
    """What the torque columns of the logs hold."""

    tau_unit: str | None = tau_unit("what the columns tau hold (default: N*m)")
    drive_gains: str | None = drive_gains("N·m/A per joint: turns motor currents into torques (default: N*m)")


class RecordedAsModel(Recorded):
    """The same, by default as the model's training logs."""

    tau_unit: str | None = tau_unit("what the columns tau hold (default: as the model's training logs)")
    drive_gains: str | None = drive_gains(
        "N·m/A per joint: turns motor currents into torques (default: as the model's training logs)"
    )


class OfModel(Logs, Chain, RecordedAsModel):
    """A model, and logs that are to be compared with it."""

    model: str = argument("MODEL.json")
    arm: str | None = option(REFUSE_OTHERS)


class HeldOut(Recorded):
    """Runs that are not fitted."""

    held_out: list[str] = option(
        "further runs of the arm as it is now, never fitted: error before and after on each of them",
        [],
        metavar="LOG",
        nargs="+",
        action="extend",
    )


class Json(Options):
    """The choice of a machine-readable answer."""

    json: bool = flag("print one JSON object and nothing else")


def seed(text: str) -> int:
    """A seed of a random generator, from 0."""
    if not (text.isascii() and text.isdecimal()) or len(text) > 10 or int(text) >= 1 << 32:
        raise argparse.ArgumentTypeError(
            f"{text!r:.60} is no seed; give a whole number from 0 to {(1 << 32) - 1}"
        )
    return int(text)


#: Most processes that may be asked for.
MOST_PROCESSES = 1024


def processes(what: str, default: int | None = None) -> Any:
    """The option ``--jobs``: how many processes do something."""
    return option(f"processes that {what}", default, metavar="N", type=_processes)


def _processes(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text[:9]) <= MOST_PROCESSES:
        raise argparse.ArgumentTypeError(f"{text!r} is no number of processes; give 1 to {MOST_PROCESSES}")
    return int(text)
