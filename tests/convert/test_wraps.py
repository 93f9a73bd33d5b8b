"""Angles that wrap after a turn are made continuous, and said to be; what only jumps is left to the reader of the log."""

import numpy as np
import pytest
from foreign_logs import bag, motion
from synthetic import three_axis

from armloop.convert import Answers, convert
from armloop.convert.wraps import unwrapped
from armloop.data.log import read_log, unchecked_log, write_log
from armloop.util.errors import LogError

TURN = 2 * np.pi


def wrapped(q: np.ndarray, least: float = -np.pi) -> np.ndarray:
    """From ``least`` to a turn more."""
    return (q - least) % TURN + least


@pytest.mark.parametrize("least", [-np.pi, 0.0])
def test_whole_turns_from_row_to_row_are_taken_out_of_what_turns(least: float) -> None:
    angle = 12.0 * np.sin(np.linspace(0.0, 5.0, 400))
    q = np.stack([wrapped(angle, least), 0.1 * angle], axis=1)
    found, counts = unwrapped(q)
    assert counts[0] >= 4 and counts[1] == 0
    np.testing.assert_allclose(found[:, 0] - found[0, 0], angle - angle[0], atol=1e-12)
    np.testing.assert_array_equal(found[:, 1], q[:, 1])


def test_what_changed_between_two_runs_stays(tmp_path) -> None:
    """A joint that may turn more than once stands a whole turn, or nearly, elsewhere when the next run begins."""
    log = motion()
    half, move = log.samples // 2, log.q[:, 0].copy()
    q = log.q.copy()
    q[half:, 0] += move[half - 1] - move[half] - TURN + 0.2
    found, counts = unwrapped(q, [0, half])
    assert counts == [0, 0, 0]
    np.testing.assert_array_equal(found, q)
    every, counts = unwrapped(q)
    assert counts == [1, 0, 0] and np.abs(every[half:, 0] - q[half:, 0] - TURN).max() < 1e-12
    # with its gap in a file
    time = log.time + 2.0 * (np.arange(log.samples) >= half)
    write_log(tmp_path / "two.csv", unchecked_log(time=time, q=q, v=log.v, tau=log.tau, name="two"))
    np.testing.assert_allclose(convert([tmp_path / "two.csv"]).log.q, q, atol=1e-6)


@pytest.mark.parametrize("turns", [0.5, 1.25, -0.75])
def test_a_jump_of_no_whole_turn_stays(turns: float) -> None:
    q = np.linspace(0.0, 1.0, 50)[:, None] + TURN * turns * (np.arange(50) > 20)[:, None]
    found, counts = unwrapped(q)
    assert counts == [0]
    np.testing.assert_array_equal(found, q)


def test_a_bag_of_joints_without_end_is_unwrapped_and_the_reader_of_a_log_says_who_does_it(tmp_path) -> None:
    log = motion()
    off = np.array([np.pi - log.q[:, 0].mean(), 0.0, 0.0])  # to where it wraps to and fro
    turning = unchecked_log(time=log.time, q=wrapped(log.q + off), v=log.v, tau=log.tau, name="raw")
    found = convert(
        [bag(tmp_path / "bag", turning, [0, 1, 2], kind="mcap")], arm=three_axis(), answers=Answers("N*m")
    )
    away = (found.log.q - log.q - off) / TURN
    np.testing.assert_allclose(away, np.round(away[0]) * np.ones_like(away), atol=1e-6)
    np.testing.assert_allclose(found.log.v, log.v, atol=1e-6)
    (note,) = [note for note in found.notes if "wrap" in note]
    assert note.startswith("angles wrap after a turn: q1 (") and note.endswith("times); unwrapped")
    write_log(tmp_path / "raw.csv", turning)
    with pytest.raises(
        LogError, match=r"column q1, row .*as where an angle wraps; armloop convert unwraps it"
    ):
        read_log(tmp_path / "raw.csv")
    np.testing.assert_allclose(
        convert([tmp_path / "raw.csv"]).log.q - log.q - off, TURN * np.round(away), atol=1e-6
    )
