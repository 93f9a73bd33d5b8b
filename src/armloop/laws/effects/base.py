"""Interface of a physical effect: where it sits, its law, its parameters and their bounds.

An effect is fitted as coefficients of columns, linear for a fixed shape (the order of a ripple, say), and
then turned into named physical parameters. The same object predicts its torque for a model that has it.
Most are a :class:`armloop.laws.effects.law.Law`; what is none (a body, a fault of a sensor, a push) derives from
:class:`Effect` itself.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from armloop.data.motion import Motion
from armloop.laws.effects.onset import Onset
from armloop.laws.effects.spells import Spells
from armloop.laws.friction import Acting, Direction
from armloop.robot.arm import Arm
from armloop.robot.newton_euler import inverse_dynamics
from armloop.util.arrays import Array
from armloop.util.functions import Functions

Value = float | list[float]
#: Parameters of a law by their names.
Values = Mapping[str, Value]
Pointwise = Callable[[Array, Array, Array], Sequence[float] | Array]
#: Name and joints of an effect: what makes two the same.
Place = tuple[str, int | None, int | None]
#: Torques (n) of positions and speeds (n) of any kind of number, by the functions for it.
StateLaw = Callable[[Functions, Sequence[Any], Sequence[Any]], list[Any]]


@dataclass(frozen=True)
class Parameter:
    """What a law calls a number of its, its unit and its bounds.

    Attributes:
        unit: with TAU, POS and INERTIA to be filled in for a joint.
        least: smallest value of the whole effect, as a simulated arm may have it; ``above``: it must be larger.
        positive: whether also what is found in addition to a model must be above zero.
        size: 3 for a vector; default: value where none is given, None where it must be.
        shape: whether it is the law's nonlinear parameter: "continuous" is refined between the values tried,
            "chosen" is one of them.
    """

    name: str
    unit: str = "1"
    least: float = -np.inf
    above: float = -np.inf
    positive: bool = False
    size: int = 1
    default: Value | None = None
    shape: str = ""

    def fault(self, value: Any, *, whole: bool = True) -> str:
        """What is wrong with a value given for it, or (not ``whole``) for a part of it, as "must be ..."; else empty."""
        try:
            number = np.asarray(value, dtype=float)
        except (TypeError, ValueError):
            return "must be a number"
        if number.shape != (() if self.size == 1 else (self.size,)) or not np.isfinite(number).all():
            return "must be one finite number" if self.size == 1 else "must be three finite numbers"
        if (number <= self.above).any():
            return f"must be above {self.above:g}"
        if whole and (number < self.least).any():
            return f"must not be {'negative' if self.least == 0 else f'below {self.least:g}'}"
        return ""


@dataclass(frozen=True)
class Estimate:
    """A physical parameter: value, standard error and unit; vectors are lists."""

    value: Value
    std_error: Value
    unit: str

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready values."""
        return {"value": self.value, "std_error": self.std_error, "unit": self.unit}

    def words(self, digits: int = 4) -> str:
        """A scalar with its standard error, where it has one, and unit."""
        value, error = number(self.value), number(self.std_error)
        stated = with_error(value, error) if 0 < error < np.inf else f"{value:.{digits}g}"
        return f"{stated} {self.unit}".removesuffix(" 1")


def with_error(value: float, error: float) -> str:
    """A number and its standard error, both to the second digit of the error."""
    places = int(np.clip(1 - np.floor(np.log10(error)), 0, 12))
    return f"{value:.{places}f} ± {error:.{places}f}"


def entry(name: str, joint: int | None, other_joint: int | None = None) -> dict[str, Any]:
    """An effect's name and joints as in ``diagnosis.json``."""
    return {"effect": name, "joint": joint, **({} if other_joint is None else {"other_joint": other_joint})}


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
        fading: per joint the speed, rad/s (m/s), over which the direction of the known model's dry friction fades in;
            empty or 0 where it turns at once.
        falls: per joint the Stribeck velocity of the known model's friction, rad/s (m/s); empty or 0 where it has none.
        ripples: orders of the known model's torque ripples by their joints (1-based).
    """

    arm: Arm
    motion: Motion
    inertial: Array | None = None
    period: float = 0.01
    load: Array | None = None
    predict: Callable[[Motion], Array] | None = None
    predicted: Array | None = None
    fading: tuple[float, ...] = ()
    falls: tuple[float, ...] = ()
    ripples: Mapping[int, tuple[float, ...]] = field(default_factory=dict)

    @cached_property
    def unfaulty(self) -> Array:
        """(N, n) the known model's torque on this motion, without sensor faults."""
        assert self.predict is not None
        return self.predict(self.motion)


class Body(NamedTuple):
    """Rigid bodies on the links: (10 n,) parameters, a gravity of their own (3,), or none; or their weight alone."""

    parameters: Array
    gravity: Array | None = None
    weight_only: bool = False


class Placed(NamedTuple):
    """A law with its numbers: the elements that act along a direction."""

    along: Direction
    terms: tuple[Acting, ...]


class Effect(ABC):
    """A physical effect on the whole arm, on one joint (1-based), or on a pair.

    Class attributes:
        name: as in ``diagnosis.json``.
        scope: "arm", "joint" or "pair"; ``joint_wise`` and ``pair_wise`` follow from it.
        role: "mechanical"; "sensor", which falsifies what is recorded instead of acting on the arm; or "event" of one
            run, which no controller supplies nor a diagnosis searches. ``sensor``, ``event``, ``searched`` follow from it.
        parameters: what it calls its numbers; as many are free (``complexity``) unless it says otherwise.
        built_in: whether an arm may be built with it, so that it is sought in training data, if it is not ``searched``.
        beside: names of the laws beside which alone, at their joints, it is sought in training data.
        needs_inertial: whether its columns are made of the known model's inertial parameters.
        needs_model: whether its columns depend on anything the known model says, not on the motion alone.
        mesh: columns of a nonlinear parameter between multiples of this may be interpolated; None where they may not.
        load: whether its torque passes the joint's bearings and gears, so that friction grows with it.
        memory: whether it depends on the path or the time, not only on q, v and vdot.
        of_time: whether on the time since a run's start, which to a controller is long ago.
        watched: whether a watch keeps its columns: not where they are nothing over much of a motion, or too many.
        simulated: whether Drake's systems can have it.
        passive: whether each of its coefficients is an inertia, or dissipates on its own: it is negative for no arm.
        rubs: whether it is friction of one joint and nothing else, as the friction selection of a reconstruction has it.
        periodic: whether its shape is a number of cycles per revolution of its joint.
        fault_order: a record is falsified by the lower ones first.
        nested: how many of its free parameters, the last, are another listed law by themselves, or nothing without the rest.
        alike: why another effect, by its name, can look the same on one motion, and which motion tells them apart.
        looks_like: the name of an effect whose likenesses it shares.
    """

    name: ClassVar[str]
    scope: ClassVar[str] = "joint"
    role: ClassVar[str] = "mechanical"
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    joint_wise: ClassVar[bool] = True
    pair_wise: ClassVar[bool] = False
    sensor: ClassVar[bool] = False
    complexity: ClassVar[int] = 1
    needs_inertial: ClassVar[bool] = False
    needs_model: ClassVar[bool] = True
    mesh: ClassVar[float | None] = None
    load: ClassVar[bool] = False
    event: bool = False
    onset: Onset | Spells | None = None
    searched: ClassVar[bool] = True
    built_in: ClassVar[bool] = False
    beside: ClassVar[tuple[str, ...]] = ()
    memory: ClassVar[bool] = False
    of_time: ClassVar[bool] = False
    watched: ClassVar[bool] = True
    simulated: ClassVar[bool] = True
    passive: ClassVar[bool] = False
    rubs: ClassVar[bool] = False
    periodic: ClassVar[bool] = False
    fault_order: ClassVar[int] = 9
    nested: ClassVar[int] = 0
    alike: ClassVar[Mapping[str, str]] = {}
    looks_like: ClassVar[str] = ""

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        stated = vars(cls)
        if "scope" in stated:
            cls.joint_wise, cls.pair_wise = cls.scope != "arm", cls.scope == "pair"
        if "role" in stated:
            cls.sensor, cls.event = cls.role == "sensor", cls.role == "event"
            cls.searched = not cls.event
        if "parameters" in stated and "complexity" not in stated:
            cls.complexity = len(cls.parameters)

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
    def index(self) -> int:
        """Its joint, counted from 0."""
        assert self.joint is not None
        return self.joint - 1

    @property
    def indices(self) -> tuple[int, ...]:
        """The joints that it sits in, counted from 0; none if it concerns the whole arm."""
        return tuple(joint - 1 for joint in (self.joint, self.other_joint) if joint is not None)

    def joints(self, parameters: Mapping[str, Any]) -> list[int]:
        """The joints, counted from 1, that its law with these parameters is of; none if it is of the whole arm."""
        return [index + 1 for index in self.indices]

    def within(self, onset: Onset | Spells) -> Self:
        """The same effect, there since an instant of a run; or until then, or at times: that was an event of it."""
        part = copy(self)
        part.onset, part.event = onset, self.event or onset.until
        return part

    @property
    def linear(self) -> bool:
        """Whether its coefficients are free, and none depends on another."""
        return type(self).embed is Effect.embed

    @property
    def place(self) -> Place:
        """Name and joints."""
        return self.name, self.joint, self.other_joint

    def shapes(self, context: Context) -> Sequence[float]:
        """Values of the nonlinear parameter to try; one dummy value where there is none."""
        return (0.0,)

    def usual(self, context: Context) -> float | None:
        """A value that is known beforehand, if any, asked beside the best of :meth:`shapes`: the likelier is taken."""
        return None

    def between(self, context: Context, shape: float) -> Sequence[float]:
        """Values around one of :meth:`shapes` that it stands for unless a run tells them apart; none by default."""
        return ()

    def geared(self, shape: float) -> Sequence[float]:
        """Values around one of :meth:`shapes` that an arm may have been built with in its place; none by default."""
        return ()

    def refined(self, x: Array, shape: float) -> float:
        """A better value of the nonlinear parameter, once free parameters x (k,) were fitted at ``shape``."""
        return shape

    @abstractmethod
    def columns(self, context: Context, shape: float) -> Array:
        """(N, n, p) torque per unit of each coefficient, or (N, p) on the effect's own joint."""

    def start(self, beta: Array) -> Array:
        """Free parameters x (k,) nearest to unconstrained coefficients beta (p,)."""
        return beta

    def embed(self, x: Array) -> tuple[Array, Array]:
        """Coefficients (p,) of free parameters x (k,), and their derivative (p, k); the identity unless laws tie them."""
        return x, np.eye(len(x))

    def alone(self, x: Array) -> slice:
        """Those of free parameters (k,) that are not ``nested``."""
        return slice(len(x) - self.nested)

    def judged(self, x: Array) -> tuple[Array, Array]:
        """Coefficients (p,) by which a diagnosis judges free parameters x (k,), and their derivative (p, k)."""
        return self.embed(x)

    def named(self, x: Array, shape: float) -> tuple[float, ...]:
        """The scalar parameters, in their order, of free parameters x (k,): these themselves by default."""
        return tuple(x.tolist())

    def estimates(self, arm: Arm, x: Array, covariance: Array, shape: float) -> dict[str, Estimate]:
        """Named parameters from the free parameters (k,) and their covariance (k, k), by the delta method.

        Of what depends on a free parameter of infinite variance the standard error is not a number: nobody knows it.
        """
        size = np.where(np.isfinite(np.diag(covariance)), np.diag(covariance), 0.0)
        step = 1e-6 * np.maximum(np.sqrt(np.abs(size)), np.maximum(np.abs(x), 1e-12))
        ends = [[self.named(x + s * h, shape) for s in (1.0, -1.0)] for h in np.diag(step)]
        slopes = np.array([np.subtract(up, down) for up, down in ends]) / (2 * step[:, None])
        errors = std_errors(slopes.T, covariance)
        return {
            p.name: Estimate(float(value), float(error), fill(arm, p.unit, self.joint))
            for p, value, error in zip(self.parameters, self.named(x, shape), errors, strict=True)
        }

    @abstractmethod
    def torque(self, context: Context, parameters: dict[str, Value]) -> Array:
        """(N, n) torque that the drive must supply in addition (or that the sensor adds)."""

    def placed(self, parameters: Values) -> Placed | None:
        """The law along its direction, where it has one written for every kind of number."""
        return None

    def of_state(self, arm: Arm, parameters: Values) -> StateLaw | None:
        """The torque as a function of q and v alone, written for every kind of number; None where it is none."""
        return None

    def order(self, parameters: Values) -> float:
        """The highest harmonic of its joint's angle in the torque, where that is higher than a rigid body's; else zero."""
        return 0.0

    def body(self, arm: Arm, parameters: Values, inertial: Array | None) -> Body | None:
        """The bodies whose torque it is, where it is one of rigid bodies; ``inertial`` (10 n,) are the model's."""
        return None

    def pointwise(self, arm: Arm, parameters: dict[str, Value], inertial: Array | None) -> Pointwise:
        """The same torque for one sample at a time: (q, v, vdot), each (n,), -> (n,); none of an event."""
        rest = np.zeros(arm.n)
        if self.event:
            return lambda q, v, vdot: rest
        body = self.body(arm, parameters, inertial)
        if body is not None:
            dynamics = inverse_dynamics(arm, body.parameters, body.gravity)
            return (lambda q, v, vdot: dynamics(q, rest, rest)) if body.weight_only else dynamics

        def torque(q: Array, v: Array, vdot: Array) -> Array:
            motion = Motion(np.zeros(1), q[None], v[None], vdot[None])
            return self.torque(Context(arm, motion, inertial), parameters)[0]

        return torque

    @classmethod
    def fault(cls, parameters: Mapping[str, Any]) -> str:
        """What is wrong with parameters beside each other, each of which is right; empty if nothing is."""
        return ""

    def falsified(self, time: Array, q: Array, tau: Array, parameters: Values) -> tuple[Array, Array] | None:
        """What a sensor makes of one run's q and tau (N, n), recorded at ``time`` (N,); None where it cannot be told so."""
        return None

    def plausible(self, arm: Arm, parameters: dict[str, Estimate]) -> bool:
        """Whether the parameters are physically possible."""
        return all(number(parameters[p.name].value) > 0 for p in self.parameters if p.positive)

    def comes_off(self, arm: Arm, parameters: dict[str, Estimate]) -> bool:
        """Whether parameters, impossible by themselves, are what the same effect has lost that the arm had before."""
        return False

    def possible(self, arm: Arm, parameters: dict[str, Estimate], had: Collection[Place] = ()) -> bool:
        """Whether the parameters are physically possible on an arm that had effects at these places before."""
        return self.plausible(arm, parameters) or (self.place in had and self.comes_off(arm, parameters))

    def resolved(self, parameters: dict[str, Estimate], tried: Sequence[float]) -> bool:
        """Whether the run can show the nonlinear parameter found; beyond what was tried it stands for another effect."""
        return True

    @abstractmethod
    def sentence(self, parameters: dict[str, Estimate]) -> str:
        """What was found, in words."""

    def remedy(self, parameters: dict[str, Estimate]) -> str:
        """What the arm's owner should do, in words; empty for what acts on the arm itself."""
        of = "" if self.joint is None else f" of joint {self.joint}"
        return (
            f"Correct the reading{of} before anything uses it. The feedforward stays as it is"
            if self.sensor
            else ""
        )

    def full_columns(self, context: Context, shape: float) -> Array:
        """(N, n, p) columns on all joints."""
        return self.on_all_joints(self.columns(context, shape), context.arm.n)

    def fixed_columns(self, context: Context, shape: float) -> Array:
        """(N, n, p) of the free parameters alone, on all joints, at a nonlinear parameter that stays as it is."""
        return self.full_columns(context, shape)

    def fixed_refined(self, x: Array, shape: float) -> float:
        """A better value of the nonlinear parameter, once coefficients x (p,) of :meth:`fixed_columns` were fitted at it."""
        return self.refined(x, shape)

    def on_all_joints(self, columns: Array, joints: int) -> Array:
        """(N, n, p) of columns on the effect's own joint (N, p); others as they are."""
        if columns.ndim == 3:
            return columns
        full = np.zeros((len(columns), joints, columns.shape[1]))
        full[:, self.index] = columns
        return full


def std_errors(derivative: Array, covariance: Array) -> Array:
    """(p,) standard errors of functions of free parameters with this covariance (k, k), by their derivative (p, k).

    NaN where a function depends on a free parameter that has infinite variance.
    """
    unknown = ~np.isfinite(np.diag(covariance))
    J, known = derivative[:, ~unknown], covariance[np.ix_(~unknown, ~unknown)]
    errors = np.sqrt(np.maximum(np.einsum("pk,kl,pl->p", J, known, J), 0.0))
    large = 1e-9 * np.abs(derivative).max(axis=1, keepdims=True, initial=0.0)
    return np.where((np.abs(derivative) > large)[:, unknown].any(axis=1), np.nan, errors)


def number(value: Value) -> float:
    """The single number of a scalar parameter."""
    return float(np.asarray(value, dtype=float).reshape(()))


def less(e: Estimate) -> Estimate:
    """A scalar parameter that has become less, as by how much."""
    return Estimate(-number(e.value), e.std_error, e.unit)


def fill(arm: Arm, text: str, joint: int | None) -> str:
    """A unit with TAU, POS and INERTIA filled in for a joint (1-based)."""
    if joint is None:
        return text
    kind = arm.joints[joint - 1]
    inertia = "kg*m^2" if kind.kind == "revolute" else "kg"
    unit = text.replace("TAU", kind.torque_unit).replace("POS", kind.position_unit)
    return unit.replace("INERTIA", inertia)
