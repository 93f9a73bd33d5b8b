"""Settings of an experiment design: what a user chooses about an exciting motion, and what follows from it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from armloop.experiment.design.criteria import CRITERIA
from armloop.util.errors import InputError

LIBRARIES = ("rigid-body", "double-feature-set")

#: s of rigid-body, and of the double feature set up to three joints and beyond: it has several times as many columns
#: (94 at three joints, 156 at four, N1 = 1), and one short curve cannot tell them apart.
_DURATION, _DURATIONS = 20.0, (60.0, 120.0)
#: Random references that a comparison may take.
_MOST_RANDOM = 10_000
_LONGEST_PERIOD, _LONGEST = 120.0, 3600.0
#: Hz that the default number of harmonics reaches, about the band of the random trajectories.
_TOP = 0.4
_FEWEST, _MOST = 4, 64
_USUAL = (6, 48)
#: Products of columns and trigonometric functions reach beyond the motion's own band; this keeps most of them below
#: the corner of the low-pass that the log will meet.
_BELOW_CUTOFF = 5.0
_LARGEST_NOISE = 1e6  # N*m (N)


@dataclass(frozen=True)
class Settings:
    """Choices, with defaults that depend on each other left open as None.

    Attributes:
        library: one of :data:`LIBRARIES`, whose columns are to be determined.
        criterion: a key of `CRITERIA`.
        duration: s, a whole number of periods.
        base_frequency: Hz; by default one period is the duration, up to two minutes.
        harmonics: of the base frequency; by default as many as reach 0.4 Hz, 6 to 48.
        order: N1 of the double feature set.
        reserve: part of the effort limits kept free for what the torque's prediction lacks.
        noise: standard deviation of each joint's torque noise, N*m (N).
        cutoff_hz: low-pass that the log will meet.
        starts: of the optimiser; by default 4 up to four joints, else 3.
        seed: of the starts and of the random references.
        random: number of random references that it is compared with.
    """

    library: str = "rigid-body"
    criterion: str = "variance"
    duration: float | None = None
    base_frequency: float | None = None
    harmonics: int | None = None
    order: int = 1
    reserve: float = 0.2
    noise: tuple[float, ...] | None = None
    cutoff_hz: float = 10.0
    starts: int | None = None
    seed: int = 0
    random: int = 20

    def timing(self, joints: int) -> Timing:
        """Period, harmonics and number of periods for an arm of so many joints.

        Raises:
            InputError: a choice is unknown or out of range, or the duration is too short for the rest.
        """
        if self.criterion not in CRITERIA:
            raise InputError(f"unknown criterion {self.criterion!r}; there are: {', '.join(CRITERIA)}")
        if self.library not in LIBRARIES:
            raise InputError(
                f"no motion can be designed for library {self.library!r}; there are: {', '.join(LIBRARIES)}"
            )
        if not 1 <= self.order <= 3:
            raise InputError(
                f"order {self.order}: give 1, 2 or 3; beyond, no motion tells the candidates apart"
            )
        if not 0 <= self.reserve < 1:
            raise InputError(f"reserve {self.reserve:g}: give a part of the effort limits, from 0 to below 1")
        noise = self.noise
        if noise is not None and (len(noise) != joints or not all(0 < x <= _LARGEST_NOISE for x in noise)):
            raise InputError(f"noise must be {joints} positive numbers, one per joint, not {noise}")
        if not 3 <= self.random <= _MOST_RANDOM:
            raise InputError(
                f"random {self.random}: at least 3 random references are needed for a comparison, and at most "
                f"{_MOST_RANDOM}"
            )
        duration = self.duration
        if duration is None:
            duration = _DURATION if self.library == "rigid-body" else _DURATIONS[joints > 3]
        if not 0 < duration <= _LONGEST:
            raise InputError(f"duration {duration:g} s: give more than 0 and at most {_LONGEST:g} s")
        period, periods = _period(duration, self.base_frequency)
        harmonics = self.harmonics
        if harmonics is None:
            harmonics = min(_USUAL[1], max(_USUAL[0], round(_TOP * period)))
        if not _FEWEST <= harmonics <= _MOST:
            raise InputError(f"harmonics {harmonics}: give {_FEWEST} to {_MOST}")
        highest = self.cutoff_hz / _BELOW_CUTOFF
        if self.cutoff_hz > 0 and harmonics / period > highest:
            raise InputError(
                f"duration too short: {harmonics} harmonics in a period of {period:g} s reach {harmonics / period:.3g} Hz, "
                f"more than a fifth of the low-pass of {self.cutoff_hz:g} Hz; give a period of at least "
                f"{harmonics / highest:.3g} s, or fewer harmonics"
            )
        return Timing(period, periods, harmonics)


@dataclass(frozen=True)
class Timing:
    """Period in s, number of periods, and harmonics of 1 / period."""

    period: float
    periods: int
    harmonics: int

    @property
    def duration(self) -> float:
        """The whole motion, s."""
        return self.period * self.periods


def _period(duration: float, base_frequency: float | None) -> tuple[float, int]:
    if base_frequency is None:
        periods = max(1, math.ceil(duration / _LONGEST_PERIOD - 1e-9))
        return duration / periods, periods
    if not 0 < base_frequency < math.inf:
        raise InputError(f"base frequency {base_frequency:g} Hz: give a positive number")
    periods = round(duration * base_frequency)
    if periods < 1:
        raise InputError(
            f"duration too short: {duration:g} s is less than one period of {base_frequency:g} Hz, "
            f"{1 / base_frequency:g} s"
        )
    if abs(periods - duration * base_frequency) > 1e-6 * periods:
        raise InputError(
            f"duration {duration:g} s is no whole number of periods of {base_frequency:g} Hz; give "
            f"{periods / base_frequency:g} s"
        )
    return 1 / base_frequency, periods


def baseline_noise(rmse: Sequence[float | None] | None) -> tuple[float, ...] | None:
    """What a model leaves on its own data (n,), as the noise of each joint's torque; None where it does not say for all."""
    return tuple(float(x) for x in rmse if x) if rmse and all(rmse) else None
