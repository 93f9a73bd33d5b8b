"""An arm as a Drake plant whose joints really stick: discrete, with Stribeck friction, Eq. (34) of the paper.

Drake 1.51 has no dry friction in joints (a URDF's `<dynamics friction>` only warns). Eq. (34) is split into

- -clamp(d v, +-f_s): a second actuator on every joint with a pure, very stiff velocity gain and effort limit
f_s.
  Drake's discrete solver applies gains and limits implicitly, so the joint sticks below f_s;
- +(f_s - f_c) (1 - exp(-(v/v_s)^2)) sign(v): smooth, from the system `JointLoads`;
- -f_v v: the joint's damping, implicit too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    PdControllerGains,
    PrismaticJoint,
    RevoluteJoint,
    RotationalInertia,
    SpatialInertia,
    UnitInertia,
)
from pydrake.systems.framework import BasicVector, Context, Diagram, DiagramBuilder, LeafSystem
from pydrake.systems.primitives import ConstantVectorSource, MatrixGain

from armloop.arm import Arm
from armloop.drake_systems.effects import Realisation, UndeclaredEffect, realise
from armloop.drake_systems.friction import JointFriction
from armloop.errors import ArmError

Array = NDArray[np.float64]

STICKING_GAIN = 1e6
"""Velocity gain of the friction actuators, N*m*s/rad: a joint at rest creeps at tau / gain."""
PAYLOAD_DENSITY = 7850.0
"""A payload is a steel ball, kg/m^3: its mass and centre are exact, its own inertia is small and known."""


@dataclass(frozen=True)
class ServoGains:
    """A drive in speed mode: gains of the servo that Drake's discrete solver applies implicitly.

    p : N*m/rad (N/m) on the position, d : N*m*s/rad (N*s/m) on the velocity
    """

    p: float = 5e4
    d: float = 1e3


class JointLoads(LeafSystem):
    """The smooth part of what acts on the joints besides the drive.

    tau_i = (f_s - f_c)_i (1 - exp(-(v_i/v_si)^2)) sign(v_i) - sum k (q_i - q0) - sum A sin(N q_i + phi)

    Input port `state`: (2n,) positions, then velocities. Output port `tau`: (n,) generalized forces on the
    plant. Stateless; not for scalar types other than float.
    """

    def __init__(self, friction: Sequence[JointFriction], springs: Array, ripples: Array) -> None:
        """friction : n joints; springs, ripples : rows as in `effects.Realisation`."""
        super().__init__()
        self._n = len(friction)
        self._drops = [(f.static - f.coulomb, 1.0 / f.stribeck_velocity) for f in friction]
        self._springs = [(int(j), float(k), float(rest)) for j, k, rest in springs]
        self._ripples = [(int(j), float(a), float(order), float(phase)) for j, a, order, phase in ripples]
        self._state = self.DeclareVectorInputPort("state", 2 * self._n)
        self.DeclareVectorOutputPort("tau", self._n, self._calc_tau)

    def _calc_tau(self, context: Context, output: BasicVector) -> None:
        # Called every step: for a handful of joints plain floats are several times faster than arrays.
        state = self._state.Eval(context).tolist()
        tau = []
        for (drop, inverse_vs), v in zip(self._drops, state[self._n :], strict=True):
            tau.append(-math.copysign(drop, v) * math.expm1(-((v * inverse_vs) ** 2)))
        for j, stiffness, rest in self._springs:
            tau[j] -= stiffness * (state[j] - rest)
        for j, amplitude, order, phase in self._ripples:
            tau[j] -= amplitude * math.sin(order * state[j] + phase)
        output.SetFromVector(tau)


class ArmPlant(Diagram):
    """An arm with friction and, if there are any, undeclared effects.

    M(q) vdot + C(q, v) v = tau_g(q) + tau - f(v) + effects, with f of Eq. (34), sticking below f_s.

    Torque mode (no servo). Input port `tau` (n,): drive torques, clamped to the arm's effort limits.
    Output ports `state` (2n,): true q, then v; `tau_drive` (n,): the drives' torques in the
    step that starts now, after the clamp.
    Speed mode (servo). Input port `desired_state` (2n,): q_d, then v_d at the end of the coming step.
    Output port `state`. The drives' torques follow from `servo_torque`.
    All input ports must be connected. Discrete with period `time_step`.
    """

    def __init__(
        self,
        arm: Arm,
        friction: Sequence[JointFriction],
        *,
        effects: Sequence[UndeclaredEffect] = (),
        time_step: float = 1e-3,
        servo: ServoGains | None = None,
    ) -> None:
        """Build the plant.

        arm : any arm whose last link has a mass
        friction : one `JointFriction` per joint
        effects : what the plant has in addition
        time_step : s; servo : gains of a drive in speed mode, None for one in torque mode

        Raises `ArmError` when the arm's inertias cannot move, `ScenarioError` when an effect does not fit it.
        """
        super().__init__()
        if len(friction) != arm.n:
            raise ValueError(f"friction is given for {len(friction)} joints; {arm.name} has {arm.n}")
        self.arm = arm
        self._servo = servo
        self.effects = realise(arm, effects)
        self.friction = _with_effects(friction, self.effects)
        builder = DiagramBuilder()
        self.plant: MultibodyPlant = builder.AddNamedSystem("plant", MultibodyPlant(time_step))
        add_links(self.plant, arm, self.effects)
        slots = self._add_actuators(servo)
        # A seventh faster, and `Linearize` accepts the plant.
        self.plant.SetUseSampledOutputPorts(False)
        self.plant.Finalize()
        self._connect(builder, slots, servo)
        builder.BuildInto(self)
        self.set_name(arm.name)

    def _add_actuators(self, servo: ServoGains | None) -> list[int]:
        """Add a drive and a friction actuator per joint; return the drives' actuator indices."""
        slots = []
        for j, (joint, friction) in enumerate(zip(self.arm.joints, self.friction, strict=True)):
            moving = self.plant.GetJointByName(joint.name)
            moving.set_default_damping(friction.viscous)
            drive = self.plant.AddJointActuator(f"drive_{j + 1}", moving, joint.effort)
            if servo is not None:
                drive.set_controller_gains(PdControllerGains(p=servo.p, d=servo.d))
            slots.append(int(drive.index()))
            last = drive
            if friction.static > 0:
                brake = self.plant.AddJointActuator(f"friction_{j + 1}", moving, friction.static)
                brake.set_controller_gains(PdControllerGains(p=0.0, d=STICKING_GAIN))
                last = brake
            # Drake 1.51 keeps the reflected inertia of a joint's last actuator only.
            last.set_default_gear_ratio(1.0)
            last.set_default_rotor_inertia(self.effects.rotor_inertia[j])
        return slots

    def _connect(self, builder: DiagramBuilder, slots: list[int], servo: ServoGains | None) -> None:
        plant, n, actuators = self.plant, self.arm.n, self.plant.num_actuators()
        to_slots = np.zeros((actuators, n))
        to_slots[slots, range(n)] = 1.0
        # A friction actuator does nothing unless this port is connected; its desired velocity is 0.
        desired = plant.get_desired_state_input_port(plant.GetModelInstanceByName(self.arm.name))
        if servo is not None:
            widen = builder.AddNamedSystem("desired", MatrixGain(np.kron(np.eye(2), to_slots)))
            builder.ExportInput(widen.get_input_port(), "desired_state")
            builder.Connect(widen.get_output_port(), desired)
        else:
            rest = builder.AddNamedSystem("rest", ConstantVectorSource(np.zeros(desired.size())))
            builder.Connect(rest.get_output_port(), desired)
            widen = builder.AddNamedSystem("drives", MatrixGain(to_slots))
            builder.ExportInput(widen.get_input_port(), "tau")
            builder.Connect(widen.get_output_port(), plant.get_actuation_input_port())
            narrow = builder.AddNamedSystem("tau_drive", MatrixGain(to_slots.T))
            builder.Connect(plant.get_net_actuation_output_port(), narrow.get_input_port())
            builder.ExportOutput(narrow.get_output_port(), "tau_drive")
        stribeck = any(f.static > f.coulomb for f in self.friction)
        if stribeck or len(self.effects.springs) or len(self.effects.ripples):
            loads = JointLoads(self.friction, self.effects.springs, self.effects.ripples)
            builder.AddNamedSystem("loads", loads)
            builder.Connect(plant.get_state_output_port(), loads.get_input_port())
            builder.Connect(loads.get_output_port(), plant.get_applied_generalized_force_input_port())
        builder.ExportOutput(plant.get_state_output_port(), "state")

    def servo_torque(self, state: Array, desired_state: Array) -> Array:
        """Return the torques (N, n) that a drive in speed mode applied, clamp(p (q_d - q) + d (v_d - v)).

        state : (N, 2n) at the end of each step; desired_state : (N, 2n) that was set for that end

        The solver applies the law implicitly, so it holds with the state at the end of the step. (The plant's
        own port `net_actuation` gives the sum with the friction when both actuators of a joint have gains.)
        """
        if self._servo is None:
            raise ValueError("this plant's drives are in torque mode: it was built without a servo")
        n = self.arm.n
        error = desired_state - state
        effort = np.array([joint.effort for joint in self.arm.joints])
        return np.clip(self._servo.p * error[:, :n] + self._servo.d * error[:, n:], -effort, effort)

    def set_state(self, root_context: Context, q: Array, v: Array) -> None:
        """Put the arm at positions `q` and velocities `v`, (n,) each, inside a diagram's context."""
        context = self.plant.GetMyMutableContextFromRoot(root_context)
        self.plant.SetPositionsAndVelocities(context, np.concatenate([q, v]))


def add_links(plant: MultibodyPlant, arm: Arm, effects: Realisation | None = None) -> None:
    """Add an arm's links and joints to a plant that is not finalized, payloads and the base's tilt included.

    Links are `link_1`.. and keep the frames of `arm`; joints keep their names and limits. The world is the
    base.

    Raises `ArmError` when a link's inertia is not that of a body.
    """
    instance = plant.AddModelInstance(arm.name)
    parent = plant.world_frame()
    for i, joint in enumerate(arm.joints):
        try:
            inertia = _spatial_inertia(arm.mass[i], arm.com[i], arm.inertia[i])
        except RuntimeError as error:
            reason = " ".join(str(error).split())
            raise ArmError(f"{arm.name}: link of {joint.name} has no possible inertia: {reason}") from error
        if effects is not None and i == arm.n - 1:
            for mass, com in effects.payloads:
                inertia += _ball(mass, com)
        if i == arm.n - 1 and inertia.get_mass() <= 0:
            raise ArmError(f"{arm.name}: the last link has no mass; give it one to simulate the arm")
        body = plant.AddRigidBody(f"link_{i + 1}", instance, inertia)
        X_PF = RigidTransform(arm.X_PF[i])
        frame_F = plant.AddFrame(FixedOffsetFrame(f"F_{i + 1}", parent, X_PF, instance))
        kind = RevoluteJoint if joint.kind == "revolute" else PrismaticJoint
        moving = plant.AddJoint(
            kind(joint.name, frame_F, body.body_frame(), arm.axis[i], joint.lower, joint.upper)
        )
        moving.set_velocity_limits([-joint.velocity], [joint.velocity])
        parent = body.body_frame()
    R_WB = np.eye(3) if effects is None else effects.R_WB
    plant.mutable_gravity_field().set_gravity_vector(R_WB.T @ arm.gravity)


def _with_effects(friction: Sequence[JointFriction], effects: Realisation) -> tuple[JointFriction, ...]:
    return tuple(
        JointFriction(f.static + level, f.coulomb + level, f.stribeck_velocity, f.viscous + viscous)
        for f, level, viscous in zip(friction, effects.coulomb, effects.viscous, strict=True)
    )


def _spatial_inertia(mass: float, com: Array, inertia: Array) -> SpatialInertia:
    """Return a link's spatial inertia; `inertia` is about the link frame's origin."""
    if mass <= 0:
        return SpatialInertia.Zero()
    rotational = RotationalInertia(
        inertia[0, 0], inertia[1, 1], inertia[2, 2], inertia[0, 1], inertia[0, 2], inertia[1, 2]
    )
    unit = UnitInertia()
    unit.SetFromRotationalInertia(rotational, mass)
    return SpatialInertia(mass, com, unit)


def _ball(mass: float, com: Array) -> SpatialInertia:
    """Return a steel ball's spatial inertia about the link frame's origin."""
    if mass <= 0:
        return SpatialInertia.Zero()
    return SpatialInertia.SolidSphereWithDensity(PAYLOAD_DENSITY, _radius(mass)).Shift(-com)


def _radius(mass: float) -> float:
    return float((3.0 * mass / (4.0 * np.pi * PAYLOAD_DENSITY)) ** (1.0 / 3.0))
