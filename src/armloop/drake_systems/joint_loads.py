"""What acts on the joints of a simulated arm besides torque-mode drives: friction, servos, springs, ripples."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.autodiffutils import AutoDiffXd
from pydrake.multibody.plant import MultibodyPlant, MultibodyPlant_
from pydrake.multibody.tree import JacobianWrtVariable
from pydrake.systems.framework import LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from armloop.drake_systems.effects import DryFriction, Realisation
from armloop.drake_systems.friction import JointFriction
from armloop.drake_systems.implicit import ClampedLaw, implicit_torques
from armloop.drake_systems.own_effects import Law
from armloop.drake_systems.scalars import functions_of, vector
from armloop.dynamics.model import solve

Array = NDArray[np.float64]

STICKING_GAIN = 1e8
"""A sticking joint creeps at its load divided by this, N*m*s/rad (N*s/m)."""


@dataclass(frozen=True)
class ServoGains:
    """A drive in speed mode.

    p : N*m/rad (N/m) on the position, d : N*m*s/rad (N*s/m) on the velocity
    """

    p: float = 5e4
    d: float = 1e3


@TemplateSystem.define("JointLoads_", T_list=[float, AutoDiffXd])
def JointLoads_(T: type) -> Any:
    """Return the class for one scalar type."""

    class Impl(LeafSystem_[T]):
        """Generalized forces on a discrete plant's joints, for the step that starts now.

        tau = -f(w) + clamp(p (q_d - q - h w) + d (v_d - w), +-effort) + what the effects do

        h is the plant's time step, w the velocity at its end: the plant's own step is predicted, so that joints
        really stick and servos may be stiff (see `implicit`). f is the dry part of Eq. (34) with the sign of w and
        the level at the velocity of the step's start. The servo is there in speed mode only. Effects are springs,
        ripples, drag, contacts, elasto-plastic elements, shared motors and further dry friction (see `effects`).

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
            X_tool: Array | None = None,
            law: Law | None = None,
            converter: Any = None,
        ) -> None:
            """plant : finalized and discrete, its joints' damping is the viscous friction, a drive on each joint;
            friction : n joints; X_tool : (4, 4) of the tool in the last link's frame, where contacts push;
            law : further torques (n,) that the drives must supply, of positions and velocities as lists"""
            LeafSystem_[T].__init__(self, converter=converter)
            n = len(friction)
            self._n = n
            self._arguments = plant, friction
            self._options = {"effects": effects, "servo": servo, "X_tool": X_tool, "law": law}
            # a clone predicts with the same plant, a conversion with one of its own scalar type
            plant = plant if isinstance(plant, MultibodyPlant_[T]) else plant.ToScalarType[T]()
            self._plant = plant
            self._scratch = plant.CreateDefaultContext()  # to predict with; not the simulated one
            self._step = plant.time_step()
            drives = [plant.get_joint_actuator(index) for index in plant.GetJointActuatorIndices()]
            self._effort = [drive.effort_limit() for drive in drives]
            self._damping = [self._step * drive.joint().default_damping() for drive in drives]
            # Python's own floats throughout: numpy's scalars take three times as long.
            self._dry = [
                _DryLaw(j, f, dry)
                for j, (f, dry) in enumerate(zip(friction, effects.dry, strict=True))
                if f.static > 0 or dry.stribeck or dry.by_load or dry.fading
            ]
            self._by_load = any(law.by_load for law in self._dry)
            self._constant = [-dry.constant for dry in effects.dry]
            self._quadratic = [(j, float(c)) for j, c in enumerate(effects.quadratic) if c]
            self._springs = [(int(j), k, rest) for j, k, rest in effects.springs.tolist()]
            self._ripples = [(int(j), a, order, phase) for j, a, order, phase in effects.ripples.tolist()]
            self._presliding = [(int(j), level, width) for j, level, width in effects.presliding.tolist()]
            self._couplings = [(int(j), int(k), *rest) for j, k, *rest in effects.couplings.tolist()]
            self._contacts = [
                (start, end, np.array(force)) for start, end, *force in effects.contacts.tolist()
            ]
            self._tool = np.zeros(3) if X_tool is None else np.asarray(X_tool)[:3, 3]
            self._laws = [*effects.own, *([] if law is None else [law])]
            self._servo = servo
            self._state = self.DeclareVectorInputPort("state", 2 * n)
            if servo is None:
                self._command = self.DeclareVectorInputPort("tau", n)
            else:
                self._command = self.DeclareVectorInputPort("desired_state", 2 * n)
            self.DeclareVectorOutputPort("load", n, self._calc_load)
            if self._presliding:
                # Not a number until the first step: an element is relaxed where the motion starts.
                self.DeclareDiscreteState(np.full(2 * len(self._presliding), np.nan))
                self.DeclarePeriodicDiscreteUpdateEvent(self._step, 0.0, self._stretch_on)

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            plant, friction = other._arguments
            Impl._construct(self, plant, friction, **other._options, converter=converter)

        def relax(self, context: Any) -> None:
            """Let elasto-plastic elements forget what they went through."""
            if self._presliding:
                forgotten = [math.nan] * (2 * len(self._presliding))
                context.get_mutable_discrete_state_vector().SetFromVector(vector(T, forgotten))

        def _stretches(self, context: Any, q: list[float]) -> list[float]:
            """Stretch of each elasto-plastic element now."""
            past = context.get_discrete_state_vector().CopyToVector().tolist()
            now = []
            for k, (j, _, width) in enumerate(self._presliding):
                before, stretch = past[2 * k : 2 * k + 2]
                now.append(0.0 if before != before else min(max(stretch + q[j] - before, -width), width))
            return now

        def _stretch_on(self, context: Any, values: Any) -> None:
            q = self._state.Eval(context).tolist()
            stretches = self._stretches(context, q)
            pairs = zip(self._presliding, stretches, strict=True)
            values.set_value(vector(T, [x for (j, _, _), stretch in pairs for x in (q[j], stretch)]))

        def _explicit(self, context: Any, q: list[float], v: list[float]) -> list[float]:
            """What the effects do that is soft enough to be taken at the step's start."""
            load = list(self._constant)
            for j, stiffness, rest in self._springs:
                load[j] -= stiffness * (q[j] - rest)
            sin = functions_of(T).sin
            for j, amplitude, order, phase in self._ripples:
                load[j] -= amplitude * sin(order * q[j] + phase)
            for j, drag in self._quadratic:
                load[j] -= drag * v[j] * abs(v[j])
            if self._presliding:
                for (j, level, width), stretch in zip(
                    self._presliding, self._stretches(context, q), strict=True
                ):
                    load[j] -= level * stretch / width
            for law in self._laws:
                load = [x - y for x, y in zip(load, law(q, v), strict=True)]
            for start, end, force in self._contacts:
                if start <= context.get_time() < end:
                    push = self._jacobian().T @ force
                    load = [x + y for x, y in zip(load, push.tolist(), strict=True)]
            return load

        def _jacobian(self) -> Array:
            """(3, n) of the tool's origin in the base frame, at the scratch context's posture."""
            plant, world = self._plant, self._plant.world_frame()
            last = plant.GetFrameByName(f"link_{self._n}")
            return np.asarray(
                plant.CalcJacobianTranslationalVelocity(
                    self._scratch, JacobianWrtVariable.kV, last, self._tool, world, world
                )
            )

        def predict_with(self, inertia: Any, damping: Sequence[float]) -> None:
            """Let the last link have another spatial inertia, and the joints another damping (n,); float only."""
            self._plant.GetBodyByName(f"link_{self._n}").SetSpatialInertiaInBodyFrame(self._scratch, inertia)
            self._damping = [self._step * d for d in damping]

        def _calc_load(self, context: Any, output: Any) -> None:
            # Called every step: for a handful of joints plain floats are several times faster than arrays.
            x = self._state.Eval(context)
            command = self._command.Eval(context).tolist()
            state = x.tolist()
            n, h, servo = self._n, self._step, self._servo
            q, v = state[:n], state[n:]
            plant, scratch = self._plant, self._scratch
            plant.SetPositionsAndVelocities(scratch, x)
            load = self._explicit(context, q, v)

            inertia = plant.CalcMassMatrix(scratch)
            bias = plant.CalcBiasTerm(scratch) - plant.CalcGravityGeneralizedForces(scratch)
            momentum = (inertia.dot(x[n:]) - h * bias).tolist()
            A = inertia.tolist()
            laws: list[ClampedLaw] = []
            exp = functions_of(T).exp
            pieces: list[int] = []
            for law in self._dry:
                laws.append(
                    ClampedLaw(
                        law.joint, 0.0, STICKING_GAIN, law.level(v[law.joint], context.get_time(), exp)
                    )
                )
                pieces.append(laws[-1].piece(v[law.joint]))
            for j, k, ratio, rotor, viscous, coulomb in self._couplings:
                speed = v[j] + ratio * v[k]
                laws.append(ClampedLaw(j, rotor * speed / h, rotor / h + viscous, math.inf, k, ratio))
                laws.append(ClampedLaw(j, 0.0, STICKING_GAIN, coulomb, k, ratio))
                pieces += [0, laws[-1].piece(speed)]
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
            if self._by_load:
                # The load hangs on the acceleration, that on the friction: twice is enough, friction is the smaller part.
                w = solve(A, [p + h * tau for p, tau in zip(momentum, implicit, strict=True)])
                passing = [abs(y) for y in (inertia.dot(np.array(w) - x[n:]) / h + bias).tolist()]
                for index, law in enumerate(self._dry):
                    more = law.by_load * passing[law.joint]
                    laws[index] = laws[index]._replace(limit=laws[index].limit + more)
                implicit = implicit_torques(A, momentum, laws, pieces, h)
            output.SetFromVector(vector(T, [x + y for x, y in zip(load, implicit, strict=True)]))

    return Impl


JointLoads = JointLoads_[None]


class _DryLaw:
    """Level of one joint's dry friction."""

    def __init__(self, joint: int, friction: JointFriction, more: DryFriction) -> None:
        self.joint, self.by_load = joint, float(more.by_load)
        self._coulomb = float(friction.coulomb)
        excesses = [(friction.static - friction.coulomb, friction.stribeck_velocity), *more.stribeck]
        self._excesses = [(float(d), 1.0 / float(vs)) for d, vs in excesses if d]
        self._fading = [(float(f), 1.0 / float(T)) for f, T in more.fading]

    def level(self, v: Any, time: Any, exp: Callable[[Any], Any]) -> Any:
        level = self._coulomb
        for excess, inverse in self._excesses:
            level += excess * exp(-((v * inverse) ** 2))
        for fading, inverse in self._fading:
            level += fading * exp(-time * inverse)
        return level
