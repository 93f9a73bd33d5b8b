"""Assembly of recordings and their maps to one motion log: units, signs, joint order, time, and what is kept beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from msgspec.structs import replace

from armloop.convert.clocks import DAY, through_midnight
from armloop.convert.joints import doubtful_order, match
from armloop.convert.mapping import UNSAID, Mapping, QuantityMap, per_joint
from armloop.convert.recording import Recording, some
from armloop.convert.units import CURRENTS, FACTORS, RATES, canonical, time_unit
from armloop.convert.wraps import unwrapped
from armloop.data.header import JOINT_COLUMN
from armloop.data.log import FEWEST_SAMPLES, GAP_PERIODS, MotionLog, unchecked_log
from armloop.data.plausibility import LARGEST_Q
from armloop.data.rate_noise import central_differences
from armloop.robot.arm import Arm
from armloop.util.arrays import Array, Index
from armloop.util.errors import LogError

# A run that follows another starts so many sample periods later: clearly a gap.
_GAP = 4 * GAP_PERIODS


@dataclass(frozen=True)
class Answers:
    """What the command line says of what a source does not: units, and gains that turn currents into torques."""

    tau_unit: str | None = None
    drive_gains: Sequence[float] | None = None
    angle_unit: str | None = None


@dataclass(eq=False)
class Part:
    """One source as a motion log."""

    log: MotionLog  # with the times of the source, counted from its first sample
    extra: dict[str, Array]  # further columns by name, each (N,)
    starts: list[int]  # first sample of each part that must become a run of its own
    joints: list[str]  # the source's name of each joint, base to tip
    epoch: float | None  # s since 1970 of the first sample, where the source says it
    notes: list[str] = field(default_factory=list)


def part(recording: Recording, mapping: Mapping, arm: Arm | None, answers: Answers) -> Part:
    """One source as a motion log in SI units, base to tip; raises ``LogError``, which names the column at fault."""
    where = str(recording.path)
    if recording.samples < FEWEST_SAMPLES:
        rows = f"{recording.samples} {recording.rows}{'s' * (recording.samples != 1)}"
        raise LogError(f"{where}: {rows}; a motion log has at least {FEWEST_SAMPLES}")
    mapping = _answered(recording, mapping, arm, answers)
    notes = list(recording.notes)
    order = _order(recording, mapping, arm, notes)
    n, N = len(order), recording.samples
    if arm is not None:
        _require_units_of(mapping, arm, order, where)
    values: dict[str, Array] = {}
    for kind, quantity in mapping.quantities().items():
        values[kind] = np.stack([_column(recording, quantity, kind, j) for j in order], axis=1)
    time, keep, starts = _time(recording, mapping)
    if len(keep) < FEWEST_SAMPLES:
        raise LogError(
            f"{where}: {len(keep)} of {N} {recording.rows}s have a time of their own; a motion log has at least "
            f"{FEWEST_SAMPLES}"
        )
    cells = {name: cells[keep] for name, cells in values.items()}
    if not np.any(cells["tau"]):
        raise LogError(f"{where}: the torques are zero throughout; this source did not record them")
    runs = _runs(time, starts)
    cells["q"], wraps = unwrapped(cells["q"], [run.start for run in runs])
    if any(wraps):
        which = ", ".join(f"q{j + 1} ({count} times)" for j, count in enumerate(wraps) if count)
        notes.append(f"angles wrap after a turn: {which}; unwrapped")
    if "v" not in cells:
        cells["v"] = central_differences(time, cells["q"], runs)
        notes.append("v: central differences of q, for the source has no velocities")
    unit = (
        "A"
        if mapping.tau.gains is None and canonical(mapping.tau.units()[0] or "", "tau") in CURRENTS
        else "N*m"
    )
    beyond = None if arm is None or unit == "A" else _beyond_limits(cells["tau"], arm)
    if beyond is not None:
        notes.append(beyond)
    # Parts that follow one another without a gap may jump: they are checked once they are kept apart.
    log = unchecked_log(time=time, **cells, name=recording.path.stem, tau_unit=unit)
    used, extra = mapping.used(), {}
    for name in recording.columns if mapping.keep == "all" else mapping.keep:
        if name not in recording.columns:
            raise LogError(f"{where}: no column {name} to keep; there are: {some(recording.columns, 12)}")
        if name not in used:
            extra[f"source.{name}" if name == "time" or JOINT_COLUMN.fullmatch(name) else name] = (
                recording.columns[name][keep]
            )
    if len(keep) < N:
        notes.append(f"{N - len(keep)} of {N} {recording.rows}s repeat the time of the last; left out")
    joints = mapping.joints or [str(j + 1) for j in range(n)]
    return Part(log, extra, starts, [joints[j] for j in order], recording.epoch, notes)


def joined(parts: Sequence[Part]) -> tuple[MotionLog, dict[str, Array]]:
    """All parts below each other, with a gap in time between those that the sources keep apart.

    Sources that say when they were recorded, and were so one after the other, keep their distance in time.
    """
    clocks: list[Array] = []
    logs = [one.log for one in parts]
    first = parts[0].epoch
    for one in parts:
        time = _spread(one.log.time, one.starts)
        if clocks:
            last = float(clocks[-1][-1])
            since = 0.0 if first is None or one.epoch is None else one.epoch - first
            time = time + (since if since > last else last + max(1.0, _GAP * one.log.period))
        clocks.append(time)
    has_vdot = all(log.vdot is not None for log in logs)
    cells = {
        key: np.concatenate([getattr(one, key) for one in logs])
        for key in ("q", "v", "tau", *(["vdot"] if has_vdot else []))
    }
    log = unchecked_log(time=np.concatenate(clocks), **cells, name=logs[0].name, tau_unit=logs[0].tau_unit)
    names = dict.fromkeys(name for one in parts for name in one.extra)
    extra = {
        name: np.concatenate([one.extra.get(name, np.full(one.log.samples, np.nan)) for one in parts])
        for name in names
    }
    return log, extra


def _answered(recording: Recording, mapping: Mapping, arm: Arm | None, answers: Answers) -> Mapping:
    """The map with the command line's answers in it; raises ``LogError`` where something is still not said."""
    where = str(recording.path)
    joints, asked = mapping.n, []
    tau, q, v = mapping.tau, mapping.q, mapping.v
    own = recording.kind == "motion log"  # whose header has no place for units
    if answers.drive_gains is not None:
        # Gains are given base to tip, as everywhere; the map's lists are in the order of its columns, a gripper's too.
        named = arm is not None and mapping.joints is not None
        order = _order(recording, mapping, arm, []) if named else list(range(joints))
        if len(answers.drive_gains) != len(order):
            raise LogError(
                f"{where}: {len(answers.drive_gains)} drive gains for {len(order)} joints; give one per joint"
            )
        gains = [1.0] * joints
        for j, gain in zip(order, answers.drive_gains, strict=True):
            gains[j] = gain
        if _told(tau) != {"%"}:
            _require_like(recording, tau, "A", "--drive-gains")
        tau = replace(tau, unit="A" if own else _said(tau.unit, "A"), gains=gains)
    elif answers.tau_unit is not None:
        _require_like(recording, tau, answers.tau_unit, f"--tau-unit {answers.tau_unit}")
        tau = replace(tau, unit=answers.tau_unit if own else _said(tau.unit, answers.tau_unit))
    if answers.angle_unit is not None:
        told = {str(canonical(unit, "q")) for unit in q.units() if unit}
        own &= _no_radians(recording, q)
        if not own and None not in q.units() and told & {"rad", "deg"} - {answers.angle_unit}:
            raise LogError(
                f"{where}: --angle-unit {answers.angle_unit}, but the {recording.kind} says itself that q is in "
                f"{', '.join(sorted(told))}; leave the option out, or write the right unit in a --map"
            )
        q = replace(q, unit=answers.angle_unit if own else _said(q.unit, answers.angle_unit))
        if v is not None:
            rate = RATES[answers.angle_unit]
            v = replace(v, unit=rate if own else _said(v.unit, rate))
    if None in tau.units():
        asked.append(
            "what tau holds (--tau-unit N*m; --tau-unit A; or --drive-gains k1,..,kn in N·m/A"
            f"{_sizes(recording, mapping, arm)})"
        )
    else:
        _require_one_kind(tau, where)
    if None in q.units() or (v is not None and None in v.units()):
        asked.append("the unit of positions and velocities (--angle-unit rad or deg)")
    if mapping.time.rate is None and mapping.time.column is None:
        left = recording.left_out()
        asked.append(f"the time (no column of it was found{left}; --map with time: {{rate: HZ}})")
    if asked:
        raise LogError(
            f"{where}: the {recording.kind} does not say {' nor '.join(asked)}; say it, or answer in the map that "
            "--suggest writes"
        )
    unit = mapping.time.unit
    if mapping.time.column is not None and (unit is None or unit == UNSAID):
        unit = _time_unit(recording, mapping, q, v)
    return replace(mapping, time=replace(mapping.time, unit=unit), q=q, tau=tau, v=v)


def _no_radians(recording: Recording, q: QuantityMap) -> bool:
    """Whether positions are more than any joint's in rad (m): no motion log has them, whatever its header says."""
    columns = [recording.columns[name] for name in q.names() if name in recording.columns]
    return max((float(np.abs(column).max()) for column in columns), default=0.0) > LARGEST_Q


def _told(tau: QuantityMap) -> set[str]:
    """The units of tau that a source or a map says."""
    return {unit for said in tau.units() if (unit := canonical(said or "", "tau")) is not None}


def _require_one_kind(tau: QuantityMap, where: str) -> None:
    """Raise ``LogError`` unless tau becomes the torque of every joint, or is the current of every joint."""
    told = [str(canonical(unit or "", "tau")) for unit in tau.units()]
    gains = [None] * len(told) if tau.gains is None else per_joint(tau.gains, len(told))
    for name, unit, gain in zip(tau.names(), told, gains, strict=True):
        if unit == "%" and gain is None:
            raise LogError(
                f"{where}: {name} is in percent of a rating: give gains (N·m per percent) in a --map"
            )
        if unit not in (*CURRENTS, "%") and gain not in (None, 1):
            raise LogError(
                f"{where}: {name} is said to be in {unit}, and has a gain of {gain:g}; gains make torques of A, mA or %: "
                "say its right unit, or a gain of 1"
            )
    first = next((name for name, unit in zip(tau.names(), told, strict=True) if unit in CURRENTS), None)
    other = next((name for name, unit in zip(tau.names(), told, strict=True) if unit not in CURRENTS), None)
    if tau.gains is None and first is not None and other is not None:
        raise LogError(
            f"{where}: {first} is said to be a current, {other} a torque; give gains in a --map, N·m/A for a current and 1 "
            "for a torque"
        )


def _require_like(recording: Recording, tau: QuantityMap, unit: str, option: str) -> None:
    """Raise ``LogError`` where an option says currents of what the source says are torques, or the other way round.

    A motion log's torques may be currents: its header says no unit. A file of currents says so.
    """
    told = _told(tau)
    wrong = {one for one in told if (one in CURRENTS) != (unit in CURRENTS)}
    if wrong and (recording.kind != "motion log" or "A" in wrong):
        raise LogError(
            f"{recording.path}: {option}, but the {recording.kind} says itself that tau is in "
            f"{', '.join(sorted(wrong))}; leave the option out, or write the right unit in a --map"
        )


def _sizes(recording: Recording, mapping: Mapping, arm: Arm | None) -> str:
    """The largest values of tau beside the arm's effort limits, from which its user can tell which of them they are."""
    if arm is None or not np.isfinite(arm.effort).all():
        return ""
    largest = [
        np.abs(_column(recording, mapping.tau, "tau", j)).max() for j in _order(recording, mapping, arm, [])
    ]
    limits = ", ".join(f"{joint.effort:.3g}" for joint in arm.joints)
    return f": the largest are {', '.join(f'{x:.3g}' for x in largest)}, the arm's effort limits {limits} in SI units"


def _beyond_limits(tau: Array, arm: Arm) -> str | None:
    """What to say of (N, n) torques that the arm's drives cannot give; None if they all can."""
    largest = np.abs(tau).max(axis=0)
    beyond = [
        f"{joint.name} {size:.4g} of {joint.effort:.4g} {joint.torque_unit}"
        for joint, size in zip(arm.joints, largest, strict=True)
        if size > joint.effort
    ]
    if not beyond:
        return None
    return (
        f"tau is beyond the arm's effort limits: {', '.join(beyond)}; are its unit and the drive gains right?"
    )


def _time_unit(recording: Recording, mapping: Mapping, q: QuantityMap, v: QuantityMap | None) -> str:
    """The unit of time with which v is the rate of q: measured, not guessed; raises ``LogError`` if none fits."""
    time = recording.columns.get(mapping.time.column or "")
    if v is not None and time is not None and (unit := time_unit(rate_ratio(time, recording, q, v))):
        return unit
    raise LogError(
        f"{recording.path}: the unit of the column {mapping.time.column} is not said, and no velocity tells it; "
        "say it in a --map: time: {column: …, unit: s, ms, us or ns}"
    )


def rate_ratio(time: Array, recording: Recording, q: QuantityMap, v: QuantityMap) -> float:
    """How many times v, in its unit per second, the rate of q per unit of time is; 0 where nothing moves."""
    moved = []
    for j in range(len(q.names())):
        position, velocity = _column(recording, q, "q", j), _column(recording, v, "v", j)
        step = np.diff(time)
        good = step > 0
        rate = np.diff(position)[good] / step[good]
        mean = 0.5 * (velocity[1:] + velocity[:-1])[good]
        square = float(mean @ mean)
        if square > 0:
            moved.append((square, float(rate @ mean) / square))
    return max(moved)[1] if moved else 0.0


def _said(unit: str | list[str] | None, answer: str) -> str | list[str]:
    if isinstance(unit, list):
        return [answer if one == UNSAID else one for one in unit]
    return answer if unit is None or unit == UNSAID else unit


def _order(recording: Recording, mapping: Mapping, arm: Arm | None, notes: list[str]) -> list[int]:
    names, where = mapping.joints, str(recording.path)
    if arm is None:
        if names is not None and recording.named:
            if (doubt := doubtful_order(names)) is not None:
                raise LogError(
                    f"{where}: the joints are {doubt} ({', '.join(names)}), which need not be that "
                    "of the arm; give --arm with its URDF, or a --map with joints base to tip"
                )
            notes.append(
                f"joints in the order of the source, base to tip: {', '.join(names)} (--arm would match them)"
            )
        return list(range(mapping.n))
    if names is not None:
        return match(names, arm.joint_names, where)
    if mapping.n != arm.n:
        raise LogError(f"{where}: has {mapping.n} joints; the arm {arm.name} has {arm.n}")
    return list(range(arm.n))


def _require_units_of(mapping: Mapping, arm: Arm, order: list[int], where: str) -> None:
    """Raise ``LogError`` where a unit would scale a joint that slides as an angle, or one that turns as a length.

    SI units scale nothing: sources that call all of them rad mean m where a joint slides.
    """
    for kind, quantity in (("q", mapping.q), ("v", mapping.v), ("vdot", mapping.vdot)):
        units = [] if quantity is None else quantity.units()
        for joint, turns, source in zip(arm.joints, arm.revolute, order, strict=True):
            unit = canonical(units[source] or "", kind) if units else None
            if unit is None or FACTORS[kind][unit] == 1.0 or unit.startswith("mm") != turns:
                continue
            moves, wanted = ("turns", "an angle's") if turns else ("slides", "a length's")
            raise LogError(
                f"{where}: {kind} of {joint.name} is said to be in {unit}, but this joint {moves}; give each joint its "
                f"own unit in a --map, unit: [..], {wanted} for this one"
            )


def _column(recording: Recording, quantity: QuantityMap, kind: str, j: int) -> Array:
    """One column of the source in SI units."""
    n, name = len(quantity.names()), quantity.names()[j]
    cells = _cells(recording, name, f", which {kind} of joint {j + 1} needs", "or drop what was not measured")
    unit = canonical(quantity.units()[j] or "", kind)
    factor = (FACTORS[kind][unit] if unit is not None else 1.0) * per_joint(quantity.scale, n)[j]
    if quantity.gains is not None:
        factor = factor * per_joint(quantity.gains, n)[j]
    return (cells + per_joint(quantity.offset, n)[j]) * (factor * per_joint(quantity.sign, n)[j])


def _cells(recording: Recording, name: str, needed: str, correct: str) -> Array:
    """(N,) numbers of a column; raises ``LogError`` where it is not there, or one of them is none."""
    cells = recording.columns.get(name)
    if cells is None:
        raise LogError(
            f"{recording.path}: no column {name}{needed}{recording.left_out()}; there are: {some(recording.columns, 12)}"
        )
    bad = np.flatnonzero(~np.isfinite(cells))
    if len(bad):
        raise LogError(
            f"{recording.path}: column {name}, {recording.place(int(bad[0]))}: not a number "
            f"({len(bad)} of {len(cells)}); correct {correct}"
        )
    return cells


def _time(recording: Recording, mapping: Mapping) -> tuple[Array, Index, list[int]]:
    """Seconds from the first sample, the rows that are kept, and where parts of the source start among them."""
    N = recording.samples
    if mapping.time.rate is not None:
        return np.arange(N) / mapping.time.rate, np.arange(N), list(recording.starts)
    name = mapping.time.column or ""
    raw = _cells(recording, name, " for the time", "the time")
    edges = set(recording.starts)
    factor = FACTORS["time"][canonical(mapping.time.unit or "s", "time") or "s"]
    raw = through_midnight(raw, DAY / factor)
    step = np.diff(raw, prepend=raw[0] - 1)
    step[list(edges)] = 1.0
    back = np.flatnonzero(step < 0)
    if len(back):
        row = int(back[0])
        raise LogError(
            f"{recording.path}: column {name}, {recording.place(row)}: {raw[row]:.9g} follows {raw[row - 1]:.9g}; "
            "time must rise; give runs that were recorded one by one as files of their own"
        )
    keep = np.flatnonzero(step > 0)
    starts = [int(k) for k in np.searchsorted(keep, sorted(edges))]
    return (raw[keep] - raw[0]) * factor, keep, starts


def _spread(time: Array, starts: Sequence[int]) -> Array:
    """The same times with a gap before each part, where it does not lie behind one already."""
    time = time - time[0]
    steps = np.diff(time)
    inside = np.ones(len(steps), dtype=bool)
    inside[[start - 1 for start in starts if 0 < start < len(time)]] = False
    least = max(1.0, _GAP * float(np.median(steps[inside]))) if inside.any() else 1.0
    for start in starts:
        if 0 < start < len(time):
            missing = least - (time[start] - time[start - 1])
            if missing > 0:
                time[start:] += missing
    return time


def _runs(time: Array, starts: Sequence[int]) -> list[slice]:
    """Rows of each part between its gaps."""
    steps = np.diff(time)
    gaps = np.flatnonzero((steps > GAP_PERIODS * np.median(steps)) | (steps <= 0)) + 1
    return [slice(*edges) for edges in pairwise(sorted({0, len(time), *starts, *(int(k) for k in gaps)}))]
