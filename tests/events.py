"""Runs of a motion at rest, and events in them."""

import numpy as np

from armloop.data.motion import Motion
from armloop.laws.effects import Estimate, effect
from armloop.model import AddedEffect


def motion(lengths: tuple[int, ...] = (100,), joints: int = 2, period: float = 0.1) -> Motion:
    """Runs of so many samples, 5 s apart."""
    N, starts = sum(lengths), np.cumsum([0, *lengths[:-1]])
    time = np.arange(N) * period + 5.0 * (np.searchsorted(starts, np.arange(N), side="right") - 1)
    return Motion(time, *np.zeros((3, N, joints)), starts)


def event(start: float, end: float, name: str = "external_torque") -> AddedEffect:
    values = {"start": Estimate(start, 0.0, "s"), "end": Estimate(end, 0.0, "s")}
    return AddedEffect(effect(name, 1), values)
