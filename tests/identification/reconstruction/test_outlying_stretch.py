"""A short stretch of the training logs of which a model leaves far more than of all the rest is said; model error is not."""

import warnings
from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import fourier_motion, friction, measured, rigid_torque, standing, three_axis

from armloop.data.motion import Samples
from armloop.identification.reconstruction import Options, outlying_stretch, reconstruct
from armloop.identification.reconstruction.outlying_stretch import Burst, doubtful, outlying_stretches
from armloop.util.arrays import Array
from armloop.util.errors import InputWarning

PERIOD = 0.01


def samples(seconds: float = 40.0) -> Samples:
    """Of two joints that slide all the time, of torques of 10 N·m."""
    N = round(seconds / PERIOD)
    motion = replace(standing(N, 2), time=PERIOD * np.arange(N))
    return Samples(motion, np.full((N, 2), 10.0), np.ones((N, 2), dtype=bool), PERIOD, cutoff_hz=10.0)


def usual(log: Samples) -> Array:
    """A residual of amplitude 1 that comes back every second: at most 0.98 over any window of 0.15 s."""
    return np.sin(2 * np.pi * log.motion.time)[:, None] * np.ones(2)


def found(
    logs: Sequence[Samples],
    residuals: Sequence[Array],
    monkeypatch: pytest.MonkeyPatch,
    slow: tuple[float, float] = (0.0, 0.0),
) -> list[Burst]:
    """With joints that are slower than it is known of at some times, s."""
    left = {id(log): residual for log, residual in zip(logs, residuals, strict=True)}
    monkeypatch.setattr(outlying_stretch, "residual", lambda model, one: left[id(one)])

    def too_slow(model: Any, one: Samples) -> np.ndarray:
        time = one.motion.time
        return np.broadcast_to(((time > slow[0]) & (time < slow[1]))[:, None], one.moving.shape)

    monkeypatch.setattr(outlying_stretch, "too_slow", too_slow)
    model: Any = SimpleNamespace(arm=SimpleNamespace(n=2))
    return outlying_stretches(model, [("run", log) for log in logs])


def with_burst(log: Samples, start: float, end: float, size: float) -> Array:
    """The usual residual, and more at joint 2."""
    t, left = log.motion.time, usual(log)
    left[(t >= start) & (t < end), 1] = size
    return left


@pytest.mark.parametrize(
    ("start", "end", "size", "said"),
    [
        (20.0, 20.5, 8.0, True),
        (20.0, 20.5, 5.1, True),
        (20.0, 20.5, 4.8, False),  # not five times the most of the rest
        (20.0, 22.5, 8.0, True),
        (20.0, 23.5, 8.0, False),  # no short stretch
        (0.3, 0.8, 8.0, False),  # how the motion begins
        (39.2, 39.8, 8.0, False),
    ],
)
def test_a_short_stretch_that_stands_out_is_found(
    start: float, end: float, size: float, said: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    logs = [samples(), samples()]
    bursts = found(logs, [usual(logs[0]), with_burst(logs[1], start, end, size)], monkeypatch)
    assert [(burst.log, burst.joint) for burst in bursts] == ([(1, 1)] if said else [])
    for burst in bursts:
        # to the window, and the sine's 0.98 at most
        assert (burst.start, burst.end) == pytest.approx((start, end), abs=0.15)
        assert burst.peak == pytest.approx(size) and burst.times == pytest.approx(size / 0.98, rel=0.02)


def test_what_comes_back_is_no_outlier_nor_what_is_next_to_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    log = samples()
    twice = np.maximum(with_burst(log, 10.0, 10.5, 8.0), with_burst(log, 30.0, 30.5, 8.0))
    assert found([log], [twice], monkeypatch) == []
    # nor what is half as large at another time
    half = np.maximum(with_burst(log, 10.0, 10.5, 4.0), with_burst(log, 30.0, 30.5, 8.0))
    assert found([log], [half], monkeypatch) == []
    # in another log, too
    assert found([log, samples()], [with_burst(log, 20.0, 20.5, 8.0)] * 2, monkeypatch) == []
    one = with_burst(log, 20.0, 20.5, 8.0)
    assert found([log], [0.05 * one], monkeypatch) == [] and found([log], [0.07 * one], monkeypatch)
    # nor where the joint does not slide, nor where too little is known of the rest, nor of samples that are no series
    resting = replace(log, moving=log.moving & (np.abs(log.motion.time - 20.0) > 1.0)[:, None])
    assert found([resting], [one], monkeypatch) == []
    assert found([log], [one], monkeypatch, slow=(19.5, 21.0)) == []
    short = samples(14.0)
    assert found([short], [with_burst(short, 7.0, 7.5, 8.0)], monkeypatch) == []
    assert found([replace(log, cutoff_hz=0.0)], [one], monkeypatch) == found([], [], monkeypatch) == []


def test_how_a_run_ends_hides_no_burst_within_it(monkeypatch: pytest.MonkeyPatch) -> None:
    log = samples()
    left = with_burst(log, 20.0, 20.5, 8.0)
    left[:30, 1] = 50.0
    assert found([log], [left], monkeypatch) == []
    monkeypatch.setattr(Samples, "at_an_end", property(lambda one: one.motion.time < 0.4))
    (burst,) = found([log], [left], monkeypatch)
    assert burst.peak == pytest.approx(8.0)


def test_several_joints_at_one_time_are_one_line() -> None:
    bursts = [Burst(0, "a", 1, 2.0, 2.6, 9.0, 18.6), Burst(0, "a", 0, 1.8, 2.5, 7.73, 18.7)]
    later = Burst(0, "a", 2, 3.0, 3.5, 1.0, 4.0)
    units = ["N*m", "N", "N*m"]
    (line,) = doubtful(bursts, units)
    assert "as where something ran into the arm or a brake closed: cut it out" in line
    left = "the model leaves 7.73 N·m at joint 1 and 9 N at joint 2, 19 and 19 times the most"
    assert line.startswith(f"a: from 1.8 to 2.6 s {left}")
    assert len(doubtful([*bursts, later], units)) == 2
    # another log of the same name
    assert len(doubtful([*bursts, bursts[0]._replace(log=1)], units)) == 2


@pytest.mark.parametrize("struck", [True, False])
def test_reconstruct_says_so(struck: bool) -> None:
    motion = fourier_motion(30.0, 100.0, 1)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)
    if struck:
        tau[(motion.time >= 12.0) & (motion.time < 12.5), 1] += 20.0
    quick = Options(parts=False, standard_errors=False)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", InputWarning)
        reconstruct([measured(motion, tau, 1)], three_axis(), library="rigid-body", options=quick)
    lines = [str(one.message) for one in caught if "cut it out of the training log" in str(one.message)]
    assert len(lines) == struck and all(
        "at joint 2" in line and line.startswith("run: from 1") for line in lines
    )
