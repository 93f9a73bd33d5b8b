"""A physical effect as a system, to insert into a diagram or take out of it again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.systems.framework import DiagramBuilder, InputPort, LeafSystem_, System
from pydrake.systems.primitives import Adder, MatrixGain

from armloop.drake.given import joints_for, require_of, require_plant, warn_of_damping
from armloop.drake.scalar_types import scalar_template
from armloop.drake.scalars import functions_of, vector, within
from armloop.dynamics import effect_law
from armloop.laws.effects import Values, effect, misplaced, misstated
from armloop.laws.effects.base import number
from armloop.laws.friction import Sliding, torque_along
from armloop.robot.arm import Arm
from armloop.util.errors import InputError, ModelError
from armloop.util.given import require


@scalar_template("EffectTorque_", __name__)
def EffectTorque_(T: type) -> Any:
    """Return the class for one scalar type."""

    class Impl(LeafSystem_[T]):
        """The torque of one effect, listed or a user's own: of a payload, a spring, a ripple, additional friction, ..

        tau = law(q, v, vdot), what the drive must supply because of it (see `armloop.laws.effects`);
        force = -tau, what it does to the arm.

        Input ports: `state` (2n,) positions, then velocities; `vdot` (n,), only for effects whose torque depends on it, such
        as `payload` and `rotor_inertia`. Output ports: `tau` (n,), to add to a feedforward; `force`
        (n,), to add to a plant's applied generalized forces (`add_joint_forces`). N*m (N). Stateless; time enters where
        the law knows it. Scalar types float, AutoDiffXd and Expression.

        The sign of dry friction, and what fades in over less, is smoothed as tanh(v / `smoothing`). Friction that
        grows with the load takes the load from the input port `load` (n,), declared for it alone.

        An inertia cannot be added to a plant by a force, for its acceleration would depend on itself: on a plant,
        connect `vdot` to the reference's, to a delayed measurement, or build the plant with the effect
        (`ArmPlant`, `ForwardDynamics` of an augmented model). Not supported: the sensors' effects, which are in
        the record and not in the arm; `presliding_hysteresis` acts as if fully slid, `PreslidingFriction` remembers.
        """

        def _construct(
            self,
            arm: Arm,
            name: str,
            joint: int | None,
            parameters: Values,
            *,
            other_joint: int | None = None,
            inertial: Any = None,
            smoothing: float = 0.01,
        ) -> None:
            """arm : of n joints; name, joint, other_joint (from 1), parameters : as in `diagnosis.json`, SI units;
            inertial : (10 n,) link parameters of the known model, for `gravity_tilt` (`model.carried_parameters()`).

            Raises `ModelError` for an effect without such a law, a joint that the arm does not have, wrong parameters.
            """
            require("a number above 0", smoothing=smoothing)
            require_of(Arm, arm=arm)
            require_of(Mapping, parameters=parameters)
            self.arm = arm
            self._given["parameters"] = dict(parameters)
            self._smoothing = smoothing
            kind = effect(name, joint, other_joint)
            if not kind.simulated:
                raise ModelError(f"effect {name} is found in logs alone; no system can have it")
            fault = misplaced(arm, kind, parameters) or misstated(type(kind), parameters, whole=False)
            if fault:
                raise ModelError(f"effect {name}: {fault}")
            self._law = effect_law(arm, name, joint, parameters, functions_of(T), inertial, other_joint)
            event = kind.role == "event"
            self._interval = (number(parameters["start"]), number(parameters["end"])) if event else None
            n = self._n = arm.n
            self._state = self.DeclareVectorInputPort("state", 2 * n)
            self._vdot = self.DeclareVectorInputPort("vdot", n) if self._law.has_inertia else None
            rubbing = self._law.friction.terms if self._law.friction else ()
            self._rubbing = [t.widened(smoothing) for t in rubbing]
            by_load = any(t.element.by_load for t in rubbing)
            self._load = self.DeclareVectorInputPort("load", n) if by_load else None
            sources = {self.all_input_ports_ticket(), self.time_ticket()}
            for port, factor in (("tau", 1.0), ("force", -1.0)):
                self.DeclareVectorOutputPort(port, n, partial(self._calc, factor), sources)

        def _calc(self, factor: float, context: Any, output: Any) -> None:
            n, law = self._n, self._law
            state = self._state.Eval(context).tolist()
            q, v = state[:n], state[n:]
            tau: list[Any] = [0.0] * n
            if law.equations is not None:
                still = [0.0] * n
                tau = law.equations.torque(
                    q, v, still if self._vdot is None else self._vdot.Eval(context).tolist()
                )
            if law.friction is not None:
                along = law.friction.along
                w, functions = along.of(v), functions_of(T)
                sign = functions.tanh(w / self._smoothing)
                load = 0.0 if self._load is None else self._load.Eval(context).tolist()[along.joint]
                x = Sliding(along.of(q), w, sign, context.get_time())
                along.add(tau, torque_along(self._rubbing, x, load, functions, sharp=False))
            if self._interval is not None:
                factor = factor * within(T, context.get_time(), *self._interval)
            output.SetFromVector(vector(T, [factor * x for x in tau]))

    return Impl


EffectTorque = EffectTorque_[None]


def add_joint_forces(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    systems: Sequence[System] | Mapping[ModelInstanceIndex, Sequence[System]],
) -> list[System]:
    """Add friction and effects to a plant of one's own; leave one out of the list, and it is gone.

    Each system's `force` is summed into the plant's applied generalized forces, and its `state` port is fed
    the plant's state. Further ports (`vdot`, `load`) stay to be connected.

    plant : finalized, in the builder; its port for applied generalized forces must be free. Where more moves in it than the
        arm, as a gripper's fingers or a thing to grasp, a system acts on the joints that have the names of its arm's
    systems : such as `JointFrictionSystem`, `PreslidingFriction`, `EffectTorque`, not yet in the builder; of several arms,
        or one whose joints have other names, by its model instance

    A plant whose joints have another damping than the viscous friction that `BeyondBodies` leaves to them is warned of.

    Returns the systems added. Raises `InputError` for a plant that is not finalized or whose arm floats, whose joints are
    others than those of a system's arm or stand in another order, and for a system without these ports.
    """
    require_of(DiagramBuilder, builder=builder)
    require_plant(plant)
    given = systems if isinstance(systems, Mapping) else {None: systems}
    for each in given.values():
        require_of(Sequence, systems=each)
    if all(plant is not system for system in builder.GetSystems()):
        raise InputError("the plant is in no diagram of this builder: call builder.AddSystem(plant) first")
    if builder.IsConnectedOrExported(plant.get_applied_generalized_force_input_port()):
        raise InputError(
            "the plant's port applied_generalized_force is taken; give all systems in one call of add_joint_forces"
        )
    # what knows no arm, as friction alone, is of the same one as those beside it
    arms = {
        instance: next((arm for x in each if isinstance(arm := getattr(x, "arm", None), Arm)), None)
        for instance, each in given.items()
    }
    placed = [(system, instance) for instance, each in given.items() for system in each]
    joints = []
    if not placed:
        raise InputError("systems is empty; give those whose force acts on the plant")
    for system, instance in placed:
        name = type(system).__name__.partition("_")[0]  # of a template without its scalar type
        if not (
            isinstance(system, System) and system.HasInputPort("state") and system.HasOutputPort("force")
        ):
            raise InputError(f"{name}: has not the input port state and the output port force")
        if any(system is other for other in builder.GetSystems()):
            raise InputError(
                f"{system.get_name() or name}: is in the builder already; add_joint_forces adds it"
            )
        n, arm = system.GetInputPort("state").size() // 2, getattr(system, "arm", None)
        arm = arm if isinstance(arm, Arm) else arms[instance]
        arm = arm if arm is None or arm.n == n else None
        joints.append(joints_for(plant, system.get_name() or name, n, arm, instance))
        warn_of_damping(joints[-1], getattr(system, "damping", None))
    total = builder.AddSystem(Adder(len(placed), plant.num_velocities()))
    for index, (system, _) in enumerate(placed):
        builder.AddSystem(system)
        _connect(builder, plant, system, joints[index], total.get_input_port(index))
    builder.Connect(total.get_output_port(), plant.get_applied_generalized_force_input_port())
    return [system for system, _ in placed]


def _connect(
    builder: DiagramBuilder, plant: MultibodyPlant, system: System, joints: Sequence[Any], sum_port: InputPort
) -> None:
    """Connect a system with some of a plant's joints: past a selection where there are more."""
    nq, nv, n = plant.num_positions(), plant.num_velocities(), len(joints)
    state, force = plant.get_state_output_port(), system.GetOutputPort("force")
    if nq + nv > 2 * n:
        rows = [j.position_start() for j in joints] + [nq + j.velocity_start() for j in joints]
        chosen = builder.AddSystem(MatrixGain(np.eye(nq + nv)[rows]))
        builder.Connect(state, chosen.get_input_port())
        placed = builder.AddSystem(MatrixGain(np.eye(nv)[:, [j.velocity_start() for j in joints]]))
        builder.Connect(force, placed.get_input_port())
        state, force = chosen.get_output_port(), placed.get_output_port()
    builder.Connect(state, system.GetInputPort("state"))
    builder.Connect(force, sum_port)
