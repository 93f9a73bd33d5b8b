"""Dry and viscous friction of a joint: the Stribeck law, Eq. (34) of the paper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from armloop.laws.friction import stribeck_fall
from armloop.util.arrays import Array
from armloop.util.errors import InputError
from armloop.util.functions import NUMPY, Functions
from armloop.util.given import require


@dataclass(frozen=True)
class JointFriction:
    """Parameters of f(v) = [f_c + (f_s - f_c) exp(-(v/v_s)^2)] sign(v) + f_v v.

    static, coulomb : f_s >= f_c >= 0 in N*m (N for a prismatic joint)
    stribeck_velocity : v_s > 0 in rad/s (m/s)
    viscous : f_v >= 0 in N*m*s/rad (N*s/m)

    Raises `InputError` for a value outside these ranges.
    """

    static: float = 0.0
    coulomb: float = 0.0
    stribeck_velocity: float = 0.1
    viscous: float = 0.0

    def __post_init__(self) -> None:
        require("a finite number", **vars(self))
        if self.coulomb < 0 or self.viscous < 0:
            raise InputError(f"coulomb {self.coulomb} and viscous {self.viscous} must not be negative")
        if self.static < self.coulomb:
            raise InputError(f"static {self.static} must be at least coulomb {self.coulomb}")
        if self.stribeck_velocity <= 0:
            raise InputError(f"stribeck_velocity {self.stribeck_velocity} must be above 0")

    def level(self, v: Any, functions: Functions = NUMPY) -> Any:
        """Return the level of the dry part at `v`, a number of any kind."""
        return self.coulomb + (self.static - self.coulomb) * stribeck_fall(
            v, self.stribeck_velocity, functions
        )

    def dry(self, v: ArrayLike) -> Array:
        """Return the part with sign(v) at `v` (any shape); 0 at rest, where it is not determined."""
        v = np.asarray(v, dtype=float)
        return np.asarray(self.level(v) * np.sign(v))

    def force(self, v: ArrayLike) -> Array:
        """Return f(v), what the drive must supply to keep sliding at `v` (any shape)."""
        return self.dry(v) + self.viscous * np.asarray(v, dtype=float)
