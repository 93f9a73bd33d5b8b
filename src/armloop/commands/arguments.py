"""Arguments that several commands share."""

from __future__ import annotations

import argparse

_LOG_HELP = "motion logs, CSV or Parquet: time,q1..qn,v1..vn,tau1..taun (SI units; joints base to tip)"
ARM_HELP = "a built-in arm (three_axis, scara) or the path of a URDF"


def add_logs(p: argparse.ArgumentParser) -> None:
    """One log or more."""
    p.add_argument("logs", nargs="+", metavar="LOG", help=_LOG_HELP)


def add_chain(p: argparse.ArgumentParser) -> None:
    """How a URDF with a gripper or branches becomes a serial arm."""
    p.add_argument(
        "--lock",
        action="append",
        default=[],
        metavar="JOINT=VALUE",
        help="fix this joint of the URDF at a position (rad, m), such as a gripper's; may be given several times",
    )
    p.add_argument(
        "--tip",
        default=None,
        metavar="LINK",
        help="the arm's last link: moving joints off the way to it are fixed at zero, their links keep their masses",
    )


def add_recorded(p: argparse.ArgumentParser, default: str) -> None:
    """What the torque columns of the logs hold."""
    p.add_argument(
        "--tau-unit",
        choices=("N*m", "A"),
        default=None,
        help=f"what the columns tau hold (default: {default})",
    )
    p.add_argument(
        "--drive-gains",
        default=None,
        metavar="K1,..,KN",
        help=f"N·m/A per joint: turns motor currents into torques (default: {default})",
    )


def seed(text: str) -> int:
    """A seed of a random generator, from 0."""
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r} is no seed; give a whole number from 0")
    return int(text)


#: Most processes that may be asked for.
_PROCESSES = 1024


def add_jobs(p: argparse.ArgumentParser, what: str, default: int | None = None) -> None:
    """How many processes do something."""
    p.add_argument("--jobs", type=_processes, default=default, metavar="N", help=f"processes that {what}")


def _processes(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text[:9]) <= _PROCESSES:
        raise argparse.ArgumentTypeError(f"{text!r} is no number of processes; give 1 to {_PROCESSES}")
    return int(text)


def add_json(p: argparse.ArgumentParser) -> None:
    """The choice of a machine-readable answer."""
    p.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
