"""Clocks of tables: dates and times of day, as pyarrow reads them or as text, in seconds from the first row."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from armloop.convert.recording import Array
from armloop.data.log import GAP_PERIODS

# A date in whatever order, or none, and a time of day: 31.03.2024 23:59:58,25, 3/31/2024 11:59:58 PM, 23:59:58.250.
_TIME_OF_DAY = re.compile(r"(?:([\d./-]+)[T ] ?)?(\d{1,2}):(\d\d):(\d\d(?:[.,]\d+)?) ?([AaPp]\.?[Mm]\.?)?")
DAY, _HOUR = 86400.0, 3600.0
_COUNTED = "dates or times of day, counted in s from the first row"
# A stamp in two columns, as ROS has it: header.stamp.sec and header.stamp.nanosec.
_SECONDS, _REST = re.compile(r"(.*?)[._/]?secs?$"), r"[._/]?n(?:ano)?secs?"


def clock_seconds(cells: Any) -> tuple[Array, str] | None:
    """(N,) seconds from the first of pyarrow's dates or times of day, and what is to be said of them.

    None where the cells are none or one is missing.
    """
    import pyarrow

    kind = cells.type
    if cells.null_count or not len(cells):
        return None
    if pyarrow.types.is_string(kind):
        found = _of_texts([cell.as_py() for cell in cells])
        return None if found is None else _through_summer_time(found)
    if not (pyarrow.types.is_timestamp(kind) or pyarrow.types.is_time(kind)):
        return None
    per_second = {"s": 1, "ms": 1e3, "us": 1e6, "ns": 1e9}[kind.unit]
    width = pyarrow.int32() if pyarrow.types.is_time32(kind) else pyarrow.int64()
    ticks = cells.cast(width).to_numpy()
    seconds = np.asarray((ticks - ticks[0]) / per_second, dtype=np.float64)
    if pyarrow.types.is_time(kind):
        return _through_summer_time(_past_midnight(seconds))
    # a zone that is said makes them instants
    return _through_summer_time(seconds) if kind.tz is None else (seconds, _COUNTED)


def stamps_of(columns: Mapping[str, Array]) -> dict[str, tuple[str, str, Array]]:
    """Stamps in columns of seconds and of nanoseconds: by their common name both, and (N,) seconds from the first row."""
    found = {}
    for name, seconds in columns.items():
        stem = _SECONDS.fullmatch(name)
        rest = (
            [] if stem is None else [one for one in columns if re.fullmatch(re.escape(stem[1]) + _REST, one)]
        )
        if stem is None or len(rest) != 1:
            continue
        nanoseconds = columns[rest[0]]
        whole = bool((seconds == np.round(seconds)).all())
        if whole and bool(((nanoseconds >= 0) & (nanoseconds < 1e9)).all()):
            stamp = seconds - seconds[0] + 1e-9 * (nanoseconds - nanoseconds[0])
            found[stem[1] or "stamp"] = name, rest[0], stamp
    return found


def _of_texts(texts: Sequence[str]) -> Array | None:
    """(N,) seconds of texts that all end in a time of day; the date before it, in any order, has to change at midnight."""
    seconds = np.empty(len(texts))
    dates = []
    for row, text in enumerate(texts):
        found = _TIME_OF_DAY.fullmatch(text.strip())
        if found is None:
            return None
        date, hours, minutes, rest, half = found.groups()
        hour = int(hours) if half is None else int(hours) % 12 + 12 * (half[0] in "Pp")
        seconds[row] = 3600 * hour + 60 * int(minutes) + float(rest.replace(",", "."))
        dates.append(date)
    if not any(dates):
        return _past_midnight(seconds - seconds[0])
    days = np.cumsum([0, *(one != other for one, other in zip(dates[1:], dates[:-1], strict=True))])
    return np.asarray(seconds - seconds[0] + DAY * days)


def _past_midnight(seconds: Array) -> Array:
    """Times of day that go on past midnight, where they fall by more than half a day."""
    return np.asarray(seconds + DAY * np.cumsum(np.diff(seconds, prepend=seconds[:1]) < -0.5 * DAY))


def through_midnight(numbers: Array, day: float) -> Array:
    """(N,) numbers of a clock that begins anew each day as if it went on, if a day later each fall is the step of a run."""
    step = np.diff(numbers, prepend=numbers[:1])
    longest = GAP_PERIODS * float(np.median(step[step > 0])) if (step > 0).any() else 0.0
    falls = step < 0
    if not (np.abs(step[falls] + day - 0.5 * longest) <= 0.5 * longest).all():
        return numbers
    return np.asarray(numbers + day * np.cumsum(falls))


def _through_summer_time(seconds: Array) -> tuple[Array, str]:
    """A local clock as if it had never been put forward or back, and what is to be said of it.

    It was where a step is that of a run but for an hour: a pause is hardly ever an hour to within ten samples.
    """
    step = np.diff(seconds)
    longest = GAP_PERIODS * float(np.median(step)) if len(step) else 0.0
    shift = np.zeros(len(step))
    if 0 < longest < _HOUR:
        for hour in (_HOUR, -_HOUR):
            shift[(step - hour >= 0) & (step - hour <= longest)] = hour
    rows = (np.flatnonzero(shift) + 2).tolist()
    if not rows:
        return seconds, _COUNTED
    said = ", ".join(f"{'forward' if shift[row - 2] > 0 else 'back'} at row {row}" for row in rows[:3])
    return (
        seconds - np.concatenate([[0.0], np.cumsum(shift)]),
        f"{_COUNTED}; an hour taken out where the clock was put {said} (summer time; an instant has a zone: 12:00:00Z)",
    )
