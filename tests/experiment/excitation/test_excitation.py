"""Poses, segments and trajectories keep within their ranges and are what they say."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from armloop.experiment.excitation import (
    MotionRanges,
    constant_velocity_segments,
    fourier_reference,
    paper_reference,
    ranges_with,
    read_reference,
    speeds,
    static_poses,
    static_segments,
    within,
    write_reference,
)
from armloop.experiment.sampling import inverse_dynamics_samples
from armloop.robot.arm import load_arm
from armloop.robot.kinematics import nominal_parameters, regressor
from armloop.util.errors import InputError, LogError

RANGES = MotionRanges(
    np.array([-1.5, -1.0, 0.0]),
    np.array([1.5, 1.0, 0.2]),
    np.array([1.5, 1.5, 0.1]),
    np.array([3.0, 3.0, 0.2]),
)
PI = np.pi
RANGES_3 = MotionRanges(
    np.array([-PI / 2, -PI / 3, -PI]), np.array([PI / 2, PI / 3, PI]), np.full(3, PI / 2), np.full(3, PI)
)


@pytest.mark.parametrize("seed", range(8))
def test_fourier_trajectories_use_the_ranges_and_keep_within(seed):
    reference = fourier_reference(RANGES, 20.0, seed)
    assert within(RANGES, [reference])
    q, v, vdot = reference.evaluate(np.arange(0.0, 20.0, 0.005))
    # Each joint reaches 0.97 of the tightest of its three limits.
    use = np.maximum.reduce(
        [
            np.ptp(q, axis=0) / (RANGES.upper - RANGES.lower),
            np.abs(v).max(axis=0) / RANGES.velocity,
            np.abs(vdot).max(axis=0) / RANGES.acceleration,
        ]
    )
    assert_allclose(use, 0.97, atol=5e-3)


def test_fourier_derivatives_and_start_from_rest():
    reference = fourier_reference(RANGES, 12.0, 3, harmonics=5)
    t = np.arange(0.0, 12.0, 1e-3)
    q, v, vdot = reference.evaluate(t)
    assert_allclose(np.gradient(q, t, axis=0)[1:-1], v[1:-1], atol=2e-5)
    assert_allclose(np.gradient(v, t, axis=0)[1:-1], vdot[1:-1], atol=2e-3)
    assert_allclose(v[0], 0)
    assert_allclose(vdot[0], 0)


def test_a_seed_is_a_trajectory():
    first, again, other = (fourier_reference(RANGES, 10.0, seed).evaluate([3.0])[0] for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.allclose(first, other)


def test_paper_reference():
    """Fig. 14 with k = 0.2, 0.3, 0.4 rad, written out; |q| <= 76 deg, |v| <= 1.02 rad/s; period 20 s."""
    t = np.linspace(0.0, 40.0, 4001)
    k1, k2, k3, w1, w2, w3 = 0.2, 0.3, 0.4, 0.5 * np.pi, 0.4 * np.pi, 0.3 * np.pi
    q, v, _ = paper_reference().evaluate(t)
    assert_allclose(
        q[:, 0], k1 * np.cos(w1 * t) + k2 * np.sin(w2 * t) + k3 * np.cos(w3 * t) - k1 - k3, atol=1e-12
    )
    assert_allclose(q[:, 1], k1 * np.sin(w1 * t) + k2 * np.cos(w2 * t) + k3 * np.sin(w3 * t) - k2, atol=1e-12)
    assert_allclose(
        q[:, 2], k1 * np.cos(w1 * t) + k2 * np.cos(w2 * t) + k3 * np.cos(w3 * t) - k1 - k2, atol=1e-12
    )
    assert_allclose(q[:2001], q[2000:], atol=1e-9)
    assert np.rad2deg(np.abs(q).max()) < 77
    assert np.abs(v).max() < 1.02


def test_static_poses_fill_the_ranges():
    poses = static_poses(RANGES, 200, 0)
    unit = (poses - RANGES.lower) / (RANGES.upper - RANGES.lower)
    assert unit.min() >= 0 and unit.max() <= 1
    counts = np.stack([np.histogram(column, 5, (0, 1))[0] for column in unit.T])
    assert counts.min() >= 35


def test_static_segments_pass_each_pose_both_ways():
    segments = static_segments(RANGES, 40, np.array([2e-3, 2e-3, 1e-4]), 0.3, 1)
    assert len(segments) == 80
    signs = set()
    for there, back in zip(segments[::2], segments[1::2], strict=True):
        assert_allclose(there.velocity, -back.velocity)
        assert_allclose(there.evaluate(0.15)[0], back.evaluate(0.15)[0], atol=1e-12)
        assert_allclose(np.abs(there.velocity), [2e-3, 2e-3, 1e-4])
        signs.add(tuple(np.sign(there.velocity)))
    assert len(signs) == 8


def test_dwelling_is_one_still_segment_per_pose():
    segments = static_segments(RANGES, 10, 0.0, 0.3, 1)
    assert len(segments) == 10
    assert not np.any([segment.velocity for segment in segments])


def test_constant_velocity_segments_cover_slow_and_fast():
    slowest = np.array([0.01, 0.01, 1e-3])
    segments = constant_velocity_segments(RANGES, 120, slowest, 0.3, 2)
    assert len(segments) == 120
    assert within(RANGES, segments)
    speed = np.abs([segment.velocity for segment in segments])
    assert np.all(speed >= slowest * (1 - 1e-9))
    assert np.all(speed.min(axis=0) < 2 * slowest)
    assert np.all(speed.max(axis=0) > 0.9 * RANGES.velocity)
    signs = {tuple(np.sign(segment.velocity)) for segment in segments}
    assert len(signs) == 8


def test_ranges_of_an_arm_without_stated_ones():
    arm = load_arm("scara")
    ranges = MotionRanges.of(arm)
    assert all(
        j.lower < low and high < j.upper
        for j, low, high in zip(arm.joints, ranges.lower, ranges.upper, strict=True)
    )
    assert_allclose(ranges.velocity, [1.25, 1.25, 0.25, 1.25])
    assert_allclose(speeds(arm, 2.0, 0.5), [2.0, 2.0, 0.5, 2.0])


@pytest.mark.parametrize(("lower", "upper"), [(2.0, np.inf), (-np.inf, -2.0)])
def test_a_joint_with_one_limit_moves_on_its_free_side(lower, upper):
    arm = load_arm("scara")
    arm = replace(arm, joints=tuple(replace(joint, lower=lower, upper=upper) for joint in arm.joints))
    ranges = ranges_with(arm, None)
    assert (lower < ranges.lower).all() and (ranges.upper < upper).all()
    assert_allclose(ranges.upper - ranges.lower, 0.9 * np.where(arm.revolute, 2 * np.pi, 0.2))


@pytest.mark.parametrize("bad", [{"lower": np.array([2.0, 0, 0])}, {"velocity": np.array([0.0, 1, 1])}])
def test_empty_ranges_are_refused(bad):
    fields = {key: getattr(RANGES, key) for key in ("lower", "upper", "velocity", "acceleration")}
    with pytest.raises(ValueError, match="must have"):
        MotionRanges(**(fields | bad))


def test_inverse_dynamics_samples():
    arm = load_arm("three_axis")
    logs = inverse_dynamics_samples(arm, RANGES_3, (100, 300, 400), seed=4)
    assert [len(logs[key].time) for key in ("static", "constant_velocity", "varying")] == [100, 300, 400]
    assert not logs["static"].v.any() and not logs["static"].vdot.any()
    assert logs["constant_velocity"].v.any() and not logs["constant_velocity"].vdot.any()
    varying = logs["varying"]
    tau = regressor(arm, varying.q, varying.v, varying.vdot) @ nominal_parameters(arm)
    assert_allclose(varying.tau, tau)
    assert np.abs(varying.q[:, 2]).max() > 3.0 and np.abs(varying.vdot).max() > 3.0


def test_noise_has_the_stated_ratio():
    arm = load_arm("three_axis")
    exact, noisy = (
        inverse_dynamics_samples(arm, RANGES_3, (10, 10, 20_000), 4, snr)["varying"]
        for snr in (None, (60, 40, 20))
    )
    for key, decibel in (("q", 60), ("v", 40), ("vdot", 20)):
        clean, dirty = getattr(exact, key), getattr(noisy, key)
        ratio = np.mean(clean**2, axis=0) / np.mean((dirty - clean) ** 2, axis=0)
        assert_allclose(10 * np.log10(ratio), decibel, atol=0.3)
    assert np.array_equal(exact.tau, noisy.tau)


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_a_reference_survives_its_file(tmp_path, suffix):
    made = fourier_reference(RANGES, 12.0, 5)
    path = tmp_path / f"reference{suffix}"
    assert write_reference(path, made, 100.0) == 1201
    read = read_reference(path, 3)
    assert read.duration == 12.0
    t = np.linspace(0.0, 12.0, 3457)
    # a quintic over 10 ms of a motion below 1 Hz
    for ours, theirs, size in zip(read.evaluate(t), made.evaluate(t), (1e-9, 1e-8, 1e-6), strict=True):
        assert_allclose(ours, theirs, atol=size)


def test_a_reference_rests_outside_its_table(tmp_path):
    write_reference(tmp_path / "r.csv", fourier_reference(RANGES, 6.0, 5), 50.0)
    read = read_reference(tmp_path / "r.csv", 3)
    q, v, vdot = read.evaluate([-1.0, 6.0, 9.0])
    assert_allclose(q, [read.q[0], read.q[-1], read.q[-1]])
    assert not v[[0, 2]].any() and not vdot[[0, 2]].any()
    assert_allclose(v[1], read.v[-1])


def _degrees(lines):
    return [lines[0]] + [
        ",".join([c[0], *(str(57.3 * float(x)) for x in c[1:4]), *c[4:]])
        for c in (x.split(",") for x in lines[1:])
    ]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda lines: [lines[0].replace("vdot2", "a2"), *lines[1:]], "column vdot2 is missing"),
        (
            lambda lines: [*lines[:3], lines[2], *lines[3:]],
            r"column time, row 3 \(line 4\): .* does not rise",
        ),
        (lambda lines: [lines[0], *lines[2:]], "a reference starts at time 0"),
        (lambda lines: lines[:2], "1 row; a reference has at least 2"),
        (_degrees, r"column v\d, row \d+ .*must be the rate of change of q"),
    ],
)
def test_faulty_references(tmp_path, change, says):
    path = tmp_path / "r.csv"
    write_reference(path, fourier_reference(RANGES, 6.0, 5), 50.0)
    path.write_text("\n".join(change(path.read_text().splitlines())) + "\n")
    with pytest.raises(LogError, match=says):
        read_reference(path, 3)


def test_stated_ranges():
    arm = load_arm("three_axis")
    ranges = ranges_with(arm, None, velocity=[1.0, 0.5, 0.25], lower=[-1, -1, -1])
    assert_allclose(ranges.acceleration, [2.0, 1.0, 0.5])
    assert_allclose(ranges.lower, -1)
    assert_allclose(ranges.upper, MotionRanges.of(arm).upper)
    assert_allclose(ranges_with(arm, RANGES_3, velocity=[1, 1, 1]).acceleration, np.pi)
    with pytest.raises(InputError, match="joint 'joint_2' would go from -3 to"):
        ranges_with(arm, None, lower=[-1, -3, -1])
    with pytest.raises(InputError, match="no motion is within the ranges: each range must have lower below"):
        ranges_with(arm, None, lower=[1, 1, 1], upper=[1, 1, 1])
