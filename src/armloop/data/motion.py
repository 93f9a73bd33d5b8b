"""A motion and its measured forces as plain arrays: what all numerics take in.

`Motion` is kinematics only and serves prediction; `Samples` adds the forces and serves regression.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armloop.data.filters import filter_reach
from armloop.util.arrays import Array, Index, Mask
from armloop.util.errors import InputError

#: A clock that goes on for so many seconds without a record is another log's: its drive is as cold as at first.
_ANOTHER = 3600.0


@dataclass(frozen=True, eq=False)
class Motion:
    """Positions, velocities and accelerations of `n` joints at `N` instants, in `R` runs without gaps.

    time : (N,) seconds
    q, v, vdot : (N, n) rad, rad/s, rad/s^2 (m, m/s, m/s^2 for a prismatic joint)
    starts : (R,) index of the first sample of each run; `starts[0] == 0`; one run by default
    begins : (R,) instant at which the record of each run began, where a filter has cut its ends; None where it is that of
        the first sample

    Raises `InputError` when the shapes do not agree.
    """

    time: Array
    q: Array
    v: Array
    vdot: Array
    starts: Index = field(default_factory=lambda: np.array([0]))
    begins: Array | None = None

    def __post_init__(self) -> None:
        for key in ("time", "q", "v", "vdot", "begins"):
            given = getattr(self, key)
            if type(given) is not np.ndarray or given.dtype != np.float64:
                if key != "begins" or given is not None:
                    object.__setattr__(self, key, _as_array(given, key, "fiu", np.float64))
        if type(self.starts) is not np.ndarray or self.starts.dtype != np.intp:
            object.__setattr__(self, "starts", _as_array(self.starts, "starts", "iu", np.intp))
        if self.time.ndim != 1 or self.q.ndim != 2 or len(self.q) != len(self.time):
            raise InputError(f"time must be (N,) and q (N, n); they are {self.time.shape} and {self.q.shape}")
        if self.v.shape != self.q.shape or self.vdot.shape != self.q.shape:
            raise InputError(
                "q, v and vdot must have one shape; "
                f"they are {self.q.shape}, {self.v.shape}, {self.vdot.shape}"
            )
        if self.starts.ndim != 1 or len(self.starts) == 0 or self.starts[0] != 0:
            raise InputError("starts must begin with 0, the first sample of the first run")
        if len(self.starts) > 1:
            last = int(self.starts[-1])
            if last >= self.samples or (self.starts[1:] <= self.starts[:-1]).any():
                raise InputError(
                    f"starts must rise, each the index of one of the {self.samples} samples; the last is {last}"
                )
        falls = np.flatnonzero(self.time[1:] < self.time[:-1]) + 1
        falls = falls[~np.isin(falls, self.starts)] if len(falls) else falls
        if len(falls):
            row = int(falls[0])
            raise InputError(
                f"time must not fall within a run: it does at sample {row}, {self.time[row - 1]:g} to {self.time[row]:g} s; "
                "starts takes the first sample of each run"
            )
        if self.begins is not None and self.begins.shape != self.starts.shape:
            raise InputError(
                f"begins must have the shape of starts, {self.starts.shape}; it is {self.begins.shape}"
            )

    @classmethod
    def joined(cls, motions: Sequence["Motion"]) -> "Motion":
        """Return motions of the same joints as one; none of their runs goes on in the next."""
        before = np.cumsum([0, *(m.samples for m in motions[:-1])])
        starts = np.concatenate([m.starts + n for m, n in zip(motions, before, strict=True)])
        time, q, v, vdot = (
            np.concatenate([getattr(m, key) for m in motions]) for key in ("time", "q", "v", "vdot")
        )
        begins = np.concatenate([m.time[m.starts] if m.begins is None else m.begins for m in motions])
        return cls(time, q, v, vdot, starts, begins)

    @classmethod
    def accelerated(cls, q: Array) -> "Motion":
        """(P n) samples at rest at postures q (P, n), each joint accelerated by one in turn: they show a mass matrix."""
        postures = np.repeat(q, q.shape[1], axis=0)
        unit = np.tile(np.eye(q.shape[1]), (len(q), 1))
        return cls(np.arange(float(len(postures))), postures, np.zeros_like(postures), unit)

    def take(self, rows: Any, starts: Index | None = None) -> "Motion":
        """Return some of the samples, in order, as one run of each record's clock, unless `starts` says otherwise."""
        time = self.time[rows]
        starts = np.concatenate([[0], np.flatnonzero(time[1:] < time[:-1]) + 1]) if starts is None else starts
        return Motion(time, self.q[rows], self.v[rows], self.vdot[rows], starts)

    @property
    def samples(self) -> int:
        """The number of samples N."""
        return len(self.time)

    @property
    def joints(self) -> int:
        """The number of joints n."""
        return self.q.shape[1]

    @property
    def period(self) -> float:
        """The usual time between samples in seconds, free of the stamps' rounding; 0 for a single sample."""
        steps = np.diff(self.time)
        median = np.median(steps) if len(steps) else 0.0
        usual = np.abs(steps - median) <= 1e-2 * median
        return float(steps[usual].mean()) if usual.any() else float(median)

    @cached_property
    def elapsed(self) -> Array:
        """(N,) seconds since the record of each sample's log began.

        Runs whose clock goes on belong to one log; a clock that goes back is another's. Where one clock stamps all logs,
        another begins after an hour without a record.
        """
        steps = self.time[self.starts[1:]] - self.time[self.starts[1:] - 1]
        first = np.concatenate([[True], (steps <= 0) | (steps > _ANOTHER)])
        lengths = np.diff(np.append(self.starts[first], self.samples))
        begins = self.time[self.starts] if self.begins is None else self.begins
        return np.asarray(self.time - np.repeat(begins[first], lengths))

    @property
    def seconds(self) -> float:
        """The length of all runs together, s."""
        return sum(float(np.ptp(self.time[run])) for run in self.runs())

    def run_of(self, sample: int) -> slice:
        """Return the samples of the run that a sample lies in."""
        return next(run for run in self.runs() if run.start <= sample < run.stop)

    def runs(self) -> list[slice]:
        """Return the samples of each run as a slice, in order."""
        ends = [*self.starts[1:], self.samples]
        return [slice(int(first), int(last)) for first, last in zip(self.starts, ends, strict=True)]


def _as_array(given: Any, name: str, kinds: str, dtype: type) -> NDArray[Any]:
    """What is no array of a type yet as one; raises `InputError` where it holds no numbers of these kinds of numpy's."""
    try:
        found = np.asarray(given)
    except ValueError:
        found = np.asarray(None)
    if found.dtype.kind not in kinds:
        numbers = "numbers" if "f" in kinds else "whole numbers"
        raise InputError(
            f"{name} of a motion must be an array of {numbers}; it is of type {type(given).__name__}"
            + (f" and holds {found.dtype}" if isinstance(given, np.ndarray) else "")
        )
    return found.astype(dtype)


@dataclass(frozen=True, eq=False)
class Samples:
    """A motion with its measured generalized forces.

    motion : the kinematics, N samples of n joints
    tau : (N, n) N*m (N for a prismatic joint)
    moving : (N, n) true where joint j slides: |v_j| is above the dead zone of its velocity noise, tau is known, and no
        standstill is so near that the filter has mixed it in
    period : the sample period in seconds
    cutoff_hz : corner of the low-pass that tau has passed; 0 where there was none
    spans : (R, 2) first and last instant of the recorded run that each run of the motion was cut from; None where
        the runs are as they were recorded
    wider : corner of the low-pass that the motion has passed, as a multiple of tau's
    unknown : (N, n) true where tau is no measurement of the joint's torque (it counts as not moving); None where all are
    fastest : (n,) largest speed of each joint, rad/s (m/s), infinite where it gets nowhere; None where nobody looked
    velocity_noise : (n,) noise of each joint's speed that its dead zone goes by, rad/s (m/s); None where there is none

    Raises `InputError` when the shapes do not agree.
    """

    motion: Motion
    tau: Array
    moving: Mask
    period: float
    cutoff_hz: float = 0.0
    spans: Array | None = None
    wider: float = 1.0
    unknown: Mask | None = None
    fastest: Array | None = None
    velocity_noise: Array | None = None

    def __post_init__(self) -> None:
        if self.tau.shape != self.motion.q.shape or self.moving.shape != self.motion.q.shape:
            raise InputError(
                f"tau and moving must have the shape of q, {self.motion.q.shape}; "
                f"they are {self.tau.shape}, {self.moving.shape}"
            )

    @property
    def reach(self) -> float:
        """Seconds to either side over which the samples' low-pass smears a step."""
        return filter_reach(self.cutoff_hz)

    @property
    def at_an_end(self) -> Mask:
        """(N,) so near a run's start or end that the filter still shows how the arm began or ceased to move.

        A controller that is switched on, a reference that begins at speed, or brakes that fall in, make it jump.
        """
        motion = self.motion
        near = np.zeros(motion.samples, dtype=bool)
        for run in motion.runs():
            time = motion.time[run]
            near[run] = np.minimum(time - time[0], time[-1] - time) < self.reach
        return near
