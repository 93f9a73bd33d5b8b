"""The equations of an effect of a user's own, whose law is known for arrays of samples alone.

The listed effects' laws are written out for any kind of number (:mod:`armloop.dynamics.effects`); of a user's, its
``torque`` and ``pointwise`` serve floats and arrays. AutoDiffXd and symbolic Expressions are refused.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from armloop.data.motion import Motion
from armloop.dynamics.equations import Array, Equations, Numbers, Rows
from armloop.laws.effects import Context, Effect, Values
from armloop.robot.arm import Arm
from armloop.util.errors import ModelError

#: Difference, relative to the torque's size, above which a torque is not linear in the acceleration.
_ROUND_OFF = 1e-6


class OwnEffectEquations(Equations):
    """tau = M(q) vdot + rest(q, v) of an effect by its torques at samples."""

    def __init__(self, arm: Arm, effect: Effect, parameters: Values, inertial: Array | None) -> None:
        """Take an effect of the arm.

        Raises:
            ModelError: it falsifies the record, its torque needs what one sample does not tell, or is not
                linear in the acceleration.
        """
        if effect.sensor:
            raise ModelError(f"effect {effect.name}: falsifies the record; it has no torque on the arm")
        self.n = arm.n
        self._arm, self._effect, self._parameters = arm, effect, dict(parameters)
        self._inertial = inertial
        self._one = effect.pointwise(arm, self._parameters, inertial)
        self.has_inertia = self._probe()

    def _probe(self) -> bool:
        """Whether the torque grows with the acceleration."""
        try:
            q, v, a = np.random.default_rng(0).uniform(-1, 1, (3, 8, self.n))
            rest, once, twice = (
                np.array([self._one(*x) for x in zip(q, v, k * a, strict=True)], dtype=float)
                for k in (0.0, 1.0, 2.0)
            )
        except (KeyError, TypeError, AttributeError, AssertionError) as error:
            raise ModelError(
                f"effect {self._effect.name}: has no torque at single samples with the parameters "
                f"{', '.join(self._parameters) or 'none'} ({type(error).__name__}: {error})"
            ) from error
        size = _ROUND_OFF * max(1.0, float(np.abs(twice).max()))
        if np.abs(twice - 2 * once + rest).max() > size:
            raise ModelError(
                f"effect {self._effect.name}: its torque is not linear in the acceleration; it has no inertia"
            )
        return bool(np.abs(once - rest).max() > size)

    def inertia(self, q: Numbers) -> Rows:
        nothing = [0.0] * self.n
        if not self.has_inertia:
            return super().inertia(q)
        rest = self.rest(q, nothing)
        columns = [self.torque(q, nothing, [float(k == j) for k in range(self.n)]) for j in range(self.n)]
        return [[columns[j][i] - rest[i] for j in range(self.n)] for i in range(self.n)]

    def rest(self, q: Numbers, v: Numbers) -> list[Any]:
        return self.torque(q, v, [0.0] * self.n)

    def torque(self, q: Numbers, v: Numbers, vdot: Numbers) -> list[Any]:
        numbers = [*q, *v, *vdot]
        if all(isinstance(x, float | int) for x in numbers):
            state = np.array(numbers, dtype=float).reshape(3, self.n)
            return np.asarray(self._one(*state), dtype=float).tolist()
        if not all(isinstance(x, float | int | np.ndarray) for x in numbers):
            raise ModelError(
                f"effect {self._effect.name}: its law is known for plain numbers only, not for AutoDiffXd or Expression; "
                "take the diagram in float, or the model without it"
            )
        shape = np.broadcast_shapes(*(np.shape(x) for x in numbers))
        states = np.stack([np.broadcast_to(x, shape) for x in numbers]).reshape(3, self.n, -1)
        qs, vs, accelerations = (np.ascontiguousarray(x.T, dtype=float) for x in states)
        if self._effect.memory:
            # samples of arrays have no past
            tau = np.array([self._one(*x) for x in zip(qs, vs, accelerations, strict=True)], dtype=float)
        else:
            motion = Motion(np.arange(float(len(qs))), qs, vs, accelerations)
            tau = self._effect.torque(Context(self._arm, motion, self._inertial), self._parameters)
        return [column.reshape(shape) for column in tau.T]
