"""An arm whose tool is turned and shifted against its last link, for tests of the effects' laws."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation
from synthetic import three_axis

from armloop.data.motion import Motion
from armloop.laws.effects import Context, Effect, Estimate
from armloop.robot.arm import Arm
from armloop.robot.kinematics import nominal_parameters, regressor

PAYLOAD = {"mass": 0.6, "com": [0.04, -0.02, 0.05], "own_inertia": 2e-3}
TILT = {"roll": 0.05, "pitch": -0.03}
X_TOOL = np.eye(4)
X_TOOL[:3, :3] = Rotation.from_euler("xyz", [0.4, -0.7, 1.1]).as_matrix()
X_TOOL[:3, 3] = [0.3, -0.05, 0.02]


def an_arm() -> Arm:
    """The three-axis arm with a tool that is turned and shifted against the last link."""
    return replace(three_axis(), X_tool=X_TOOL)


def torque(motion: Motion) -> np.ndarray:
    """What the known model of the context predicts: the bare arm."""
    arm = an_arm()
    return regressor(arm, motion.q, motion.v, motion.vdot) @ nominal_parameters(arm)


def fitted(kind: Effect, context: Context, tau: np.ndarray, shape: float) -> dict[str, Estimate]:
    """The parameters by plain least squares on the effect's columns."""
    columns = kind.full_columns(context, shape)
    beta = np.linalg.lstsq(columns.reshape(-1, columns.shape[2]), tau.ravel(), rcond=None)[0]
    x = kind.start(beta)
    return kind.estimates(context.arm, x, np.zeros((len(x), len(x))), shape)
