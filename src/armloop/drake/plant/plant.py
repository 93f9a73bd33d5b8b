"""An arm as a Drake plant whose joints really stick: discrete, with Stribeck friction, Eq. (34) of the paper.

Drake 1.51 has no dry friction in joints (a URDF's `<dynamics friction>` only warns). Eq. (34) is split into the
joint's damping, -f_v v, which Drake takes implicitly, and the dry part from the system `JointLoads`, which
solves the step ahead for it. Stiff velocity gains of a second actuator per joint, with effort limits, stick as
well, but Drake then solves a contact problem at every step: twice the time of the whole plant.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    PrismaticJoint,
    RevoluteJoint,
    SpatialInertia,
    UnitInertia,
)
from pydrake.systems.framework import Context, Diagram, DiagramBuilder

from armloop.drake.given import require_each, require_of
from armloop.drake.plant.fault_injection import Effects, Realisation, UndeclaredEffect, realise
from armloop.drake.plant.friction import JointFriction
from armloop.drake.plant.joint_loads import JointLoads, Law, ServoGains
from armloop.robot.arm import Arm
from armloop.util.arrays import Array
from armloop.util.errors import ArmError, InputError, ScenarioError
from armloop.util.given import numbers_of, require

PAYLOAD_DENSITY = 7850.0
"""A payload is a steel ball, kg/m^3: its mass and centre are exact, its own inertia is small and known."""


class ArmPlant(Diagram):
    """An arm with friction and, if there are any, undeclared effects.

    M(q) vdot + C(q, v) v = tau_g(q) + tau - f(v) + effects, with f of Eq. (34), sticking below f_s.

    Torque mode (no servo). Input port `tau` (n,): drive torques, clamped to the arm's effort limits.
    Output ports `state` (2n,): true q, then v; `tau_drive` (n,): the drives' torques in the
    step that starts now, after the clamp.
    Speed mode (servo). Input port `desired_state` (2n,): q_d, then v_d at the end of the coming step.
    Output port `state`. The drives' torques follow from `servo_torque`.
    All input ports must be connected. Discrete with period `time_step`. Direct feedthrough to `tau_drive` only.

    Scalar types float and AutoDiffXd, so that it can be cloned and linearised: where a joint sticks it stays, where it
    slides the sign of its friction is kept. Not Expression. Joint limits are Drake's, stiff but soft; velocity limits
    are not enforced.

    Not supported: contact and collision (an `external_contact` pushes with a given force), flexible joints and links, more
    than one drive on a joint but for `transmission_coupling`. Faults of the record (gain, offset, encoder, delay) are the
    instruments', not the plant's.
    """

    def __init__(
        self,
        arm: Arm,
        friction: Sequence[JointFriction],
        *,
        effects: Effects = (),
        time_step: float = 1e-3,
        servo: ServoGains | None = None,
        law: Law | None = None,
    ) -> None:
        """Build the plant.

        arm : any arm whose last link has a mass
        friction : one `JointFriction` per joint
        effects : what the plant has in addition
        time_step : s; servo : gains of a drive in speed mode, None for one in torque mode
        law : further torques (n,) that the drives must supply, of lists q and v: what no list of effects has

        Raises `ArmError` when the arm's inertias cannot move, `ScenarioError` when an effect does not fit it.
        """
        require_of(Arm, arm=arm)
        require_of(Sequence, friction=friction, effects=effects)
        require_each(JointFriction, friction, "friction of joint")
        require_each(UndeclaredEffect, effects, "effect")
        require("a number above 0", time_step=time_step)
        super().__init__()
        if len(friction) != arm.n:
            raise InputError(f"friction is given for {len(friction)} joints; {arm.name} has {arm.n}")
        self.arm = arm
        self._servo, self._law = servo, law
        self.effects = realise(arm, effects)
        self.friction = tuple(
            replace(f, viscous=f.viscous + more)
            for f, more in zip(friction, self.effects.viscous, strict=True)
        )
        builder = DiagramBuilder()
        self.plant: MultibodyPlant = builder.AddNamedSystem("plant", MultibodyPlant(time_step))
        add_links(self.plant, arm, self.effects)
        self._add_drives()
        # A seventh faster, and `Linearize` accepts the plant.
        self.plant.SetUseSampledOutputPorts(False)
        self.plant.Finalize()
        self._connect(builder)
        builder.BuildInto(self)
        self.set_name(arm.name)

    def _add_drives(self) -> None:
        for j, (joint, friction) in enumerate(zip(self.arm.joints, self.friction, strict=True)):
            moving = self.plant.GetJointByName(joint.name)
            moving.set_default_damping(friction.viscous)
            drive = self.plant.AddJointActuator(f"drive_{j + 1}", moving, joint.effort)
            drive.set_default_gear_ratio(1.0)
            drive.set_default_rotor_inertia(self.effects.rotor_inertia[j])

    def _connect(self, builder: DiagramBuilder) -> None:
        plant, effects = self.plant, self.effects
        loads = JointLoads(
            plant, self.friction, effects=effects, servo=self._servo, X_tool=self.arm.X_tool, law=self._law
        )
        self._loads = builder.AddNamedSystem("loads", loads)
        builder.Connect(plant.get_state_output_port(), loads.GetInputPort("state"))
        builder.Connect(loads.get_output_port(), plant.get_applied_generalized_force_input_port())
        if self._servo is None:
            builder.ExportInput(loads.GetInputPort("tau"), "tau")
            builder.ConnectInput("tau", plant.get_actuation_input_port())
            builder.ExportOutput(plant.get_net_actuation_output_port(), "tau_drive")
        else:
            builder.ExportInput(loads.GetInputPort("desired_state"), "desired_state")
        builder.ExportOutput(plant.get_state_output_port(), "state")

    def servo_torque(self, state: Array, desired_state: Array) -> Array:
        """Return the torques (N, n) that a drive in speed mode applied, clamp(p (q_d - q) + d (v_d - v)).

        state : (N, 2n) at the end of each step; desired_state : (N, 2n) that was set for that end

        The law is implicit: it holds with the state at the end of the step.
        """
        if self._servo is None:
            raise ValueError("this plant's drives are in torque mode: it was built without a servo")
        n = self.arm.n
        error = desired_state - state
        effort = self.arm.effort
        return np.clip(self._servo.p * error[:, :n] + self._servo.d * error[:, n:], -effort, effort)

    def set_state(self, root_context: Context, q: Array, v: Array) -> None:
        """Put the arm at positions `q` and velocities `v`, (n,) each, inside a diagram's context."""
        require_of(Context, root_context=root_context)
        context = self.plant.GetMyMutableContextFromRoot(root_context)
        q, v = numbers_of(q, (self.arm.n,), "q"), numbers_of(v, (self.arm.n,), "v")
        self.plant.SetPositionsAndVelocities(context, np.concatenate([q, v]))
        self._loads.relax(self._loads.GetMyMutableContextFromRoot(root_context))

    def begin(self, root_context: Context, effects: Effects) -> None:
        """Let effects begin in a running simulation: payloads, viscous friction; in addition to those there are.

        They stay with this plant: a simulation from the start needs a new one.

        Raises `ScenarioError` for any other effect, which a plant has to be built with.
        """
        for effect in effects:
            if effect.name not in ("payload", "viscous_friction"):
                raise ScenarioError(
                    f"effect {effect.name}: cannot begin in a running simulation; payload and viscous_friction can"
                )
        more = realise(self.arm, effects)
        context = self.plant.GetMyMutableContextFromRoot(root_context)
        last = self.plant.GetBodyByName(f"link_{self.arm.n}")
        inertia = last.CalcSpatialInertiaInBodyFrame(context)
        for mass, com, own in more.payloads:
            inertia = _with_payload(inertia, mass, com, own)
        last.SetSpatialInertiaInBodyFrame(context, inertia)
        damping = []
        for joint, viscous in zip(self.arm.joints, more.viscous, strict=True):
            moving = self.plant.GetJointByName(joint.name)
            moving.SetDamping(context, moving.GetDamping(context) + viscous)
            damping.append(moving.GetDamping(context))
        self._loads.predict_with(inertia, damping)


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
            for mass, com, own in effects.payloads:
                inertia = _with_payload(inertia, mass, com, own)
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
    gravity = arm.gravity if effects is None else effects.gravity(arm)
    plant.mutable_gravity_field().set_gravity_vector(gravity)


def _spatial_inertia(mass: float, com: Array, inertia: Array) -> SpatialInertia:
    """Return a link's spatial inertia; `inertia` is about the link frame's origin."""
    if mass <= 0:
        return SpatialInertia.Zero()
    G = inertia / mass
    return SpatialInertia(mass, com, UnitInertia(G[0, 0], G[1, 1], G[2, 2], G[0, 1], G[0, 2], G[1, 2]))


def _with_payload(link: SpatialInertia, mass: float, com: Array, own: float | None) -> SpatialInertia:
    """Return a link's spatial inertia about its frame's origin with a payload; a steel ball's where `own` is not known.

    A negative mass takes a body off the link. Raises `ArmError` where the link is no body without it.
    """
    if mass == 0:
        return link
    if own is None:
        radius = np.cbrt(3.0 * abs(mass) / (4.0 * np.pi * PAYLOAD_DENSITY))
        own = 0.4 * mass * radius**2
    total = link.get_mass() + mass
    moment = link.CalcComMoment() + mass * com
    tensor = link.CalcRotationalInertia().CopyToFullMatrix3()
    tensor = tensor + mass * (float(com @ com) * np.eye(3) - np.outer(com, com)) + own * np.eye(3)
    if total <= 0:
        raise ArmError(f"a payload of {mass:g} kg leaves the last link with a mass of {total:g} kg")
    try:
        return _spatial_inertia(total, moment / total, tensor)
    except RuntimeError as error:
        reason = " ".join(str(error).split())
        raise ArmError(
            f"without the {-mass:g} kg that were taken off, the last link is no body: {reason}"
        ) from error
