"""What a designed motion may ask of the drives."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import fourier_motion, three_axis

from armloop.experiment.design import drive_torque
from armloop.laws.effects import Estimate, effect
from armloop.laws.friction import FrictionLaw
from armloop.model import AddedEffect, ReconstructedModel
from armloop.model.components import RigidBody
from armloop.robot.kinematics import nominal_parameters
from armloop.util.errors import InputError


def test_drives_give_what_they_give_whatever_a_faulty_sensor_records() -> None:
    arm, motion = three_axis(), fourier_motion(2.0, 50.0, 1)
    body = RigidBody(nominal_parameters(arm), (), np.zeros(0))
    model = ReconstructedModel(arm, (body,), FrictionLaw(((),) * 3))
    half = AddedEffect(effect("torque_gain", 2), {"gain": Estimate(0.5, 0.0, "1")})
    spring = AddedEffect(
        effect("joint_spring", 1), {"stiffness": Estimate(2.0, 0.0, ""), "rest": Estimate(0.1, 0.0, "")}
    )
    torque = drive_torque(model.with_effects([half, spring]))(motion)
    np.testing.assert_allclose(torque, model.with_effects([spring]).predict(motion), atol=1e-12)
    assert np.abs(torque - model.predict(motion)).max() > 0.1
    with pytest.raises(InputError, match=r"predicts motor currents \(A\).*--drive-gains"):
        drive_torque(replace(model, recorded={"unit": "A", "drive_gains": None}))
