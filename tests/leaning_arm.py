"""Records of arms whose base leans, as plain arrays."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation
from synthetic import fourier_motion, friction, measured, rigid_torque

from armloop.data.log import MotionLog
from armloop.data.motion import Motion
from armloop.robot.arm import Arm, load_arm


def turned_by(arm: Arm, degrees: float, axis: tuple[float, float, float]) -> Arm:
    """The arm with gravity turned about an axis in the base frame."""
    turn = Rotation.from_rotvec(np.radians(degrees) * np.array(axis) / np.linalg.norm(axis))
    return replace(arm, gravity=turn.apply(arm.gravity))


def three_axes(seed: int, arm: Arm, dry: float = 1.0, seconds: float = 40.0) -> MotionLog:
    """A record of the three-axis arm under this gravity, with so many times its friction."""
    motion = fourier_motion(seconds, 100.0, seed)
    tau = rigid_torque(arm, motion.q, motion.v, motion.vdot) + dry * friction(motion.v)
    return measured(motion, tau, seed, name=f"run_{seed}")


def upright_axes(seed: int, lean: float, slower: float = 1.0, rubbing: float = 1.0) -> MotionLog:
    """A SCARA's record, so many times as slow, whose base leans by an angle in rad about y."""
    arm = load_arm("scara")
    parts = [fourier_motion(40.0 / slower, 100.0 * slower, seed + more) for more in (0, 50)]
    q, v, vdot = (np.hstack([getattr(part, name) for part in parts])[:, :4] for name in ("q", "v", "vdot"))
    size = np.where(arm.revolute, 1.0, 0.05)
    rates = [x * size / slower**order for order, x in enumerate((q, v, vdot))]
    motion = Motion(slower * parts[0].time, *rates, np.array([0]))
    leaning = replace(arm, gravity=9.81 * np.array([np.sin(lean), 0.0, -np.cos(lean)]))
    tau = rigid_torque(leaning, motion.q, motion.v, motion.vdot)
    return measured(motion, tau + rubbing * (0.3 * np.sign(motion.v) + 0.2 * motion.v), seed)
