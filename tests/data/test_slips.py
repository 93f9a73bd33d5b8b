"""A position that steps and stays there while its rate goes on is told as a slip, with the time; nothing else is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rubbing_arm import run

from armloop.data.log import MotionLog, recorded
from armloop.data.plausibility import doubts
from armloop.data.slips import slips
from armloop.util.errors import LogError


def stepped(by: list[float], last: int | None = None) -> MotionLog:
    """A run whose positions step at 4 s, for so many samples or from then on."""
    log = run(1, 10.0)
    rows = slice(500, None if last is None else 500 + last)
    q = log.q.copy()
    q[rows] += by
    return replace(log, q=q)


@pytest.mark.parametrize("size", [0.01, -0.04])
def test_a_lasting_step_of_one_position_is_a_slip(size: float) -> None:
    log = recorded(stepped([0.0, size, 0.0]))
    (slip,) = slips(log)
    assert (slip.joint, slip.row) == (1, 500) and abs(slip.size - size) < 2e-4
    (words,) = [f"{found.columns} {found.text}" for found in doubts(log) if "slips" in found.text]
    assert words.startswith(f"column q2 steps by {slip.size:.3g} at 4 s and stays there, while v2 goes on")


def test_what_a_brake_stops_has_not_slipped_and_what_steps_at_rest_has() -> None:
    log = run(1, 10.0)
    rest = replace(log, q=log.q.copy(), v=log.v.copy())
    rest.q[500:, 1], rest.v[500:, 1] = log.q[499, 1], 0.0
    # where it is faster than it has braked from one sample to the next, it is not where its speed has led
    braked = replace(rest, q=rest.q + np.where(np.arange(len(rest.q)) < 500, 0.0, -5e-3)[:, None] * [0, 1, 0])
    assert list(slips(recorded(braked))) == []
    # what slipped before it braked is told all the same
    both = replace(
        braked, q=braked.q + np.where(np.arange(len(rest.q)) < 200, 0.0, 2e-3)[:, None] * [0, 1, 0]
    )
    assert [slip.row for slip in slips(recorded(both))] == [200]
    later = replace(rest, q=rest.q + np.where(np.arange(len(rest.q)) < 700, 0.0, 0.03)[:, None] * [0, 1, 0])
    (slip,) = slips(recorded(later))
    assert (slip.joint, slip.row) == (1, 700)


def test_a_large_slip_is_refused_with_the_time_and_what_it_is() -> None:
    with pytest.raises(
        LogError, match=r"column q2, row 501 steps by 0\.2 at 4 s and stays there.*slips; correct q2"
    ):
        stepped([0.0, 0.2, 0.0])


def test_a_rest_before_a_jump_is_no_encoder_that_is_stuck() -> None:
    """Where all joints jump, runs are joined; where one rests afterwards, too, it has slipped."""
    moves = run(2, 12.0)
    rows = np.arange(moves.samples)
    still = np.where(rows < 600, 300, rows)
    with pytest.raises(LogError, match=r"column q\d, row 601 .*jumps by .*leave a gap in time between runs"):
        MotionLog.from_arrays(moves.time, moves.q[still], moves.tau)
    q = moves.q.copy()
    q[300:600, 1], q[600:900, 1] = q[299, 1], q[299, 1] + 0.2
    q[900:, 1] += q[899, 1] - q[900, 1]
    with pytest.raises(LogError, match=r"column q2, row 601 .*jumps by 0\.2"):
        MotionLog.from_arrays(moves.time, q, moves.tau)
    q[600:900, 1] = moves.q[600:900, 1] + 0.2
    brief = moves.q.copy()
    brief[588:600, 1] = brief[588, 1]
    brief[600:, 1] += 0.3
    with pytest.raises(LogError, match=r"column q2, row 601 jumps by"):
        MotionLog.from_arrays(moves.time, brief, moves.tau)
    with pytest.raises(LogError, match=r"column q2, row 300 .*stands still to the last digit for 2\.4 s"):
        MotionLog.from_arrays(moves.time, q, moves.tau)


def test_what_is_repaired_happens_to_all_joints_or_is_the_motions_own_is_none() -> None:
    assert not list(slips(recorded(stepped([0.0, 0.03, 0.0], last=2))))
    assert not list(slips(recorded(stepped([0.03, 0.03, 0.03]))))
    assert not list(slips(recorded(stepped([0.0, 5e-4, 0.0]))))
    assert not list(slips(recorded(run(2, 10.0))))
    # what rounds its angles steps, too, again and again
    coarse = run(3, 10.0)
    assert not list(slips(recorded(replace(coarse, q=np.round(coarse.q / 2e-3) * 2e-3))))
    assert not list(slips(replace(recorded(stepped([0.0, 0.03, 0.0])), derived=True)))
