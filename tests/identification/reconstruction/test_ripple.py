"""A ripple is a line of the spectrum over the angle: how strong it must be, and that it keeps its phase."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import ttest_1samp
from synthetic import three_axis

from armloop.data.log import MotionLog
from armloop.data.signals import Conditioning, preprocess
from armloop.identification.reconstruction import lines, ripple
from armloop.identification.reconstruction.ripple import Residual
from armloop.laws.effects.torque_ripple import TorqueRipple
from armloop.robot.arm import load_arm

ORDERS = np.arange(1.0, 201.0)


def residual(
    sine: float = 0.3, cosine: float = 0.4, noise: float = 0.5, blocks: int = 40, **of: Any
) -> Residual:
    """A joint that turns evenly, with a wave of order 100 in given blocks of 100 samples."""
    rng = np.random.default_rng(of.get("seed", 0))
    q = np.sort(rng.uniform(-3, 3, 100 * blocks))
    block = np.arange(100 * blocks) // 100
    wave = sine * np.sin(100 * q) + cosine * np.cos(100 * q)
    there = np.isin(block, of.get("there", range(blocks)))
    left = np.where(there, wave, 0.0) + noise * rng.normal(size=len(q))
    return Residual(q, left, block, np.ones_like(q))


def test_a_line_has_the_coefficients_and_the_errors_of_least_squares_over_blocks() -> None:
    left = residual()
    line = ripple._line(left, ORDERS, 3)
    assert line is not None
    order, x, covariance = line
    assert order == 100.0
    X = np.column_stack([np.sin(100 * left.q), np.cos(100 * left.q)])
    np.testing.assert_allclose(x, np.linalg.lstsq(X, left.left, rcond=None)[0])
    np.testing.assert_allclose(x, [0.3, 0.4], atol=4 * 0.5 * np.sqrt(2 / 4000))
    bread, after = np.linalg.inv(X.T @ X), left.left - X @ x
    scores = np.array([X[left.block == k].T @ after[left.block == k] for k in range(40)])
    np.testing.assert_allclose(covariance, bread @ scores.T @ scores @ bread)


@pytest.mark.parametrize(
    ("order", "found"), [(100.37, 100.37), (99.6, 99.6), (100.01, 100.0), (100.0, 100.0)]
)
def test_behind_a_gear_an_order_is_any_number_and_has_an_error(order: float, found: float) -> None:
    """A hundredth off, the whole number stands for it: it says 99 % of what is there."""
    q = np.sort(np.random.default_rng(1).uniform(-1, 2, 4000))
    block = np.arange(4000) // 100
    y = 0.3 * np.sin(order * q) + 0.4 * np.cos(order * q) + 0.2 * np.random.default_rng(2).normal(size=4000)
    line = ripple._line(Residual(q, y, block, np.ones_like(q)), ORDERS, 3)
    assert line is not None
    exact, x, covariance = line
    p = TorqueRipple(1).estimates(three_axis(), x, covariance, exact)
    if found == round(found):
        assert exact == found and p["order"].std_error == 0 and len(x) == 2
        return
    # of a phase that is known to s, over a travel of 3 rad: s sqrt(12) / 3
    amplitude = 0.2 * np.sqrt(2 / 4000)
    assert abs(exact - found) < 4 * p["order"].std_error
    assert p["order"].std_error == pytest.approx(amplitude / 0.5 * np.sqrt(12) / 3, rel=0.3)
    assert p["amplitude"].value == pytest.approx(0.5, abs=4 * amplitude)
    assert p["phase"].value == pytest.approx(np.arctan2(0.4, 0.3), abs=4 * float(p["phase"].std_error))


def test_an_order_that_others_stand_for_is_not_left_for_another_whole_one() -> None:
    """What lies a whole order away is a line of its own."""
    q = np.linspace(-0.5, 0.5, 2000)
    assert lines.between(q, np.sin(21.3 * q), 20.0, 40) == 20.0
    assert lines.between(q, np.sin(20.7 * q), 20.0, 40) == pytest.approx(20.7)


def test_noise_has_no_line_nor_has_what_a_few_blocks_hold() -> None:
    assert all(ripple._line(residual(0.0, 0.0, seed=seed), ORDERS, 3) is None for seed in range(5))
    # strong in two blocks of forty it stands out of the spectrum, but no chance is ruled out
    burst = residual(6.0, 8.0, there=(7, 22))
    power = lines.spectrum(burst.q, burst.left, ORDERS)
    assert power[99] > 20 * np.median(power) and power[99] > 0.005 * np.sum(burst.left**2)
    assert ripple._line(burst, ORDERS, 3) is None
    # in every other block: it gains there what it loses in the others, but for about two standard errors
    half = residual(0.5, 0.5, there=range(0, 40, 2))
    power = lines.spectrum(half.q, half.left, ORDERS)
    assert power[99] > 20 * np.median(power) and power[99] > 0.005 * np.sum(half.left**2)
    assert ripple._line(half, ORDERS, 3) is None


def even(*waves: tuple[int, float]) -> Residual:
    """Eight turns at an even speed, of which waves of whole orders are orthogonal, in forty blocks."""
    q = 16 * np.pi * np.arange(4000) / 4000
    return Residual(q, np.sum([a * np.sin(k * q) for k, a in waves], axis=0), np.arange(4000) // 100, 0 * q)


@pytest.mark.parametrize(("share", "found"), [(0.0051, True), (0.0049, False)])
def test_a_line_must_hold_a_two_hundredth_of_the_squares(share: float, found: bool) -> None:
    line = ripple._line(even((1, np.sqrt(1 / share - 1)), (100, 1.0)), ORDERS[20:], 3)
    assert (line is not None) == found
    assert line is None or line[1] == pytest.approx([1.0, 0.0], abs=1e-9)


@pytest.mark.parametrize(("factor", "found"), [(1.001, True), (0.999, False)])
def test_the_chance_is_student_s_of_what_blocks_gain(
    factor: float, found: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each block by itself, whatever its size, beside fits of the other folds; for any order of any joint."""
    left = residual(0.5, 0.5, blocks=20, there=range(0, 20, 2))
    left = replace(left, left=left.left * np.where(left.block == 5, 2.0, 1.0))
    gains = []
    for k in range(20):
        X = np.column_stack([np.sin(100 * left.q), np.cos(100 * left.q)])
        own, others = left.block == k, left.block % 5 != k % 5
        after = left.left[own] - X[own] @ np.linalg.lstsq(X[others], left.left[others], rcond=None)[0]
        a, b = np.sum(left.left[own] ** 2), np.sum(after**2)
        gains.append((a - b) / (a + b))
    chance = float(ttest_1samp(gains, 0.0, alternative="greater").pvalue)
    assert chance < 0.5
    monkeypatch.setattr(ripple, "CHANCE", factor * chance * 200 * 3)
    monkeypatch.setattr(lines, "_STANDS_OUT", 5.0)
    assert (ripple._line(left, ORDERS, 3) is not None) == found


def test_what_the_corner_takes_away_is_left_of_the_torque() -> None:
    """A third of the sample rate is told from what a model explains, in blocks of one and a half seconds."""
    time = np.arange(2400) / 200
    wave = np.sin(2 * np.pi * 60 * time)
    q = np.column_stack([0.3 * time, np.sin(time), 0.2 * time])
    v = np.column_stack([0.3 + 0 * time, np.cos(time), 0.2 + 0 * time])
    logs = [
        MotionLog(time[:N] + 100 * k, q[:N], v[:N], (q + (1 + k) * wave[:, None])[:N], name=f"run{k}")
        for k, N in enumerate((2400, 2000))
    ]
    short = MotionLog(time[:20] + 50, q[:20], v[:20], q[:20], name="short")
    how = Conditioning(cutoff_hz=5.0)
    samples = preprocess(logs, how)
    # what lies between two samples has the later one's part
    held, known = samples.motion.time > 105.0, samples.motion.time[samples.motion.runs()[0]]
    held[[0, len(known) - 1]] = True
    model: Any = SimpleNamespace(arm=three_axis(), conditioning=how, predict=lambda motion: motion.q)
    residuals, period = ripple._residuals(model, [logs[0], short, logs[1]], samples, held)
    assert period == pytest.approx(1 / 200)
    for j, left in enumerate(residuals):
        at = np.interp(left.q, q[:, j], time) if j != 1 else None
        if at is not None:
            first = left.block < 8
            times = np.where(first, 1.0, 2.0)
            np.testing.assert_allclose(left.left, times * np.sin(2 * np.pi * 60 * at), atol=0.05)
            assert sorted(set(left.block)) == [*range(12)]
            np.testing.assert_allclose(left.v, v[0, j], atol=1e-3)
            assert at[~first].max() == pytest.approx(5.0, abs=0.1)
            # to half a sample, 5 ms apart
            assert at[first].min() == pytest.approx(known[0] + 0.005, abs=0.0025)
            assert at[first].max() == pytest.approx(known[-2], abs=0.0025)


@pytest.mark.parametrize("exact", [100.0, 100.4])
def test_the_amplitude_is_what_the_drive_shows_below_the_corner_if_it_shows_less_beyond(exact: float) -> None:
    """There slowly and back so fast that the joint's inertia takes up half of it."""
    q = np.concatenate([np.linspace(-3, 3, 2000), np.linspace(3, -3, 2000)])
    fast, block = np.arange(4000) >= 2000, np.arange(4000) // 100
    noise = 0.1 * np.random.default_rng(1).normal(size=4000)
    # a wave of 0.5 N·m: 100 times per radian, by 0.1 and 1 rad/s at a corner of 2 Hz
    wave = 0.3 * np.sin(exact * q) + 0.4 * np.cos(exact * q)
    slowed = Residual(q, noise + np.where(fast, 0.5, 1.0) * wave, block, np.where(fast, -1.0, 0.1))
    line = ripple._line(slowed, ORDERS, 3)
    assert line is not None
    order, x, covariance = line
    assert np.hypot(*x[:2]) == pytest.approx(0.5 * 0.75, rel=0.05)
    own, spread = ripple._below(slowed, line, 2.0)
    error = np.sqrt(np.diag(spread))
    assert len(own) == len(x) and (np.abs(own[:2] - [0.3, 0.4]) < 4 * error[:2]).all()
    assert error[:2] == pytest.approx(0.1 * np.sqrt(2 / 2000), rel=0.5)
    # as strong at any speed: all samples tell more
    alike = replace(slowed, left=noise + wave)
    line = ripple._line(alike, ORDERS, 3)
    assert line is not None and ripple._below(alike, line, 2.0)[0] is line[1]
    # too little was recorded below the corner
    for few in (np.where(block < 9, 0.1, 1.0), np.ones(4000)):
        few_left = replace(slowed, v=few)
        assert ripple._below(few_left, (order, x, covariance), 2.0)[0] is x


def cogging(order: float, corner_hz: float, shown: float = 1.5, seed: int = 3) -> Residual:
    """A joint that creeps here and there, and moves fast in between; its drive shows a motor's cogging to some corners."""
    rng = np.random.default_rng(seed)
    moves, q = [], 0.0
    for k in range(60):
        speed = rng.choice([-1, 1]) * (
            1.2 if k % 3 == 0 else rng.uniform(0.3, 1.2) * 2 * np.pi * corner_hz / order
        )
        moves.append((q + speed * 0.01 * np.arange(100), np.full(100, speed)))
        q = float(moves[-1][0][-1]) if abs(moves[-1][0][-1]) < 2 else 0.0
    angle, v = (np.concatenate(x) for x in zip(*moves, strict=True))
    seen = order * np.abs(v) < 2 * np.pi * corner_hz * shown
    wave = 1.2 * np.sin(order * angle) + 1.6 * np.cos(order * angle)
    left = np.where(seen, wave, 0.0) + rng.normal(size=len(v))
    return Residual(angle, left, np.arange(len(v)) // 100, v)


@pytest.mark.parametrize("order", [150.0, 320.0, 404.37, 808.0])
def test_what_a_motor_does_is_found_where_the_joint_creeps(
    order: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """2 N·m, of which the drive shows nothing while the joint moves fast: orders beyond those of the diagnosis, too."""
    arm, corner = three_axis(), 8.0
    other = Residual(*(np.zeros(0) for _ in range(4)))  # type: ignore[arg-type]
    monkeypatch.setattr(ripple, "_residuals", lambda *_: ([cogging(order, corner), other, other], 0.01))
    monkeypatch.setattr(ripple.TorqueRipple, "shapes", lambda self, context: [*range(4, 60)])
    sampled: Any = SimpleNamespace(cutoff_hz=corner, motion=None)
    nothing: Any = None
    found = ripple.find_ripple(SimpleNamespace(arm=arm), [], sampled, nothing)  # type: ignore[arg-type]
    (own,) = found
    p = own.parameters
    assert own.effect.joint == 1
    assert p["order"].value == pytest.approx(order, abs=0.02)
    assert p["amplitude"].value == pytest.approx(2.0, abs=4 * float(p["amplitude"].std_error))
    assert float(p["amplitude"].std_error) < 0.15


def test_samples_that_are_too_few_to_creep_tell_of_no_motor(monkeypatch: pytest.MonkeyPatch) -> None:
    arm, asked = three_axis(), []
    fast = cogging(404.0, 8.0)
    fast = replace(fast, v=np.where(np.arange(len(fast.v)) < 499, 0.01, 1.5))
    monkeypatch.setattr(ripple, "_residuals", lambda *_: ([fast] * 3, 0.01))
    monkeypatch.setattr(ripple.TorqueRipple, "shapes", lambda self, context: [4])
    monkeypatch.setattr(ripple, "_line", lambda left, orders, joints: asked.append(orders.tolist()))
    sampled: Any = SimpleNamespace(cutoff_hz=8.0, motion=None)
    nothing: Any = None
    assert ripple.find_ripple(SimpleNamespace(arm=arm), [], sampled, nothing) == []  # type: ignore[arg-type]
    assert asked == [[4]] * 3


@pytest.mark.parametrize("samples", [499, 500])
def test_joints_that_turn_are_asked_until_nothing_is_left_three_times_at_most(
    samples: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A SCARA: the third joint slides."""
    arm, asked = load_arm("scara"), []
    own = Residual(np.zeros(samples), np.full(samples, 9.0), np.zeros(samples, dtype=int), np.zeros(samples))

    def line(left: Residual, orders: Any, joints: int) -> Any:
        asked.append(float(left.left[0]))
        return None if len(asked) == 5 else (10.0 + len(asked), np.array([3.0, 2.0]), np.eye(2))

    monkeypatch.setattr(ripple, "_residuals", lambda *_: ([own] * 4, 0.01))
    monkeypatch.setattr(ripple, "_line", line)
    # stated is what is there below the corner
    monkeypatch.setattr(ripple, "_below", lambda left, line, corner: (line[1] * corner / 2, line[2]))
    monkeypatch.setattr(ripple.TorqueRipple, "shapes", lambda self, context: [1.0, 2.0])
    model: Any = SimpleNamespace(arm=arm)
    sampled: Any = SimpleNamespace(cutoff_hz=1.0, motion=None)
    nothing: Any = None
    found = ripple.find_ripple(model, [], sampled, nothing)
    if samples == 499:
        assert found == [] and asked == []
        return
    # what a line explains, two per unit of its cosine, is taken away before the next
    assert asked == [9.0, 7.0, 5.0, 9.0, 7.0, 9.0, 7.0, 5.0]
    assert [added.effect.joint for added in found] == [1, 1, 1, 2, 4, 4, 4]
    assert {added.when for added in found} == {"always"}
    amplitudes = [added.parameters["amplitude"].value for added in found]
    assert amplitudes == pytest.approx([np.hypot(3, 2) / 2] * 7)
    sampled.cutoff_hz = 0.0
    assert ripple.find_ripple(model, [], sampled, nothing) == [] and three_axis().n == 3
