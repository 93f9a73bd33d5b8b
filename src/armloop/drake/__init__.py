"""Drake systems and simulations: the plant with friction, data collection, controllers, tracking, replay.

The only package that imports pydrake's systems. A diagram of one's own starts with `add_arm_with_controller`, or with
the systems it is made of. Names that end in an underscore are templates, `Feedforward_[AutoDiffXd]` for instance.
"""

from armloop.drake.control.adaptive_feedforward import AdaptiveFeedforward
from armloop.drake.control.computed_torque import AccelerationGains, ComputedTorque, ComputedTorque_
from armloop.drake.control.controllers import Controller, register_controller
from armloop.drake.control.feedforward import Feedforward, Feedforward_, FeedforwardModel
from armloop.drake.control.pid import PidController, PidGains
from armloop.drake.control.rate_limiter import RateLimiter, RateLimiter_
from armloop.drake.control.reference import ReferenceSource
from armloop.drake.control.residual_monitor import ResidualMonitor
from armloop.drake.experiments.closed_loop import (
    CONTROLLERS,
    ControlledArm,
    add_arm_under,
    add_arm_with_controller,
)
from armloop.drake.plant.beyond_bodies import BeyondBodies, BeyondBodies_, friction_systems
from armloop.drake.plant.effect_system import EffectTorque, EffectTorque_, add_joint_forces
from armloop.drake.plant.forward_dynamics import ForwardDynamics, ForwardDynamics_
from armloop.drake.plant.friction import JointFriction
from armloop.drake.plant.friction_system import (
    JointFrictionSystem,
    JointFrictionSystem_,
    PreslidingFriction,
    PreslidingFriction_,
    Stop,
    presliding_of,
)
from armloop.drake.plant.model_expressions import model_equations
from armloop.drake.plant.plant import ArmPlant
from armloop.drake.plant.sticking import StickingForwardDynamics, StickingForwardDynamics_

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
