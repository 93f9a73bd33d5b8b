"""Joint loads of a simulated arm besides torque-mode drives: friction, servos, springs, ripples."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.autodiffutils import AutoDiffXd
from pydrake.multibody.plant import MultibodyPlant, MultibodyPlant_
from pydrake.multibody.tree import JacobianWrtVariable
from pydrake.systems.framework import LeafSystem_

from armloop.drake.plant.fault_injection import Law, Realisation
from armloop.drake.plant.friction import JointFriction
from armloop.drake.plant.implicit import ClampedLaw, implicit_torques
from armloop.drake.scalar_types import scalar_template
from armloop.drake.scalars import functions_of, vector
from armloop.dynamics.model import solve
from armloop.laws.effects.base import Placed
from armloop.laws.friction import Acting, Direction, Sliding, torque_along
from armloop.laws.hysteresis import stop_step
from armloop.util.arrays import Array
from armloop.util.functions import MATH, Functions

_STEP = 1e-5  # rad/s (m/s), of the slope of what is smooth
_LOAD_ROUNDS = 4


@dataclass(frozen=True)
class ServoGains:
    """A drive in speed mode.

    p : N*m/rad (N/m) on the position, d : N*m*s/rad (N*s/m) on the velocity
    """

    p: float
    d: float


@scalar_template("JointLoads_", __name__, [float, AutoDiffXd])
def JointLoads_(T: type) -> Any:
    """Return the class for one scalar type."""

    class Impl(LeafSystem_[T]):
        """Generalized forces on a discrete plant's joints, for the step that starts now.

        tau = -f(w) + clamp(p (q_d - q - h w) + d (v_d - w), +-effort) + what the effects do

        h is the plant's time step, w the velocity at its end: the plant's own step is predicted, so that joints
        really stick and servos may be stiff (see `implicit`). f is the dry part of Eq. (34) with the sign of w and
        the level at the velocity of the step's start. The servo is there in speed mode only. Of an effect's law along a
        direction the dry part adds to that level, what is smooth in w is taken to first order about the step's start, and
        what depends on the position, elasto-plastic elements and contacts at it (see `effects`).

        Input ports: `state` (2n,) positions, then velocities; torque mode: `tau` (n,) of the drives, clamped here
        as in the plant; speed mode: `desired_state` (2n,) at the end of the step. Output port `load` (n,).
        Discrete state, only with elasto-plastic elements: their position and stretch at the last step, period h.
        Scalar types float and AutoDiffXd: what has been linearised sticks where the joint sticks, has the sign of friction
        where it slides, and stands at its limit where the servo is clamped. Not Expression, which cannot tell the pieces of
        the implicit law apart. With a `law` of floats alone only float.
        """

        def _construct(
            self,
            plant: MultibodyPlant,
            friction: Sequence[JointFriction],
            *,
            effects: Realisation,
            servo: ServoGains | None = None,
            X_tool: Array,
            law: Law | None = None,
        ) -> None:
            """plant : finalized and discrete, its joints' damping is the viscous friction, a drive on each joint;
            friction : n joints; X_tool : (4, 4) of the tool in the last link's frame, where contacts push;
            law : further torques (n,) that the drives must supply, of positions and velocities as lists"""
            n = len(friction)
            self._n = n
            # a clone predicts with the same plant, a conversion with one of its own scalar type
            plant = plant if isinstance(plant, MultibodyPlant_[T]) else plant.ToScalarType[T]()
            self._plant = plant
            self._scratch = plant.CreateDefaultContext()  # to predict with; not the simulated one
            self._step = plant.time_step()
            drives = [plant.get_joint_actuator(index) for index in plant.GetJointActuatorIndices()]
            self._effort = [drive.effort_limit() for drive in drives]
            self._damping = [self._step * drive.joint().default_damping() for drive in drives]
            # Python's own floats throughout: numpy's scalars take three times as long.
            self._rubbing = _rubbing(friction, effects.laws)
            acting = [(along, term) for along, terms in effects.laws for term in terms]
            self._soft = [(along, term) for along, term in acting if term.element.part == "position"]
            self._memories = [(along, term) for along, term in acting if term.element.way == "memory"]
            self._rotors = [(along, t.coefficient) for along, t in acting if t.element.part == "inertia"]
            self._contacts = effects.contacts
            self._tool = np.asarray(X_tool)[:3, 3]
            self._laws = [*effects.own, *([] if law is None else [law])]
            self._servo = servo
            self._state = self.DeclareVectorInputPort("state", 2 * n)
            if servo is None:
                self._command = self.DeclareVectorInputPort("tau", n)
            else:
                self._command = self.DeclareVectorInputPort("desired_state", 2 * n)
            self.DeclareVectorOutputPort("load", n, self._calc_load)
            if self._memories:
                # Not a number until the first step: an element is relaxed where the motion starts.
                self.DeclareDiscreteState(np.full(2 * len(self._memories), np.nan))
                self.DeclarePeriodicDiscreteUpdateEvent(self._step, 0.0, self._stretch_on)

        def relax(self, context: Any) -> None:
            """Let elasto-plastic elements forget what they went through."""
            if self._memories:
                forgotten = [math.nan] * (2 * len(self._memories))
                context.get_mutable_discrete_state_vector().SetFromVector(vector(T, forgotten))

        def _stretches(self, context: Any, q: list[float]) -> list[float]:
            """Stretch of each elasto-plastic element now."""
            past = context.get_discrete_state_vector().CopyToVector().tolist()
            now = []
            for k, (along, term) in enumerate(self._memories):
                before, stretch = past[2 * k : 2 * k + 2]
                new = before != before
                now.append(
                    0.0 if new else stop_step(stretch, along.of(q) - before, term.parameter, functions_of(T))
                )
            return now

        def _stretch_on(self, context: Any, values: Any) -> None:
            q = self._state.Eval(context).tolist()
            pairs = zip(self._memories, self._stretches(context, q), strict=True)
            values.set_value(vector(T, [x for (along, _), z in pairs for x in (along.of(q), z)]))

        def _explicit(self, context: Any, q: list[float], v: list[float]) -> list[float]:
            """What the effects do that is soft enough to be taken at the step's start."""
            load, functions = [0.0] * self._n, functions_of(T)
            for along, term in self._soft:
                x = Sliding(along.of(q), 0.0, 0.0)
                along.add(load, -torque_along([term], x, 0.0, functions))
            if self._memories:
                for (along, term), z in zip(self._memories, self._stretches(context, q), strict=True):
                    x = Sliding(along.of(q), along.of(v), z / term.parameter, context.get_time())
                    along.add(load, -torque_along([term], x, 0.0, functions))
            for law in self._laws:
                load = [x - y for x, y in zip(load, law(q, v), strict=True)]
            for start, end, force in self._contacts:
                if start <= context.get_time() < end:
                    plant, world = self._plant, self._plant.world_frame()
                    last = plant.GetFrameByName(f"link_{self._n}")
                    J = plant.CalcJacobianTranslationalVelocity(
                        self._scratch, JacobianWrtVariable.kV, last, self._tool, world, world
                    )
                    load = [x + y for x, y in zip(load, (J.T @ force).tolist(), strict=True)]
            return load

        def predict_with(self, inertia: Any, damping: Sequence[float]) -> None:
            """Let the last link have another spatial inertia, and the joints another damping (n,); float only."""
            self._plant.GetBodyByName(f"link_{self._n}").SetSpatialInertiaInBodyFrame(self._scratch, inertia)
            self._damping = [self._step * d for d in damping]

        def _calc_load(self, context: Any, output: Any) -> None:
            # Called every step: for a handful of joints plain floats are several times faster than arrays.
            known = self._state.Eval(context)
            command = self._command.Eval(context).tolist()
            state = known.tolist()
            n, h, servo = self._n, self._step, self._servo
            q, v = state[:n], state[n:]
            plant, scratch = self._plant, self._scratch
            plant.SetPositionsAndVelocities(scratch, known)
            load, functions = self._explicit(context, q, v), functions_of(T)

            inertia = plant.CalcMassMatrix(scratch)
            bias = plant.CalcBiasTerm(scratch) - plant.CalcGravityGeneralizedForces(scratch)
            momentum = (inertia.dot(known[n:]) - h * bias).tolist()
            A = inertia.tolist()
            laws = [
                ClampedLaw.along(along, rotor * along.of(v) / h, rotor / h) for along, rotor in self._rotors
            ]
            pieces, by_load = [0] * len(laws), []
            for rubbing in self._rubbing:
                along, w = rubbing.along, rubbing.along.of(v)
                if rubbing.alone is not None:
                    laws.append(ClampedLaw.dry(along, max(rubbing.alone.level(w, functions), 0.0)))
                    pieces.append(laws[-1].piece(w))
                    continue
                x = Sliding(along.of(q), w, 1.0, context.get_time())
                level, more = rubbing.level(x, functions), rubbing.more
                if rubbing.smooth:
                    torque, slope = rubbing.smoothly(x, functions)
                    laws.append(ClampedLaw.along(along, slope * w - torque, slope))
                    pieces.append(0)
                if more:
                    by_load.append((len(laws), along, level, torque_along(more, x, 1.0, functions)))
                laws.append(ClampedLaw.dry(along, max(level, 0.0)))
                pieces.append(laws[-1].piece(w))
            for j in range(n):
                A[j][j] += self._damping[j]
                limit, acting = self._effort[j], load[j]
                if servo is None:
                    acting += min(max(command[j], -limit), limit)
                else:
                    pull = servo.p * (command[j] - q[j]) + servo.d * command[n + j]
                    laws.append(ClampedLaw(j, pull, servo.d + h * servo.p, limit))
                    pieces.append(0)
                momentum[j] += h * acting
            implicit = implicit_torques(A, momentum, laws, pieces, h)
            for _ in range(_LOAD_ROUNDS if by_load else 0):
                # The load hangs on the acceleration, that on the friction, which is the smaller part.
                w = solve(A, [p + h * tau for p, tau in zip(momentum, implicit, strict=True)])
                passing = [abs(y) for y in (inertia.dot(np.array(w) - known[n:]) / h + bias).tolist()]
                for index, along, level, part in by_load:
                    laws[index] = ClampedLaw.dry(along, max(level + part * passing[along.joint], 0.0))
                implicit = implicit_torques(A, momentum, laws, pieces, h)
            output.SetFromVector(vector(T, [x + y for x, y in zip(load, implicit, strict=True)]))

    return Impl


JointLoads = JointLoads_[None]


class _Rubbing:
    """What rubs along one direction: a joint's Eq. (34) without its viscous part, and the effects' elements.

    smooth : whether a part of it does not turn with the sliding; it is taken to first order about the step's start
    more : elements that grow with the load
    alone : the joint's friction where nothing else rubs: its velocity is all that counts
    """

    def __init__(self, along: Direction, friction: JointFriction | None, terms: Sequence[Acting]) -> None:
        self.along, self._friction = along, friction
        own = [t for t in terms if t.element.part == "friction" and t.element.way != "memory"]
        self._terms = [t for t in own if not t.element.by_load]
        self.more = [t for t in own if t.element.by_load]
        states = (Sliding(0.3, w, 1.0, 1.0) for w in (-0.7, 0.2))
        self.smooth = any(self._smooth(x, MATH) != 0.0 for x in states)
        self.alone = None if self._terms or self.more else friction

    def __bool__(self) -> bool:
        eq34 = self._friction is not None and self._friction.static > 0
        return eq34 or bool(self._terms) or bool(self.more)

    def level(self, x: Sliding, functions: Functions) -> Any:
        """Level of the dry part without what grows with the load."""
        own = 0.0 if self._friction is None else self._friction.level(x.v, functions)
        if not self._terms:
            return own
        forward, backward = self._ends(x, functions)
        return own + 0.5 * (forward - backward)

    def smoothly(self, x: Sliding, functions: Functions) -> tuple[Any, Any]:
        """What is smooth, and its slope where it resists."""
        up, down = (self._smooth(x._replace(v=x.v + step), functions) for step in (_STEP, -_STEP))
        return self._smooth(x, functions), max((up - down) / (2.0 * _STEP), 0.0)

    def _smooth(self, x: Sliding, functions: Functions) -> Any:
        forward, backward = self._ends(x, functions)
        return 0.5 * (forward + backward)

    def _ends(self, x: Sliding, functions: Functions) -> list[Any]:
        return [torque_along(self._terms, x._replace(sign=s), 0.0, functions) for s in (1.0, -1.0)]


def _rubbing(friction: Sequence[JointFriction], laws: Sequence[Placed]) -> list[_Rubbing]:
    """What rubs along each joint, and each direction that two share."""
    terms: dict[Direction, list[Acting]] = {Direction(j): [] for j in range(len(friction))}
    for law in laws:
        terms.setdefault(law.along, []).extend(law.terms)
    found = [
        _Rubbing(along, None if along.ratio else friction[along.joint], own) for along, own in terms.items()
    ]
    return [rubbing for rubbing in found if rubbing]
