"""Time window of an event: an interval of one log, told from other logs with the same clock."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from armloop.data.motion import Motion
from armloop.laws.effects.base import Estimate, Value, number
from armloop.laws.effects.spells import Interval, during_any
from armloop.util.arrays import Array, Mask


def during(motion: Motion, parameters: dict[str, Value]) -> Mask:
    """(N,) samples within an event's interval.

    ``posture``, the joints' positions at ``start``, says which log it was: every log's clock passes the same
    times, and no two motions measured pass the same numbers. Without it every run counts.
    """
    start, end = number(parameters["start"]), number(parameters["end"])
    posture = parameters.get("posture")
    if posture is None:
        return (motion.time >= start) & (motion.time <= end)
    return during_any(motion, [Interval(start, end, tuple(np.asarray(posture, dtype=float).tolist()))])


def ends(parameters: Mapping[str, Estimate]) -> tuple[float, float]:
    """Start and end, s, of an event that was found."""
    return number(parameters["start"].value), number(parameters["end"].value)


def ends_before_it_starts(parameters: Mapping[str, Any]) -> str:
    """The fault of an event's interval; empty if it has none."""
    late = number(parameters["end"]) <= number(parameters["start"])
    return "end must come after start" if late else ""


def interval(
    start: float, end: float, errors: tuple[float, float], posture: Array, unit: str
) -> dict[str, Estimate]:
    """The parameters by which :func:`during` knows an event; standard errors of its start and its end."""
    still = [0.0] * len(posture)
    return {
        "start": Estimate(start, errors[0], "s"),
        "end": Estimate(end, errors[1], "s"),
        "posture": Estimate([float(x) for x in posture], still, unit),
    }
