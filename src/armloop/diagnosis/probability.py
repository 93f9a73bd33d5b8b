"""Calibration by histogram binning (Zadrozny and Elkan 2001): how often what was named so was there, in blind tests.

The counts are of verdicts on 247 runs whose answers were sealed: 192 of 24 arms of MuJoCo, and 55 measured ones of a UR10e
and a UR5 to which effects were added (``tests/blind/calibrate.py`` prints them of kept tests). A bin's probability is
(right + 1) / (named + 2), Laplace's rule of succession: few cases state little.
"""

from __future__ import annotations

from typing import NamedTuple


class Bin(NamedTuple):
    """How many were named, and how many of these were there; of effects, with at least a share of what can be explained,
    and at least so many times the baseline.
    """

    named: int
    right: int
    least_share: float = 0.0
    least_times: float = 0.0

    @property
    def probability(self) -> float:
        """Rule of succession."""
        return (self.right + 1) / (self.named + 2)


#: Effects by the part of what can be explained that they remove, and by how many times more than the model's own
#: shortcomings: a companion that removes little is false more often, and so is what hardly exceeds the baseline.
EFFECTS = (Bin(144, 140, 0.05, 3.0), Bin(20, 18))
#: Events of a run, and residuals that follow no listed effect.
EVENT, UNLISTED = Bin(21, 20), Bin(23, 23)


def bin_of(share: float, times: float) -> Bin:
    """What is counted together with an effect that removes this share, and so many times the baseline."""
    return next((b for b in EFFECTS if share >= b.least_share and times >= b.least_times), EFFECTS[-1])


def of_effect(share: float, times: float) -> float:
    """Probability that an effect is there, or one of its alternatives."""
    return bin_of(share, times).probability
