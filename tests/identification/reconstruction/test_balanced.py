"""A gas spring between two links is found in the training data as a spring that pulls by levers, and as no stop."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from synthetic import fourier_motion, friction, measured, rigid_torque, three_axis

from armloop.data.motion import Motion
from armloop.identification.reconstruction import Options, reconstruct
from armloop.laws.effects import Context, Estimate, effect
from armloop.robot.arm import Arm, load_arm

Array = NDArray[np.float64]
#: N; m from the axis on either link; rad.
FORCE, NEAR, FAR, DEAD_CENTRE = 60.0, 0.1, 0.25, 0.2
BALANCER = effect("spring_balancer", 2)


def pulled(q: Array) -> Array:
    """(N, 3) torque of a gas spring of a constant force at joint 2."""
    angle = q[:, 1] - DEAD_CENTRE
    length = np.sqrt(NEAR**2 + FAR**2 - 2 * NEAR * FAR * np.cos(angle))
    return np.outer(FORCE * NEAR * FAR * np.sin(angle) / length, [0, 1, 0])


@pytest.mark.parametrize(
    "seed", [0, pytest.param(1, marks=pytest.mark.long), pytest.param(2, marks=pytest.mark.long)]
)
def test_a_gas_spring_is_found_in_the_training_data(seed: int) -> None:
    def torque(arm: Arm, motion: Motion) -> Array:
        return rigid_torque(arm, motion.q, motion.v, motion.vdot) + friction(motion.v) + pulled(motion.q)

    arm, motion = three_axis(), fourier_motion(60, 100, seed)
    log = measured(motion, torque(arm, motion), seed, name="run")
    made = reconstruct([log], arm, library="rigid-body", options=Options(standard_errors=False, parts=False))
    (added,) = made.model.effects
    assert added.effect.place == ("spring_balancer", 2, None)
    assert any("a spring pulls at joint 2 by levers" in note for note in made.notes)
    fresh = fourier_motion(30, 100, seed + 7)
    left = torque(arm, fresh) - made.model.predict(fresh)
    slides = np.abs(fresh.v) > 0.05
    assert np.sqrt(np.mean(left[:, 1] ** 2, where=slides[:, 1])) < 0.05 * np.abs(pulled(fresh.q)).max()


def test_its_parameters_are_the_harmonics_of_its_column() -> None:
    q = np.linspace(-1.0, 1.5, 40)[:, None] * [0.3, 1.0, -0.5]
    motion = Motion(np.arange(40.0), q, 0 * q, 0 * q, np.array([0]))
    context = Context(three_axis(), motion)
    (shape,) = BALANCER.shapes(context)
    x = np.array([1.0, -0.5, 0.2, 0.3])
    found = BALANCER.estimates(three_axis(), x, 0.01 * np.eye(4), shape)
    values = {key: e.value for key, e in found.items()}
    np.testing.assert_allclose(
        BALANCER.torque(context, values), BALANCER.full_columns(context, shape) @ x, atol=1e-12
    )
    assert values["second"] == pytest.approx(np.hypot(1.0, 0.5)) and values["third"] == pytest.approx(
        np.hypot(0.2, 0.3)
    )
    assert found["second"].std_error == pytest.approx(0.1) and found["third"].std_error == pytest.approx(0.1)
    words = BALANCER.sentence({**found, "second": Estimate(4.0, 0.1, "N*m")})
    assert "4.00 ± 0.10 N*m twice and" in words and "part of the first moments" in words


@pytest.mark.parametrize("name", ["spring_balancer", "counterbalance"])
def test_a_slide_has_none(name: str) -> None:
    arm = load_arm("scara")
    q = np.zeros((2, arm.n))
    context = Context(arm, Motion(np.arange(2.0), q, q, q, np.array([0])))
    shapes = [len(effect(name, j + 1).shapes(context)) for j in range(arm.n)]
    assert shapes == [int(turns) for turns in arm.revolute]
