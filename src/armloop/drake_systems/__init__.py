"""Everything that runs in Drake: the plant with friction, data collection, controllers, tracking, replay.

The only room that imports pydrake's systems. A diagram of one's own starts with `add_arm_with_controller`, or with
the systems it is made of. Names that end in an underscore are templates, `Feedforward_[AutoDiffXd]` for instance.
"""

from armloop.drake_systems.adaptive_feedforward import AdaptiveFeedforward
from armloop.drake_systems.beyond_bodies import BeyondBodies, BeyondBodies_, friction_systems
from armloop.drake_systems.closed_loop import (
    CONTROLLERS,
    ControlledArm,
    add_arm_under,
    add_arm_with_controller,
)
from armloop.drake_systems.computed_torque import AccelerationGains, ComputedTorque, ComputedTorque_
from armloop.drake_systems.controllers import Controller, register_controller
from armloop.drake_systems.effect_system import EffectTorque, EffectTorque_, add_joint_forces
from armloop.drake_systems.feedforward import Feedforward, Feedforward_, FeedforwardModel
from armloop.drake_systems.forward_dynamics import ForwardDynamics, ForwardDynamics_
from armloop.drake_systems.friction import JointFriction
from armloop.drake_systems.friction_system import (
    JointFrictionSystem,
    JointFrictionSystem_,
    PreslidingFriction,
    PreslidingFriction_,
    Stop,
    presliding_of,
)
from armloop.drake_systems.model_expressions import model_equations
from armloop.drake_systems.pid import PidController, PidGains
from armloop.drake_systems.plant import ArmPlant
from armloop.drake_systems.rate_limiter import RateLimiter, RateLimiter_
from armloop.drake_systems.reference import ReferenceSource
from armloop.drake_systems.residual_monitor import ResidualMonitor
from armloop.drake_systems.sticking import StickingForwardDynamics, StickingForwardDynamics_

__all__ = [
    "CONTROLLERS",
    "AccelerationGains",
    "AdaptiveFeedforward",
    "ArmPlant",
    "BeyondBodies",
    "BeyondBodies_",
    "ComputedTorque",
    "ComputedTorque_",
    "ControlledArm",
    "Controller",
    "EffectTorque",
    "EffectTorque_",
    "Feedforward",
    "FeedforwardModel",
    "Feedforward_",
    "ForwardDynamics",
    "ForwardDynamics_",
    "JointFriction",
    "JointFrictionSystem",
    "JointFrictionSystem_",
    "PidController",
    "PidGains",
    "PreslidingFriction",
    "PreslidingFriction_",
    "RateLimiter",
    "RateLimiter_",
    "ReferenceSource",
    "ResidualMonitor",
    "StickingForwardDynamics",
    "StickingForwardDynamics_",
    "Stop",
    "add_arm_under",
    "add_arm_with_controller",
    "add_joint_forces",
    "friction_systems",
    "model_equations",
    "presliding_of",
    "register_controller",
]
