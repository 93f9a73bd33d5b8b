"""An end stop that an arm had all along is found in its training data, between the positions that are tried."""

from __future__ import annotations

import numpy as np
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
