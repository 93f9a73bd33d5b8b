"""Joint friction as systems of their own, to insert into a plant or leave out: sliding and presliding."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from pydrake.systems.framework import LeafSystem_

from armloop.drake.given import require_each, require_of
from armloop.drake.plant.friction import JointFriction
from armloop.drake.scalar_types import scalar_template
from armloop.drake.scalars import functions_of, vector
from armloop.laws.hysteresis import stop_step
from armloop.util.errors import InputError
from armloop.util.given import require


@scalar_template("JointFrictionSystem_", __name__)
def JointFrictionSystem_(T: type) -> Any:
    """Return the class for one scalar type."""

    class Impl(LeafSystem_[T]):
        """Stribeck friction as a generalized force on the joints, Eq. (34) of the paper.

        force = -([f_c + (f_s - f_c) exp(-(v/v_s)^2)] s(v) + f_v v),  s(v) = tanh(v / `smoothing`)

        Input port: `state` (2n,) positions, then velocities. Output port: `force` (n,), N*m (N), to add to a plant's
        applied generalized forces (`add_joint_forces`). Stateless. Scalar types float, AutoDiffXd and Expression.

        An explicit force cannot make a joint stick: it creeps at the speed at which tanh carries the load, and
        in a discrete plant with the step h it chatters unless h f_s (M^-1)_ii < 2 `smoothing`. `ArmPlant` and
        `StickingForwardDynamics` stick. Not supported: friction that grows with the load (`EffectTorque` has it).
        """

        def _construct(self, friction: Sequence[JointFriction], smoothing: float = 0.01) -> None:
            """friction : n joints; smoothing : rad/s (m/s)."""
            require("a number above 0", smoothing=smoothing)
            require_of(Sequence, friction=friction)
            require_each(JointFriction, friction, "friction")
            self._friction, self._smoothing, self._n = tuple(friction), smoothing, len(friction)
            self._state = self.DeclareVectorInputPort("state", 2 * self._n)
            self.DeclareVectorOutputPort("force", self._n, self._calc_force, {self.all_input_ports_ticket()})

        def _calc_force(self, context: Any, output: Any) -> None:
            functions = functions_of(T)
            force = [
                -(f.level(v, functions) * functions.tanh(v / self._smoothing) + f.viscous * v)
                for f, v in zip(self._friction, self._state.Eval(context).tolist()[self._n :], strict=True)
            ]
            output.SetFromVector(vector(T, force))

    return Impl


JointFrictionSystem = JointFrictionSystem_[None]


class Stop(NamedTuple):
    """One elasto-plastic element: joint from 1; level N*m (N) when it slides; width of its stretch, rad (m)."""

    joint: int
    level: float
    width: float


@scalar_template("PreslidingFriction_", __name__)
def PreslidingFriction_(T: type) -> Any:
    """Return the class for one scalar type."""

    class Impl(LeafSystem_[T]):
        """Friction with memory: elasto-plastic elements side by side (see `armloop.laws.hysteresis`).

        z = clip(z' + q - q', -w, w),  force_j = -sum over the joint's elements of level z / w

        with z' and q' of the last sample. Before a joint slides it hangs on springs of stiffness level / w; when it
        has moved by 2 w in one direction the force is the level.

        Input port: `state` (2n,) positions, then velocities. Output port: `force` (n,), N*m (N), to add to a
        plant's applied generalized forces. Discrete states with the given period: the positions q' (n,), then
        z' of each element. Direct feedthrough. Scalar types float, AutoDiffXd and Expression.

        `set_relaxed` starts all elements relaxed at given positions; without it the first sample moves them there from
        zero. A plant of step h needs h^2 (M^-1)_ii sum(level / w) < 1; elements have no damping of their own.
        Not supported: levels that depend on the speed or the load; add `JointFrictionSystem` for what slides.
        """

        def _construct(self, n: int, elements: Sequence[Stop], period: float) -> None:
            """n : joints; elements : any number of `Stop`; period : s."""
            require("a whole number above 0", n=n)
            require("a number above 0", period=period)
            require_of(Sequence, elements=elements)
            require_each(Stop, elements, "elements")
            for e in elements:
                require("a whole number", joint=e.joint)
                require("a number above 0", width=e.width)
                require("a finite number", level=e.level)
                if not 1 <= e.joint <= n or e.level < 0:
                    raise InputError(f"{e}: joint must be from 1 to {n}, level at least 0 and width above 0")
            self._n, self._elements = n, tuple(elements)
            self._state = self.DeclareVectorInputPort("state", 2 * n)
            self.DeclareDiscreteState(n + len(elements))
            self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
            sources = {self.all_input_ports_ticket(), self.all_state_ticket()}
            self.DeclareVectorOutputPort("force", n, self._calc_force, sources)

        def set_relaxed(self, context: Any, q: Any) -> None:
            """Relax all elements at the positions q (n,), in this system's own context."""
            memory = [*q, *(0.0 for _ in self._elements)]
            context.SetDiscreteState(vector(T, memory))

        def _stretched(self, context: Any) -> tuple[list[Any], list[Any]]:
            """Return the positions now, and z of each element."""
            n, elements = self._n, self._elements
            q = self._state.Eval(context).tolist()[:n]
            memory = context.get_discrete_state_vector().CopyToVector().tolist()
            z = [
                stop_step(last, q[e.joint - 1] - memory[e.joint - 1], e.width, functions_of(T))
                for e, last in zip(elements, memory[n:], strict=True)
            ]
            return q, z

        def _update(self, context: Any, discrete: Any) -> None:
            q, z = self._stretched(context)
            discrete.set_value(vector(T, [*q, *z]))

        def _calc_force(self, context: Any, output: Any) -> None:
            force: list[Any] = [0.0] * self._n
            for e, z in zip(self._elements, self._stretched(context)[1], strict=True):
                force[e.joint - 1] = force[e.joint - 1] - e.level / e.width * z
            output.SetFromVector(vector(T, force))

    return Impl


PreslidingFriction = PreslidingFriction_[None]


def presliding_of(terms: Sequence[Sequence[Any]]) -> list[Stop]:
    """Return the elements of a model's friction law: its `hysteresis` terms (`model.friction.terms`)."""
    require_of(Sequence, **{"terms (model.friction.terms)": terms})
    return [
        Stop(j + 1, float(term.coefficient), float(term.parameter))
        for j, joint in enumerate(terms)
        for term in joint
        if term.element.way == "memory" and not term.by_load
    ]
