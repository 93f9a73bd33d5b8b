"""Springs that an arm had all along are found in its training data: between the positions and ratios that are tried."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic import fourier_motion, friction, measured, rigid_torque, three_axis

from armloop.identification.reconstruction import Options, reconstruct


def test_a_stop_is_found_where_it_begins() -> None:
    motion = fourier_motion(40.0, 100.0, 0)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)
    tau[:, 2] += 5.0 * np.maximum(motion.q[:, 2] - 0.23, 0.0)
    options = Options(standard_errors=False, parts=False)
    found = reconstruct([measured(motion, tau, 0)], three_axis(), library="rigid-body", options=options)
    (added,) = found.model.effects
    assert added.effect.place == ("upper_end_stop", 3, None)
    begins, stiffness = added.parameters["begins"], added.parameters["stiffness"]
    assert 0 < begins.std_error < 0.02 and abs(begins.value - 0.23) < 4 * begins.std_error
    assert abs(stiffness.value - 5.0) < 4 * stiffness.std_error + 0.1


@pytest.mark.parametrize("seed", [0, 3, 5])
def test_a_spring_over_two_joints_is_found_with_its_ratio_and_no_encoder_is_blamed(seed: int) -> None:
    """Three logs, as encoder zeros that differ from log to log would need: those explain a part of it."""
    logs = []
    for k in range(3):
        motion = fourier_motion(20.0, 100.0, 100 * seed + 10 + k)
        tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)
        tension = 2.0 * (motion.q[:, 1] - 0.7 * motion.q[:, 2] - 0.3)
        tau[:, 1] += tension
        tau[:, 2] -= 0.7 * tension
        logs.append(measured(motion, tau, 1000 * seed + k, name=f"log {k}"))
    found = reconstruct(logs, three_axis(), library="rigid-body", options=Options(parts=False))
    (added,) = found.model.effects
    assert added.effect.place == ("coupling_spring", 2, 3) and "encoder_zeros" not in found.model.history
    for name, truth in {"stiffness": 2.0, "rest": 0.3, "ratio": -0.7}.items():
        estimate = added.parameters[name]
        assert abs(estimate.value - truth) < 4 * estimate.std_error < 0.3
