"""Elements of friction, the one vocabulary of the program, and their sum as the friction law of an arm.

An element is a function of the state along one direction, per unit of its coefficient: the friction selection of a
reconstruction chooses among them, and the effects of a diagnosis consist of them. It is written once, over
:class:`armloop.util.functions.Functions`, for floats, arrays of samples, AutoDiffXd and symbolic Expressions alike. Whoever
evaluates it hands in the direction of sliding: sign(v), a smooth stand-in, or the state of an elasto-plastic element;
from the values for +1 and -1 follow the level of dry friction, which a plant needs to stick, and what is smooth.

Sect. 4.3 of the paper sorts data by direction and adds Stribeck exponentials; here the direction is a
column, sign(v), which gives the same forward and backward levels together with the offset. The Stribeck
column is (1 − exp(−(v/v_s)²)) sign(v), which vanishes at standstill, so that a later step adds it without
touching the level inherited from the first: with level f_s and coefficient f_c − f_s it is Eq. (34).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from armloop.data.motion import Motion
from armloop.laws.hysteresis import stop_operator
from armloop.util.arrays import Array
from armloop.util.errors import ModelError
from armloop.util.functions import NUMPY, Functions

#: A joint that is no faster than this when a run begins, rad/s or m/s, begins at rest.
_AT_REST = 0.005
#: Part of a parameter by which a central difference steps: the third root of the rounding, where its error is least.
_STEP = float(np.finfo(float).eps) ** (1 / 3)
#: A state of which it is asked whether an element changes with the time: position, velocity, direction.
_SOMEWHERE = (np.float64(0.3), np.float64(0.7), np.float64(1.0))


class Direction(NamedTuple):
    """What a law acts along: joint j, or w = v_j + r v_k of two joints that share it; counted from 0."""

    joint: int
    other: int = -1
    ratio: float = 0.0

    def of(self, x: Sequence[Any] | Array) -> Any:
        """The component of a vector of n numbers."""
        return x[self.joint] + self.ratio * x[self.other] if self.ratio else x[self.joint]

    def add(self, total: list[Any], torque: Any) -> None:
        """Add a torque that acts along it to those of the n joints: by virtual work, r times on joint k."""
        total[self.joint] = total[self.joint] + torque
        if self.ratio:
            total[self.other] = total[self.other] + self.ratio * torque


class Sliding(NamedTuple):
    """Position and velocity along a direction, the direction of sliding in [-1, 1], and the time since the start, s."""

    q: Any
    v: Any
    sign: Any
    t: Any = np.inf


@dataclass(frozen=True)
class Element:
    """A function of the state along a direction, per unit of its coefficient.

    Attributes:
        value: (state, parameter, functions) -> torque.
        pattern: readable form, with {j} for the joint and {p} for the parameter.
        step: step of the reconstruction that finds it: 1 with the direction only, 2 with the velocity.
        part: what of M vdot + bias + gravity + friction it belongs to: "friction"; "position", of q alone; or
            "inertia", which multiplies the acceleration.
        way: how the direction of sliding turns: "sharp", as sign(v); "fading", as tanh(v / parameter); "memory", as the
            state of an elasto-plastic element (:mod:`armloop.laws.hysteresis`) of the width ``parameter``.
        by_load: whether it grows with the torque that passes the joint, abs(load).
        called: what a user calls the friction law that it belongs to, if the selection has it.
        steep: whether it is infinitely steep at rest but for ``parameter``, rad/s (m/s), below which it is rounded off.
        one_way: whether it acts in one direction of sliding alone.
    """

    value: Callable[[Sliding, float, Functions], Any]
    pattern: str
    step: int = 3
    way: str = "sharp"
    by_load: bool = False
    part: str = "friction"
    called: tuple[str, ...] = ()
    steep: bool = False
    one_way: bool = False

    @property
    def of_time(self) -> bool:
        """Whether it changes with the time since the start."""
        with np.errstate(all="ignore"):
            early, late = (self.value(Sliding(*_SOMEWHERE, t), 0.9, NUMPY) for t in (0.5, 1.5))
        return not np.array_equal(early, late, equal_nan=True)

    @property
    def of_position(self) -> bool:
        """Whether it changes with the position."""
        with np.errstate(all="ignore"):
            here, there = (self.value(Sliding(q, *_SOMEWHERE[1:], 1.0), 0.9, NUMPY) for q in (0.37, 1.9))
        return not np.array_equal(here, there, equal_nan=True)

    @property
    def dry(self) -> bool:
        """Whether it turns with the direction of sliding."""
        back, forth = (self.value(Sliding(*_SOMEWHERE[:2], sign, 1.0), 0.9, NUMPY) for sign in (-1.0, 1.0))
        return bool(back != forth)


class Acting(NamedTuple):
    """An element with its coefficient and parameter."""

    coefficient: float
    element: Element
    parameter: float = 0.0

    def widened(self, width: float) -> Acting:
        """The same; where its direction fades in, or it is steep, it does over no less than a width, rad/s (m/s)."""
        fades = self.element.way == "fading" or self.element.steep
        return self._replace(parameter=max(self.parameter, width)) if fades else self


def torque_along(
    terms: Iterable[Acting], x: Sliding, load: Any, functions: Functions, sharp: bool = True
) -> Any:
    """The sum of elements at a state; ``sharp`` takes directions that fade in as the one handed in."""
    total: Any = 0.0
    for coefficient, element, p in terms:
        fading = not sharp and element.way == "fading"
        value = coefficient * element.value(
            x._replace(sign=functions.tanh(x.v / p)) if fading else x, p, functions
        )
        total = total + (value * abs(load) if element.by_load else value)
    return total


def stribeck_fall(v: Any, speed: Any, functions: Functions = NUMPY) -> Any:
    """exp(−(v/v_s)²): what is left at a velocity of the excess of static over Coulomb friction, Eq. (34)."""
    x = v / speed
    return functions.exp(-x * x)


def _direction(x: Sliding, p: float, f: Functions) -> Any:
    return x.sign


#: Every kind of friction element by the name that model files give it; first those that the selection tries, in its order.
KINDS: dict[str, Element] = {
    "smooth_sign": Element(_direction, "tanh(v{j}/{p:g})", 1, "fading", called=("coulomb", "coulomb_fading")),
    "viscous": Element(lambda x, p, f: x.v, "v{j}", 2, called=("viscous",)),
    "offset": Element(lambda x, p, f: 1.0, "1", 1, called=("offset",)),
    "stribeck_peak": Element(
        lambda x, p, f: stribeck_fall(x.v, p, f) * x.sign,
        "exp(-(v{j}/{p:g})^2)*sign(v{j})",
        2,
        called=("stribeck",),
    ),
    # sqrt(|v|) sign(v), rounded off below 1e-10 so that it has a derivative at rest
    "root": Element(
        lambda x, p, f: x.v / f.sqrt(f.sqrt(x.v * x.v + (p * p + 1e-20))),
        "sqrt(abs(v{j}))*sign(v{j})",
        2,
        called=("nonlinear_viscous",),
        steep=True,
    ),
    "quadratic": Element(lambda x, p, f: abs(x.v) * x.v, "abs(v{j})*v{j}", 2, called=("nonlinear_viscous",)),
    "cubic": Element(lambda x, p, f: x.v * x.v * x.v, "v{j}^3", 2, called=("nonlinear_viscous",)),
    "viscous_forward": Element(
        lambda x, p, f: 0.5 * (x.v + abs(x.v)),
        "max(v{j},0)",
        2,
        called=("viscous_by_direction",),
        one_way=True,
    ),
    "viscous_backward": Element(
        lambda x, p, f: 0.5 * (x.v - abs(x.v)),
        "min(v{j},0)",
        2,
        called=("viscous_by_direction",),
        one_way=True,
    ),
    "load_smooth_sign": Element(
        _direction, "abs(load{j})*tanh(v{j}/{p:g})", 1, "fading", True, called=("coulomb_by_load",)
    ),
    "hysteresis": Element(_direction, "stop(q{j},{p:g})", 1, "memory", called=("presliding",)),
    "load_hysteresis": Element(
        _direction, "abs(load{j})*stop(q{j},{p:g})", 1, "memory", True, called=("presliding_by_load",)
    ),
    "sign": Element(_direction, "sign(v{j})", 1),
    "load_sign": Element(_direction, "abs(load{j})*sign(v{j})", 1, by_load=True),
    "both_ways": Element(lambda x, p, f: x.sign * x.sign, "abs(sign(v{j}))", 1),
    "fading_sign": Element(lambda x, p, f: f.exp(-(x.t / p)) * x.sign, "exp(-t/{p:g})*sign(v{j})", 1),
    "stribeck": Element(
        lambda x, p, f: (1.0 - stribeck_fall(x.v, p, f)) * x.sign, "(1-exp(-(v{j}/{p:g})^2))*sign(v{j})", 2
    ),
}
#: Eq. (34) by kinds of elements: a level, and a rise from it (the level is f_s) or a fall onto it (the level is f_c).
_EQUATION_34 = ("sign", "smooth_sign"), ("stribeck",), ("stribeck_peak",)
#: Viscous friction, of both directions and of either.
_VISCOUS = ("viscous", "viscous_forward", "viscous_backward")
#: A direction that fades in as tanh(v/p) is all there from this many p on, to half a percent.
FADED = 3.0
#: What a user calls the friction laws of the selection, and the kinds of elements that each consists of. Of the directions
#: that fade in, plain Coulomb friction is the sharpest: the others stand in for what happens before the joint slides.
FRICTION_LAWS: dict[str, tuple[str, ...]] = {
    name: tuple(kind for kind, element in KINDS.items() if name in element.called)
    for name in dict.fromkeys(name for element in KINDS.values() for name in element.called)
}


def column(
    element: Element,
    motion: Motion,
    along: Direction,
    parameter: float,
    load: Array | None = None,
    sign: Array | None = None,
) -> Array:
    """(N,) values of an element along a direction; ``load`` (N, n) is the torque that passes the joints.

    Args:
        sign: (N,) direction of sliding where it is known, as of a memory that began before this motion does.
    """
    q, v, vdot = (np.asarray(along.of(x.T)) for x in (motion.q, motion.v, motion.vdot))
    if element.part == "inertia":
        return vdot
    sign = sliding_direction(element, motion, along, parameter) if sign is None else sign
    values = element.value(Sliding(q, v, sign, motion.elapsed), parameter, NUMPY)
    if element.by_load:
        assert load is not None
        values = values * np.abs(load[:, along.joint])
    return np.asarray(values + np.zeros_like(v))


def sliding_direction(element: Element, motion: Motion, along: Direction, parameter: float) -> Array:
    """(N,) direction of sliding in [-1, 1] as an element sees it.

    Of its memory a run of a log tells nothing: it begins relaxed where the joint is at rest, else as if the acceleration
    had been what it is now since the last reversal (v²/2a ago where the joint speeds up, without end where it slows down).
    """
    v = np.asarray(along.of(motion.v.T))
    if element.way == "memory":
        vdot = np.asarray(along.of(motion.vdot.T))
        start = _entry(v[motion.starts], vdot[motion.starts], parameter)
        return stop_operator(np.asarray(along.of(motion.q.T)), parameter, motion.starts, start)
    return np.asarray(np.tanh(v / parameter) if element.way == "fading" else np.sign(v))


def _entry(v: Array, a: Array, width: float) -> Array:
    """State in [-1, 1] of an elasto-plastic element with which runs begin that start at velocities v, accelerating by a."""
    speeding = v * a > 0
    distance = np.where(speeding, v**2 / (2 * np.where(speeding, np.abs(a), 1.0)), np.inf)
    distance = np.where(np.abs(v) > _AT_REST, distance, 0.0)
    return np.asarray(np.sign(v) * (distance > 0) * np.minimum(distance / width - 1, 1))


@dataclass(frozen=True)
class FrictionTerm:
    """One term of a joint's friction: a kind, its parameter (v_s in rad/s, width in rad, …) and coefficient."""

    kind: str
    coefficient: float = 1.0
    parameter: float = 0.0

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ModelError(f"unknown friction term {self.kind!r}; there are: {', '.join(KINDS)}")
        if "{p" in self.element.pattern and not self.parameter > 0:
            raise ModelError(f"friction term {self.kind!r} needs a positive parameter, not {self.parameter}")

    @property
    def element(self) -> Element:
        """What its coefficient multiplies."""
        return KINDS[self.kind]

    @property
    def acting(self) -> Acting:
        """The element with its numbers; Python's own, as numpy's scalars take three times as long."""
        return Acting(float(self.coefficient), self.element, float(self.parameter))

    @property
    def step(self) -> int:
        """Step of the reconstruction that finds it: 1 with the direction only, 2 with the velocity."""
        return self.element.step

    def name(self, joint: int) -> str:
        """Readable form for a joint counted from 1."""
        return self.element.pattern.format(j=joint, p=self.parameter)

    @property
    def share(self) -> float:
        """Part of its coefficient that acts in the mean of both directions of sliding."""
        return 0.5 if self.element.one_way else 1.0

    @property
    def by_load(self) -> bool:
        """Whether it is proportional to the torque that passes the joint."""
        return self.element.by_load

    def slope(self, motion: Motion, joint: int) -> Array:
        """(N,) derivative of its torque by its parameter: the column of the parameter as an unknown (delta method)."""
        h = _STEP * self.parameter
        low, high = (replace(self, parameter=self.parameter + by).column(motion, joint) for by in (-h, h))
        return np.asarray(self.coefficient * (high - low) / (2 * h))

    def column(
        self, motion: Motion, joint: int, load: Array | None = None, sign: Array | None = None
    ) -> Array:
        """(N,) values for joint ``joint`` (0-based), without the coefficient.

        ``load`` (N, n) is the rigid-body torque, which kinds proportional to the load need; ``sign`` (N,) the direction
        of sliding where it is known already.
        """
        if self.by_load and load is None:
            raise ModelError(f"friction term {self.kind!r} needs the load torque")
        return column(self.element, motion, Direction(joint), self.parameter, load, sign)


def without_spanned(law: Sequence[FrictionTerm]) -> list[int]:
    """Places of a law's terms without viscous friction where both directions have their own, of which it is the sum."""
    kinds = {term.kind for term in law}
    spanned = set(_VISCOUS) <= kinds
    return [k for k, term in enumerate(law) if not (spanned and term.kind == _VISCOUS[0])]


def stribeck_term(law: Iterable[FrictionTerm]) -> FrictionTerm | None:
    """The term of a joint's law whose parameter is the Stribeck velocity; None without one, or of a row of several."""
    falls = [term for term in law if term.kind in _EQUATION_34[1] + _EQUATION_34[2]]
    return falls[0] if len(falls) == 1 else None


@dataclass(frozen=True)
class FrictionLaw:
    """Friction of all joints: a tuple of terms per joint."""

    terms: tuple[tuple[FrictionTerm, ...], ...]

    def torque(self, motion: Motion, step: int = 3, load: Array | None = None) -> Array:
        """(N, n) friction torque of the terms found up to ``step``; ``load`` (N, n) is the rigid-body torque."""
        tau = np.zeros_like(motion.q)
        for j, terms in enumerate(self.terms):
            for term in terms:
                if term.step <= step:
                    tau[:, j] += term.coefficient * term.column(motion, j, load)
        return tau

    def remembers(self, joint: int) -> bool:
        """Whether the friction of a joint (0-based) has memory."""
        return any(term.element.way == "memory" for term in self.terms[joint])

    def sets_in_gradually(self, joint: int) -> bool:
        """Whether the dry friction of a joint (0-based) is there with the path since it turned round, or with its speed."""
        return self.remembers(joint) or self.fading(joint) > 0

    def stribeck_velocity(self, joint: int) -> float:
        """The velocity at which a joint's (0-based) dry friction falls, rad/s (m/s); 0 where it has none, or several."""
        fall = stribeck_term(self.terms[joint])
        return 0.0 if fall is None else fall.parameter

    def fading(self, joint: int) -> float:
        """Least speed over which a direction of the dry friction of a joint (0-based) fades in; 0 where it turns at once."""
        dry = [
            t for t in self.terms[joint] if t.element.dry and t.kind not in _EQUATION_34[1] + _EQUATION_34[2]
        ]
        if any(t.element.way == "sharp" for t in dry):
            return 0.0
        return min((t.parameter for t in dry if t.element.way == "fading"), default=0.0)

    def stribeck_sums(self, joint: int) -> dict[str, list[FrictionTerm]]:
        """f_s, f_c, f_v of Eq. (34) for a joint (0-based), each by the terms whose shares of coefficients add up to it.

        Viscous friction that differs by direction has the mean of both as f_v.
        Empty where the dry friction has another form: of several levels, with falls at several velocities, with memory, or
        with a level that is not yet all there where the fall ends.
        """
        terms = self.terms[joint]
        level, rise, fall = ([t for t in terms if t.kind in kinds] for kinds in _EQUATION_34)
        dry = [t for t in terms if t.element.dry and not t.by_load]
        fades = any(t.element.way == "fading" for t in level)
        if len(level) > 1 or len(rise + fall) > 1 or len(dry) > len(level + rise + fall):
            return {}
        if fades and not (fall and fall[0].parameter > FADED * level[0].parameter):
            return {}
        viscous = [t for t in terms if t.kind in _VISCOUS]
        sums = {"static": level + fall, "coulomb": level + rise}
        return {**sums, "viscous": viscous} if viscous else sums

    def stribeck_parameters(self, joint: int) -> dict[str, float]:
        """f_s, f_c, f_v, v_s of Eq. (34) for a joint (0-based), where the law has that form."""
        values = {
            key: sum(term.share * term.coefficient for term in terms)
            for key, terms in self.stribeck_sums(joint).items()
        }
        fall = stribeck_term(self.terms[joint])
        return {**values, "stribeck_velocity": fall.parameter} if values and fall else values

    def sliding_sums(self, joint: int) -> dict[str, list[FrictionTerm]]:
        """f_c, f_v, and f_s where it is determined, of a joint (0-based) whose dry friction has any number of levels.

        While it slides, a direction that fades in is all there, and so is a memory: their coefficients add up to one
        level. f_s, that level with the fall, needs one fall at most and directions that are there before it ends.
        Empty without a level, or beside friction that is nonlinear in v, of which a level at speed is a part.
        """
        terms = self.terms[joint]
        falls = [t for t in terms if t.kind in _EQUATION_34[2]]
        levels = [t for t in terms if t.element.dry and not t.by_load and t not in falls]
        rises = [t for t in levels if t.kind in _EQUATION_34[1]]
        if not levels or any("nonlinear_viscous" in t.element.called for t in terms):
            return {}
        viscous = [t for t in terms if t.kind in _VISCOUS]
        sums = {"coulomb": levels, **({"viscous": viscous} if viscous else {})}
        fall = stribeck_term(terms)
        if fall is None:
            return sums
        fading = (t.parameter for t in levels if t.element.way == "fading")
        if all(fall.parameter > FADED * parameter for parameter in fading):
            sums["static"] = [t for t in levels if t not in rises] + falls
        return sums

    def to_dict(self) -> list[list[dict[str, Any]]]:
        """JSON-ready values, one list of terms per joint."""
        return [
            [
                {
                    "kind": t.kind,
                    "name": t.name(j + 1),
                    "coefficient": t.coefficient,
                    "parameter": t.parameter,
                }
                for t in terms
            ]
            for j, terms in enumerate(self.terms)
        ]

    @staticmethod
    def from_dict(data: Any) -> FrictionLaw:
        """Rebuild from :meth:`to_dict`, as `armloop.schemas.model` checks it; raises ``ModelError`` for unknown terms."""
        return FrictionLaw(
            tuple(
                tuple(
                    FrictionTerm(t["kind"], float(t["coefficient"]), float(t.get("parameter", 0)))
                    for t in joint
                )
                for joint in data
            )
        )
