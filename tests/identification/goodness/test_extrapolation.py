"""What lies beyond the range that a model was fitted on, and how it is told."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from synthetic import fourier_motion, three_axis

from armloop.data.motion import Motion, Samples
from armloop.diagnosis.evidence import Evidence
from armloop.identification.goodness import extrapolated, outside_trained_range, trained_range
from armloop.laws.effects import Estimate, effect
from armloop.laws.friction import FrictionLaw
from armloop.model import AddedEffect, ReconstructedModel
from armloop.model.components import RigidBody
from armloop.robot.arm import Arm
from armloop.robot.kinematics import nominal_parameters


def inside(motion: Motion) -> list[np.ndarray]:
    """The range of a motion as a model's history keeps it."""
    half, centre = np.ptp(motion.q, axis=0) / 2, (motion.q.max(axis=0) + motion.q.min(axis=0)) / 2
    return [half, np.abs(motion.v).max(axis=0), np.abs(motion.vdot).max(axis=0), centre]


def test_outside_the_trained_range() -> None:
    motion = fourier_motion(10, 50, 0)
    assert outside_trained_range(motion, inside(motion)).max() == 0
    faster = Motion(motion.time, motion.q, motion.v * [1, 3, 1], motion.vdot, motion.starts)
    shares = outside_trained_range(faster, inside(motion))
    assert shares[1] > 0.2 and shares[0] == shares[2] == 0
    assert outside_trained_range(motion, None).tolist() == [0, 0, 0]


def test_what_is_extrapolated_is_told_by_what_leaves_its_range_most_often() -> None:
    motion, arm = fourier_motion(10, 50, 0), three_axis()
    trained = inside(motion)
    assert extrapolated(arm, motion, trained) == extrapolated(arm, motion, None) == []
    faster = Motion(motion.time, motion.q, motion.v * [1, 3, 1], motion.vdot, motion.starts)
    (words,) = extrapolated(arm, faster, trained)
    share = outside_trained_range(faster, trained)[1]
    assert words.startswith(f"joint 2: {share:.0%} of the motion lies outside the range")
    assert f"its speed up to {3 * trained[1][1]:.3g} rad/s, trained up to {trained[1][1]:.3g}" in words
    away = Motion(
        motion.time, motion.q + np.array([0.0, 0.0, 9.0]), motion.v, 1.1 * motion.vdot, motion.starts
    )
    words = extrapolated(arm, away, trained)[-1]
    assert (
        words.startswith("joint 3: 100%")
        and "its position" in words
        and "from the middle of its range" in words
    )
    # one sample in a hundred is not worth a word
    rare = motion.v.copy()
    rare[::100, 0] *= 9.0
    assert extrapolated(arm, Motion(motion.time, motion.q, rare, motion.vdot, motion.starts), trained) == []


def of_links(arm: Arm, **kept: Any) -> ReconstructedModel:
    body = RigidBody(nominal_parameters(arm), (), np.zeros(0))
    return ReconstructedModel(arm, (body,), FrictionLaw(((),) * arm.n), **kept)


def test_where_nothing_depends_on_a_first_angle_it_is_trained_everywhere() -> None:
    arm, motion = three_axis(), fourier_motion(10, 50, 0)
    history = {"range": [np.asarray(x).tolist() for x in inside(motion)]}
    kept = np.array(history["range"])
    found = trained_range(of_links(arm, history=history))
    assert found is not None and found[0, 0] == np.inf
    np.testing.assert_array_equal(np.delete(found.ravel(), 0), np.delete(kept.ravel(), 0))
    away = replace(motion, q=motion.q + np.array([9.0, 0.0, 0.0]))
    assert outside_trained_range(away, found).max() == 0 < outside_trained_range(away, kept)[0]
    samples = Samples(away, np.zeros_like(away.q), np.ones(away.q.shape, dtype=bool), 0.02, 5.0)
    evidence = Evidence.of(of_links(arm, history=history, baseline={"rmse": [1e3] * 3}), samples, [])
    assert evidence.rows[:, 0].sum() > 20
    # but where the arm leans, or something else knows the angle
    leans = replace(arm, gravity=arm.gravity + np.array([0.05, 0.0, 0.0]))
    np.testing.assert_array_equal(trained_range(of_links(leans, history=history)), kept)
    parameters = {"amplitude": 1.0, "order": 3.0, "phase": 0.0}
    rippled = AddedEffect(
        effect("torque_ripple", 1), {key: Estimate(x, 0.0, "") for key, x in parameters.items()}
    )
    np.testing.assert_array_equal(trained_range(of_links(arm, history=history, effects=(rippled,))), kept)
    assert trained_range(of_links(arm)) is None
