"""Design an exciting reference for an arm and a library, and compare it with random ones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from armloop.data.motion import Motion
from armloop.experiment.design.columns import double_feature_columns, rigid_body_columns
from armloop.experiment.design.criteria import CRITERIA, ROUND_OFF, condition_number
from armloop.experiment.design.data_ratio import DataRatio, data_ratio, spread
from armloop.experiment.design.information import Regression
from armloop.experiment.design.limits import (
    LIMITED,
    Limits,
    TorqueLaw,
    check_rest,
    hardly_any_motion,
    nominal_torque,
)
from armloop.experiment.design.optimise import Problem
from armloop.experiment.design.random import random_references
from armloop.experiment.design.series import Series, sampled
from armloop.experiment.design.settings import Settings, Timing
from armloop.experiment.excitation import FourierReference, MotionRanges
from armloop.robot.arm import Arm
from armloop.util.arrays import Array
from armloop.util.errors import InputError
from armloop.util.finite import finite
from armloop.util.progress import Progress, silent
from armloop.util.workers import one_thread

#: Speed below which a joint's direction fades in the columns, relative to its fastest.
_SLOW = 0.02
#: Torque noise relative to a drive's effort limit, or to the predicted torque's size where there is none.
_NOISE = 0.01
#: Beyond this, coefficients drown in the noise.
_SINGULAR = 1e5
#: s between samples for the comparison; as information is a mean over samples, it only has to be short enough.
_STEP = 0.05
_POOL = 48


@dataclass(frozen=True)
class Measure:
    """How informative a reference is.

    Attributes:
        condition: condition number of the scaled regression.
        logdet: log-determinant (natural) of the mean information of a sample.
        error: root mean square standard error of the coefficients, times the root of the number of samples.
    """

    condition: float
    logdet: float
    error: float


@dataclass(frozen=True, eq=False)
class Excitation:
    """An optimised reference with the account of how it came about.

    Attributes:
        use: (4, n) largest part used of the limits of position, velocity, acceleration and torque.
        random: measures of random references within the same limits.
        starts: the criterion's value after each start.
        notes: what the user should know.
    """

    arm: Arm
    settings: Settings
    timing: Timing
    reference: FourierReference
    regression: Regression
    limits: Limits
    use: Array
    measure: Measure
    random: list[Measure]
    starts: list[float]
    notes: list[str]

    def compare(self) -> DataRatio:
        """How much more data random references of one period need for the same coefficient error."""
        period = self.timing.period
        motions = [
            sampled(reference, _STEP)
            for reference in random_references(self.limits, period, _POOL, self.settings.seed + 1)
        ]
        return data_ratio(self.regression, self.period_motion(_STEP), motions, self.settings.seed)

    def period_motion(self, step: float) -> Motion:
        """One period of the reference, sampled."""
        motion = sampled(self.reference, step)
        return motion.take(motion.time < self.timing.period - 1e-9)

    def to_dict(self) -> dict[str, Any]:
        """The answer of ``armloop excite --json``, without the path."""
        table = {key: [getattr(m, key) for m in self.random] for key in ("condition", "logdet", "error")}
        return {
            "library": self.settings.library,
            "criterion": self.settings.criterion,
            "coefficients": self.regression.count,
            "duration": self.timing.duration,
            "period": self.timing.period,
            "harmonics": self.timing.harmonics,
            # a measure is infinite where some coefficients are not determined at all
            **{key: finite(getattr(self.measure, key)) for key in table},
            "random": {key: {**spread(values), "count": len(values)} for key, values in table.items()},
            "use": dict(zip(LIMITED, self.use.tolist(), strict=True)),
            "notes": self.notes,
        }


@one_thread
def excite(
    arm: Arm,
    ranges: MotionRanges,
    settings: Settings,
    torque: TorqueLaw | None = None,
    progress: Progress = silent,
) -> Excitation:
    """Design an exciting reference.

    Args:
        ranges: of position, velocity and acceleration.
        torque: predicts the joint torques; by default from the URDF's inertias, without friction.

    Raises:
        InputError: settings out of range, or limits that exclude any motion.
    """
    timing = settings.timing(arm.n)
    limits = Limits(ranges, (1 - settings.reserve) * arm.effort, torque or nominal_torque(arm))
    notes = _effort_notes(arm)
    check_rest(arm, limits)
    progress(f"{settings.random} random references of {timing.period:g} s within the limits")
    drawn = random_references(limits, timing.period, settings.random, settings.seed)
    if len(drawn) < 3:
        raise hardly_any_motion(arm, limits)
    step = timing.period / (32 * timing.harmonics)
    typical = [sampled(reference, min(step, _STEP)) for reference in drawn]
    regression = _regression(arm, limits, settings, typical)
    if dropped := len(regression.names) - regression.count:
        notes.append(
            f"{dropped} columns are sums of others on every motion within the limits and were left out"
        )
    series = Series(arm.n, timing.harmonics, timing.period)
    problem = Problem(series, regression, CRITERIA[settings.criterion], limits)
    starts = settings.starts or (4 if arm.n <= 4 else 3)
    progress(
        f"optimising {arm.n * series.free} numbers for {regression.count} coefficients "
        f"({settings.library}, {settings.criterion})"
    )
    design = problem.optimise(starts, settings.seed, progress=progress)
    if design is None:
        raise InputError(f"{arm.name}: no motion within the limits was found; widen the ranges or the effort")
    reference = FourierReference(**{**design.reference.__dict__, "duration": timing.duration})
    measure = measured(regression, sampled(design.reference, min(step, _STEP)))
    if not measure.condition < _SINGULAR:
        notes.append(
            f"the motion does not tell all {regression.count} coefficients apart (condition number "
            f"{measure.condition:.2g}); give a longer duration with more harmonics, or join several motions"
        )
    notes.append(
        "the motion knows nothing of obstacles, nor of the arm hitting itself: watch it in slow motion first"
    )
    return Excitation(
        arm,
        settings,
        timing,
        reference,
        regression,
        limits,
        limits.use(sampled(design.reference, problem.fine_step)),
        measure,
        [measured(regression, motion) for motion in typical],
        design.starts,
        notes,
    )


def measured(regression: Regression, motion: Motion) -> Measure:
    """How informative a motion is for a regression."""
    F = regression.information(motion)
    values = np.linalg.eigvalsh(F)
    if not values[0] > ROUND_OFF * values[-1]:
        return Measure(np.inf, -np.inf, np.inf)
    return Measure(condition_number(F), float(np.log(values).sum()), float(np.sqrt((1 / values).mean())))


def _regression(arm: Arm, limits: Limits, settings: Settings, typical: list[Motion]) -> Regression:
    slow = _SLOW * limits.ranges.velocity
    if settings.library == "rigid-body":
        columns, names = rigid_body_columns(arm, slow)
        return Regression.of(columns, names, _noise(arm, limits, settings, typical), typical)
    columns, names = double_feature_columns(arm.revolute.tolist(), settings.order, slow)
    # every joint alone is regressed on the same columns: the level of its noise changes nothing
    return Regression.of(columns, names, np.ones(1), typical)


def _noise(arm: Arm, limits: Limits, settings: Settings, typical: list[Motion]) -> Array:
    """(n,) standard deviations of the torque noise, N*m (N)."""
    if settings.noise is not None:
        return np.array(settings.noise, dtype=float)
    rms = np.sqrt(np.mean([np.mean(limits.torque(motion) ** 2, axis=0) for motion in typical], axis=0))
    rms = np.where(rms > 1e-6 * rms.max(initial=1e-6), rms, 1.0)
    return np.asarray(_NOISE * np.where(np.isfinite(arm.effort), arm.effort, rms))


def _effort_notes(arm: Arm) -> list[str]:
    notes = []
    unlimited = [joint.name for joint in arm.joints if not np.isfinite(joint.effort)]
    if unlimited:
        which = "any joint" if len(unlimited) == arm.n else ", ".join(unlimited)
        notes.append(f"the URDF states no effort limit for {which}: the torque there is unbounded")
    if len(unlimited) < arm.n and not arm.mass.any() and not arm.inertia.any():
        notes.append("the URDF states no inertias: the predicted torque is zero and its limits say nothing")
    return notes
