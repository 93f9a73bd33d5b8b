"""Units that other people's logs come in, and the factor that takes each to SI."""

from __future__ import annotations

import numpy as np

_DEGREE = np.pi / 180

#: By quantity: the factor from the unit to SI. A motor current stays one, in A, and so does a percentage of a
#: rated torque: only a gain turns them into a torque.
FACTORS: dict[str, dict[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "q": {"rad": 1.0, "deg": _DEGREE, "rev": 2 * np.pi, "m": 1.0, "mm": 1e-3},
    "v": {"rad/s": 1.0, "deg/s": _DEGREE, "rpm": np.pi / 30, "rev/s": 2 * np.pi, "m/s": 1.0, "mm/s": 1e-3},
    "vdot": {"rad/s^2": 1.0, "deg/s^2": _DEGREE, "m/s^2": 1.0, "mm/s^2": 1e-3},
    "tau": {"N*m": 1.0, "mN*m": 1e-3, "cN*m": 1e-2, "kN*m": 1e3, "N": 1.0, "A": 1.0, "mA": 1e-3, "%": 1.0},
}
#: Units of `tau` that are no torque.
CURRENTS = ("A", "mA")
#: By unit, how others spell it, lower case.
_SPELT = {
    "s": "sec, secs, second, seconds, sek, sekunde, sekunden, 秒",
    "ms": "msec, millisec, milliseconds, millisekunden, 毫秒",
    "us": "usec, µs, \u03bcs, microseconds, mikrosekunden",
    "ns": "nsec, nanoseconds",
    "rad": "radian, radians, radiant, radianes, radianti, рад, 弧度",
    "deg": "degree, degrees, °, grad, grados, gradi, graus, degrés, град, 度",
    "deg/s": "°/s, degs",
    "rad/s": "rads",
    "N*m": "nm, n*m, n·m, n.m, n m, n-m, newtonmeter, н·м, нм, 牛米",
    "N": "newton, n",
    "mN*m": "mnm, mn*m, mn·m, nmm, n*mm, n·mm, n.mm, n mm, n-mm",
    "cN*m": "cnm, cn*m, cn·m, ncm, n*cm, n·cm, n.cm, n cm, n-cm",
    "kN*m": "knm, kn*m, kn·m, kn.m",
    "A": "a, amp, amps, ampere, 安, 安培",
    "mA": "ma",
    "%": "percent, prozent",
    "rpm": "u/min, 1/min, r/min, rev/min, umdr/min, upm, min-1, min^-1, об/мин",
    "rev/s": "u/s, umdr/s, r/s",
}
_ALIASES = {word: unit for unit, words in _SPELT.items() for word in words.split(", ")}
_SQUARED = ("^2", "**2", "²", "2")
#: The unit of the velocity that goes with a position's, and so on.
RATES = {"rad": "rad/s", "deg": "deg/s", "rev": "rev/s", "m": "m/s", "mm": "mm/s"}


def spelt(text: str) -> str:
    """A unit as this module spells it, whatever it is of."""
    return _ALIASES.get(text.lower(), text.lower())


def canonical(text: str, quantity: str) -> str | None:
    """The unit of a quantity as this module spells it, or None where the text names none of that quantity."""
    text = text.strip()
    known = FACTORS[quantity]
    if text in known:
        return text
    alias = spelt(text)
    if alias in known:
        return alias
    of, _, per = text.partition("/")
    rate = RATES.get(canonical(of, "q") or "") if quantity in ("v", "vdot") and per else None
    if rate is None:
        return None
    if quantity == "v":
        return rate if canonical(per, "time") == "s" else None
    square = next((per.removesuffix(end) for end in _SQUARED if per.endswith(end)), "")
    return f"{rate}^2" if f"{rate}^2" in known and canonical(square, "time") == "s" else None


def time_unit(ratio: float) -> str | None:
    """The unit of time with which v is the rate of q, where its numbers are ``ratio`` times q's rate per unit of time."""
    return next((unit for unit, second in FACTORS["time"].items() if 0.7 < ratio / second < 1.4), None)


def fitting(ratio: float) -> list[tuple[str, str]]:
    """The units of q and v with which v is the rate of q, whose numbers change ``ratio`` times as fast as v says."""
    return [
        (q, v)
        for q in RATES
        for v, factor in FACTORS["v"].items()
        if 0.9 < ratio * FACTORS["q"][q] / factor < 1.1 and (q in ("m", "mm")) == (v in ("m/s", "mm/s"))
    ]
