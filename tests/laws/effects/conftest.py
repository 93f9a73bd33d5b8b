"""One motion of one arm, shared by the tests of the effects' laws."""

import pytest
from effect_arm import an_arm, torque
from synthetic import fourier_motion

from armloop.laws.effects import Context
from armloop.robot.kinematics import nominal_parameters


@pytest.fixture(scope="package")
def context() -> Context:
    motion = fourier_motion(20.0, 50.0, seed=3)
    return Context(
        an_arm(), motion, nominal_parameters(an_arm()), 0.02, torque(motion), torque, torque(motion)
    )
