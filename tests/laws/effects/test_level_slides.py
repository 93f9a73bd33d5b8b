"""A tilt of an arm on a rail is found with what of the mass on the rail weighs nothing, where other joints feel the tilt."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chains import RAIL, X, Y, Z, arm_of
from synthetic import nominal_parameters

from armloop.data.motion import Motion
from armloop.laws.effects import Context, Estimate, effect
from armloop.laws.effects.gravity_tilt import level_slides, of_what_leans
from armloop.regression.embedded import solve
from armloop.regression.moments import Moments
from armloop.robot.arm import Arm

TILT, MOTOR = {"roll": 0.03, "pitch": 0.05}, 12.0


def context_of(arm: Arm) -> Context:
    q = np.random.default_rng(0).uniform(-1, 1, (60, arm.n))
    motion = Motion(np.arange(60) * 0.01, q, 0 * q, 0 * q, np.array([0]))
    return Context(arm, motion, nominal_parameters(arm))


@pytest.mark.parametrize(
    ("joints", "slides"),
    [
        (RAIL, [0]),
        ([("prismatic", X), ("prismatic", Y), ("revolute", Z)], [0, 1]),
        ([("prismatic", Z), ("prismatic", X), ("revolute", Y)], [1]),
        ([("revolute", Z), ("prismatic", X), ("revolute", Y)], []),
        ([("prismatic", "1 0 1"), ("revolute", Y)], []),
        ([("prismatic", X), ("prismatic", Y), ("prismatic", X), ("prismatic", Y)], [0, 1, 2]),
    ],
)
def test_slides_that_carry_all_the_rest(joints: Any, slides: list[int], tmp_path: Path) -> None:
    assert level_slides(arm_of(tmp_path, *joints)) == slides


def found_in(context: Context, tau: Any) -> dict[str, Estimate]:
    tilt = effect("gravity_tilt", None)
    columns = tilt.columns(context, 0.0)
    moments = Moments.of(columns.reshape(-1, columns.shape[2]), tau.ravel())
    x = solve(moments, [tilt], [columns.shape[2]])[1][0]
    return tilt.estimates(context.arm, x, np.eye(len(x)), 0.0)


def test_the_angles_are_those_that_other_joints_feel(tmp_path: Path) -> None:
    context = context_of(arm_of(tmp_path, *RAIL))
    truly: Any = {**TILT, "weightless": [MOTOR, 0.0, 0.0]}
    tau = effect("gravity_tilt", None).torque(context, truly)
    bare = effect("gravity_tilt", None).torque(context, dict(TILT))
    np.testing.assert_allclose(tau[:, 1:], bare[:, 1:], atol=1e-12)
    # what has no weight pulls nothing along the rail, which is pitched alone
    pull = MOTOR * 9.81 * np.sin(TILT["pitch"])
    np.testing.assert_allclose(np.abs(tau - bare)[:, 0], pull, rtol=1e-9)
    found = found_in(context, tau)
    for key, value in TILT.items():
        assert found[key].value == pytest.approx(value, rel=1e-4)
    assert found["weightless"].value == pytest.approx([MOTOR, 0.0, 0.0], rel=1e-3)
    words = effect("gravity_tilt", None).sentence(found)
    assert "of what its level slides move 12.00 ± 1.00 kg have no weight" in words.replace(
        "12.0 ± 1.0", "12.00 ± 1.00"
    )


def test_where_no_other_joint_feels_it_a_slide_weighs_all_that_it_moves(tmp_path: Path) -> None:
    context = context_of(arm_of(tmp_path, ("prismatic", X), ("prismatic", Y), ("prismatic", Z)))
    found = found_in(context, effect("gravity_tilt", None).torque(context, dict(TILT)))
    assert found["pitch"].value == pytest.approx(TILT["pitch"], rel=1e-4)
    assert np.allclose(found.get("weightless", Estimate([0.0] * 3, 0.0, "")).value, 0.0)


def test_what_carries_a_slide_carries_its_motor(tmp_path: Path) -> None:
    arm = arm_of(tmp_path, ("prismatic", Z), ("prismatic", X), ("prismatic", Y), ("revolute", Z))
    links = of_what_leans(arm, np.zeros(40), {**TILT, "weightless": [5.0, 3.0, 0.0]})
    carried = links[::10][::-1].cumsum()[::-1]
    np.testing.assert_allclose(carried, [0.0, -5.0, -3.0, 0.0])
