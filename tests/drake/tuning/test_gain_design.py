"""Proposed gains have what was asked for, and the linear loop is what the simulated arm does."""

import dataclasses
import warnings

import numpy as np
import pytest
from numpy.testing import assert_allclose

from armloop.drake.control.pid import PidGains
from armloop.drake.experiments.scenarios import load_plant
from armloop.drake.plant.exact import exact_model
from armloop.drake.tuning import gain_design
from armloop.drake.tuning.gain_design import propose_gains
from armloop.drake.tuning.loop_analysis import SampledArm, model_posture, posture_model, sampled_margins
from armloop.drake.tuning.step_check import linear_step, simulated_step
from armloop.util.errors import InputError

Q0 = {"three_axis": [0.2, -0.4, 0.3], "scara": [0.3, 0.5, 0.1, 0.0]}


@pytest.mark.parametrize(
    ("name", "hertz", "margin"),
    [
        ("three_axis", 3.0, 45.0),
        ("scara", 8.0, 70.0),
        pytest.param("three_axis", 8.0, 70.0, marks=pytest.mark.long),
        pytest.param("scara", 3.0, 45.0, marks=pytest.mark.long),
    ],
)
def test_every_joint_by_itself_has_bandwidth_and_margin(name, hertz, margin):
    plant = load_plant(name)
    linear = posture_model(plant.arm, plant.config.friction, Q0[name])
    gains = propose_gains(linear, 1e-3, 2 * np.pi * hertz, margin)
    for i in range(plant.arm.n):
        alone = SampledArm.of(tuple(x[i : i + 1, i : i + 1] for x in linear), 1e-3)
        own = PidGains(gains.kp[i], gains.ki[i], gains.kd[i])
        (reached,) = sampled_margins(alone, own, points=5000)
        assert reached.bandwidth == pytest.approx(2 * np.pi * hertz, rel=0.03)
        if gains.kd[i] > 0:
            assert reached.phase_margin == pytest.approx(margin, abs=0.5)
        else:
            assert reached.phase_margin > margin
    assert SampledArm.of(linear, 1e-3).is_stable(gains)


def test_unstable_gains_are_told_and_impossible_ones_refused():
    plant = load_plant("three_axis")
    linear = posture_model(plant.arm, plant.config.friction, Q0["three_axis"])
    sampled = SampledArm.of(linear, 1e-3)
    assert sampled.is_stable(PidGains.paper(3))
    assert not sampled.is_stable(PidGains([80.0] * 3, [8.0] * 3, [200.0] * 3))
    with pytest.raises(InputError, match="below a quarter of the sampling rate, 250 Hz"):
        propose_gains(linear, 1e-3, 2 * np.pi * 300, 60)
    with pytest.raises(InputError, match=r"joint \d: no gains give 24 Hz with a margin of 85 deg at 100 Hz"):
        propose_gains(linear, 1e-2, 2 * np.pi * 24, 85)
    with pytest.raises(InputError, match="must be 20 to 85"):
        propose_gains(linear, 1e-3, 30.0, 120)


def test_a_models_posture_is_the_arms():
    plant = load_plant("three_axis")
    ours = model_posture(exact_model(plant.arm, plant.config.friction), Q0["three_axis"])
    theirs = posture_model(plant.arm, plant.config.friction, Q0["three_axis"])
    for a, b in zip(ours, theirs, strict=True):
        assert_allclose(a, b, atol=1e-6)


def test_a_loop_that_is_not_stable_ends_where_numbers_do():
    plant = load_plant("three_axis")
    linear = posture_model(plant.arm, plant.config.friction, Q0["three_axis"])
    gains = PidGains([1e12] * 3, [0.0] * 3, [0.0] * 3)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        _, motion = linear_step(SampledArm.of(linear, 1e-3), gains, np.full(3, 0.01), 0.4)
    assert np.isfinite(motion[:3]).all() and np.isnan(motion[-1]).all() and not np.isinf(motion).any()


@pytest.mark.parametrize("name", Q0)
def test_the_simulated_arm_steps_as_the_linear_loop_says(name):
    plant, q0 = load_plant(name), np.array(Q0[name])
    linear = posture_model(plant.arm, plant.config.friction, q0)
    gains = propose_gains(linear, 1e-3, 2 * np.pi * 5, 60)
    step = np.where(plant.arm.revolute, np.deg2rad(0.5), 1e-3)
    time, expected = linear_step(SampledArm.of(linear, 1e-3), gains, step, 0.4)
    again, simulated = simulated_step(plant, gains, q0, step, 0.4, dry=False)
    assert_allclose(time, again, atol=1e-9)
    assert np.abs(expected / step).max() > 1.1  # it overshoots: there is something to compare
    assert_allclose(simulated / step, expected / step, atol=0.03)
    # dry friction is what the linear loop does not know
    held = simulated_step(plant, dataclasses.replace(gains, ki=0 * gains.ki), q0, 0.05 * step, 0.2, dry=True)[
        1
    ]
    assert np.abs(held / step).max() < 0.05


def test_bandwidths_and_margins_that_may_be_asked_for(monkeypatch):
    monkeypatch.setattr(gain_design, "_joint", lambda linear, *_: (float(linear[0][0, 0]), 2.0, 3.0))
    linear = tuple(np.diag([1.0, 5.0]) for _ in range(3))
    highest = 0.5 * np.pi / 1e-3
    for bandwidth, margin in ((0.999 * highest, 20.0), (1e-3, 85.0)):
        gains = propose_gains(linear, 1e-3, bandwidth, margin)
        assert (gains.kp.tolist(), gains.ki.tolist(), gains.kd.tolist()) == ([1, 5], [2, 2], [3, 3])
    for bandwidth, margin in ((highest, 45.0), (0.0, 45.0), (10.0, 19.9), (10.0, 85.1)):
        with pytest.raises(InputError):
            propose_gains(linear, 1e-3, bandwidth, margin)
