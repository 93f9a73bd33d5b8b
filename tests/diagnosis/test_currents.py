"""A model of motor currents has no physical units to state an effect in, and says so."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import fourier_motion, measured, rigid_torque, three_axis

from armloop.diagnosis import diagnose
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import ReconstructedModel
from armloop.model.components import RigidBody
from armloop.robot.kinematics import nominal_parameters
from armloop.util.errors import InputError


def test_a_model_of_currents_is_refused_and_one_with_drive_gains_is_not():
    law = tuple((FrictionTerm("sign", 0.7), FrictionTerm("viscous", 2.0)) for _ in range(3))
    body = RigidBody(nominal_parameters(three_axis()), ("m1",), np.ones(1))
    gained = {"unit": "A", "drive_gains": [1.0, 1.0, 1.0]}
    model = ReconstructedModel(
        three_axis(), (body,), FrictionLaw(law), recorded=gained, baseline={"rmse": [0.05] * 3}
    )
    motion = fourier_motion(20.0, 100.0, 1)
    tau = (
        rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + 0.7 * np.sign(motion.v) + 2.0 * motion.v
    )
    log = measured(motion, tau, 1)
    assert diagnose(model, [log]).verdict == "no_effect"
    with pytest.raises(InputError, match="--drive-gains"):
        diagnose(replace(model, recorded={"unit": "A", "drive_gains": None}), [log])
