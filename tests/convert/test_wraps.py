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
    q = np.stack([wrapped(angle, least), 0.1 * angle, wrapped(angle, least)], axis=1)
    found, counts = unwrapped(q, np.array([True, True, False]))
    assert counts[0] >= 4 and counts[1:] == [0, 0]
    np.testing.assert_allclose(found[:, 0] - found[0, 0], angle - angle[0], atol=1e-12)
    np.testing.assert_array_equal(found[:, 1:], q[:, 1:])


def test_what_changed_between_two_runs_stays() -> None:
    """A joint that may turn more than once stands somewhere else when the next run begins."""
    run = np.linspace(0.0, 3.0, 40)
    q = wrapped(np.concatenate([run + 1.0, run + 1.0 - TURN + 0.1]) + 0.5)[:, None]
    found, counts = unwrapped(q, np.array([True]), [0, 40])
    assert counts == [2]
    for part in (slice(0, 40), slice(40, 80)):
        assert found[part][0] == q[part][0] and np.abs(np.diff(found[part], axis=0)).max() < 0.1
    every, _ = unwrapped(q, np.array([True]))
    assert np.abs(every[40:] - found[40:]).max() > 6.0


@pytest.mark.parametrize("turns", [0.5, 1.25, -0.75])
def test_a_jump_of_no_whole_turn_stays(turns: float) -> None:
    q = np.linspace(0.0, 1.0, 50)[:, None] + TURN * turns * (np.arange(50) > 20)[:, None]
    found, counts = unwrapped(q, np.array([True]))
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
