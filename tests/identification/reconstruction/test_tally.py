"""What a model leaves on held-out data, joint by joint, as plain means over the samples that count."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armloop.identification.reconstruction.tally import Tally, at_least


def tally(counts: list[list[int]], errors: list[list[float]]) -> Tally:
    """Blocks (B,) of joints (n,) with so many moving samples and such mean squared errors; a torque of RMS 2."""
    c, e = np.array(counts, dtype=float), np.array(errors)
    blocks = np.stack([c * e, c], axis=1)
    moving = np.array([(c * e).sum(axis=0), 4.0 * c.sum(axis=0), c.sum(axis=0)])
    rest = np.array([[9.0] * c.shape[1], [36.0] * c.shape[1], [1.0] * c.shape[1]])
    places = {
        "reversals": np.array([25.0 * c.sum(axis=0), c.sum(axis=0)]),
        "creeping": np.array([9.0 * c[0], c[0]]),
    }
    return Tally({0: np.array([rest, moving])}, blocks, int(c.sum()) + 1, places, {0: moving})


def test_rest_and_motion_are_scored_apart_and_together() -> None:
    score = tally([[30, 20], [10, 0]], [[1.0, 4.0], [5.0, 0.0]]).score()
    assert score.moving["rmse"] == pytest.approx([np.sqrt(80 / 40), 2.0])
    assert score.moving["nrmse"] == pytest.approx([np.sqrt(2.0) / 2, 1.0])
    assert score.standstill["rmse"] == [3.0, 3.0] and score.standstill["nrmse"] == [0.5, 0.5]
    assert score.overall["rmse"] == pytest.approx([np.sqrt(89 / 41), np.sqrt(89 / 21)])
    assert score.rms == pytest.approx([2.0, 2.0]) and score.samples == 61


def test_tallies_add_over_chunks_and_conditions() -> None:
    one, two = tally([[30]], [[1.0]]), tally([[10]], [[5.0]])
    sums, sliding = ({0: each[0], 3: 2 * each[0]} for each in (two.sums, two.sliding))
    both = one + Tally(sums, two.blocks, two.samples, two.places, sliding)
    np.testing.assert_array_equal(both.sums[0], one.sums[0] + two.sums[0])
    np.testing.assert_array_equal(both.sums[3], 2 * two.sums[0])
    np.testing.assert_array_equal(both.sliding[0], one.sliding[0] + two.sliding[0])
    np.testing.assert_array_equal(both.sliding[3], 2 * two.sliding[0])
    assert both.samples == 31 + 11 and both.blocks.shape == (2, 2, 1)
    assert both.places["reversals"].tolist() == [[1000.0], [40.0]]
    assert both.yardsticks() == {"worst": [None], "reversals": [5.0], "creeping": [3.0]}
    # neither of what was added has changed
    assert one.sums[0][1, 2, 0] == 30.0 and list(one.sums) == [0]


def test_the_baseline_is_that_of_the_worst_condition() -> None:
    one, two = tally([[30, 0]], [[1.0, 0.0]]), tally([[10, 0]], [[5.0, 0.0]])
    other = Tally({1: 9.0 * two.sums[0]}, two.blocks, two.samples, two.places, {1: two.sliding[0]})
    found = replace(one + other, sums={0: one.sums[0] + two.sums[0]}).baseline()
    assert found["rmse"] == [pytest.approx(np.sqrt(5.0)), None]
    assert found["rms"] == [pytest.approx(2.0), None]
    assert found["nrmse"] == [pytest.approx(np.sqrt(5.0) / 2), None]
    assert found["samples"] == 42 and found["worst"] == [None, None]
    # a joint that never turns round is known by nothing there
    assert found["reversals"] == [5.0, None] and found["creeping"] == [3.0, None]


def test_one_block_in_ten_exceeds_the_worst_of_those_with_samples_enough() -> None:
    errors = [[float(k + 1)] for k in range(11)]
    worst = tally([[20]] * 11, errors).worst()
    assert worst == [pytest.approx(np.sqrt(10.0))]
    assert tally([[20]] * 9, errors[:9]).worst() == [None]
    assert tally([[20]] * 10, errors[:10]).worst() == [pytest.approx(np.sqrt(9.1))]
    assert tally([[19]] + [[20]] * 9, errors[:10]).worst() == [None]


def test_blocks_are_relative_to_the_torque_of_the_joints_that_move_in_them() -> None:
    found = tally([[20, 20], [40, 19], [0, 5]], [[2.0, 6.0], [3.0, 99.0], [0.0, 1.0]]).relative_blocks()
    np.testing.assert_allclose(found, [(2.0 + 6.0) / 4 / 2, 3.0 / 4, np.nan])


def test_a_baseline_is_no_better_than_what_is_left_of_all_data() -> None:
    held = tally([[30, 20, 0]], [[1.0, 4.0, 0.0]]).baseline()
    whole = tally([[20, 20, 20]] * 10, [[4.0, 1.0, 0.25]] * 10)
    found = at_least(held, whole)
    assert found["rmse"] == pytest.approx([2.0, 2.0, 0.5])  # joint 3 moves in no held-out block
    assert found["nrmse"] == pytest.approx([1.0, 1.0, 0.25]) and found["rms"] == pytest.approx(
        [2.0, 2.0, 2.0]
    )
    assert found["worst"] == pytest.approx([2.0, 1.0, 0.5]) and found["samples"] == held["samples"]
    # of joint 3 nothing is known there but from all data
    assert found["reversals"] == [5.0, 5.0, 5.0] and found["creeping"] == [3.0, 3.0, 3.0]
    assert at_least(whole.baseline(), tally([[30, 20, 0]], [[1.0, 0.25, 0.0]]))["worst"] == pytest.approx(
        [2.0, 1.0, 0.5]
    )
    # where both are known, the larger error of the two
    less = tally([[20, 20, 20]], [[0.0, 0.0, 0.0]])
    less.places["reversals"][0] /= 25.0
    assert at_least(held, less)["reversals"] == [5.0, 5.0, 1.0]
    assert at_least(less.baseline(), tally([[30, 20, 0]], [[1.0, 4.0, 0.0]]))["reversals"] == [5.0, 5.0, 1.0]
    # samples that are no time series have no places
    bare = {key: x for key, x in held.items() if key not in ("reversals", "creeping")}
    assert at_least(bare, whole)["rmse"] == found["rmse"] and "reversals" not in at_least(bare, whole)


def test_of_no_sample_nothing_is_scored() -> None:
    score = Tally({}, np.zeros((0, 2, 2)), 0, {}, {}).score()
    assert (score.samples, score.overall["rmse"], score.moving["nrmse"]) == (0, [None, None], [None, None])
