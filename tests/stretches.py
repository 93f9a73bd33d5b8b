"""Runs at rest, and levels of stretches in them: numbers small enough to see through."""

from __future__ import annotations

import numpy as np

from armloop.data.motion import Motion


def motion(lengths: list[int], period: float = 0.04, joints: int = 1, pause: float = 5.0) -> Motion:
    """Runs of so many samples, at rest, with a pause between them."""
    N, starts = sum(lengths), np.cumsum([0, *lengths[:-1]])
    time = np.arange(N) * period + pause * (np.searchsorted(starts, np.arange(N), side="right") - 1)
    return Motion(time, *np.zeros((3, N, joints)), starts)


def steps(N: int, *stretches: tuple[int, int, float]) -> np.ndarray:
    """Zero but for stretches [first, last] of a height."""
    level = np.zeros(N)
    for first, last, height in stretches:
        level[first : last + 1] = height
    return level


def circling(N: int, period: int) -> Motion:
    """One joint that swings between -1 and 1 rad, a period of so many samples of 0.04 s."""
    phase = np.arange(N) * 2 * np.pi / period
    q, v = np.sin(phase)[:, None], np.cos(phase)[:, None]
    return Motion(np.arange(N) * 0.04, q, v, np.zeros((N, 1)), np.array([0]))
