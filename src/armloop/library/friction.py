"""Candidate functions of one joint's friction, and their sum as a friction law.

Sect. 4.3 of the paper sorts data by direction and adds Stribeck exponentials; here the direction is a
column, sign(v), which gives the same forward and backward levels together with the offset. The Stribeck
column is (1 − exp(−(v/v_s)²)) sign(v), which vanishes at standstill, so that a later step adds it without
touching the level inherited from the first: with level f_s and coefficient f_c − f_s it is Eq. (34).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armloop.errors import ModelError
from armloop.library.hysteresis import stop_operator
from armloop.motion import Motion

Array = NDArray[np.float64]

#: A joint that is no faster than this when a run begins, rad/s or m/s, begins at rest.
_AT_REST = 0.005


@dataclass(frozen=True)
class _Kind:
    step: int
    pattern: str
    column: Callable[[Array, Array, Any, float], Array]
    by_load: bool = False


@dataclass(frozen=True)
class _Entry:
    """How the runs begin: index of each first sample, and what is known of the path before it.

    ``travel`` (R,) is the distance since the last reversal, signed by its direction, as if the acceleration had
    been what it is now: v²/2a where the joint speeds up, without end where it slows down.
    """

    starts: NDArray[np.intp]
    travel: Array

    @staticmethod
    def of(motion: Motion, joint: int) -> _Entry:
        v, a = motion.v[motion.starts, joint], motion.vdot[motion.starts, joint]
        speeding = v * a > 0
        distance = np.where(speeding, v**2 / (2 * np.where(speeding, np.abs(a), 1.0)), np.inf)
        return _Entry(motion.starts, np.sign(v) * np.where(np.abs(v) > _AT_REST, distance, 0.0))

    def stop(self, q: Array, width: float) -> Array:
        """The stop operator; relaxed where a run begins at rest."""
        state = np.sign(self.travel) * np.clip(np.abs(self.travel) / width - 1, -1, 1)
        return stop_operator(q, width, self.starts, state)


# q (N,), v (N,), how the runs begin, parameter -> (N,)
_KINDS: dict[str, _Kind] = {
    "offset": _Kind(1, "1", lambda q, v, entry, p: np.ones_like(v)),
    "sign": _Kind(1, "sign(v{j})", lambda q, v, entry, p: np.sign(v)),
    "smooth_sign": _Kind(1, "tanh(v{j}/{p:g})", lambda q, v, entry, p: np.tanh(v / p)),
    "hysteresis": _Kind(1, "stop(q{j},{p:g})", lambda q, v, entry, p: entry.stop(q, p)),
    "load_sign": _Kind(1, "abs(load{j})*sign(v{j})", lambda q, v, entry, p: np.sign(v), by_load=True),
    "load_smooth_sign": _Kind(
        1, "abs(load{j})*tanh(v{j}/{p:g})", lambda q, v, entry, p: np.tanh(v / p), by_load=True
    ),
    "load_hysteresis": _Kind(
        1, "abs(load{j})*stop(q{j},{p:g})", lambda q, v, entry, p: entry.stop(q, p), by_load=True
    ),
    "viscous": _Kind(2, "v{j}", lambda q, v, entry, p: v),
    "viscous_forward": _Kind(2, "max(v{j},0)", lambda q, v, entry, p: np.maximum(v, 0.0)),
    "viscous_backward": _Kind(2, "min(v{j},0)", lambda q, v, entry, p: np.minimum(v, 0.0)),
    "root": _Kind(2, "sqrt(abs(v{j}))*sign(v{j})", lambda q, v, entry, p: np.sqrt(np.abs(v)) * np.sign(v)),
    "quadratic": _Kind(2, "abs(v{j})*v{j}", lambda q, v, entry, p: np.abs(v) * v),
    "cubic": _Kind(2, "v{j}^3", lambda q, v, entry, p: v**3),
    "stribeck_peak": _Kind(
        2, "exp(-(v{j}/{p:g})^2)*sign(v{j})", lambda q, v, entry, p: np.exp(-((v / p) ** 2)) * np.sign(v)
    ),
    "stribeck": _Kind(
        2,
        "(1-exp(-(v{j}/{p:g})^2))*sign(v{j})",
        lambda q, v, entry, p: -np.expm1(-((v / p) ** 2)) * np.sign(v),
    ),
}


@dataclass(frozen=True)
class FrictionTerm:
    """One term of a joint's friction: a kind, its parameter (v_s in rad/s, width in rad, …) and coefficient."""

    kind: str
    coefficient: float = 1.0
    parameter: float = 0.0

    def __post_init__(self) -> None:
        if self.kind not in _KINDS:
            raise ModelError(f"unknown friction term {self.kind!r}; there are: {', '.join(_KINDS)}")
        needs_parameter = "{p" in _KINDS[self.kind].pattern
        if needs_parameter and not self.parameter > 0:
            raise ModelError(f"friction term {self.kind!r} needs a positive parameter, not {self.parameter}")

    @property
    def step(self) -> int:
        """Step of the reconstruction that finds it: 1 with the direction only, 2 with the velocity."""
        return _KINDS[self.kind].step

    def name(self, joint: int) -> str:
        """Readable form for a joint counted from 1."""
        return _KINDS[self.kind].pattern.format(j=joint, p=self.parameter)

    @property
    def by_load(self) -> bool:
        """Whether it is proportional to the torque that passes the joint."""
        return _KINDS[self.kind].by_load

    def column(self, motion: Motion, joint: int, load: Array | None = None) -> Array:
        """(N,) values for joint ``joint`` (0-based), without the coefficient.

        ``load`` (N, n) is the rigid-body torque, which kinds proportional to the load need.
        """
        v = motion.v[:, joint]
        column = _KINDS[self.kind].column(motion.q[:, joint], v, _Entry.of(motion, joint), self.parameter)
        if self.by_load:
            if load is None:
                raise ModelError(f"friction term {self.kind!r} needs the load torque")
            column = column * np.abs(load[:, joint])
        return column


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

    def stribeck_parameters(self, joint: int) -> dict[str, float]:
        """f_s, f_c, f_v, v_s of Eq. (34) for a joint (0-based), where the law has that form."""
        by_kind = {term.kind: term for term in self.terms[joint]}
        static = by_kind["sign"].coefficient if "sign" in by_kind else 0.0
        values = {"static": static, "coulomb": static}
        if "stribeck" in by_kind:
            values["coulomb"] += by_kind["stribeck"].coefficient
            values["stribeck_velocity"] = by_kind["stribeck"].parameter
        if "viscous" in by_kind:
            values["viscous"] = by_kind["viscous"].coefficient
        return values

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
        """Rebuild from :meth:`to_dict`; raises ``ModelError`` for unknown or misshapen terms."""
        try:
            return FrictionLaw(
                tuple(
                    tuple(
                        FrictionTerm(t["kind"], float(t["coefficient"]), float(t.get("parameter", 0)))
                        for t in joint
                    )
                    for joint in data
                )
            )
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            if isinstance(error, ModelError):
                raise
            raise ModelError(f"friction: a list of terms per joint is needed: {error!r}") from error
