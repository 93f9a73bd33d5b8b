"""Motion ranges: what the joints may do during a collection."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from armloop.robot.arm import Arm
from armloop.util.arrays import Array
from armloop.util.errors import InputError


@dataclass(frozen=True, eq=False)
class MotionRanges:
    """What joints may do during a collection, as Tables 1 and 3 of the paper state it.

    lower, upper : (n,) rad (m); velocity : (n,) rad/s (m/s); acceleration : (n,) rad/s^2 (m/s^2), both +-

    Raises `ValueError` when the shapes do not agree or a range is empty.
    """

    lower: Array
    upper: Array
    velocity: Array
    acceleration: Array

    def __post_init__(self) -> None:
        for name in ("lower", "upper", "velocity", "acceleration"):
            value = np.asarray(getattr(self, name), dtype=float)
            object.__setattr__(self, name, value)
            if value.ndim != 1 or value.shape != self.lower.shape or not np.isfinite(value).all():
                raise ValueError(f"{name} must be finite numbers, one per joint; it is {value}")
        if not (
            np.all(self.lower < self.upper) and np.all(self.velocity > 0) and np.all(self.acceleration > 0)
        ):
            raise ValueError("each range must have lower below upper, and velocity and acceleration above 0")

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.lower)

    def used(self, q: Array, v: Array, vdot: Array) -> Array:
        """Return (n,) the largest part of a joint's travel, velocity and acceleration that a motion (N, n) takes."""
        parts = np.ptp(q, axis=0), np.abs(v).max(axis=0), np.abs(vdot).max(axis=0)
        limits = self.upper - self.lower, self.velocity, self.acceleration
        return np.maximum.reduce([part / limit for part, limit in zip(parts, limits, strict=True)])

    @staticmethod
    def of(arm: Arm) -> MotionRanges:
        """Return ranges for an arm without stated ones: nine tenths of its travel, half its speed.

        Joints without a limit get +-pi rad (+-0.1 m) and 1 rad/s (0.1 m/s), those with one as much travel on its free
        side; acceleration is twice the velocity.
        """
        turns = arm.revolute
        lower, upper, velocity = (
            np.array([getattr(joint, key) for joint in arm.joints], dtype=float)
            for key in ("lower", "upper", "velocity")
        )
        travel = np.where(turns, 2 * np.pi, 0.2)
        lower = np.where(np.isfinite(lower), lower, np.where(np.isfinite(upper), upper - travel, -travel / 2))
        upper = np.where(np.isfinite(upper), upper, lower + travel)
        half = 0.45 * (upper - lower)
        centre = 0.5 * (upper + lower)
        limited = np.isfinite(velocity)
        speed = np.where(limited, 0.5 * np.where(limited, velocity, 0.0), np.where(turns, 1.0, 0.1))
        return MotionRanges(centre - half, centre + half, speed, 2.0 * speed)


def ranges_with(arm: Arm, ranges: MotionRanges | None, **stated: Sequence[float] | None) -> MotionRanges:
    """Return ranges in which what is stated (`lower`, `upper`, `velocity`, `acceleration`) stands instead.

    ranges : what else holds; `MotionRanges.of` the arm when None, and then accelerations follow a stated
        velocity

    Raises `InputError` when a range is empty or beyond the limits of the arm's URDF.
    """
    given = {key: np.array(values, dtype=float) for key, values in stated.items() if values is not None}
    if ranges is None:
        ranges = MotionRanges.of(arm)
        if "velocity" in given:
            given = {"acceleration": 2.0 * given["velocity"]} | given
    try:
        ranges = replace(ranges, **given)
    except ValueError as error:
        raise InputError(f"{arm.name}: no motion is within the ranges: {error}") from error
    for joint, low, high, speed in zip(arm.joints, ranges.lower, ranges.upper, ranges.velocity, strict=True):
        if low < joint.lower or high > joint.upper or speed > joint.velocity:
            raise InputError(
                f"{arm.name}: joint {joint.name!r} would go from {low:.4g} to {high:.4g} {joint.position_unit} at "
                f"up to {speed:.4g} a second; its URDF allows {joint.lower:.4g} to {joint.upper:.4g} at "
                f"{joint.velocity:.4g}"
            )
    return ranges


def speeds(arm: Arm, revolute: float, prismatic: float) -> Array:
    """Return (n,) the value for turning joints where a joint turns, else that for sliding ones."""
    return np.where(arm.revolute, revolute, prismatic)
