"""What a diagnosis changes: the feedforward, the error on whole runs kept apart, and nothing left to find."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from exact_parts import as_it_was
from synthetic import (
    fourier_motion,
    friction,
    measured,
    rigid_torque,
    three_axis,
)

from armloop.data.log import MotionLog
from armloop.data.motion import Motion
from armloop.data.signals import preprocess
from armloop.diagnosis import close, diagnose
from armloop.identification.scoring import score
from armloop.laws.effects import Estimate, effect
from armloop.model import AddedEffect, ReconstructedModel
from armloop.robot.kinematics import regressor, tool_jacobian
from armloop.util.errors import InputError

Law = Callable[[Motion], np.ndarray]


def drag(motion: Motion) -> np.ndarray:
    """0.6 N·m·s/rad at joint 1."""
    return motion.v * [0.6, 0.0, 0.0]


def load(motion: Motion) -> np.ndarray:
    """0.45 kg, a point 0.3 m along the last link."""
    mass, com = 0.45, np.array([0.30, 0.02, -0.03])
    inertia = mass * (com @ com * np.eye(3) - np.outer(com, com))
    entries = [inertia[i] for i in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    Y = regressor(three_axis(), motion.q, motion.v, motion.vdot)[:, :, 20:]
    return Y @ np.array([mass, *(mass * com), *entries])


def total(motion: Motion) -> np.ndarray:
    """What the drives of the arm as it was supply."""
    return rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)


def shifted(motion: Motion) -> np.ndarray:
    """Joint 2's encoder reads 0.04 rad too much."""
    return total(replace(motion, q=motion.q - [0.0, 0.04, 0.0])) - total(motion)


def too_large(motion: Motion) -> np.ndarray:
    """Joint 3's torque reads 8 % too large."""
    return total(motion) * [0.0, 0.0, 0.08]


def push(motion: Motion) -> np.ndarray:
    """A force at the tool from 20 to 21.2 s."""
    tau = np.zeros_like(motion.q)
    during = (motion.time >= 20.0) & (motion.time <= 21.2)
    tau[during] = -np.array([6.0, 0.0, -9.0]) @ tool_jacobian(three_axis(), motion.q[during])
    return tau


def run(*laws: Law, seed: int, seconds: float = 40.0) -> MotionLog:
    """A log of the arm with friction and the laws' torques on top."""
    motion = fourier_motion(seconds, 100.0, seed)
    tau = total(motion) + sum(law(motion) for law in laws)
    return measured(motion, tau, seed, name=f"run{seed}")


@pytest.fixture(scope="module")
def model() -> ReconstructedModel:
    """The arm as it was, with what it leaves on a clean run as its baseline."""
    return as_it_was(run(seed=90))


PAIRS: dict[str, tuple[tuple[Law, ...], set[str]]] = {
    "two effects": ((load, drag), {"payload", "viscous_friction"}),
    "a fault and an effect": ((shifted, drag), {"encoder_offset", "viscous_friction"}),
    "a fault and a push": ((too_large, push), {"torque_gain", "external_contact"}),
}


@pytest.mark.long
@pytest.mark.parametrize("case", PAIRS)
def test_the_augmented_model_leaves_nothing_to_find(model: ReconstructedModel, case: str) -> None:
    laws, names = PAIRS[case]
    log = run(*laws, seed=5)
    found = diagnose(model, [log])
    assert {e["effect"] for e in found.to_dict()["effects"]} == names
    again = diagnose(found.model, [log]).to_dict()
    assert (again["verdict"], again["effects"]) == ("no_effect", [])


def with_effects(model: ReconstructedModel, *effects: tuple) -> ReconstructedModel:
    return model.with_effects(
        [
            AddedEffect(effect(name, joint), {key: Estimate(x, 0.0, "") for key, x in values.items()})
            for name, joint, values in effects
        ]
    )


PUSH = ("external_contact", None, {"start": 5.0, "end": 6.0, "force": [6.0, 0.0, -9.0]})


def test_the_controller_adds_the_effects_torque(model: ReconstructedModel) -> None:
    samples = preprocess([run(seed=3, seconds=20.0)], model.conditioning)
    after = with_effects(model, ("viscous_friction", 1, {"coefficient": 0.6}), PUSH)
    change = close(model, after, samples).feedforward
    v = samples.motion.v[change.rows]
    slides = samples.moving[change.rows, 0]
    np.testing.assert_allclose(change.torque[slides, 0], 0.6 * v[slides, 0], atol=1e-9)
    assert (change.torque[~slides, 0] == 0).all() and (change.torque[:, 1:] == 0).all()
    assert change.rms[0] == pytest.approx(0.6 * np.sqrt(np.mean(v[:, 0] ** 2)), rel=0.02)
    assert change.largest[0] == pytest.approx(0.6 * np.abs(v[:, 0]).max())


def test_the_controller_adds_a_load_at_rest_too(model: ReconstructedModel) -> None:
    samples = preprocess([run(seed=3, seconds=20.0)], model.conditioning)
    body = {"mass": 0.45, "com": [0.0, 0.0, 0.0], "own_inertia": 0.0}
    after = with_effects(model, ("payload", None, body))
    change = close(model, after, samples).feedforward
    expected = after.predict(samples.motion) - model.predict(samples.motion)
    np.testing.assert_allclose(change.torque, expected[change.rows], atol=1e-9)


def test_a_fault_and_an_event_add_nothing(model: ReconstructedModel) -> None:
    samples = preprocess([run(seed=3, seconds=20.0)], model.conditioning)
    after = with_effects(
        model,
        ("torque_gain", 1, {"gain": 1.1}),
        ("torque_offset", 2, {"offset": 0.5}),
        ("encoder_offset", 2, {"offset": 0.05}),
        ("time_delay", None, {"seconds": 0.02}),
        PUSH,
    )
    assert (close(model, after, samples).feedforward.torque == 0).all()


def test_whole_runs_kept_apart_are_scored_without_the_events_of_the_run(model: ReconstructedModel) -> None:
    fitted, apart = run(drag, seed=3, seconds=20.0), run(drag, seed=4, seconds=20.0)
    samples = preprocess([fitted], model.conditioning)
    drags = ("viscous_friction", 1, {"coefficient": 0.6})
    after = with_effects(model, drags, PUSH)
    answer = close(model, after, samples, [apart]).to_dict()
    (scored,) = answer["held_out_runs"]
    assert scored["log"] == "run4"
    before, then = (np.array(scored["rmse"][key]) for key in ("before", "after"))
    assert before[0] > 10 * then[0]
    alone = score(with_effects(model, drags), preprocess([apart], model.conditioning))
    np.testing.assert_allclose(then, alone.moving["rmse"], rtol=1e-12)
    np.testing.assert_allclose(before[1:], then[1:])
    assert "held_out_runs" not in close(model, after, samples).to_dict()


def test_a_run_of_another_arm_is_refused(model: ReconstructedModel) -> None:
    log = run(seed=3, seconds=20.0)
    two = MotionLog(log.time, log.q[:, :2], log.v[:, :2], log.tau[:, :2], name="two")
    samples = preprocess([log], model.conditioning)
    with pytest.raises(InputError, match="two: 2 joints, but the model's arm three_axis has 3"):
        close(model, model, samples, [two])
