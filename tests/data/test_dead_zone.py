"""A joint moves where its speed leaves a dead zone that follows the noise of that speed."""

from dataclasses import replace

import numpy as np
from synthetic import sines, with_noise

from armloop.data.creep import may_stick
from armloop.data.log import MotionLog
from armloop.data.signals import Conditioning, Speeds, preprocess, velocity_noise

TEN_HZ = Conditioning(cutoff_hz=10.0)


def stop_and_go(seconds: tuple[float, ...] = (2.0, 2.0, 2.0), speed: float = 0.5) -> MotionLog:
    """At rest, at a constant speed, at rest; 250 Hz, a little noise on v."""
    v = np.concatenate([np.full(int(s * 250), speed * (k % 2)) for k, s in enumerate(seconds)])[:, None]
    q = np.cumsum(v, axis=0) * 0.004
    v = v + 1e-3 * np.random.default_rng(1).normal(size=v.shape)
    return MotionLog(np.arange(len(v)) * 0.004, q, v, np.sign(q), name="stop")


def test_moving_keeps_half_a_period_away_from_standstill():
    samples = preprocess([stop_and_go()], TEN_HZ)
    moving = samples.motion.time[samples.moving[:, 0]]
    # at 2 s and 4 s the speed steps; smeared by the filter it crosses the dead zone up to 0.1 s before
    assert moving.min() >= 2.0 - 0.1 + 0.05
    assert moving.max() <= 4.0 + 0.1 - 0.05
    inside = (samples.motion.time > 2.06) & (samples.motion.time < 3.94)
    assert samples.moving[inside, 0].all()


def test_a_reversal_is_dilated_by_half_a_period_of_the_corner():
    time = np.arange(0, 10, 0.004)
    log = sines(time, (0.25,))
    samples = preprocess(
        [replace(log, v=log.v + 1e-3 * np.random.default_rng(2).normal(size=log.v.shape))], TEN_HZ
    )
    for reversal in (1.0, 3.0, 5.0, 7.0, 9.0):
        near = np.abs(samples.motion.time - reversal) < 0.05
        assert near.any() and not samples.moving[near].any()
        assert samples.moving[np.abs(samples.motion.time - reversal - 0.5) < 0.2].all()


def test_a_reversal_between_two_samples_is_one():
    """Without noise the dead zone is so narrow that a joint turning round is never seen inside it."""
    samples = preprocess([sines(np.arange(0.0013, 10, 0.004), (0.25,))], TEN_HZ)
    for reversal in (1.0, 3.0, 5.0, 7.0, 9.0):
        near = np.abs(samples.motion.time - reversal) < 0.045
        assert near.any() and not samples.moving[near].any()
        assert samples.moving[np.abs(samples.motion.time - reversal - 0.5) < 0.2].all()


def test_the_dead_zone_follows_the_noise():
    log = sines(np.arange(0, 10, 0.004), (0.25,))
    shares = [
        float(preprocess([with_noise(log, level)], TEN_HZ).moving.mean()) for level in (1e-3, 1e-1, 1.0)
    ]
    assert shares[0] > 0.9 and shares[0] > shares[1] + 0.02 and shares[1] > shares[2] + 0.2


def test_a_joint_that_rests_never_counts_as_moving():
    log = stop_and_go(speed=0.0)
    assert not preprocess([log], TEN_HZ).moving.any()


def test_a_joint_that_rests_to_the_last_digit_shows_no_noise_then():
    """Of five seconds it moves for one, and the noise of its speed is seen then alone."""
    time = np.arange(0, 5, 0.004)
    moves = (time < 1)[:, None]
    speed = 0.5 + 0.02 * np.random.default_rng(5).normal(size=(len(time), 1))
    rests = MotionLog(time, 0.5 * np.minimum(time, 1.0)[:, None], np.where(moves, speed, 0.0), 1.0 * moves)
    level = velocity_noise(rests.select(moves[:, 0]), 10.0)
    assert level[0] > 1e-3
    np.testing.assert_allclose(velocity_noise(rests, 10.0), level, rtol=0.3)
    assert velocity_noise(rests.select(time > 2), 10.0)[0] == 0.0


def test_a_joint_goes_as_fast_as_in_the_log_in_which_it_does_and_one_that_others_shake_is_not_known():
    time = np.arange(0, 20, 0.01)
    # a swing, a slow one, one of a few thousandths of a radian; then the first joint rests and the second goes faster
    q = np.column_stack([np.sin(time), 0.05 * np.sin(time), 0.004 * np.sin(10 * time)])
    v = np.column_stack([np.cos(time), 0.05 * np.cos(time), 0.04 * np.cos(10 * time)])
    first = MotionLog(time, q, v, 0 * q)
    then = replace(first, q=[0, 2, 1] * q, v=[0, 2, 1] * v)
    one, other = (Speeds.of(log, 10.0) for log in (first, then))
    np.testing.assert_allclose(one.fastest, [1.0, 0.05, np.inf], rtol=1e-3)
    np.testing.assert_allclose(other.fastest, [np.inf, 0.1, np.inf], rtol=1e-3)
    np.testing.assert_allclose(Speeds.joined([one, other]).fastest, [1.0, 0.1, np.inf], rtol=1e-3)
    samples = preprocess([first, then], TEN_HZ)
    np.testing.assert_allclose(samples.fastest, [1.0, 0.1, np.inf], rtol=1e-3)
    np.testing.assert_allclose(may_stick(samples.fastest), [0.01, 0.005, 0.01], rtol=1e-3)


def test_the_noise_is_that_of_all_runs_not_of_the_longest():
    time = np.arange(0, 4, 0.004)
    still, moves = sines(time), sines(time[:800])
    still = replace(still, q=0 * still.q, v=0 * still.v)
    moves = replace(moves, v=moves.v + 0.1 * np.random.default_rng(4).normal(size=moves.v.shape))
    both = [np.concatenate([getattr(still, key), getattr(moves, key)]) for key in ("q", "v", "tau")]
    joined = MotionLog(np.concatenate([time, 10 + moves.time]), *both)
    np.testing.assert_allclose(velocity_noise(joined, 10.0), velocity_noise(moves, 10.0), rtol=1e-9)
