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
from armloop.library.friction import FrictionTerm
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
    """What an effect may look at: the arm, the motion, and what the known model says of it.

    Attributes:
        inertial: (10 n,) link parameters that reproduce the known model's rigid-body torques on this
            motion, or None where no effect needed them.
        period: sample period, s.
        load: (N, n) torque that passes the joints' bearings and gears, by the known model.
        predict: the known model's torque (N, n) of any motion, without sensor faults.
        predicted: (N, n) the same on this motion, with the sensor faults that come before.
    """

    arm: Arm
    motion: Motion
    inertial: Array | None = None
    period: float = 0.01
    load: Array | None = None
    predict: Callable[[Motion], Array] | None = None
    predicted: Array | None = None


class Effect(ABC):
    """A physical effect on all joints (``joint`` None), on one (1-based), or on a pair.

    Class attributes:
        name: as in ``diagnosis.json``.
        joint_wise: whether it sits in one joint.
        pair_wise: whether it also concerns another joint, ``other_joint``.
        sensor: whether it falsifies what is recorded instead of acting on the arm.
        complexity: number of free parameters, for preferring the simplest of equals.
        needs_inertial: whether its columns are made of the known model's inertial parameters.
        needs_model: whether its columns depend on anything the known model says, not on the motion alone.
        load: whether its torque passes the joint's bearings and gears, so that friction grows with it.
        searched: whether it is one of the hypotheses of a diagnosis; an event of one run is found otherwise.
        memory: whether it depends on the path or the time, not only on q, v and vdot.
    """

    name: ClassVar[str]
    joint_wise: ClassVar[bool] = True
    pair_wise: ClassVar[bool] = False
    sensor: ClassVar[bool] = False
    complexity: ClassVar[int] = 1
    needs_inertial: ClassVar[bool] = False
    needs_model: ClassVar[bool] = True
    load: ClassVar[bool] = False
    searched: ClassVar[bool] = True
    memory: ClassVar[bool] = False

    def __init__(self, joint: int | None = None, other_joint: int | None = None) -> None:
        self.joint = joint
        self.other_joint = other_joint

    def label(self) -> str:
        """Readable name, such as ``viscous_friction at joint 2``."""
        if self.joint is None:
            return self.name
        if self.other_joint is not None:
            return f"{self.name} of joints {self.joint} and {self.other_joint}"
        return f"{self.name} at joint {self.joint}"

    @property
    def place(self) -> tuple[str, int | None, int | None]:
        """Name and joints: what makes two effects the same."""
        return self.name, self.joint, self.other_joint

    def shapes(self, context: Context) -> Sequence[float]:
        """Values of the nonlinear parameter to try; one dummy value where there is none."""
        del context
        return (0.0,)

    def refined(self, x: Array, shape: float) -> float:
        """A better value of the nonlinear parameter, once free parameters x (k,) were fitted at ``shape``."""
        del x
        return shape

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

    def friction(self, parameters: dict[str, Value]) -> FrictionTerm | None:
        """The friction term of its joint that a controller supplies for it, where it is one."""
        del parameters
        return None

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

    def resolved(self, parameters: dict[str, Estimate], tried: Sequence[float]) -> bool:
        """Whether the run can show the nonlinear parameter found; beyond what was tried it stands for another effect."""
        del parameters, tried
        return True

    @abstractmethod
    def sentence(self, parameters: dict[str, Estimate]) -> str:
        """What was found, in words."""

    def full_columns(self, context: Context, shape: float) -> Array:
        """(N, n, p) columns on all joints."""
        return self.on_all_joints(self.columns(context, shape), context.arm.n)

    def on_all_joints(self, columns: Array, joints: int) -> Array:
        """(N, n, p) of columns on the effect's own joint (N, p); others as they are."""
        if columns.ndim == 3:
            return columns
        assert self.joint is not None
        full = np.zeros((len(columns), joints, columns.shape[1]))
        full[:, self.joint - 1] = columns
        return full


def number(value: Value) -> float:
    """The single number of a scalar parameter."""
    return float(np.asarray(value, dtype=float).reshape(()))


def fill(arm: Arm, text: str, joint: int | None) -> str:
    """A unit with TAU, POS and INERTIA filled in for a joint (1-based)."""
    assert joint is not None
    kind = arm.joints[joint - 1]
    inertia = "kg*m^2" if kind.kind == "revolute" else "kg"
    unit = text.replace("TAU", kind.torque_unit).replace("POS", kind.position_unit)
    return unit.replace("INERTIA", inertia)


class LinearJointEffect(Effect):
    """An effect of one joint with one linear coefficient: torque = coefficient · column."""

    needs_model = False
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

    def estimates(self, arm: Arm, x: Array, covariance: Array, shape: float) -> dict[str, Estimate]:
        error = float(np.sqrt(max(covariance[0, 0], 0.0)))
        return {self.parameter: Estimate(float(x[0]), error, fill(arm, self.unit, self.joint))}

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        e = parameters[self.parameter]
        return (
            f"joint {self.joint} needs {self.law} in addition, with {self.parameter} "
            f"{number(e.value):.4g} ± {number(e.std_error):.2g} {e.unit}"
        )

    def plausible(self, arm: Arm, parameters: dict[str, Estimate]) -> bool:
        return not self.nonnegative or number(parameters[self.parameter].value) > 0


class ProfiledJointEffect(Effect):
    """An effect of one joint, linear in one coefficient a for each value of a positive nonlinear parameter s.

    The search tries values of s on a grid; around the best, a·c(s) is taken to first order in log s, with the
    columns c and dc/dlog s, so that s has a value between the grid's and a standard error.

    Class attributes:
        parameter, shape_name: names of a and s.
        unit, shape_unit: their units, with TAU, POS and INERTIA to be filled in.
        law: as a formula.
    """

    complexity = 2
    needs_model = False
    parameter: ClassVar[str]
    shape_name: ClassVar[str]
    unit: ClassVar[str]
    shape_unit: ClassVar[str]
    law: ClassVar[str]

    _LOG_STEP: ClassVar[float] = 0.03
    #: Beyond this the first order says nothing.
    _FARTHEST: ClassVar[float] = 0.3

    @abstractmethod
    def column(self, motion: Motion, joint: int, shape: float) -> Array:
        """(N,) torque per unit of the coefficient at joint ``joint`` (0-based)."""

    def columns(self, context: Context, shape: float) -> Array:
        assert self.joint is not None
        j, h = self.joint - 1, self._LOG_STEP
        low, middle, high = (self.column(context.motion, j, shape * float(np.exp(x))) for x in (-h, 0.0, h))
        return np.column_stack([middle, (high - low) / (2 * h)])

    def refined(self, x: Array, shape: float) -> float:
        size = float(x[0]) if abs(x[0]) > 1e-12 else 1e-12
        return shape * float(np.exp(np.clip(x[1] / size, -self._FARTHEST, self._FARTHEST)))

    def torque(self, context: Context, parameters: dict[str, Value]) -> Array:
        assert self.joint is not None
        tau = np.zeros_like(context.motion.q)
        shape = number(parameters[self.shape_name])
        tau[:, self.joint - 1] = self.column(context.motion, self.joint - 1, shape)
        return tau * number(parameters[self.parameter])

    def estimates(self, arm: Arm, x: Array, covariance: Array, shape: float) -> dict[str, Estimate]:
        size = float(x[0]) if abs(x[0]) > 1e-12 else 1e-12
        slope = np.array([-x[1] / size**2, 1 / size])
        value = self.refined(x, shape)
        error = value * float(np.sqrt(max(slope @ covariance @ slope, 0.0)))
        return {
            self.parameter: Estimate(
                float(x[0]), float(np.sqrt(max(covariance[0, 0], 0.0))), fill(arm, self.unit, self.joint)
            ),
            self.shape_name: Estimate(value, error, fill(arm, self.shape_unit, self.joint)),
        }

    def plausible(self, arm: Arm, parameters: dict[str, Estimate]) -> bool:
        return number(parameters[self.parameter].value) > 0

    def resolved(self, parameters: dict[str, Estimate], tried: Sequence[float]) -> bool:
        return min(tried) <= number(parameters[self.shape_name].value) <= max(tried)

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        level, shape = parameters[self.parameter], parameters[self.shape_name]
        return (
            f"joint {self.joint} needs {self.law} in addition, with {self.parameter} "
            f"{number(level.value):.4g} ± {number(level.std_error):.2g} {level.unit} and {self.shape_name} "
            f"{number(shape.value):.3g} ± {number(shape.std_error):.2g} {shape.unit}"
        )
