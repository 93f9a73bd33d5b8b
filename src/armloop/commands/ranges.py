"""Arguments that state what an arm may do: ranges of motion, and the part of the effort that is kept free."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING, Any

from armloop.commands.options import Options, comma_numbers, option
from armloop.util.errors import InputError

if TYPE_CHECKING:
    from armloop.experiment.excitation import MotionRanges
    from armloop.robot.arm import Arm

_NAMES = ("lower", "upper", "velocity", "acceleration")


def ranges(default: str) -> Any:
    """The option ``--ranges``; ``default`` says what holds where it is not given."""
    return option(
        "take the ranges of motion from this plant of scenarios/plants.yaml, or `urdf`: nine tenths of the travel and half "
        f"the speed of the URDF's limits (default: {default})",
        metavar="PLANT",
    )


def acceleration(default: str) -> Any:
    """The option ``--acceleration``."""
    return option(f"rad/s² or m/s² per joint ({default})", metavar="X1,..,XN")


def _range(name: str, unit: str) -> Any:
    return option(f"{unit} per joint; write --{name}=-1,2 if negative", metavar="X1,..,XN")


class Ranges(Options):
    """Ranges of motion and reserve."""

    ranges: str | None = ranges("urdf")
    lower: str | None = _range("lower", "rad or m")
    upper: str | None = _range("upper", "rad or m")
    velocity: str | None = _range("velocity", "rad/s or m/s")
    acceleration: str | None = acceleration("without a plant: twice the velocity")
    reserve: float = option("part of the URDF's effort limits that is kept free (%(default)s)", 0.2)


def ranges_stated(options: Ranges) -> bool:
    """Whether any range is stated."""
    return any(getattr(options, name) is not None for name in ("ranges", *_NAMES))


def read_ranges(options: Ranges, arm: Arm, plant: str, known: MotionRanges | None = None) -> MotionRanges:
    """The ranges of ``--ranges``, else ``known``, else ``plant``'s, with what the options say; raises ``InputError``."""
    from armloop.experiment.excitation import ranges_with

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
    if text is None:
        return None
    values = tuple(comma_numbers(text, option))
    if len(values) != arm.n or not all(map(isfinite, values)):
        raise InputError(f"{option} {text!r}: give {arm.n} numbers, one per joint of {arm.name}")
    return values
