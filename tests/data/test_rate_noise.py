"""A v with far more noise than q differentiated has is left: by its noise while the joints move, for a whole log."""

from __future__ import annotations

import numpy as np
import pytest

from armloop.data.log import MotionLog
from armloop.data.rate_noise import rate_noise
from armloop.data.recorded import Recorded
from armloop.data.signals import Conditioning, Speeds, preprocess

SIZE, HZ = np.array([0.5, 0.8]), np.array([0.3, 0.4])


def a_log(
    noise: float, counts: float = 0.0, rate: float = 250.0, seconds: float = 30.0, rest: float = 0.0
) -> MotionLog:
    """Two joints in sines, at rest for a part of the time, with noise of v and an encoder that rounds to counts."""
    rng, time = np.random.default_rng(4), np.arange(round(rate * seconds)) / rate
    moves = np.minimum(time, (1 - rest) * seconds)[:, None]
    phase = 2 * np.pi * HZ * moves
    q, v = SIZE * np.sin(phase), SIZE * 2 * np.pi * HZ * np.cos(phase) * (moves == time[:, None])
    tau = 3 * np.sin(phase) + 0.1 * rng.normal(size=q.shape)
    q = counts * np.round(q / counts) if counts else q + 1e-9 * rng.normal(size=q.shape)
    return MotionLog(time, q, v + noise * rng.normal(size=v.shape), tau)


@pytest.mark.parametrize("rest", [0.0, 0.8])
@pytest.mark.parametrize(
    ("noise", "counts", "worse"),
    [
        (0.03, 3.5e-4, True),  # differences of the counts themselves, cycle by cycle
        (0.03, 5e-3, False),  # what is rounded so coarsely is worse
        (1e-3, 1e-3, False),
        (0.015, 1e-4, True),  # of the octave 0.3 % of the speed: a controller that feeds it back feels it
        (2e-3, 0.0, False),  # far noisier, and not felt
        (0.0, 0.0, False),
    ],
)
def test_the_noisier_of_two_rates_is_left(noise: float, counts: float, worse: bool, rest: float) -> None:
    log = a_log(noise, counts, rest=rest)
    assert rate_noise(log.record).recorded_is_worse is worse
    said = [doubt for doubt in log.doubts() if "q is differentiated in their place" in doubt]
    assert len(said) == worse and (log.of_least_noise is log) is not worse
    if worse:
        assert log.of_least_noise.v_derived and log.of_least_noise.velocity_lag == 0.0
        assert not any("missing" in doubt for doubt in log.doubts())
        better = MotionLog.from_arrays(log.time, log.q, log.tau)
        for of in (
            lambda one: preprocess([one], Conditioning(8.5)).motion.v,
            lambda one: Speeds.of(one, 8.5).noise,
        ):
            np.testing.assert_array_equal(of(log), of(better))


def test_noise_is_told_as_a_standard_deviation_of_its_octave() -> None:
    """White noise, of which the octave above 5 Hz is a share, 5 Hz of 125; a Butterworth's octave holds about as much."""
    noise = rate_noise(a_log(0.05, 3.5e-4).record)
    np.testing.assert_allclose(noise.recorded, 0.05 * np.sqrt(5 / 125), rtol=0.25)
    assert (noise.differentiated < noise.recorded / 3).all()
    v, rates = (float(np.sqrt(np.prod(x))) for x in noise[:2])
    assert (
        f"have {v / rates:.2g} times" in noise.sentence()
        and f"({v:.2g} and {rates:.2g} rad/s)" in noise.sentence()
    )


def test_a_stretch_has_the_rates_of_its_log() -> None:
    log = a_log(0.03, 3.5e-4)
    part = log.stretch(slice(1000, 1600))
    np.testing.assert_array_equal(part.of_least_noise.v, log.of_least_noise.v[1000:1600])
    quiet = a_log(0.0)
    part = quiet.stretch(slice(1000, 1600))
    assert part.of_least_noise is part


@pytest.mark.parametrize(("rate", "seconds"), [(39.0, 30.0), (250.0, 1.5)])
def test_a_log_too_slow_or_too_short_tells_nothing(rate: float, seconds: float) -> None:
    log = a_log(0.05, rate=rate, seconds=seconds)
    assert len(rate_noise(log.record).recorded) == 0 and log.of_least_noise is log


def test_joints_at_rest_and_samples_that_are_no_time_series_tell_nothing() -> None:
    rng = np.random.default_rng(1)
    time, still = np.arange(3000) / 250, np.zeros((3000, 2))
    trembles = 1e-5 * rng.normal(size=still.shape)
    record = Recorded(time, trembles, 0.5 * rng.normal(size=still.shape), still, None, [slice(0, 3000)])
    # no joint of this moves, and yet what its encoder trembles has a rate
    assert not rate_noise(record).recorded_is_worse and len(rate_noise(record).recorded) == 0
    q, v = rng.uniform(-1, 1, (2, 3000, 2))
    log = MotionLog(time, 0.1 * q, 200 * v, q, vdot=v)
    assert rate_noise(log.record).recorded_is_worse and log.of_least_noise is log
