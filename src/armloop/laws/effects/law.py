"""A law: coefficients times elements along a joint's direction, or along one that two joints share.

    tau = sum_i c_i e_i(q, v, sign(v), t; s)  acting along  w = v_j + r v_k

Its elements (:class:`armloop.laws.friction.Element`) are written once, over functions handed in. Everything else
follows from them: the columns of a regression, the torque of a run and of one sample, the equations of motion in
Drake's scalar types, the level of dry friction with which a plant sticks, the checks and words of its parameters.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from armloop.data.motion import Motion
from armloop.laws.effects.base import (
    Array,
    Context,
    Effect,
    Estimate,
    Parameter,
    Placed,
    Pointwise,
    Value,
    Values,
    number,
)
from armloop.laws.friction import KINDS, Acting, Direction, Element, Sliding, column, torque_along
from armloop.robot.arm import Arm
from armloop.util.functions import MATH

#: Multiplies the acceleration.
INERTIA = Element(lambda x, p, f: 1.0, "vdot{j}", part="inertia")


class Law(Effect):
    """An effect of one joint or a pair, linear in the coefficients of its elements for each value of one shape s.

    A continuous shape is searched on a grid (``shapes``); around the best, c e(s) of the first element is taken to
    first order in log s, with the columns e and de/dlog s, so that s has a value between the grid's and a standard error.
    A pair acts along v_j + r v_k, and r is its shape.

    Class attributes:
        law: as a formula.
        elements: one per coefficient: an :class:`~armloop.laws.friction.Element`, or the name of one of
            :data:`~armloop.laws.friction.KINDS`.
    """

    needs_model = False
    law: ClassVar[str]
    elements: ClassVar[tuple[Element | str, ...]] = ()

    #: Changes of the shape (:meth:`_moved`): its derivative is taken by one; beyond the other the first order says nothing.
    _STEP: ClassVar[float] = 0.03
    _FARTHEST: ClassVar[float] = 0.3

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        parts = cls._parts()
        cls.needs_model = cls.needs_model or any(element.by_load for element in parts)
        cls.rubs = cls.scope == "joint" and cls.role == "mechanical" and bool(parts)
        cls.rubs = cls.rubs and all(element.part == "friction" for element in parts)
        cls.of_time = any(element.of_time for element in parts)
        cls.memory = cls.memory or cls.of_time or any(element.way == "memory" for element in parts)

    @classmethod
    def _parts(cls) -> list[Element]:
        return [KINDS[e] if isinstance(e, str) else e for e in cls.elements]

    @classmethod
    def _shape(cls) -> Parameter | None:
        return next((p for p in cls.parameters if p.shape), None)

    @classmethod
    def _profiled(cls) -> bool:
        shape = cls._shape()
        return shape is not None and shape.shape == "continuous"

    def _follows(self, x: Array) -> bool:
        """Whether one of the coefficients (k,) is of de/dlog s."""
        return self._profiled() and len(x) > len(self.elements)

    def coefficients(self, p: Mapping[str, float]) -> tuple[float, ...]:
        """The elements' coefficients of given parameters: these themselves in their order, but for the shape."""
        return tuple(p[q.name] for q in self.parameters if not q.shape)

    def named(self, x: Array, shape: float) -> tuple[float, ...]:
        values = iter(np.delete(x, 1).tolist() if self._follows(x) else x.tolist())
        value = self.refined(x, shape) if self._profiled() else shape
        return tuple(value if p.shape else next(values) for p in self.parameters)

    def along(self, shape: float) -> Direction:
        """The direction that it acts along."""
        if self.other_joint is None:
            return Direction(self.index)
        return Direction(self.index, self.other_joint - 1, shape)

    def _numbers(self, parameters: Values) -> tuple[tuple[float, ...], float]:
        """Coefficients and shape."""
        p = {
            q.name: number(parameters[q.name] if q.default is None else parameters.get(q.name, q.default))
            for q in self.parameters
        }
        shape = self._shape()
        return self.coefficients(p), 0.0 if shape is None else p[shape.name]

    def values(self, context: Context, shape: float) -> list[Array]:
        """(N,) of each element along the direction."""
        load = context.load
        return [column(e, context.motion, self.along(shape), shape, load) for e in self._parts()]

    def columns(self, context: Context, shape: float) -> Array:
        found = self.values(context, shape)
        if self._profiled():
            h = self._STEP
            low, high = (self.values(context, self._moved(shape, x))[0] for x in (-h, h))
            found.insert(1, (high - low) / (2 * h))
        own = np.column_stack(found)
        return own if self.other_joint is None else self._spread(context, own, shape)

    def _spread(self, context: Context, own: Array, shape: float) -> Array:
        """(N, n, p) of what acts along the direction (N, p)."""
        full, along = np.zeros((len(own), context.arm.n, own.shape[1])), self.along(shape)
        full[:, along.joint] = own
        if along.ratio:
            full[:, along.other] = along.ratio * own
        return full

    def judged(self, x: Array) -> tuple[Array, Array]:
        """The coefficients themselves; that of de/dlog s no larger than where the first order holds.

        Farther off, e and de/dlog s together are the law at no s: what they happen to span would be judged in its name.
        """
        given, slope = super().judged(x)
        if self._follows(x) and abs(x[1]) > self._FARTHEST * abs(x[0]):
            ratio = self._FARTHEST * np.sign(x[0] * x[1])
            given = given.copy()
            given[1] = ratio * x[0]
            slope[1, :2] = ratio, 0.0
        return given, slope

    def refined(self, x: Array, shape: float) -> float:
        if not self._follows(x):
            return shape
        size = float(x[0]) if abs(x[0]) > 1e-12 else 1e-12
        return self._moved(shape, float(np.clip(x[1] / size, -self._FARTHEST, self._FARTHEST)))

    def _moved(self, shape: float, by: float) -> float:
        """The shape changed by so much: its logarithm, as it is positive."""
        return shape * float(np.exp(by))

    def estimates(self, arm: Arm, x: Array, covariance: Array, shape: float) -> dict[str, Estimate]:
        found, own = super().estimates(arm, x, covariance, shape), self._shape()
        held = not self._follows(x) or abs(x[1]) >= self._FARTHEST * abs(x[0])
        if own is not None and self._profiled() and held:
            # as given, or where the first order ends: by how much it is off nobody knows
            found[own.name] = replace(found[own.name], std_error=np.nan)
        return found

    def torque(self, context: Context, parameters: dict[str, Value]) -> Array:
        coefficients, shape = self._numbers(parameters)
        total = np.zeros(context.motion.samples)
        for c, values in zip(coefficients, self.values(context, shape), strict=True):
            total += c * values
        return self._spread(context, total[:, None], shape)[:, :, 0]

    def placed(self, parameters: Values) -> Placed | None:
        if not self.elements:
            return None
        coefficients, shape = self._numbers(parameters)
        parts = zip(coefficients, self._parts(), strict=True)
        return Placed(self.along(shape), tuple(Acting(c, e, shape) for c, e in parts))

    def pointwise(self, arm: Arm, parameters: dict[str, Value], inertial: Array | None) -> Pointwise:
        placed = self.placed(parameters)
        if placed is None or self.event:
            return super().pointwise(arm, parameters, inertial)
        along, terms = placed
        mass = sum(t.coefficient for t in terms if t.element.part == "inertia")
        others = [t for t in terms if t.element.part != "inertia"]

        def torque(q: Array, v: Array, vdot: Array) -> list[float]:
            total, w = [0.0] * arm.n, float(along.of(v))
            x = Sliding(float(along.of(q)), w, (w > 0) - (w < 0))
            along.add(total, mass * float(along.of(vdot)) + torque_along(others, x, 0.0, MATH, sharp=False))
            return total

        return torque

    def resolved(self, parameters: dict[str, Estimate], tried: Sequence[float]) -> bool:
        shape = self._shape()
        if shape is None or not self._profiled():
            return True
        return min(tried) <= number(parameters[shape.name].value) <= max(tried)

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        words = [f"{p.name} {parameters[p.name].words(3 if p.shape else 4)}" for p in self.parameters[:2]]
        return f"joint {self.joint} needs {self.law} in addition, with {' and '.join(words)}"


class LinearJointEffect(Law):
    """coefficient · column of one joint, where the column is known for arrays of samples alone, not for symbols."""

    parameter: ClassVar[str]
    unit: ClassVar[str]
    nonnegative: ClassVar[bool] = False

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        if hasattr(cls, "parameter") and hasattr(cls, "unit"):
            cls.parameters = cls._own_parameters()
            cls.complexity = len(cls.parameters)

    @classmethod
    def _own_parameters(cls) -> tuple[Parameter, ...]:
        return (Parameter(cls.parameter, cls.unit, positive=cls.nonnegative),)

    @abstractmethod
    def column(self, motion: Motion, joint: int, *shape: float) -> Array:
        """(N,) torque per unit of the coefficient at joint ``joint`` (0-based); of a profiled effect at a shape."""

    def values(self, context: Context, shape: float) -> list[Array]:
        return [self.column(context.motion, self.index, *((shape,) if self._profiled() else ()))]


class ProfiledJointEffect(LinearJointEffect):
    """coefficient · column(s), with a positive number s that is searched and refined."""

    shape_name: ClassVar[str]
    shape_unit: ClassVar[str]
    nonnegative = True

    @classmethod
    def _own_parameters(cls) -> tuple[Parameter, ...]:
        if not (hasattr(cls, "shape_name") and hasattr(cls, "shape_unit")):
            return ()
        return *super()._own_parameters(), Parameter(
            cls.shape_name, cls.shape_unit, above=0.0, shape="continuous"
        )
