"""The dry friction that a joint at rest may hold: what its direction changes, of its own and of gears that it shares."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from armloop.data.creep import STICKING as CREEP
from armloop.data.motion import Motion
from armloop.diagnosis import innovations
from armloop.laws.effects import Estimate, effect
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import AddedEffect, ReconstructedModel
from armloop.robot.arm import load_arm


def test_dry_friction_is_half_of_what_the_direction_changes_at_creeping_speed() -> None:
    terms = (
        FrictionTerm("sign", 2.0),
        FrictionTerm("offset", 5.0),
        FrictionTerm("viscous", 30.0),
        FrictionTerm("hysteresis", 0.5, 0.1),
        FrictionTerm("load_hysteresis", 0.25, 0.1),
    )
    arm = load_arm("three_axis")

    def level(
        terms: tuple[FrictionTerm, ...], *known: AddedEffect, load: float = 0.0, fastest: float = 1.0
    ) -> float:
        ranges = [[1.0] * 3, [fastest] * 3, [1.0] * 3, [0.0] * 3]
        model = ReconstructedModel(arm, (), FrictionLaw((terms, (), ())), history={"range": ranges})
        still = np.zeros((2, 3))
        motion = Motion(np.array([0.0, 0.1]), still, still, still, np.array([0]))
        samples, context = SimpleNamespace(motion=motion), SimpleNamespace(load=still + load)
        evidence: Any = SimpleNamespace(samples=samples, model=model, context=context)
        found = innovations.dry_level(evidence, known)
        assert found.shape == (2, 3) and not found[:, 1:].any()
        return float(found[1, 0])

    for load in (4.0, -8.0):
        assert level(terms, load=load) == pytest.approx(2 + 0.5 + 0.25 * abs(load))
    assert level(terms[3:4]) == pytest.approx(0.5)
    # what is a creep for a joint that never goes fast is slower
    peak = (FrictionTerm("stribeck_peak", 3.0, CREEP),)
    for fastest, creep in ((1.0, CREEP), (0.1, CREEP / 2)):
        assert level(peak, fastest=fastest) == pytest.approx(3 * np.exp(-((creep / CREEP) ** 2)))
    # at rest it holds the level that a direction fades in to, not what there is of it at a creep
    assert level((FrictionTerm("smooth_sign", 3.0, 10 * CREEP),)) == pytest.approx(3.0)
    # what is known of it beside the model counts, too; what no direction changes does not
    stribeck = {"static_excess": Estimate(3.0, 0.1, "N*m"), "velocity": Estimate(0.2, 0.1, "rad/s")}
    spring = {"stiffness": Estimate(9.0, 0.1, "N*m/rad"), "rest": Estimate(0.5, 0.1, "rad")}
    known = [
        AddedEffect(effect("stribeck_friction", 1), stribeck),
        AddedEffect(effect("joint_spring", 1), spring),
    ]
    assert level(terms[3:4], *known) == pytest.approx(0.5 + 3 * np.exp(-((CREEP / 0.2) ** 2)))
    # friction that fades is as large as it is then, 0.1 s after the start
    fading = {"level": Estimate(3.0, 0.1, "N*m"), "time_constant": Estimate(0.4, 0.1, "s")}
    drift = AddedEffect(effect("friction_drift", 1), fading)
    assert level(terms[3:4], drift) == pytest.approx(0.5 + 3 * np.exp(-0.1 / 0.4))


def test_joints_that_slide_may_hold_friction_of_a_direction_that_they_share_and_in_which_neither_slides() -> (
    None
):
    """Of gears that rub 0.3 N·m at the difference of speeds 1 and 2, and of others that do at the sum of speeds 2 and 3."""
    arm, v = load_arm("three_axis"), np.array([[0.5, 0.5, -0.5], [0.5, 0.7, -0.7], [0.0, 0.0, 0.0]])
    motion = Motion(np.array([0.0, 0.1, 0.2]), 0 * v, v, 0 * v, np.array([0]))

    def geared(joint: int, other: int, ratio: float, level: float) -> AddedEffect:
        sizes = {"inertia": 0.1, "viscous": 0.2, "coulomb": level, "ratio": ratio}
        return AddedEffect(
            effect("transmission_coupling", joint, other),
            {k: Estimate(x, 0.1, "1") for k, x in sizes.items()},
        )

    model = ReconstructedModel(arm, (), FrictionLaw(((FrictionTerm("sign", 2.0),), (), ())))
    model = model.with_effects([geared(1, 2, -1.0, 0.3)])
    evidence: Any = SimpleNamespace(
        samples=SimpleNamespace(motion=motion), model=model, context=SimpleNamespace(load=0 * v)
    )
    slow = np.array([0.1, 0.1, 0.3])
    near = 0.3 * np.exp(-1.0)  # a difference of 0.2 rad/s is that of two joints that creep
    expected = [[0.3, 0.3, 0.0], [near, near, 0.0], [0.3, 0.3, 0.0]]
    np.testing.assert_allclose(innovations.shared_dry(evidence, [], slow), expected)
    known = [geared(2, 3, 1.0, 0.4)]
    np.testing.assert_allclose(
        innovations.shared_dry(evidence, known, slow), expected + np.array([0.0, 0.4, 0.4])
    )
    # whichever way two joints share it, at rest either may hold it
    np.testing.assert_allclose(innovations.dry_level(evidence, known)[0], [2.3, 0.7, 0.4])
