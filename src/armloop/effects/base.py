"""What every physical effect says of itself: its law, its columns, its parameters and their bounds.

An effect is fitted as coefficients of columns, linear for a fixed shape (the order of a ripple, say), and
then turned into named physical parameters. The same object predicts its torque for a model that has it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from armloop.arm import Arm
from armloop.motion import Motion

Array = NDArray[np.float64]
Value = float | list[float]
Pointwise = Callable[[Array, Array, Array], Sequence[float] | Array]


@dataclass(frozen=True)
class Estimate:
    """A physical parameter: value, standard error and unit; vectors are lists."""

    value: Value
    std_error: Value
    unit: str

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready values."""
        return {"value": self.value, "std_error": self.std_error, "unit": self.unit}


@dataclass(frozen=True, eq=False)
class Context:
    """What an effect may look at: the arm, the motion, and the known model's rigid-body part.

    Attributes:
        inertial: (10 n,) link parameters that reproduce the known model's rigid-body torques on this
            motion, or None where no effect needed them.
        period: sample period, s.
    """

    arm: Arm
    motion: Motion
    inertial: Array | None = None
    period: float = 0.01


class Effect(ABC):
    """A physical effect on all joints (``joint`` None) or on one (1-based).

    Class attributes:
        name: as in ``diagnosis.json``.
        joint_wise: whether it sits in one joint.
        sensor: whether it falsifies what is recorded instead of acting on the arm.
        complexity: number of free parameters, for preferring the simplest of equals.
        needs_inertial: whether its columns are made of the known model's inertial parameters.
        load: whether its torque passes the joint's bearings and gears, so that friction grows with it.
    """

    name: ClassVar[str]
    joint_wise: ClassVar[bool] = True
    sensor: ClassVar[bool] = False
    complexity: ClassVar[int] = 1
    needs_inertial: ClassVar[bool] = False
    load: ClassVar[bool] = False

    def __init__(self, joint: int | None = None) -> None:
        self.joint = joint

    def label(self) -> str:
        """Readable name, such as ``viscous_friction at joint 2``."""
        return self.name if self.joint is None else f"{self.name} at joint {self.joint}"

    def shapes(self, context: Context) -> Sequence[float]:
        """Values of the nonlinear parameter to try; one dummy value where there is none."""
        del context
        return (0.0,)

    @abstractmethod
    def columns(self, context: Context, shape: float) -> Array:
        """(N, n, p) torque per unit of each coefficient, or (N, p) on the effect's own joint."""

    def start(self, beta: Array) -> Array:
        """Free parameters x (k,) nearest to unconstrained coefficients beta (p,)."""
        return beta

    def embed(self, x: Array) -> tuple[Array, Array]:
        """Coefficients (p,) of free parameters x (k,), and their derivative (p, k); the identity by default.

        An effect whose coefficients obey physical laws among themselves (a body's mass, centre and
        inertia) states them here.
        """
        return x, np.eye(len(x))

    @abstractmethod
    def estimates(self, arm: Arm, x: Array, covariance: Array, shape: float) -> dict[str, Estimate]:
        """Named parameters from the free parameters (k,) and their covariance (k, k)."""

    @abstractmethod
    def torque(self, context: Context, parameters: dict[str, Value]) -> Array:
        """(N, n) torque that the drive must supply in addition (or that the sensor adds)."""

    def pointwise(self, arm: Arm, parameters: dict[str, Value], inertial: Array | None) -> Pointwise:
        """The same torque for one sample at a time: (q, v, vdot), each (n,), -> (n,)."""

        def torque(q: Array, v: Array, vdot: Array) -> Array:
            motion = Motion(np.zeros(1), q[None], v[None], vdot[None], np.zeros(1, dtype=np.intp))
            return self.torque(Context(arm, motion, inertial), parameters)[0]

        return torque

    def plausible(self, arm: Arm, parameters: dict[str, Estimate]) -> bool:
        """Whether the parameters are physically possible."""
        del arm, parameters
        return True

    @abstractmethod
    def sentence(self, parameters: dict[str, Estimate]) -> str:
        """What was found, in words."""

    def full_columns(self, context: Context, shape: float) -> Array:
        """(N, n, p) columns on all joints."""
        columns = self.columns(context, shape)
        if columns.ndim == 3:
            return columns
        assert self.joint is not None
        N, p = columns.shape
        full = np.zeros((N, context.arm.n, p))
        full[:, self.joint - 1] = columns
        return full


def number(value: Value) -> float:
    """The single number of a scalar parameter."""
    return float(np.asarray(value, dtype=float).reshape(()))


class LinearJointEffect(Effect):
    """An effect of one joint with one linear coefficient: torque = coefficient · column."""

    parameter: ClassVar[str]
    unit: ClassVar[str]
    law: ClassVar[str]
    nonnegative: ClassVar[bool] = False

    @abstractmethod
    def column(self, motion: Motion, joint: int) -> Array:
        """(N,) torque per unit of the coefficient at joint ``joint`` (0-based)."""

    def columns(self, context: Context, shape: float) -> Array:
        assert self.joint is not None
        return self.column(context.motion, self.joint - 1)[:, None]

    def torque(self, context: Context, parameters: dict[str, Value]) -> Array:
        return self.full_columns(context, 0.0)[:, :, 0] * number(parameters[self.parameter])

    def _unit(self, arm: Arm) -> str:
        assert self.joint is not None
        joint = arm.joints[self.joint - 1]
        inertia = "kg*m^2" if joint.kind == "revolute" else "kg"
        unit = self.unit.replace("TAU", joint.torque_unit).replace("POS", joint.position_unit)
        return unit.replace("INERTIA", inertia)

    def estimates(self, arm: Arm, x: Array, covariance: Array, shape: float) -> dict[str, Estimate]:
        error = float(np.sqrt(max(covariance[0, 0], 0.0)))
        return {self.parameter: Estimate(float(x[0]), error, self._unit(arm))}

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        e = parameters[self.parameter]
        return (
            f"joint {self.joint} needs {self.law} in addition, with {self.parameter} "
            f"{number(e.value):.4g} ± {number(e.std_error):.2g} {e.unit}"
        )

    def plausible(self, arm: Arm, parameters: dict[str, Estimate]) -> bool:
        return not self.nonnegative or number(parameters[self.parameter].value) > 0
