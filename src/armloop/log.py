"""A motion log: what was measured on an arm, one row per sample, checked at the door.

The file is CSV, or Parquet with the same columns: `time,q1..qn,v1..vn,tau1..taun`, optionally `vdot1..vdotn`;
SI units; joints numbered from 1, base to tip. Columns of any other name are left alone.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armloop.errors import LogError
from armloop.tables import place, read_columns, read_header, write_columns

TAU_UNITS = ("N*m", "A")
GAP_PERIODS = 10.0
"""A pause longer than this many median sample periods starts a new run."""
FEWEST_SAMPLES = 20
"""Fewer rows than this are no motion: filters and derivatives need more."""

_JOINT_COLUMN = re.compile(r"(q|v|tau|vdot)(\d{1,3})")
# An arm's joint that turns beyond the first at more than the second is not in rad and rad/s (m and m/s).
_LARGEST_Q, _LARGEST_V = 30.0, 20.0


@dataclass(frozen=True, eq=False)
class MotionLog:
    """What was measured on an arm of `n` joints at `N` instants.

    time : (N,) seconds, strictly rising
    q, v : (N, n) measured rad, rad/s (m, m/s for a prismatic joint)
    tau : (N, n) measured generalized force in `tau_unit` (N*m stands for N on a prismatic joint)
    vdot : (N, n) rad/s^2 (m/s^2), or None when the file has none
    name : what to call the log, the file's stem
    tau_unit : "N*m", or "A" for motor current
    """

    time: NDArray[np.float64]
    q: NDArray[np.float64]
    v: NDArray[np.float64]
    tau: NDArray[np.float64]
    vdot: NDArray[np.float64] | None = None
    name: str = "log"
    tau_unit: str = "N*m"

    def __post_init__(self) -> None:
        if self.time.ndim != 1 or self.q.ndim != 2 or len(self.q) != len(self.time):
            raise ValueError(f"time must be (N,) and q (N, n); they are {self.time.shape} and {self.q.shape}")
        for label, values in (("v", self.v), ("tau", self.tau), ("vdot", self.vdot)):
            if values is not None and values.shape != self.q.shape:
                raise ValueError(f"{label} must have the shape of q, {self.q.shape}; it is {values.shape}")

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

    def runs(self) -> list[slice]:
        """Return the stretches without a gap as slices; never filter or differentiate across two of them."""
        steps = np.diff(self.time)
        gaps = np.flatnonzero(steps > GAP_PERIODS * np.median(steps)) if len(steps) else steps[:0]
        edges = [0, *(int(gap) + 1 for gap in gaps), self.samples]
        return [slice(first, last) for first, last in pairwise(edges)]

    def read(self) -> "MotionLog":
        """Return the log itself: in memory it is its own source (see `armloop.pieces`)."""
        return self

    def select(self, rows: slice) -> "MotionLog":
        """Return the log of these samples only; the arrays are views."""
        vdot = None if self.vdot is None else self.vdot[rows]
        return MotionLog(
            self.time[rows], self.q[rows], self.v[rows], self.tau[rows], vdot, self.name, self.tau_unit
        )


def read_log(
    path: str | Path,
    *,
    joints: int | None = None,
    tau_unit: str = "N*m",
    drive_gains: ArrayLike | None = None,
    rows: tuple[int, int] | None = None,
) -> MotionLog:
    """Read a motion log and check that it is one.

    joints : how many joints the arm has; None takes what the file has
    tau_unit : what the columns `tau` hold, "N*m" or "A"
    drive_gains : (n,) N*m/A (N/A); `tau` is multiplied by them and the log's unit is "N*m"
    rows : first row and the one after the last, counted from 0, of a Parquet file; None reads all

    Raises `LogError`, one line that names the file, the column or row, what is wrong and what would be right.
    """
    path = Path(path)
    if tau_unit not in TAU_UNITS:
        raise LogError(f"{path}: tau unit {tau_unit!r} is unknown; it must be one of {', '.join(TAU_UNITS)}")
    n, has_vdot = check_header(path, joints)
    gains = None if drive_gains is None else _check_gains(path, drive_gains, n)

    quantities = ["q", "v", "tau", "vdot"] if has_vdot else ["q", "v", "tau"]
    names = ["time", *(f"{kind}{j}" for kind in quantities for j in range(1, n + 1))]
    table = read_columns(path, names, rows)
    stacked = {kind: np.stack([table[f"{kind}{j}"] for j in range(1, n + 1)], axis=1) for kind in quantities}
    log = MotionLog(table["time"], **stacked, name=path.stem, tau_unit=tau_unit)
    check_log(path, log, rows[0] if rows else 0)
    if gains is None:
        return log
    return MotionLog(log.time, log.q, log.v, log.tau * gains, log.vdot, log.name, "N*m")


def write_log(path: str | Path, log: MotionLog) -> None:
    """Write a log as CSV or Parquet, by its suffix, whole or not at all; `read_log` gives it back exactly.

    Raises `LogError` for another suffix and `InputError` when the place cannot be written to.
    """
    columns = {"time": log.time}
    for kind, values in (("q", log.q), ("v", log.v), ("tau", log.tau), ("vdot", log.vdot)):
        if values is not None:
            columns |= {f"{kind}{j}": values[:, j - 1] for j in range(1, log.joints + 1)}
    write_columns(Path(path), columns)


def check_log(path: Path, log: MotionLog, first: int = 0) -> None:
    """Raise `LogError` unless the samples are a motion: time rises, and q, v and time are in SI units.

    path : where the samples come from, for the message
    first : the row of the file that the first sample stands in, counted from 0
    """
    _check_time(path, log.time, first)
    _check_units(path, log)


def check_header(path: Path, joints: int | None = None) -> tuple[int, bool]:
    """Return the number of joints of a file and whether accelerations are there, from its header alone.

    joints : how many joints the arm has; None takes what the file has

    Raises `LogError` when the file is missing or its columns are not those of a log.
    """
    n, has_vdot = _columns(path, read_header(path))
    if joints is not None and n != joints:
        raise LogError(f"{path}: the columns are those of {n} joints; the arm has {joints}")
    return n, has_vdot


def _columns(path: Path, header: Sequence[str]) -> tuple[int, bool]:
    if len(header) == 1 and re.search(r"[;\t ]", header[0]):
        raise LogError(f"{path}: the header is one column, {header[0][:40]!r}; put commas between the names")
    found: dict[str, set[int]] = {"q": set(), "v": set(), "tau": set(), "vdot": set()}
    for name in header:
        match = _JOINT_COLUMN.fullmatch(name)
        if match is None and name != "time":
            continue
        if header.count(name) > 1:
            raise LogError(f"{path}: column {name} stands {header.count(name)} times; each must stand once")
        if match is not None:
            kind, number = match[1], int(match[2])
            if name != f"{kind}{number}" or number == 0:
                raise LogError(
                    f"{path}: column {name}: joints are numbered {kind}1, {kind}2, ... from the base"
                )
            found[kind].add(number)
    n = max((number for numbers in found.values() for number in numbers), default=1)
    kinds = [kind for kind in found if kind != "vdot" or found[kind]]
    missing = [] if "time" in header else ["time"]
    missing += [f"{kind}{j}" for kind in kinds for j in range(1, n + 1) if j not in found[kind]]
    if missing:
        raise LogError(
            f"{path}: the header lacks {_listed(missing)}; "
            f"it must be time,q1..qn,v1..vn,tau1..taun (optionally vdot1..vdotn) with one n"
        )
    return n, bool(found["vdot"])


def _listed(names: Sequence[str], most: int = 6) -> str:
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


def _check_gains(path: Path, drive_gains: ArrayLike, n: int) -> NDArray[np.float64]:
    gains = np.asarray(drive_gains, dtype=np.float64).reshape(-1)
    if len(gains) != n:
        raise LogError(f"{path}: {len(gains)} drive gains for {n} joints; give one per joint, in N*m/A")
    for j, gain in enumerate(gains, start=1):
        if not (np.isfinite(gain) and gain > 0):
            raise LogError(f"{path}: drive gain {j} is {gain:g}; it must be a positive number of N*m/A")
    return gains


def _check_time(path: Path, time: NDArray[np.float64], first: int = 0) -> None:
    if len(time) < FEWEST_SAMPLES:
        raise LogError(f"{path}: {len(time)} rows; a motion log has at least {FEWEST_SAMPLES}")
    late = np.flatnonzero(np.diff(time) <= 0)
    if len(late):
        row = int(late[0]) + 1
        raise LogError(
            f"{path}: column time, {place(path, first + row)}: {time[row]:.9g} follows {time[row - 1]:.9g}; "
            "time must rise strictly from row to row"
        )


def _check_units(path: Path, log: MotionLog) -> None:
    """Refuse what cannot be rad (m), rad/s (m/s) and seconds; when in doubt, let it pass."""
    for j in range(log.joints):
        farthest, fastest = np.abs(log.q[:, j]).max(), np.abs(log.v[:, j]).max()
        if farthest > _LARGEST_Q and fastest > _LARGEST_V:
            raise LogError(
                f"{path}: columns q{j + 1}, v{j + 1} reach {farthest:.3g} and {fastest:.3g}, "
                "more than any arm's joint in rad (m) and rad/s (m/s); convert degrees (mm) to SI units"
            )
    for j, ratio in _clear_ratios(log):
        if not 0.5 < ratio < 2.0:
            raise LogError(
                f"{path}: column v{j + 1} is {ratio:.3g} times the rate of q{j + 1}, {_likely_cause(ratio)}; "
                "time, q and v must be in s, rad (m) and rad/s (m/s)"
            )


def _clear_ratios(log: MotionLog) -> Iterator[tuple[int, float]]:
    """Yield the joints whose v is beyond doubt proportional to dq/dt, and the factor."""
    inside = np.concatenate([np.arange(run.start, run.stop - 1) for run in log.runs()])
    rate = (log.q[inside + 1] - log.q[inside]) / (log.time[inside + 1] - log.time[inside])[:, None]
    v = 0.5 * (log.v[inside + 1] + log.v[inside])
    cross, rate_square, v_square = (rate * v).sum(axis=0), (rate * rate).sum(axis=0), (v * v).sum(axis=0)
    for j in np.flatnonzero(np.abs(cross) > 0.9 * np.sqrt(rate_square * v_square)):
        if rate_square[j] > 0 and v_square[j] > 0:
            yield int(j), float(cross[j] / rate_square[j])


def _likely_cause(ratio: float) -> str:
    causes = {
        180 / np.pi: "as if v were in deg/s",
        np.pi / 180: "as if q were in degrees",
        1e3: "as if time were in milliseconds or v in mm/s",
        1e-3: "as if q were in mm",
        -1.0: "the opposite sign",
    }
    for factor, cause in causes.items():
        if 0.8 < ratio / factor < 1.25:
            return cause
    return "which is not one"
