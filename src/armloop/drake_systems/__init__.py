"""Everything that runs in Drake: the plant with friction, data collection, controllers, tracking, replay.

The only room that imports pydrake's systems. A diagram of one's own starts with `add_arm_with_controller`, or
with the systems it is made of.
"""

from armloop.drake_systems.closed_loop import ControlledArm, add_arm_with_controller
from armloop.drake_systems.feedforward import Feedforward, FeedforwardModel
from armloop.drake_systems.friction import JointFriction
from armloop.drake_systems.pid import PidController, PidGains
from armloop.drake_systems.plant import ArmPlant
from armloop.drake_systems.reference import ReferenceSource

__all__ = [
    "ArmPlant",
    "ControlledArm",
    "Feedforward",
    "FeedforwardModel",
    "JointFriction",
    "PidController",
    "PidGains",
    "ReferenceSource",
    "add_arm_with_controller",
]
