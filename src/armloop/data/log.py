"""A motion log: what was measured on an arm, one row per sample, checked at the door.

`MotionLog` checks what Python gives and `read_log` what a file gives by the same rules (`armloop.data.plausibility`).

The file is CSV, or Parquet with the same columns: `time,q1..qn,v1..vn,tau1..taun`, optionally `vdot1..vdotn`;
SI units; joints numbered from 1, base to tip. Columns of any other name are left alone.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from html import escape
from itertools import chain, pairwise
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armloop.data.dropouts import mended, mended_part
from armloop.data.header import check_header, columns_of
from armloop.data.plausibility import doubts, faults, is_time_series
from armloop.data.rate_noise import central_differences, rate_noise
from armloop.data.recorded import Finding, Recorded
from armloop.data.redundancy import velocity_lag
from armloop.data.stamps import bridged, coincident
from armloop.data.tables import place, read_columns, write_columns
from armloop.data.torque_unit import check_unit, said_of_unit, told_unit
from armloop.util.arrays import Array, Mask
from armloop.util.doubts import warn
from armloop.util.errors import LogError
from armloop.util.given import path_of

GAP_PERIODS = 10.0
"""A pause longer than this many median sample periods starts a new run."""
#: Fewer rows than this are no motion: filters and derivatives need more.
FEWEST_SAMPLES = 20
#: N*m/A (N/A): from below that of a watch to above that of a crane.
GAINS = (1e-6, 1e6)


@dataclass(frozen=True, eq=False, repr=False)
class MotionLog:
    """What was measured on an arm of `n` joints at `N` instants.

    time : (N,) seconds, strictly rising
    q, v : (N, n) measured rad, rad/s (m, m/s for a prismatic joint)
    tau : (N, n) measured generalized force in `tau_unit` (N*m stands for N on a prismatic joint)
    vdot : (N, n) rad/s^2 (m/s^2), or None when the file has none
    name : what to call the log, the file's stem
    tau_unit : "N*m", or "A" for motor current
    v_derived : v was not measured; it is the derivative of q (see `from_arrays`)

    Lists are converted. Raises `LogError`, one line that names the log, the column and the row, for shapes that do
    not agree, numbers that are not finite, time that does not rise and what no arm can have done: degrees, spikes,
    a v that is not the rate of q.
    """

    time: Array
    q: Array
    v: Array
    tau: Array
    vdot: Array | None = None
    name: str = "log"
    tau_unit: str = "N*m"
    v_derived: bool = False

    #: The log of which it is a stretch, and which of its rows.
    _part_of: ClassVar[tuple["MotionLog", slice] | None] = None

    def columns(self) -> dict[str, Array]:
        """Return what was measured by the names of the columns of its file, (N,) each, in their order."""
        columns = {"time": self.time}
        for kind, values in (("q", self.q), ("v", self.v), ("tau", self.tau), ("vdot", self.vdot)):
            if values is not None and not (kind == "v" and self.v_derived):
                columns |= {f"{kind}{j + 1}": values[:, j] for j in range(self.joints)}
        return columns

    def __post_init__(self) -> None:
        check_unit(self.tau_unit, self.name)
        for key in ("time", "q", "v", "tau", "vdot"):
            if key != "vdot" or self.vdot is not None:
                object.__setattr__(self, key, _numbers(getattr(self, key), key, self.name))
        _check_shapes(self.time, self.q, self.name)
        if 0 in self.q.shape:
            raise LogError(f"{self.name}: q is {self.q.shape}; a log has samples and joints")
        for label, values in (("v", self.v), ("tau", self.tau), ("vdot", self.vdot)):
            if values is not None and values.shape != self.q.shape:
                raise LogError(
                    f"{self.name}: {label} must have the shape of q, {self.q.shape}; it is {values.shape}"
                )
        for key in ("time", "q", "v", "tau", "vdot"):
            values = getattr(self, key)
            if values is not None and not np.isfinite(values).all():
                row, *column = np.argwhere(~np.isfinite(values))[0]
                raise LogError(
                    f"{self.name}: {key}{f' of joint {column[0] + 1}' if column else ''}, row {row + 1}: "
                    f"{values[row, *column]} is not a finite number; correct it or drop the row"
                )
        _check(self, self.name, lambda row: f"row {row + 1}")

    @classmethod
    def from_arrays(
        cls,
        time: ArrayLike,
        q: ArrayLike,
        tau: ArrayLike,
        *,
        v: ArrayLike | None = None,
        vdot: ArrayLike | None = None,
        name: str = "log",
        tau_unit: str = "N*m",
    ) -> "MotionLog":
        """Make a log of anything that can be an array; where there is no v, q is differentiated, run by run.

        v and vdot are given by name, for their order after tau is not that of a file's columns.
        What is doubtful is said as `armloop.util.errors.InputWarning`. Raises `LogError` as the class does.
        """
        seconds, positions = _numbers(time, "time", name), _numbers(q, "q", name)
        rates = differentiated(seconds, positions, name) if v is None else _numbers(v, "v", name)
        log = cls(seconds, positions, rates, np.asarray(tau), vdot, name, tau_unit, v is None)  # type: ignore[arg-type]
        _say_doubts(log)
        return log

    @classmethod
    def from_frame(
        cls, frame: Any, *, joints: int | None = None, name: str = "log", tau_unit: str = "N*m"
    ) -> "MotionLog":
        """Make a log of a data frame (pandas, polars, pyarrow), or a dict of columns, as in a file: `time,q1..,v1..,tau1..`.

        joints : how many joints the arm has; None takes what the frame has. v may be missing: see `from_arrays`

        Raises `LogError` when columns are missing, and as the class does.
        """
        names = frame.keys() if isinstance(frame, Mapping) else getattr(frame, "columns", None)
        names = getattr(frame, "column_names", names)
        if names is None:
            raise LogError(
                f"{name}: {type(frame).__name__} has no columns by name; give a data frame or a dict of columns "
                "time,q1..,v1..,tau1.., or arrays to MotionLog.from_arrays"
            )
        kinds = columns_of(Path(name), [str(column) for column in names], joints)
        seconds = _numbers(_column(frame, "time", name), "time", name)
        columns: dict[str, Array] = {}
        for key in chain(*kinds.values()):
            columns[key] = _numbers(_column(frame, key, name), key, name)
            if columns[key].shape != seconds.shape or seconds.ndim != 1:
                raise LogError(
                    f"{name}: {key} has the shape {columns[key].shape}, time {seconds.shape}; each column must be (N,)"
                )
        return cls.from_arrays(seconds, **_side_by_side(columns, kinds), name=name, tau_unit=tau_unit)

    def __repr__(self) -> str:
        runs, seconds = len(self.runs()), float(self.time[-1] - self.time[0])
        return (
            f"<armloop.MotionLog {self.name}: {self.q.shape[1]} joints, {self.samples} samples in {runs} "
            f"{'run' if runs == 1 else 'runs'}, {seconds:.4g} s, tau in {self.tau_unit}>"
        )

    def __str__(self) -> str:
        unit = "A" if self.tau_unit == "A" else "N·m"
        lines = [repr(self), f"joint       q, rad (m)  largest |v|, 1/s  |tau|, {unit}"]
        for j in range(self.joints):
            q, v, tau = self.q[:, j], self.v[:, j], self.tau[:, j]
            reach = f"{q.min():.3g} … {q.max():.3g}"
            lines.append(f"{j + 1:<5d} {reach:>15s}  {np.abs(v).max():16.3g}  {np.abs(tau).max():10.3g}")
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        return f"<pre>{escape(str(self))}</pre>"

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
        """The median time between samples in seconds."""
        return float(np.median(np.diff(self.time)))

    @cached_property
    def record(self) -> Recorded:
        """The arrays as checks see them, with what was found of them once the log is conditioned."""
        if self._part_of is None:
            return recorded(self)
        whole, rows = self._part_of
        return mended_part(whole.record, rows, self.runs())

    @cached_property
    def velocity_lag(self) -> float:
        """The group delay of v behind dq/dt in seconds, 0 if none is sure (see :mod:`armloop.data.redundancy`)."""
        return self._part_of[0].velocity_lag if self._part_of else velocity_lag(mended(self.record))

    @cached_property
    def of_least_noise(self) -> "MotionLog":
        """The log with q differentiated in place of a v that has clearly more noise; itself where v has not."""
        if self._part_of is not None:
            whole, rows = self._part_of
            return self if whole.of_least_noise is whole else whole.of_least_noise.stretch(rows)
        if self.v_derived or not is_time_series(self.q, self.runs()):
            return self
        if not rate_noise(mended(self.record)).recorded_is_worse:
            return self
        rates = differentiated(self.time, self.q, self.name)
        return unchecked_log(**{**vars(self), "v": rates, "v_derived": True})

    def runs(self) -> list[slice]:
        """Return the stretches without a gap as slices; never filter or differentiate across two of them."""
        return _runs(self.time)

    def doubts(self) -> list[str]:
        """Return what may be right and should be known before the log is relied on, one line each."""
        found = doubts(recorded(self.of_least_noise))
        if self.of_least_noise is not self:
            noisy = Finding("columns v", rate_noise(mended(self.record)).sentence())
            found = chain([noisy], (other for other in found if other.columns != noisy.columns))
        return [f"{found.columns} {found.text}" for found in found]

    def rows_digest(self) -> NDArray[np.uint64]:
        """(N,) a number for each row's q, v and tau, the same for the same digits: equal rows are found by it."""
        mixed = np.full(self.samples, 0x9E3779B97F4A7C15, dtype=np.uint64)
        for values in (self.q, *(() if self.v_derived else (self.v,)), self.tau):
            for column in (values + 0.0).T:  # -0.0 is 0.0
                mixed = (mixed ^ np.ascontiguousarray(column).view(np.uint64)) * np.uint64(0xFF51AFD7ED558CCD)
                mixed ^= mixed >> np.uint64(33)
        return mixed

    def read(self) -> "MotionLog":
        """Return the log itself: in memory it is its own source (see `armloop.data.pieces`)."""
        return self

    def select(self, rows: slice | Mask) -> "MotionLog":
        """Return the log of these samples only; a slice gives views."""
        cut = {
            key: None if getattr(self, key) is None else getattr(self, key)[rows]
            for key in ("time", "q", "v", "tau", "vdot")
        }
        return unchecked_log(**cut, name=self.name, tau_unit=self.tau_unit, v_derived=self.v_derived)

    def stretch(self, rows: slice) -> "MotionLog":
        """Return the log of part of a run, conditioned as in the whole: its v is as late, its spikes are as far out."""
        part = self.select(rows)
        vars(part)["_part_of"] = self, rows
        return part


def read_log(
    path: str | Path,
    *,
    joints: int | None = None,
    tau_unit: str = "N*m",
    drive_gains: ArrayLike | None = None,
    rows: tuple[int, int] | None = None,
    quiet: bool = False,
) -> MotionLog:
    """Read a motion log and check that it is one.

    joints : how many joints the arm has; None takes what the file has
    tau_unit : what the columns `tau` hold, "N*m" or "A"
    drive_gains : (n,) N*m/A (N/A); `tau` is multiplied by them and the log's unit is "N*m"
    rows : first row and the one after the last, counted from 0; None reads all
    quiet : do not say what is doubtful (`armloop.util.errors.InputWarning`)

    Raises `LogError`, one line that names the file, the column or row, what is wrong and what would be right.
    """
    path = path_of(path, "the path of a log", LogError)
    check_unit(tau_unit, path)
    kinds = check_header(path, joints)
    if tau_unit != "A" and told_unit(path) == "A":
        raise LogError(
            f"{path}: tau holds motor currents (A), as the file itself says; give --tau-unit A, and --drive-gains to make "
            "torques of them"
        )
    gains = None if drive_gains is None else _check_gains(path, drive_gains, len(kinds["q"]))

    # The row before some is checked with them: what does not follow from it is a fault there, as in the whole.
    first, before = (max(0, rows[0] - 1), min(1, rows[0])) if rows else (0, 0)
    table = read_columns(path, ["time", *chain(*kinds.values())], (first, rows[1]) if rows else None)
    time, stacked = table.pop("time"), _side_by_side(table, kinds)
    count = len(time) - before
    if count < FEWEST_SAMPLES:
        raise LogError(f"{path}: {count} row{'s' * (count != 1)}; a motion log has at least {FEWEST_SAMPLES}")
    derived = "v" not in kinds
    if derived:
        _check_time(time, str(path), lambda row: place(path, first + row))
        stacked["v"] = differentiated(time, stacked["q"], str(path))
    log = unchecked_log(time=time, **stacked, name=path.stem, tau_unit=tau_unit, v_derived=derived)
    check_log(path, log, first)
    log = log.select(slice(before, None)) if before else log
    if not quiet:
        _say_doubts(log, str(path))
    if gains is None:
        return log
    return unchecked_log(**{**vars(log), "tau": log.tau * gains, "tau_unit": "N*m"})


def write_log(path: str | Path, log: MotionLog) -> None:
    """Write a log as CSV or Parquet, by its suffix, whole or not at all; `read_log` gives it back exactly.

    Raises `LogError` for another suffix and `InputError` when the place cannot be written to.
    """
    where = path_of(path, "the path of a log", LogError)
    if not isinstance(log, MotionLog):
        raise LogError(f"{where}: what is written must be a MotionLog; this is of type {type(log).__name__}")
    write_columns(where, log.columns(), said_of_unit(log.tau_unit))


def check_log(path: Path, log: MotionLog, first: int = 0) -> None:
    """Raise `LogError` unless the samples are a motion that an arm can have made.

    path : where the samples come from, for the message
    first : the row of the file that the first sample stands in, counted from 0
    """
    _check(log, str(path), lambda row: place(path, first + row))


def _check_gains(path: Path, drive_gains: ArrayLike, n: int) -> Array:
    gains = _numbers(drive_gains, "drive_gains", str(path)).reshape(-1)
    if len(gains) != n:
        raise LogError(f"{path}: {len(gains)} drive gains for {n} joints; give one per joint, in N*m/A")
    for j, gain in enumerate(gains, start=1):
        if not GAINS[0] <= gain <= GAINS[1]:
            raise LogError(
                f"{path}: drive gain {j} is {gain:g}; it must be a positive number of N*m/A, {GAINS[0]:g} to {GAINS[1]:g}"
            )
    return gains


def differentiated(time: Array, q: Array, name: str) -> Array:
    """(N, n) rates of q by central differences within each run; a run of one sample has none.

    Rows whose stamps nearly coincide count as one.

    Raises `LogError` when time and q do not fit together or time does not rise.
    """
    _check_shapes(time, q, name)
    _check_time(time, name, lambda row: f"row {row + 1}")
    runs = _runs(time)
    return central_differences(time, bridged(q, coincident(time, q, runs), time), runs)


def _side_by_side(columns: dict[str, Array], kinds: Mapping[str, list[str]]) -> dict[str, Array]:
    """(N, n) of each kind of signal, by its columns' names; they are taken out, for all of them may fill the memory."""
    return {kind: np.stack([columns.pop(key) for key in keys], axis=1) for kind, keys in kinds.items()}


def _check_shapes(time: Array, q: Array, name: str) -> None:
    if time.size == 0:
        raise LogError(f"{name}: there are no samples; a log has one row per instant")
    if time.ndim != 1 or q.ndim != 2 or len(q) != len(time):
        raise LogError(f"{name}: time must be (N,) and q (N, n); they are {time.shape} and {q.shape}")


def _column(frame: Any, key: str, name: str) -> Any:
    """A column of a data frame; raises `LogError` where the frame does not give it, as a lazy one does not."""
    try:
        return frame[key]
    except (TypeError, KeyError) as error:
        raise LogError(
            f"{name}: the {type(frame).__name__} gives no column by its name, {key!r}; give a data frame in memory: of a "
            "lazy one what its collect() returns"
        ) from error


def _numbers(values: Any, label: str, name: str) -> Array:
    """The values as an array of floating-point numbers; raises `LogError` where they are none."""
    try:
        numbers = np.asarray(values)
        if numbers.dtype.kind not in "fiu":
            raise ValueError(f"it holds {numbers.dtype}")
        if np.ma.is_masked(values):
            raise ValueError("some are masked")
        return np.asarray(numbers, dtype=np.float64)
    except (TypeError, ValueError) as error:
        right = "give real numbers in SI units, none of them missing"
        if label == "time":
            right = "give seconds as numbers, of dates such as (time - time[0]) / numpy.timedelta64(1, 's')"
        raise LogError(f"{name}: {label} is no array of numbers ({str(error)[:80]}); {right}") from error


def unchecked_log(**values: Any) -> MotionLog:
    """A log of arrays that have been checked, are part of a log, or will be (`check_log`)."""
    log = object.__new__(MotionLog)
    for field in fields(MotionLog):
        object.__setattr__(log, field.name, values.get(field.name, field.default))
    return log


def _runs(time: Array) -> list[slice]:
    steps = np.diff(time)
    gaps = np.flatnonzero(steps > GAP_PERIODS * np.median(steps)) if len(steps) else steps[:0]
    edges = [0, *(int(gap) + 1 for gap in gaps), len(time)]
    return [slice(first, last) for first, last in pairwise(edges)]


def recorded(log: MotionLog) -> Recorded:
    """The arrays of a log, as checks see them."""
    return Recorded(log.time, log.q, log.v, log.tau, log.vdot, log.runs(), log.v_derived)


def _check(log: MotionLog, label: str, place: Callable[[int], str]) -> None:
    """Raise `LogError` for time that does not rise and for the first thing that no arm can have done."""
    _check_time(log.time, label, place)
    found: Finding | None = next(faults(recorded(log)), None)
    if found is not None:
        where = "" if found.row is None else f", {place(found.row)}"
        raise LogError(f"{label}: {found.columns}{where} {found.text}")


def _say_doubts(log: MotionLog, label: str | None = None) -> None:
    for doubt in log.doubts():
        warn(f"{label or log.name}: {doubt}")


def _check_time(time: Array, label: str, place: Callable[[int], str]) -> None:
    late = np.flatnonzero(np.diff(time) <= 0)
    if len(late):
        row = int(late[0]) + 1
        repeated = time[row] == time[row - 1]
        right = (
            "; leave out rows that repeat the last one's time (`armloop convert` does)" if repeated else ""
        )
        raise LogError(
            f"{label}: column time, {place(row)}: {time[row]:.9g} follows {time[row - 1]:.9g}; "
            f"time must rise strictly from row to row{right}"
        )
