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


@dataclass(frozen=True)
class _Kind:
    step: int
    pattern: str
    column: Callable[[Array, Array, Any, float], Array]
    by_load: bool = False


# q (N,), v (N,), run starts, parameter -> (N,)
_KINDS: dict[str, _Kind] = {
    "offset": _Kind(1, "1", lambda q, v, starts, p: np.ones_like(v)),
    "sign": _Kind(1, "sign(v{j})", lambda q, v, starts, p: np.sign(v)),
    "smooth_sign": _Kind(1, "tanh(v{j}/{p:g})", lambda q, v, starts, p: np.tanh(v / p)),
    "hysteresis": _Kind(1, "stop(q{j},{p:g})", lambda q, v, starts, p: stop_operator(q, p, starts)),
    "load_sign": _Kind(1, "abs(load{j})*sign(v{j})", lambda q, v, starts, p: np.sign(v), by_load=True),
    "load_hysteresis": _Kind(
        1, "abs(load{j})*stop(q{j},{p:g})", lambda q, v, starts, p: stop_operator(q, p, starts), by_load=True
    ),
    "viscous": _Kind(2, "v{j}", lambda q, v, starts, p: v),
    "root": _Kind(2, "sqrt(abs(v{j}))*sign(v{j})", lambda q, v, starts, p: np.sqrt(np.abs(v)) * np.sign(v)),
    "quadratic": _Kind(2, "abs(v{j})*v{j}", lambda q, v, starts, p: np.abs(v) * v),
    "cubic": _Kind(2, "v{j}^3", lambda q, v, starts, p: v**3),
    "stribeck": _Kind(
        2,
        "(1-exp(-(v{j}/{p:g})^2))*sign(v{j})",
        lambda q, v, starts, p: -np.expm1(-((v / p) ** 2)) * np.sign(v),
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
        column = _KINDS[self.kind].column(motion.q[:, joint], v, motion.starts, self.parameter)
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
