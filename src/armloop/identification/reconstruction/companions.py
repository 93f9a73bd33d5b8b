"""Wald test of laws that stand beside others: what a law that was found brings along that the base parameters say too.

A spring that pulls by levers has a part that is as a weight: beside the base parameters it removes next to nothing, for
these have soaked it up. It is there if its coefficients are, by their errors over blocks (Hotelling's T²), and then the
base parameters are not what they were.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from scipy.stats import f

from armloop.identification.reconstruction.projected import CHANCE, Trial
from armloop.laws.effects import Effect, kinds


class _Chosen(Protocol):
    @property
    def effect(self) -> Effect: ...


def companions(chosen: Sequence[_Chosen]) -> list[Effect]:
    """Laws that an arm may have beside those chosen, at their joints, and only there."""
    every = kinds()
    places = dict.fromkeys(
        (kind, law.effect.joint) for law in chosen for kind in every if law.effect.name in kind.beside
    )
    return [kind(joint) for kind, joint in places]


def accompanied(effect: Effect, chosen: Sequence[_Chosen]) -> bool:
    """Whether one of the laws that a companion stands beside is among those chosen, at its joint."""
    return any(law.effect.name in effect.beside and law.effect.joint == effect.joint for law in chosen)


def is_there(trial: Trial | None) -> bool:
    """Whether coefficients are not zero, beyond chance, by their covariance over blocks; None where they say nothing new."""
    if trial is None or trial.blocks <= len(trial.coefficients):
        return False
    x, blocks = trial.coefficients, trial.blocks
    # fewer blocks than coefficients leave the covariance singular
    squared = float(x @ np.linalg.lstsq(trial.covariance, x, rcond=None)[0])
    p = len(x)
    return squared > p * (blocks - 1) / (blocks - p) * float(f.isf(CHANCE, p, blocks - p))
