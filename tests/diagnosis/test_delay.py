"""A late record brings what joints at rest hold into samples in which they slide: that is no evidence."""

import numpy as np
import pytest
from synthetic import measured, rigid_torque, three_axis

from armloop.data.motion import Motion
from armloop.diagnosis import diagnose
from armloop.diagnosis.account import slid_since
from armloop.laws.effects import effect
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import ReconstructedModel
from armloop.model.components import RigidBody
from armloop.robot.kinematics import nominal_parameters

LEVEL, PAUSE, DELAY = 3.0, 0.6, 0.07


def paused_motion(seconds: float, rate: float) -> Motion:
    """Waves that all joints stop in for a while every two seconds and a half, smoothly."""
    t = np.arange(0.0, seconds, 1 / rate)
    phase = np.clip((t % 2.5) / (2.5 - PAUSE), 0.0, 1.0)
    # how far along the waves: a minimum-jerk step a stretch, at rest in between
    along = np.floor(t / 2.5) + phase**3 * (10 - 15 * phase + 6 * phase**2)
    q = np.column_stack(
        [a * np.sin(w * along + p) for a, w, p in ((1, 1.1, 0), (0.7, 1.7, 1), (1.2, 1.4, 2))]
    )
    v = np.gradient(q, 1 / rate, axis=0)
    return Motion(t, q, v, np.gradient(v, 1 / rate, axis=0), np.array([0]))


def held(motion: Motion, rng: np.random.Generator) -> np.ndarray:
    """Dry friction: of a joint at rest anything below its level, another at every rest."""
    rests = np.floor(motion.time / 2.5).astype(int)
    anything = rng.uniform(-LEVEL, LEVEL, (rests.max() + 1, motion.joints))[rests]
    return np.where(np.abs(motion.v) < 1e-3, anything, LEVEL * np.sign(motion.v))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_delay_is_found_alone_beside_joints_that_rest(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    kinds = ("viscous_friction", "coulomb_friction", "load_dependent_friction")
    few = [effect("time_delay", None), *(effect(kind, j) for kind in kinds for j in (1, 2, 3))]
    monkeypatch.setattr("armloop.diagnosis.trials.hypotheses", lambda arm: few)
    arm, motion = three_axis(), paused_motion(20.0, 100.0)
    law = FrictionLaw(((FrictionTerm("sign", LEVEL),),) * 3)
    body = RigidBody(nominal_parameters(arm), ("m1",), np.ones(1))
    model = ReconstructedModel(arm, (body,), law, baseline={"rmse": [0.03] * 3})
    tau = rigid_torque(arm, motion.q, motion.v, motion.vdot) + held(motion, np.random.default_rng(seed))
    late = np.column_stack([np.interp(motion.time - DELAY, motion.time, x) for x in tau.T])
    found = diagnose(model, [measured(motion, late, seed)])
    assert found.named == [("time_delay", None)]
    seconds = found.outcome.added()[0].parameters["seconds"]
    assert seconds.value == pytest.approx(DELAY, abs=max(4 * seconds.std_error, 0.01 * DELAY))


@pytest.mark.parametrize(("seconds", "first"), [(0.2, 3), (-0.2, 1)])
def test_what_was_recorded_late_of_a_rest_is_left_out(seconds: float, first: int) -> None:
    """Ten samples a second; the joint rests in the fourth and the fifth, in another run never."""
    time = np.concatenate([0.1 * np.arange(10), 0.1 * np.arange(10)])
    motion = Motion(time, *np.zeros((3, 20, 1)), np.array([0, 10]))
    moving = np.ones((20, 1), dtype=bool)
    moving[[3, 4]] = False
    expected = np.ones((20, 1), dtype=bool)
    expected[first : first + 4] = False
    assert (slid_since(motion, moving, seconds) == expected).all()
