"""Options that several commands share."""

from __future__ import annotations

from typing import Any

from armloop.commands.options import Check, Options, argument, flag, option, several, whole, within

_LOG_HELP = "motion logs, CSV or Parquet: time,q1..qn,v1..vn,tau1..taun (SI units; joints base to tip)"
ARM_HELP = "a built-in arm (three_axis, scara) or the path of a URDF"

REFUSE_OTHERS = (
    "refuse the model unless it was made for an arm of the same joints and kinematics; the name does not count, and other "
    "masses are warned of"
)

METHOD: str = option(
    "stepwise, or sindy: one regression of everything, the reference method (%(default)s)", "stepwise"
)
MAX_ORDER: int = option(
    "largest truncation order N1 tried (%(default)s)", 4, check=within(1, 6, "give an order from 1 to 6")
)
CUTOFF: float | None = option(
    "low-pass in Hz, 0 for none (default: by held-out error, at most 10)",
    check=Check(
        lambda hz: hz == 0 or 1e-3 <= hz <= 1e4, "give a frequency from 0.001 to 10000 Hz, or 0 for no filter"
    ),
)
TORQUE_LAG: float | None = option(
    "seconds by which tau is recorded later than q, where that is known, such as the delay of its filter (default: "
    "found in the logs, where it is clear)",
    check=within(-0.1, 0.1, "a record is late by at most 0.1 s"),
)
FRICTION: str | None = option(
    "friction laws that may be chosen with rigid-body and lagrangian, such as coulomb,viscous: coulomb, coulomb_fading "
    "(its sign fades in with the speed), viscous, offset (levels differ by direction), stribeck, nonlinear_viscous, "
    "viscous_by_direction, coulomb_by_load, presliding (memory: spring-like before it slides), presliding_by_load; the "
    "first of these is taken anyway, each other where it earns its place on held-out data (default: all)",
    metavar="LAW,..",
)


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


#: The type of a seed of a random generator.
seed = whole(0, (1 << 32) - 1, f"no seed; give a whole number from 0 to {(1 << 32) - 1}")
#: Most processes that may be asked for.
MOST_PROCESSES = 1024


def processes(what: str, default: int | None = None) -> Any:
    """The option ``--jobs``: how many processes do something."""
    number = whole(1, MOST_PROCESSES, f"no number of processes; give 1 to {MOST_PROCESSES}")
    return option(f"processes that {what}", default, metavar="N", type=number)


def friction_laws(named: str | None) -> tuple[str, ...] | None:
    """The laws that --friction names, apart by commas; None for all."""
    return None if named is None else tuple(name for one in named.split(",") if (name := one.strip()))
