"""An unlisted law that a diagnosis found, taken into a model: waves of the angles, speeds and directions.

It knows where it was seen: inside the range of its run it acts in full, outside it fades, for nothing is known of it there.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np

from armloop.laws.effects.base import Array, Context, Effect, Estimate, Pointwise, StateLaw, Values, number
from armloop.robot.arm import Arm
from armloop.util.errors import ModelError
from armloop.util.functions import MATH, NUMPY, Functions

#: Beyond its range a law fades, and is gone at this many times half of the range from the middle: as far as a run is judged.
FAR = 1.2
#: Parameters that are no coefficient: the first and last value seen of every joint's position and speed.
RANGE = ("q_low", "q_high", "v_low", "v_high")

_PART = re.compile(r"(?:(sin|cos|sign)\(([^()]*)\)|([qv]\d{1,2}))(?:\^(\d))?")
_ADDEND = re.compile(r"([+-]?)(?:(\d)\*)?q(\d{1,2})")


@dataclass(frozen=True)
class _Factor:
    """A wave of angles (wave numbers by joint, from 0), or a position, a speed or its direction; to a power."""

    kind: str
    power: int
    joint: int = 0
    wave: tuple[tuple[int, int], ...] = ()

    @property
    def joints(self) -> list[int]:
        """Whose state it is a function of, counted from 0."""
        return [j for j, _ in self.wave] or [self.joint]

    def __call__(self, functions: Functions, q: Sequence[Any], v: Sequence[Any]) -> Any:
        if self.wave:
            phase = sum(k * q[j] for j, k in self.wave)
            x = functions.sin(phase) if self.kind == "sin" else functions.cos(phase)
        else:
            x = q[self.joint] if self.kind == "q" else v[self.joint]
            x = functions.sign(x) if self.kind == "sign" else x
        value = x
        for _ in range(self.power - 1):
            value = value * x
        return value


class FoundLaw(Effect):
    """tau_j += w(q, v) sum_t c_t f_t(q, v); w is 1 within the range of the run and 0 far outside of it.

    Each coefficient bears the name of its function, such as ``cos(2*q1)*v2``, and :data:`RANGE` says where it was found;
    without a range it holds everywhere, as in a simulated plant that is given one.
    ``armloop diagnose --adopt`` makes one; no search tries it.
    """

    name = "unlisted"
    searched = False
    needs_model = False
    parameters: ClassVar = ()

    def columns(self, context: Context, shape: float) -> Array:
        raise NotImplementedError(
            "an unlisted law is no hypothesis; its functions are found by a search of their own"
        )

    def joints(self, parameters: Mapping[str, Any]) -> list[int]:
        of_terms = [] if self.fault(parameters) else _joints(parameters)
        return [*super().joints(parameters), *(j + 1 for j in of_terms)]

    def of_state(self, arm: Arm, parameters: Values) -> StateLaw:
        terms = [(_factors(name), number(value)) for name, value in parameters.items() if name not in RANGE]
        within = _range(terms, parameters) if RANGE[0] in parameters else []

        def torque(functions: Functions, q: Sequence[Any], v: Sequence[Any]) -> list[Any]:
            total: Any = 0.0
            for factors, coefficient in terms:
                value: Any = coefficient
                for factor in factors:
                    value = value * factor(functions, q, v)
                total = total + value
            for kind, joint, middle, half in within:
                total = total * _fading((q if kind == "q" else v)[joint], middle, half)
            tau: list[Any] = [0.0] * len(q)
            tau[self.index] = total
            return tau

        return torque

    def torque(self, context: Context, parameters: Values) -> Array:
        motion = context.motion
        tau = self.of_state(context.arm, parameters)(NUMPY, list(motion.q.T), list(motion.v.T))
        return np.stack([np.broadcast_to(x, motion.samples) for x in tau], axis=1).astype(float)

    def pointwise(self, arm: Arm, parameters: Values, inertial: Array | None) -> Pointwise:
        law = self.of_state(arm, parameters)
        return lambda q, v, vdot: law(MATH, q.tolist(), v.tolist())

    def plausible(self, arm: Arm, parameters: dict[str, Estimate]) -> bool:
        fault = self.fault({key: e.value for key, e in parameters.items()})
        low = parameters[RANGE[0]].value if RANGE[0] in parameters else [0.0] * arm.n
        if not fault and len(np.atleast_1d(low)) != arm.n:
            fault = f"{RANGE[0]} has another number of joints than the arm, {arm.n}"
        if not fault and max(_joints(parameters), default=0) >= arm.n:
            fault = f"has a term of joint {max(_joints(parameters)) + 1}; the arm has {arm.n}"
        if fault:
            raise ModelError(f"effect {self.label()}: {fault}")
        return True

    @classmethod
    def fault(cls, parameters: Mapping[str, Any]) -> str:
        try:
            terms = [_factors(name) for name in parameters if name not in RANGE]
        except ModelError as error:
            return str(error)
        if not terms:
            return "has no term"
        if not set(RANGE) & set(parameters):
            return ""
        ranges = [parameters.get(key) for key in RANGE]
        if any(not isinstance(x, list) or len(x) != len(ranges[0] or []) for x in ranges):
            return f"needs {', '.join(RANGE)}, one number a joint"
        for end in ("q", "v"):
            low, high = (parameters[f"{end}_{side}"] for side in ("low", "high"))
            if any(first > last for first, last in zip(low, high, strict=True)):
                return f"has a {end}_low above its {end}_high"
        if max(_joints(parameters), default=0) >= len(ranges[0] or []):
            return "has a term of a joint that its range does not know"
        return ""

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        terms = [
            f"({number(e.value):.3g} ± {number(e.std_error):.2g}) {name}"
            for name, e in parameters.items()
            if name not in RANGE
        ]
        return f"joint {self.joint} follows a law that is not listed: {' + '.join(terms)}, where the run has been"


def found_law(
    arm: Arm,
    joint: int,
    terms: Mapping[str, tuple[float, float]],
    low: tuple[Array, Array],
    high: tuple[Array, Array],
) -> dict[str, Estimate]:
    """Parameters of a law found at a joint (1-based).

    Args:
        terms: coefficient and its standard error by the function's name, N·m (N) per unit of the function.
        low, high: (n,) least and largest q and v of the samples it was found on, rad or m, and per second.

    Raises:
        ModelError: a name is that of no function.
    """
    estimates = {name: Estimate(c, e, _unit(arm, joint, name)) for name, (c, e) in terms.items()}
    units = {j.position_unit for j in arm.joints}
    unit = units.pop() if len(units) == 1 else "rad or m"
    values = (low[0], high[0], low[1], high[1])
    for key, value, per in zip(RANGE, values, ("", "", "/s", "/s"), strict=True):
        estimates[key] = Estimate(value.tolist(), [0.0] * arm.n, unit + per)
    return estimates


def _unit(arm: Arm, joint: int, name: str) -> str:
    seconds, lengths = 0, dict.fromkeys(("rad", "m"), 0)
    for factor in _factors(name):
        if factor.kind in ("q", "v"):
            lengths[arm.joints[factor.joint].position_unit] += factor.power
            seconds += factor.power * (factor.kind == "v")
    powers = [
        (key, power) for key, power in (("s", seconds), *((k, -p) for k, p in lengths.items())) if power
    ]
    unit = arm.joints[joint - 1].torque_unit
    for key, power in powers:
        unit += f"{'*' if power > 0 else '/'}{key}{f'^{abs(power)}' if abs(power) > 1 else ''}"
    return unit


def _joints(parameters: Iterable[str]) -> list[int]:
    """The joints that terms are functions of, counted from 0."""
    return [j for name in parameters if name not in RANGE for factor in _factors(name) for j in factor.joints]


def _fading(x: Any, middle: float, half: float) -> Any:
    """1 within the range, 0 beyond :data:`FAR` of it, a smooth step between."""
    inside = (FAR * half - abs(x - middle)) / ((FAR - 1.0) * half)
    s = (1.0 + abs(inside) - abs(inside - 1.0)) / 2.0  # between 0 and 1, without a branch
    return s * s * (3.0 - 2.0 * s)


def _range(
    terms: Sequence[tuple[tuple[_Factor, ...], float]], parameters: Values
) -> list[tuple[str, int, float, float]]:
    """Middle and half width of the range of each position and speed that the terms contain."""
    used: dict[tuple[str, int], None] = {}
    for factor in (factor for factors, _ in terms for factor in factors):
        for joint in factor.joints:
            used["q" if factor.wave or factor.kind == "q" else "v", joint] = None
    found = []
    for kind, joint in used:
        low, high = (np.asarray(parameters[f"{kind}_{end}"], dtype=float)[joint] for end in ("low", "high"))
        found.append((kind, joint, float(low + high) / 2, max(float(high - low) / 2, 1e-9)))
    return found


@lru_cache(maxsize=256)
def _factors(name: str) -> tuple[_Factor, ...]:
    """The factors of a product by its name, such as ``sin(q1+2*q3)*v2^2*sign(v2)``; none of ``1``.

    Raises:
        ModelError: it is the name of no such product.
    """
    factors = []
    for part in [] if name == "1" else re.split(r"\*(?![^(]*\))", name):
        match = _PART.fullmatch(part)
        if match is None:
            raise ModelError(
                f"unknown term {name!r:.80}: {part!r:.40} is no wave, position, speed or direction"
            )
        function, inner, plain, power = match.groups()
        size = int(power or 1)
        if size == 0:
            raise ModelError(f"unknown term {name!r:.80}: a power is at least 1")
        if plain:
            factors.append(_Factor(plain[0], size, int(plain[1:]) - 1))
        elif function == "sign":
            if not re.fullmatch(r"v\d{1,2}", inner):
                raise ModelError(f"unknown term {name!r:.80}: sign() takes one speed")
            factors.append(_Factor("sign", size, int(inner[1:]) - 1))
        else:
            if "".join(m.group() for m in _ADDEND.finditer(inner)) != inner or not inner:
                raise ModelError(f"unknown term {name!r:.80}: {inner!r:.40} is no sum of angles")
            wave: dict[int, int] = {}
            for sign, times, joint in _ADDEND.findall(inner):
                wave[int(joint) - 1] = wave.get(int(joint) - 1, 0) + int(times or 1) * (
                    -1 if sign == "-" else 1
                )
            factors.append(_Factor(function, size, wave=tuple(wave.items())))
    if any(f.joint < 0 or any(j < 0 for j, _ in f.wave) for f in factors):
        raise ModelError(f"unknown term {name!r:.80}: joints are counted from 1")
    return tuple(factors)
