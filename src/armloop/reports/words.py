"""Formatting of numbers, units and names in tables, figures and reports."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from armloop.laws.effects.base import with_error as of_scalar

if TYPE_CHECKING:
    from armloop.laws.effects import Effect

MISSING = "–"
_LEAST_PART = 1e-5

_STEPS = {"step1": "Step I", "step2": "Step II", "step3": "Step III"}
_OTHER_CONTROLLERS = {
    "computed_torque": "computed torque",
    "bounded": "PID + Step III within limits",
    "exact": "PID + exact model",
}
_UNITS = {"*": "·", "^2": "²", "^3": "³"}
_PERCENT = re.compile(r"(?<=[0-9])%")
#: A torque's or a load's unit behind its number; ``--tau-unit N*m`` stays as it is typed.
_UNIT = re.compile(r"(?<=[0-9)] )(?:N|kg)\*m\S*")
_WIDTH = 110


def number(x: float | None, digits: int = 3) -> str:
    """Significant digits without exponents where a person would not write one; a dash for None and NaN."""
    if x is None or not np.isfinite(x):
        return MISSING
    x = float(x)
    if x == 0:
        return "0"
    if not 1e-4 <= abs(x) < 1e6:
        return f"{x:.{digits - 1}e}"
    decimals = max(0, digits - 1 - int(np.floor(np.log10(abs(x)))))
    return f"{x:.{decimals}f}"


def numbers(values: Iterable[float | None], digits: int = 3, separator: str = " / ") -> str:
    """Several numbers, one per joint."""
    return separator.join(number(x, digits) for x in values)


def percent(x: float | None) -> str:
    """A part as a percentage; one that is too small to matter as less than what would."""
    if x is None or not np.isfinite(x):
        return MISSING
    if 0 < abs(x) < _LEAST_PART:
        return f"< {100 * _LEAST_PART:g} %"
    return f"{100 * x:.0f} %" if abs(x) >= 0.0995 else f"{number(100 * x, 2)} %"


def unit(text: str) -> str:
    """``N*m`` as N·m, ``kg*m^2`` as kg·m², ``1`` as nothing."""
    if text == "1":
        return ""
    for plain, sign in _UNITS.items():
        text = text.replace(plain, sign)
    return text


def spelled(text: str) -> str:
    """A sentence with its numbers as in the tables: ``0.81%`` as 0.81 %, ``2 N*m`` as 2 N·m."""
    return _UNIT.sub(lambda found: unit(found[0]), _PERCENT.sub(" %", text))


def wrapped(sentence: str, indent: str = "") -> str:
    """A sentence for a terminal, spelled, in lines that are no longer than a table is wide."""
    return textwrap.fill(spelled(sentence), _WIDTH, initial_indent=indent, subsequent_indent=f"{indent}  ")


def vector(value: float | Sequence[float], digits: int = 3) -> str:
    """A scalar, or a vector in brackets."""
    if isinstance(value, Sequence):
        return "(" + ", ".join(number(x, digits) for x in value) + ")"
    return number(value, digits)


def with_error(value: float | Sequence[float], std_error: float | Sequence[float]) -> str:
    """A parameter and its standard error, to the digit at which the error begins.

    Of a vector some components of which have an error, the others are not determined, and not written.
    """
    if isinstance(value, Sequence):
        errors = np.broadcast_to(np.asarray(std_error, dtype=float), len(value)).tolist()
        lost = np.isnan(errors) & ~np.isnan(errors).all()
        parts = (
            MISSING if none else with_error(x, e) for x, e, none in zip(value, errors, lost, strict=True)
        )
        return f"({', '.join(parts)})"
    error = float(np.max(std_error))
    if not np.isfinite(error) or error <= 0:
        return number(value)
    return of_scalar(value, error)


def angle(text: str, of: str) -> str:
    """A tracking error with its unit, ``deg`` or ``mm``, as short as a headline needs it."""
    return f"{text}°" if of == "deg" else f"{text} {of}"


def controller(name: str) -> str:
    """``pid_step1`` as PID + Step I."""
    if name == "pid":
        return "PID"
    if name in _OTHER_CONTROLLERS:
        return _OTHER_CONTROLLERS[name]
    rest = name.removeprefix("pid_")
    return name.replace("_", " ") if rest == name else f"PID + {_STEPS.get(rest, rest)}"


def effect_name(name: str, joint: int | None, other_joint: int | None = None) -> str:
    """``viscous_friction`` at joint 2 as viscous friction, joint 2."""
    plain = name.replace("_", " ")
    if other_joint is not None:
        return f"{plain}, joints {joint} and {other_joint}"
    return plain if joint is None else f"{plain}, joint {joint}"


def place(item: Mapping[str, Any]) -> str:
    """An effect's entry in a file as its name with its joints."""
    return effect_name(item["effect"], item.get("joint"), item.get("other_joint"))


def effect_label(effect: Effect) -> str:
    """The name of an effect with its joint."""
    return effect_name(effect.name, effect.joint, effect.other_joint)


def counted(count: int, singular: str, plural: str | None = None) -> str:
    """``1 run``, ``12 345 runs``."""
    digits = f"{count:,}".replace(",", "\u202f")
    return f"{digits} {singular if count == 1 else plural or singular + 's'}"


def from_to(values: Sequence[float], written: Callable[[float], str] = str) -> str:
    """The least and the largest of some values, as ``3 to 5``; one where both read alike."""
    least, most = written(min(values, default=0)), written(max(values, default=0))
    return most if least == most else f"{least} to {most}"


def listed(items: Sequence[str]) -> str:
    """``a, b and c``."""
    return items[0] if len(items) == 1 else f"{', '.join(items[:-1])} and {items[-1]}" if items else ""


def joints(numbers: Sequence[int]) -> str:
    """Joints by their numbers, in rising order: "joint 2", "joints 1, 2", "joints 1–5, 7"."""
    runs: list[list[int]] = []
    for j in numbers:
        if runs and j == runs[-1][-1] + 1:
            runs[-1].append(j)
        else:
            runs.append([j])
    parts = [f"{run[0]}–{run[-1]}" if len(run) > 2 else ", ".join(map(str, run)) for run in runs]
    return f"joint{'s' if len(numbers) > 1 else ''} {', '.join(parts)}"


def parameters(values: Mapping[str, object]) -> str:
    """Plain parameters as ``mass 0.45, com (0.03, 0, 0.02)``."""
    plain = {key.replace("_", " "): np.asarray(value, dtype=float).tolist() for key, value in values.items()}
    return ", ".join(f"{name} {vector(value)}" for name, value in plain.items())
