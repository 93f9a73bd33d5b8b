"""Arguments that state what an arm may do: ranges of motion, and the part of the effort that is kept free."""

from __future__ import annotations

import argparse
from math import isfinite
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from armloop.experiment.excitation import MotionRanges
    from armloop.robot.arm import Arm

#: Part of the effort limits that is kept free unless an option says otherwise.
RESERVE = 0.2
_NAMES = ("lower", "upper", "velocity", "acceleration")


def add_ranges(p: argparse._ActionsContainer, ranges: str, acceleration: str) -> None:
    """Ranges of motion and reserve; ``ranges`` and ``acceleration`` say what holds where nothing is stated."""
    p.add_argument(
        "--ranges",
        default=None,
        metavar="PLANT",
        help="take the ranges of motion from this plant of scenarios/plants.yaml, or `urdf`: nine tenths of the travel and "
        f"half the speed of the URDF's limits (default: {ranges})",
    )
    for name, unit in (("lower", "rad or m"), ("upper", "rad or m"), ("velocity", "rad/s or m/s")):
        p.add_argument(
            f"--{name}",
            default=None,
            metavar="X1,..,XN",
            help=f"{unit} per joint; write --{name}=-1,2 if negative",
        )
    p.add_argument(
        "--acceleration",
        default=None,
        metavar="X1,..,XN",
        help=f"rad/s² or m/s² per joint ({acceleration})",
    )
    p.add_argument(
        "--reserve",
        type=float,
        default=RESERVE,
        help="part of the URDF's effort limits that is kept free (%(default)s)",
    )


def ranges_stated(options: argparse.Namespace) -> bool:
    """Whether any range is stated."""
    return any(getattr(options, name) is not None for name in ("ranges", *_NAMES))


def reserve_stated(options: argparse.Namespace) -> bool:
    """Whether another reserve than the default is stated."""
    return bool(options.reserve != RESERVE)


def read_ranges(
    options: argparse.Namespace, arm: Arm, plant: str, known: MotionRanges | None = None
) -> MotionRanges:
    """The ranges of ``--ranges``, else ``known``, else those of ``plant``, with what the options say instead.

    Raises:
        InputError: a range is empty, beyond the URDF's limits, or not one number per joint.
    """
    from armloop.experiment.excitation import ranges_with
    from armloop.util.errors import InputError

    stated = {key: numbers(getattr(options, key), f"--{key}", arm) for key in _NAMES}
    if options.ranges is None and known is not None:
        return ranges_with(arm, known, **stated)
    name = options.ranges or plant
    if name == "urdf":
        return ranges_with(arm, None, **stated)
    from armloop.drake.experiments.scenarios import load_plant

    found = load_plant(name)
    if found.arm.n != arm.n:
        raise InputError(f"--ranges {name}: of an arm with {found.arm.n} joints; {arm.name} has {arm.n}")
    return ranges_with(arm, found.config.ranges, **stated)


def numbers(text: str | None, option: str, arm: Arm) -> tuple[float, ...] | None:
    """One finite number per joint."""
    from armloop.util.errors import InputError

    if text is None:
        return None
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError as error:
        raise InputError(f"{option} {text!r}: give one number per joint, separated by commas") from error
    if len(values) != arm.n or not all(map(isfinite, values)):
        raise InputError(f"{option} {text!r}: give {arm.n} numbers, one per joint of {arm.name}")
    return values
