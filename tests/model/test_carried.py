"""A base that leans turns the weight of all that the arm carries, of a payload that a diagnosis added too."""

import numpy as np
from synthetic import fourier_motion, three_axis

from armloop.dynamics import Dynamics
from armloop.laws.effects import Estimate, effect
from armloop.laws.effects.gravity_tilt import tilted_gravity
from armloop.laws.effects.payload import link_parameters
from armloop.laws.friction import FrictionLaw
from armloop.model import AddedEffect, ReconstructedModel
from armloop.model.components import RigidBody
from armloop.robot.kinematics import nominal_parameters, regressor


def test_a_tilt_turns_a_payloads_weight_too() -> None:
    arm, motion = three_axis(), fourier_motion(2.0, 50.0, 1)
    load = {"mass": Estimate(1.0, 0.01, "kg"), "com": Estimate([0.1, 0.0, 0.0], [0.01] * 3, "m")}
    lean = {"roll": Estimate(0.1, 0.01, "rad"), "pitch": Estimate(0.05, 0.01, "rad")}
    both = AddedEffect(effect("payload", None), load), AddedEffect(effect("gravity_tilt", None), lean)
    links = nominal_parameters(arm)
    body = RigidBody(links.copy(), (), np.zeros(0))
    links[-10:] += link_parameters(arm, both[0].values)
    gravity = tilted_gravity(arm.gravity, 0.1, 0.05)
    wanted = regressor(arm, motion.q, motion.v, motion.vdot, gravity) @ links
    for effects in (both, both[::-1]):
        model = ReconstructedModel(arm, (body,), FrictionLaw(((),) * 3), effects=effects)
        np.testing.assert_allclose(model.predict(motion), wanted, atol=1e-10)
        for k, state in enumerate(zip(motion.q, motion.v, motion.vdot, strict=True)):
            np.testing.assert_allclose(model.feedforward(*state), wanted[k], atol=1e-10)
        np.testing.assert_allclose(
            Dynamics(model).torque(motion.q, motion.v, motion.vdot), wanted, atol=1e-10
        )
