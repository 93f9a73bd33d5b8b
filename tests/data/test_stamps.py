"""Rows whose stamps nearly coincide: which of them are taken to be one, and what becomes of a log that has some."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic import fourier_motion

from armloop.data.log import MotionLog, differentiated
from armloop.data.motion import Motion, Samples
from armloop.data.signals import Conditioning, preprocess
from armloop.data.stamps import bridged, coincident

TIME = np.arange(40) * 0.01
WHOLE = [slice(0, 40)]


def line(time: np.ndarray) -> np.ndarray:
    return np.column_stack([2.0 * time, -time])


def test_of_a_group_the_row_nearest_to_its_neighbours_line_is_kept() -> None:
    """Row 10 was taken before row 11 and stamped with it; rows 20 and 21 came a step late, with row 22."""
    time, q = TIME.copy(), line(TIME)
    time[10] = time[11] - 1e-6
    time[20], time[21] = time[22] - 2e-6, time[22] - 1e-6
    assert coincident(time, q, WHOLE).tolist() == [10, 20, 21]


def test_a_log_that_changes_its_rate_has_no_such_rows() -> None:
    """1 kHz while the arm moves and 100 Hz while it rests, as many rows of either, back and forth."""
    steps = np.tile(np.repeat([0.001, 0.01], 100), 3)
    time = np.concatenate([[0.0], np.cumsum(steps)])
    assert len(coincident(time, line(time), [slice(0, len(time))])) == 0
    # pairs throughout, and bursts of ten with a pause after each, are of one instant each
    pairs = np.cumsum(np.tile([1e-6, 0.01], 100))
    assert len(coincident(pairs, line(pairs), [slice(0, 200)])) == 100 - 1
    bursts = np.cumsum(np.tile([*[1e-4] * 9, 0.0091], 20))
    assert len(coincident(bursts, line(bursts), [slice(0, 200)])) > 0.8 * 200


def test_three_such_rows_are_said_and_two_are_none() -> None:
    motion = fourier_motion(5.0, 200.0, 1)
    time, rows = motion.time.copy(), [100, 300, 500]
    for many, k in enumerate(rows, 1):
        time[k] = time[k + 1] - 1e-6
        said = [
            x for x in MotionLog(time, motion.q, motion.v, motion.vdot, name="run").doubts() if "nearer" in x
        ]
        assert len(said) == int(many == 3)
    assert "nearer to another than 25% of the usual step, 3 in all, 1e-06 s at the least" in said[0]


def test_nearly_is_a_quarter_of_the_mean_step() -> None:
    for part, found in ((0.26, []), (0.23, [10])):
        time = TIME.copy()
        time[10] = time[11] - part * 0.01
        assert coincident(time, line(TIME), WHOLE).tolist() == found


def test_the_first_and_the_last_row_of_a_run_stay_and_runs_are_apart() -> None:
    time, q = TIME.copy(), line(TIME)
    time[1], time[38] = time[0] + 1e-6, time[39] - 1e-6
    assert coincident(time, q, WHOLE).tolist() == [1, 38]
    time = np.where(np.arange(40) < 20, TIME, 5.0 + TIME)
    time[19], time[21] = time[18] + 1e-6, time[20] + 1e-6
    assert coincident(time, q, [slice(0, 20), slice(20, 40)]).tolist() == [18, 21]
    assert coincident(np.array([0.0, 1e-6, 1.0]), np.zeros((3, 1)), [slice(0, 3)]).tolist() == []


def test_what_lies_beside_takes_their_place() -> None:
    x = np.array([[0.0, 4.0], [9.0, 9.0], [3.0, 1.0]])
    found = bridged(x, np.array([1]), np.array([0.0, 1.0, 3.0]))
    assert found.tolist() == [[0.0, 4.0], [1.0, 3.0], [3.0, 1.0]] and x[1, 0] == 9.0


def path_of(motion: Motion) -> tuple[np.ndarray, ...]:
    return motion.q, motion.v, motion.vdot


@pytest.mark.parametrize("near", [1e-9, 1e-6, 1e-4])
def test_stamps_that_nearly_coincide_spoil_no_other_row(near: float) -> None:
    motion, rng = fourier_motion(20.0, 200.0, 1), np.random.default_rng(2)
    q = motion.q + 1e-5 * rng.standard_normal(motion.q.shape)
    # of a v so quiet that it is not left for q differentiated
    v, tau = (x + 0.004 * rng.standard_normal(x.shape) for x in (motion.v, motion.vdot))
    time = motion.time.copy()
    late = np.arange(50, len(time) - 50, 100)
    time[late] = time[late + 1] - near
    logs = [(motion.time, motion.q, motion.v, motion.vdot), (motion.time, q, v, tau), (time, q, v, tau)]
    true, honest, jittered = (preprocess([MotionLog(*of, name="run")], Conditioning()) for of in logs)

    def error(samples: Samples) -> np.ndarray:
        given, exact = (np.stack([*path_of(s.motion), s.tau]) for s in (samples, true))
        return np.sqrt(np.mean((given - exact) ** 2, axis=(1, 2)))

    # a row in a hundred is given up, and is a line between its neighbours
    assert (error(jittered) < 1.05 * error(honest)).all()


def test_rates_across_rows_that_nearly_coincide_are_those_of_the_path() -> None:
    rng = np.random.default_rng(3)
    time, q = TIME.copy(), line(TIME) + 1e-5 * rng.standard_normal((40, 2))
    time[10] = time[11] - 1e-8
    np.testing.assert_allclose(differentiated(time, q, "run"), np.tile([2.0, -1.0], (40, 1)), atol=0.02)
