"""The exact model is the simulated arm's own inverse dynamics."""

import numpy as np
import pytest
from exact_model import ExactModel
from numpy.testing import assert_allclose

from armloop.drake.experiments.scenarios import load_plant
from armloop.drake.plant.exact import exact_model
from armloop.drake.plant.fault_injection import UndeclaredEffect

PAYLOAD = UndeclaredEffect("payload", None, {"mass": 0.4, "com": [0.03, 0.01, 0.0]})
OTHERS = (
    UndeclaredEffect("viscous_friction", 2, {"coefficient": 0.5}),
    UndeclaredEffect("coulomb_friction", 1, {"level": 0.2}),
)


@pytest.mark.parametrize("name", ["three_axis", "scara"])
@pytest.mark.parametrize("effects", [(), OTHERS, (PAYLOAD,)])
def test_agrees_with_drakes_inverse_dynamics(name, effects):
    plant = load_plant(name)
    ours = exact_model(plant.arm, plant.config.friction, effects)
    drakes = ExactModel(plant.arm, plant.config.friction, effects)
    # the ball's own inertia is left out: 2/5 m r^2 = 9e-5 kg m^2
    tolerance = 5e-4 if effects == (PAYLOAD,) else 1e-9
    for q, v, vdot in np.random.default_rng(3).uniform(-1, 1, (20, 3, plant.arm.n)):
        assert_allclose(ours.feedforward(q, v, vdot), drakes.feedforward(q, v, vdot, 3), atol=tolerance)
