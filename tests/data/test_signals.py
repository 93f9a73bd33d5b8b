"""Filtering keeps signals together in time, never crosses a gap, and knows when a joint slides."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import sines

from armloop.data.dropouts import mended, repaired
from armloop.data.filters import filter_reach
from armloop.data.log import MotionLog, recorded
from armloop.data.motion import Motion
from armloop.data.signals import (
    Conditioning,
    ShortRunError,
    _thinned,
    as_torque,
    derivative,
    independent_rows,
    preprocess,
    smooth,
    uniform_period,
)
from armloop.util.errors import LogError

TEN_HZ = Conditioning(cutoff_hz=10.0)


def phase_of(time: np.ndarray, x: np.ndarray, hz: float) -> float:
    """Phase of x against sin(2 pi hz t), rad, by least squares."""
    w = 2 * np.pi * hz
    a, b = np.linalg.lstsq(np.column_stack([np.sin(w * time), np.cos(w * time)]), x, rcond=None)[0]
    return float(np.arctan2(b, a))


def test_every_signal_keeps_its_place_in_time():
    # a filter that runs forwards only would delay 2 Hz by some 40 ms, half a radian
    samples = preprocess([sines(np.arange(0, 8, 0.004))], TEN_HZ)
    motion = samples.motion
    for j, hz in enumerate((0.7, 2.0)):
        phases = {
            name: phase_of(motion.time, x[:, j], hz)
            for name, x in (("q", motion.q), ("v", motion.v), ("vdot", motion.vdot), ("tau", samples.tau))
        }
        assert phases["q"] == pytest.approx(0.0, abs=1e-3)
        assert phases["v"] == pytest.approx(np.pi / 2, abs=1e-3)
        assert phases["tau"] == pytest.approx(np.pi / 2, abs=1e-3)
        assert abs(phases["vdot"]) == pytest.approx(np.pi, abs=1e-3)


def test_velocity_does_not_lag_the_derivative_of_the_position_under_noise():
    rng = np.random.default_rng(4)
    log = sines(np.arange(0, 20, 0.002))
    log = replace(log, v=log.v + 0.05 * rng.normal(size=log.v.shape))
    motion = preprocess([log], TEN_HZ).motion
    rate = derivative(motion.q, float(np.median(np.diff(motion.time))))
    acceleration = derivative(rate, float(np.median(np.diff(motion.time))))
    for j in range(2):
        lag = -np.polyfit(acceleration[:, j], motion.v[:, j] - rate[:, j], 1)[0]
        assert abs(lag) < 2e-4  # s


def test_how_far_the_filter_reaches_is_asked_of_the_filter(monkeypatch):
    assert Conditioning(10.0).smear / 10.0 == Conditioning(10.0).reach == filter_reach(10.0)
    monkeypatch.setattr("armloop.data.filters.SMEAR", 0.8)
    with pytest.raises(ShortRunError, match=r"at least 0\.48 s"):
        preprocess([sines(np.arange(0, 0.2, 0.004), (1.0,))], TEN_HZ)


def test_what_is_slow_passes_and_what_is_fast_does_not():
    time = np.arange(0, 8, 0.004)
    samples = preprocess([sines(time, (1.0, 40.0))], TEN_HZ)
    motion = samples.motion
    inside = np.abs(motion.time - 4) < 3.4  # the ends know one side of the motion only
    np.testing.assert_allclose(motion.q[inside, 0], np.sin(2 * np.pi * motion.time[inside]), atol=1e-5)
    # forth and back at four times the torque's corner, and twice the motion's
    gain = {
        corner: 1 / (1 + (np.tan(np.pi * 40 * 0.004) / np.tan(np.pi * corner * 0.004)) ** 8)
        for corner in (10, 20)
    }
    size = np.abs(samples.tau[inside, 1]).max() / (80 * np.pi)
    assert size == pytest.approx(gain[10], rel=0.05) and gain[10] < 1e-4
    assert np.abs(motion.q[inside, 1]).max() == pytest.approx(gain[20], rel=0.05)


def test_filtered_like_the_torque_the_motion_loses_what_the_torque_has_lost():
    samples = preprocess([sines(np.arange(0, 8, 0.004), (1.0, 12.0))], TEN_HZ)
    alike, inside = as_torque(samples), np.abs(samples.motion.time - 4) < 3.4
    # the record's torque is its velocity
    np.testing.assert_allclose(alike.motion.v[inside, 0], samples.tau[inside, 0], atol=1e-4)
    lost = np.abs(samples.motion.v - samples.tau)[inside, 1].max()
    assert np.abs(alike.motion.v - samples.tau)[inside, 1].max() < 0.05 * lost
    assert as_torque(alike) is alike
    as_drawn = replace(samples, cutoff_hz=0.0)
    assert as_torque(as_drawn) is as_drawn


def test_the_acceleration_is_that_of_the_motion():
    samples = preprocess([sines(np.arange(0, 8, 0.004), (0.5,))], TEN_HZ)
    w = 2 * np.pi * 0.5
    expected = -(w**2) * np.sin(w * samples.motion.time)
    inside = np.abs(samples.motion.time - 4) < 3.4
    np.testing.assert_allclose(samples.motion.vdot[inside, 0], expected[inside], atol=1e-4 * w**2)
    np.testing.assert_allclose(samples.motion.vdot[:, 0], expected, atol=1e-2 * w**2)


def test_a_log_that_brings_accelerations_keeps_them():
    log = sines(np.arange(0, 8, 0.004), (0.5,))
    samples = preprocess([replace(log, vdot=np.full_like(log.q, 7.0))], TEN_HZ)
    np.testing.assert_allclose(samples.motion.vdot, 7.0)


def test_a_gap_is_never_filtered_across():
    time = np.concatenate([np.arange(0, 3, 0.004), np.arange(5, 9, 0.004), np.arange(9.5, 12, 0.004)])
    log = sines(time)
    levels = np.select([time < 4, time < 9.2], [0.0, 100.0], -50.0)
    log = replace(log, tau=np.column_stack([levels, log.tau[:, 1]]))
    samples = preprocess([log], TEN_HZ)
    assert [samples.motion.time[run.start].round(2) for run in samples.motion.runs()] == [0.05, 5.05, 9.55]
    for run, level in zip(samples.motion.runs(), (0.0, 100.0, -50.0), strict=True):
        np.testing.assert_allclose(samples.tau[run, 0], level, atol=1e-9)
    apart = preprocess([log.select(run) for run in log.runs()], TEN_HZ)
    for name in ("time", "q", "v", "vdot", "starts"):
        np.testing.assert_array_equal(getattr(samples.motion, name), getattr(apart.motion, name))
    np.testing.assert_array_equal(samples.tau, apart.tau)


def test_time_is_counted_from_the_start_of_the_record_not_from_the_first_sample_that_a_filter_leaves():
    time = np.concatenate([np.arange(0.0, 4.0, 0.01), np.arange(5.0, 9.0, 0.01)])
    wave = np.sin(time)[:, None]
    log = MotionLog(100.0 + time, wave, np.cos(time)[:, None], wave)
    other = MotionLog(50.0 + time, wave, np.cos(time)[:, None], wave)
    motion = preprocess([log, other], Conditioning(10.0)).motion
    first, second, third = motion.starts[:3]
    elapsed = motion.elapsed
    # half a period of the corner is cut off; after the gap the same log goes on, and the next counts anew
    np.testing.assert_allclose(elapsed[[first, second, third]], [0.05, 5.05, 0.05], atol=1e-9)
    alone = preprocess([log], Conditioning(10.0)).motion
    # stamped by one clock, a log of the next day begins anew, and what goes on after a pause goes on
    later = [replace(alone, time=alone.time + pause, begins=None) for pause in (0.0, 3000.0, 90_000.0)]
    days = Motion.joined(later).elapsed.reshape(3, -1)
    np.testing.assert_allclose(days - days[0], [[0.0], [3000.0], [0.0]] * np.ones_like(days), atol=1e-6)
    np.testing.assert_array_equal(Motion.joined([alone, alone]).elapsed, np.tile(alone.elapsed, 2))
    np.testing.assert_array_equal(replace(motion, begins=None).elapsed[[first, third]], 0.0)


def test_smoothing_a_prediction_keeps_runs_apart_too():
    time = np.concatenate([np.arange(0, 3, 0.004), np.arange(5, 9, 0.004)])
    samples = preprocess([sines(time)], TEN_HZ)
    steps = np.zeros_like(samples.motion.q)
    steps[samples.motion.starts[1] :] = 1.0
    np.testing.assert_allclose(smooth(samples, steps), steps, atol=1e-9)


def test_jittered_stamps_are_put_on_an_even_grid():
    rng = np.random.default_rng(0)
    time = np.arange(0, 8, 0.01) + rng.uniform(-0.003, 0.003, 800)
    log = sines(time, (1.0,))
    motion = preprocess([log], TEN_HZ).motion
    steps = np.diff(motion.time)
    np.testing.assert_allclose(steps, steps[0], rtol=1e-6)
    np.testing.assert_allclose(motion.q[:, 0], np.sin(2 * np.pi * motion.time), atol=2e-3)
    # taken as if they were even, the same samples are wrong by ten times as much
    even = replace(log, time=time[0] + np.arange(800) * np.diff(time).mean())
    wrong = preprocess([even], TEN_HZ).motion
    assert np.abs(wrong.q[:, 0] - np.sin(2 * np.pi * wrong.time)).max() > 5e-3


def test_the_period_of_even_and_of_jittered_stamps():
    time = np.arange(0, 1, 0.01)
    assert uniform_period(time) == pytest.approx(0.01)
    alternating = np.cumsum(np.tile([0.01, 0.012], 100))  # 10 or 12 ms, as the UR10e's controller stamps
    assert uniform_period(alternating) == pytest.approx(0.011, rel=1e-2)


def test_short_runs_are_dropped_and_long_ones_kept():
    time = np.concatenate([np.arange(0, 3, 0.004), np.arange(5, 5.2, 0.004), np.arange(6, 9, 0.004)])
    samples = preprocess([sines(time)], TEN_HZ)
    assert len(samples.motion.starts) == 2
    assert not ((samples.motion.time > 4) & (samples.motion.time < 5.5)).any()


def test_no_run_long_enough_is_an_error_that_says_how_long_it_must_be():
    time = np.concatenate([k + np.arange(0, 0.2, 0.004) for k in range(5)])
    with pytest.raises(LogError, match=r"^log sines: .*lasts 0\.196 s; .* 10 Hz .* at least 0\.3 s"):
        preprocess([sines(time)], TEN_HZ)


def test_a_sample_alone_between_gaps_is_a_run_too_short():
    whole = sines(np.arange(0, 3, 0.004))
    alone = preprocess([replace(whole, time=np.r_[-5.0, whole.time[1:]])], TEN_HZ)
    np.testing.assert_array_equal(
        alone.motion.time, preprocess([whole.select(slice(1, None))], TEN_HZ).motion.time
    )
    with pytest.raises(LogError, match="the longest run without a gap lasts 0 s"):
        preprocess([whole.select(slice(0, 1))], TEN_HZ)


def test_without_a_filter_samples_stay_and_accelerations_are_needed():
    log = sines(np.arange(0, 3, 0.004))
    with pytest.raises(LogError, match=r"sines: .* vdot1\.\.vdot2"):
        preprocess([log], Conditioning(cutoff_hz=0))
    full = replace(log, vdot=log.v)
    samples = preprocess([full, full], Conditioning(cutoff_hz=0))
    np.testing.assert_array_equal(samples.tau, np.vstack([log.tau, log.tau]))
    np.testing.assert_array_equal(samples.motion.starts, [0, log.samples])
    assert samples.moving.all()
    assert smooth(samples, samples.tau) is samples.tau


def test_a_prediction_is_smeared_like_the_measurement():
    # friction steps at a reversal; the filter smears the measured step, so the predicted one must be smeared
    log = sines(np.arange(0, 20, 0.004), (0.25,))
    samples = preprocess([replace(log, tau=np.sign(log.v))], TEN_HZ)
    predicted = np.sign(samples.motion.v)
    sharp = np.sqrt(np.mean((samples.tau - predicted) ** 2))
    smeared = np.sqrt(np.mean((samples.tau - smooth(samples, predicted)) ** 2))
    assert smeared < 0.5 * sharp


def at_rates(*steps: float) -> list[MotionLog]:
    return [sines(np.arange(0, 8, step)) for step in steps]


def test_logs_of_several_rates_are_one_rate_that_of_the_slowest():
    fast, slow = at_rates(0.002, 0.01)
    samples, alone = preprocess([fast, slow], TEN_HZ), preprocess([slow], TEN_HZ)
    first, second = samples.motion.runs()
    assert samples.period == pytest.approx(0.01) == alone.period
    for key in ("time", "q", "v", "vdot"):
        np.testing.assert_array_equal(getattr(samples.motion, key)[second], getattr(alone.motion, key))
    # what was put on the coarser grid is still the motion; at the filter's own error
    truth = preprocess([fast], TEN_HZ)
    for key in ("q", "v", "vdot"):
        own = getattr(samples.motion, key)[first]
        expected = [
            np.interp(samples.motion.time[first], truth.motion.time, x) for x in getattr(truth.motion, key).T
        ]
        assert np.abs(own - np.transpose(expected)).max() < 1e-3 * np.abs(own).max()
    moving = np.mean(samples.moving[first]), np.mean(truth.moving)
    assert moving[0] == pytest.approx(moving[1], abs=0.02) and moving[0] < 1


def test_on_a_coarser_grid_a_joint_slides_where_it_did_before_and_after():
    time = np.arange(6) * 0.004
    flags = np.array([[True], [True], [False], [True], [True], [True]])
    values = [np.arange(6.0)[:, None] for _ in range(4)]
    part = _thinned((time, *values, flags, ~flags), 0.006)
    np.testing.assert_allclose(part[0], [0.0, 0.006, 0.012, 0.018])
    # at 6 ms it slides at 4 and not at 8, where its torque is lost
    assert part[5][:, 0].tolist() == [True, False, False, True] == (~part[6][:, 0]).tolist()


def test_what_is_no_measurement_stays_so_at_another_rate():
    fast, slow = at_rates(0.002, 0.01)
    held = fast.tau.copy()
    held[2000:2400] = held[2000]
    fast = replace(fast, tau=held)
    samples = preprocess([fast, slow], TEN_HZ)
    lost = samples.unknown[samples.motion.runs()[0]].all(axis=1)
    time = samples.motion.time[samples.motion.runs()[0]]
    assert lost[(time > 4.0) & (time < 4.8)].all() and not lost[(time < 3.8) | (time > 5.0)].any()


def test_each_run_passes_the_filter_of_its_own_rate():
    """Samples of two rates, as pieces of several logs are when they are put side by side."""
    parts = [preprocess([log], TEN_HZ) for log in at_rates(0.004, 0.01)]
    motion = Motion.joined([part.motion for part in parts])
    both = replace(
        parts[0],
        motion=motion,
        tau=np.concatenate([part.tau for part in parts]),
        moving=np.concatenate([part.moving for part in parts]),
        spans=None,
    )
    for of in (lambda s: smooth(s, np.sign(s.motion.v)), independent_rows):
        np.testing.assert_allclose(of(both), np.concatenate([of(part) for part in parts]), atol=1e-9)


def filtered_by_its_driver(log: MotionLog, corner: float, noise: float = 0.0, seed: int = 0) -> MotionLog:
    """The log with v of a first-order low-pass, as a controller forms it of its encoders, and noise on it."""
    a, v = np.exp(-2 * np.pi * corner * log.period), log.v.copy()
    for k in range(1, len(v)):
        v[k] = a * v[k - 1] + (1 - a) * log.v[k]
    return replace(log, v=v + noise * np.random.default_rng(seed).normal(size=v.shape))


@pytest.mark.parametrize("corner", [30.0, 60.0])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_speed_that_its_driver_filters_is_moved_to_where_it_belongs(corner: float, seed: int) -> None:
    log = sines(np.arange(0, 20, 0.004))
    late = filtered_by_its_driver(log, corner, 0.02, seed)
    # of its group delay a step of the log counts to the sample before: exp(-wT) / (1 - exp(-wT)) steps
    a = np.exp(-2 * np.pi * corner * 0.004)
    assert late.velocity_lag == pytest.approx(0.004 * a / (1 - a), abs=1e-4)
    motion, truth = preprocess([late], TEN_HZ).motion, preprocess([log], TEN_HZ).motion
    for j, hz in enumerate((0.7, 2.0)):
        for key in ("v", "vdot"):
            own, right = (phase_of(m.time, getattr(m, key)[:, j], hz) for m in (motion, truth))
            assert np.sin(own - right) == pytest.approx(0.0, abs=2 * np.pi * hz * 3e-4)


@pytest.mark.parametrize("seconds", [0.02, 0.045, 0.053])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_tracking_filters_long_lag_is_found_though_the_farthest_that_is_tried_is_near_it(
    seconds: float, seed: int
) -> None:
    log, noise = sines(np.arange(0, 40, 0.004), (0.3, 0.5)), np.random.default_rng(seed)
    moved = np.stack([np.interp(log.time - seconds, log.time, v) for v in log.v.T], axis=1)
    late = replace(log, v=moved + 0.3 * noise.normal(size=moved.shape))
    assert late.velocity_lag == pytest.approx(seconds, abs=3e-3)


def test_a_speed_that_is_in_time_or_leads_or_is_the_derivative_stays() -> None:
    log = sines(np.arange(0, 20, 0.004))
    noisy = replace(log, v=log.v + 0.02 * np.random.default_rng(5).normal(size=log.v.shape))
    assert log.velocity_lag == pytest.approx(0.0, abs=1e-4) and abs(noisy.velocity_lag) < 1e-4
    early = replace(log, v=np.stack([np.interp(log.time + 0.006, log.time, v) for v in log.v.T], axis=1))
    assert early.velocity_lag == pytest.approx(-0.006, abs=2e-4)
    np.testing.assert_array_equal(repaired(recorded(early), early.velocity_lag).v, early.v)
    assert MotionLog.from_arrays(log.time, log.q, log.tau).velocity_lag == 0.0
    # sweeps at steady speeds, rounded: what differs is the same all through a sweep, and fits some lag by chance
    rng = np.random.default_rng(1)
    speeds = np.repeat(rng.uniform(-0.7, 0.7, (40, 4)), 100, axis=0)
    times = 0.004 * np.arange(4000) + np.repeat(np.arange(40.0), 100)
    places = np.round(np.tile(0.004 * np.arange(100), 40)[:, None] * speeds / 1.2e-5) * 1.2e-5
    sweeps = MotionLog(times, places, np.round(speeds / 1e-3) * 1e-3, speeds, name="sweeps")
    assert sweeps.velocity_lag == 0.0
    # at a steady speed nothing tells
    steady = replace(log, q=np.outer(log.time, [1.0, 0.5]), v=np.tile([1.0, 0.5], (len(log.time), 1)))
    assert steady.velocity_lag == 0.0


def test_a_late_speed_is_moved_run_by_run_and_never_beyond_its_end() -> None:
    time = np.concatenate([np.arange(0, 8, 0.004), np.arange(20, 28, 0.004), [40.0, 40.004]])
    log = sines(time)
    moved = repaired(recorded(log), 0.01).v
    assert len(log.runs()) == 3
    for run in log.runs()[:2]:
        inside = slice(run.start, run.stop - 3)
        expected = sines(log.time[inside] + 0.01).v
        np.testing.assert_allclose(moved[inside], expected, atol=1e-3 * np.abs(expected).max())
        np.testing.assert_allclose(moved[run][-2:], np.tile(log.v[run][-1], (2, 1)), rtol=1e-9)
    np.testing.assert_array_equal(moved[-2:], log.v[-2:])


def test_part_of_a_run_is_conditioned_as_in_the_whole() -> None:
    log = filtered_by_its_driver(sines(np.arange(0, 20, 0.004)), 30.0, 0.5)
    log.tau[[2050, 2119], 1] += 50.0
    part, alone = (cut(slice(2000, 2120)) for cut in (log.stretch, log.select))
    # half a second says nothing of a lag, and less of what lies far out
    assert alone.velocity_lag == 0.0
    assert part.velocity_lag == log.velocity_lag > 0.003
    whole, own = (preprocess([x], TEN_HZ) for x in (log, part))
    # what lies beside the last of its rows is in the whole alone
    mended_whole, mended_part, mended_alone = (mended(x.record).tau for x in (log, part, alone))
    np.testing.assert_array_equal(mended_part, mended_whole[2000:2120])
    assert (mended_alone[-1] != mended_part[-1]).any()
    # but for what the filter's ends cost
    inside = np.searchsorted(whole.motion.time, own.motion.time[8:-8] - 1e-6)
    for name, near in (("q", 0.01), ("v", 0.3)):
        expected = getattr(whole.motion, name)[inside]
        np.testing.assert_allclose(getattr(own.motion, name)[8:-8], expected, atol=near)
    np.testing.assert_allclose(own.tau[8:-8], whole.tau[inside], atol=0.02 * np.abs(log.tau[:2000]).max())
    np.testing.assert_array_equal(part.tau, log.tau[2000:2120])


def test_a_lag_that_is_not_felt_below_the_corner_is_left() -> None:
    log = filtered_by_its_driver(sines(np.arange(0, 20, 0.002)), 60.0)
    in_time = replace(log)
    vars(in_time)["velocity_lag"] = 0.0
    assert 0.0015 < log.velocity_lag < 0.0024
    for corner, felt in ((3.0, False), (8.0, True)):
        how = Conditioning(cutoff_hz=corner)
        (own, left) = (preprocess([x], how).motion.v for x in (log, in_time))
        assert (np.abs(own - left).max() > 1e-3) == felt, corner


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_rows_that_repeat_the_one_before_do_not_hide_that_a_speed_is_late(seed: int) -> None:
    log = filtered_by_its_driver(sines(np.arange(0, 20, 0.005), (0.2, 0.3, 0.4)), 45.0, 0.002, seed)
    kept = np.arange(log.samples)
    for k in np.flatnonzero(np.random.default_rng(seed).uniform(size=log.samples - 1) < 0.05) + 1:
        kept[k] = kept[k - 1]
    held = replace(log, q=log.q[kept], v=log.v[kept], tau=log.tau[kept])
    assert held.velocity_lag == pytest.approx(log.velocity_lag, abs=2e-4) and log.velocity_lag > 0.001


def test_joints_at_a_steady_speed_have_no_say_and_the_surest_say_most() -> None:
    log = sines(np.arange(0, 20, 0.004), (0.7, 2.0, 1.3))
    rng = np.random.default_rng(3)

    def late(seconds: tuple[float, float, float]) -> np.ndarray:
        pairs = zip(log.v.T, seconds, strict=True)
        return np.stack([np.interp(log.time - lag, log.time, v) for v, lag in pairs], axis=1)

    # the first differs and is noisy
    noisy = late((0.005, 0.006, 0.006))
    noisy[:, 0] += 0.5 * rng.normal(size=len(noisy))
    assert replace(log, v=noisy).velocity_lag == pytest.approx(0.006, abs=2e-4)
    # of five joints three turn steadily, whose rounding fits some lag by chance
    steady = np.array([0.31, 0.11, 0.23])
    q = np.round(np.outer(log.time, steady) / 1e-4) * 1e-4
    v = np.round(np.tile(steady, (len(q), 1)) / 1e-3) * 1e-3
    both = MotionLog(
        log.time,
        np.hstack([log.q[:, :2], q]),
        np.hstack([late((0.006,) * 3)[:, :2], v]),
        np.hstack([log.tau[:, :2], v]),
        name="both",
    )
    assert both.velocity_lag == pytest.approx(0.006, abs=2e-4)


def test_joints_that_do_not_agree_have_no_lag_in_common() -> None:
    log = sines(np.arange(0, 20, 0.004))
    early, late = (
        np.stack([np.interp(log.time - lag, log.time, v) for v in log.v.T], axis=1) for lag in (0.002, 0.006)
    )
    assert replace(log, v=late).velocity_lag == pytest.approx(0.006, abs=2e-4)
    assert replace(log, v=np.column_stack([early[:, 0], late[:, 1]])).velocity_lag == 0.0
