"""An event that differs from what is left just before and just after it, on baselines that drift."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armloop.data.motion import Motion, Samples
from armloop.diagnosis.contrast import _clear, _peaks, beside, contrast, pulses


def samples(lengths: tuple[int, ...] = (1000,), joints: int = 1, period: float = 0.02) -> Samples:
    """Runs of so many samples of joints that slide one way, without a filter."""
    N, starts = sum(lengths), np.cumsum([0, *lengths[:-1]])
    v = np.ones((N, joints))
    return Samples(Motion(np.arange(N) * period, 0 * v, v, 0 * v, starts), 0 * v, v > 0, period)


class TestContrast:
    def test_is_the_mean_less_that_of_the_nearer_side(self) -> None:
        run = samples()
        left = np.zeros((1000, 1))
        left[:500], left[500:510], left[510:] = 1.0, 4.0, 2.0
        found, _ = contrast(run, left, 0.2)
        assert found[505, 0] == pytest.approx(2.0)  # 4 - 1 before, 4 - 2 after
        assert found[503, 0] == pytest.approx(3.4 - 2.0 - 0.4)  # eight samples of ten: 3.4; after: 2.4

    def test_what_the_filter_smears_at_the_edges_is_left_out(self) -> None:
        """A corner of 5 Hz reaches 0.1 s to either side: of an event's smeared edges the sides know nothing."""
        run = replace(samples(), cutoff_hz=5.0)
        left = np.zeros((1000, 1))
        left[490:520] = 1.0
        left[500:510] = 4.0
        # ten samples of 4, and those beside them from ten samples away on
        assert contrast(run, left, 0.2)[0][505, 0] == pytest.approx(4.0)
        assert contrast(samples(), left, 0.2)[0][505, 0] == pytest.approx(3.0)

    def test_of_a_step_or_a_slope_there_is_none(self) -> None:
        run = samples()
        slope = np.linspace(0.0, 50.0, 1000)[:, None]
        np.testing.assert_array_equal(contrast(run, slope, 0.4)[0], 0.0)
        np.testing.assert_allclose(contrast(run, np.sign(slope - 25.0), 0.4)[0], 0.0, atol=1e-12)

    def test_does_not_reach_from_run_to_run(self) -> None:
        run = samples((100, 100, 29))
        left = np.random.default_rng(1).normal(size=(229, 1))
        found, one_way = contrast(run, left, 0.2)
        # ten samples each before, within and after: 30 of a run, its middle the fifteenth; the last run holds none
        full = np.zeros(229, dtype=bool)
        full[15:86] = full[115:186] = True
        np.testing.assert_array_equal(one_way[:, 0], full)
        assert not found[~full].any() and found[full].any()

    def test_a_run_that_just_holds_all_three_has_one(self) -> None:
        left = np.zeros((30, 1))
        left[10:20] = 2.0
        found, one_way = contrast(samples((30,)), left, 0.2)
        assert np.flatnonzero(one_way[:, 0]).tolist() == np.flatnonzero(found[:, 0]).tolist() == [15]
        assert found[15, 0] == pytest.approx(2.0)

    def test_a_joint_that_rests_all_the_while_does_not_turn(self) -> None:
        run = samples()
        run.moving[400:600] = False
        _, one_way = contrast(run, np.zeros((1000, 1)), 0.2)
        assert one_way[420:580].all() and not one_way[386:415].any()

    def test_says_where_a_joint_turns_or_rests_meanwhile(self) -> None:
        run = samples(joints=2)
        run.motion.v[400:, 0] *= -1.0
        run.moving[700:720, 1] = False
        _, one_way = contrast(run, np.zeros((1000, 2)), 0.2)
        turned = np.flatnonzero(~one_way[20:-20, 0]) + 20
        assert (turned.min(), turned.max()) == (386, 414)
        rests = np.flatnonzero(~one_way[20:-20, 1]) + 20
        assert (rests.min(), rests.max()) == (686, 734)


class TestPulses:
    def test_an_event_on_a_baseline_that_drifts_by_more(self) -> None:
        run = samples(joints=2)
        t = run.motion.time
        left = np.column_stack([6.0 * np.sin(0.3 * t), 3.0 * np.cos(0.3 * t)])
        left[400:440, 1] += 3.0
        (found,) = pulses(run, left, np.ones((1000, 2), dtype=bool))
        assert found.joint == 1 and abs(found.rows.start - 400) <= 1 and abs(found.rows.stop - 440) <= 1
        np.testing.assert_array_equal(found.level, np.abs(contrast(run, left, 0.8)[0]))

    @pytest.mark.parametrize("seconds", [0.2, 0.4, 0.8, 1.6])
    def test_an_event_is_as_long_as_it_stands_out_most(self, seconds: float) -> None:
        run, length = samples((2000,)), round(50 * seconds)
        left = np.zeros((2000, 1))
        left[800 : 800 + length] = 5.0
        (found,) = pulses(run, left, run.moving)
        assert (found.rows.start, found.rows.stop) == (800, 800 + length)

    def test_noise_holds_none_and_two_events_are_two(self) -> None:
        run = samples()
        for seed in range(20):
            left = np.random.default_rng(seed).normal(size=(1000, 1))
            assert pulses(run, left, run.moving) == []
        left = 0.1 * left
        left[200:240] -= 3.0
        left[700:740] += 3.0
        found = sorted(pulse.rows.start for pulse in pulses(run, left, run.moving))
        assert found == pytest.approx([200, 700], abs=3)

    def test_a_swing_forth_and_back_is_no_event(self) -> None:
        """Its second half is as far from what is beside it as the first."""
        run, left = samples(), np.zeros((1000, 1))
        left[400:420] = 2.5
        assert len(pulses(run, left, run.moving)) == 1
        left[420:440] = -1.9
        assert pulses(run, left, run.moving) == []

    def test_what_is_not_judged_or_where_a_joint_turns_is_no_event(self) -> None:
        run = samples()
        left = np.zeros((1000, 1))
        left[400:440] = 2.5
        assert pulses(run, left, run.moving)
        judged = np.ones((1000, 1), dtype=bool)
        judged[380:460] = False
        assert pulses(run, left, judged) == []
        also = np.array(left)
        also[700:740] = 2.5
        (found,) = pulses(run, also, judged)
        assert abs(found.rows.start - 700) <= 1 and not found.level[380:460].any()
        run.motion.v[440:] = -1.0
        assert pulses(run, left, run.moving) == []

    def test_a_run_of_few_lengths_tells_nothing_of_that_length(self) -> None:
        left = np.zeros((1000, 1))
        left[400:462] = 2.5  # 1.6 s
        judged = np.ones((1000, 1), dtype=bool)
        (found,) = pulses(samples(period=0.0257), left, judged)
        assert (found.rows.start, found.rows.stop) == (400, 462)
        # 25.5 s are less than 16 times 1.6 s
        assert pulses(samples(period=0.0255), left, judged) == []


def test_events_are_three_times_what_is_beside_them_and_two_deviations_at_least() -> None:
    may = [True] * 6
    assert _clear([6.0, 2.0, 1.9], may) == (3.0, 1)
    assert _clear([5.9, 2.0, 1.9], may) == (0.0, 0)
    assert _clear([6.0, 5.0, 1.0], may) == (5.0, 2)
    assert _clear([1.99], may) == (0.0, 0)
    assert _clear([2.0], may) == (pytest.approx(3.0), 1)
    assert _clear([6.0, 1.0], [False, True]) == (0.0, 0)
    assert _clear([6.0, 2.0, 1.0], [True, False, True]) == (3.0, 1)
    assert _clear([9.0, 8.0, 7.0, 6.0, 5.0, 1.0], may) == (5.0, 5)
    assert _clear([9.0, 8.0, 7.0, 6.0, 5.0, 4.5, 1.0], [True] * 7) == (0.0, 0)


def test_peaks_lie_apart() -> None:
    level = np.array([0.0, 3.0, 2.0, 1.0, 0.0, 2.5, 0.0])
    assert _peaks(level, 1) == [1, 5, 3]
    assert _peaks(level, 2) == [1, 5]
    assert len(_peaks(np.ones(100), 2)) == 6
    # or are of the other sign
    assert _peaks(np.array([0.0, 3.0, -2.0, 1.0, 0.0, -2.5, 0.0]), 2) == [1, 5, 2]
    # at the beginning, too
    assert _peaks(np.array([3.0, 2.0, 0.0, 1.0]), 1) == [0, 3]
    assert _peaks(np.array([2.0, 3.0, 0.0, 0.0, 1.0]), 1) == [1, 4]


def test_beside_a_line_nothing_is_left_but_the_event() -> None:
    run = samples((500, 500))
    t = run.motion.time
    left = np.column_stack([2.0 + 0.5 * t])
    left[700:720] += 3.0
    found = beside(run, left, slice(700, 720))
    np.testing.assert_allclose(found[700:720], 3.0, atol=1e-12)
    np.testing.assert_allclose(found[680:700], 0.0, atol=1e-12)
    smeared = np.array(left)
    smeared[690:700], smeared[720:730] = 9.0, -9.0
    found = beside(replace(run, cutoff_hz=5.0), smeared, slice(700, 720))
    np.testing.assert_allclose(found[700:720], 3.0, atol=1e-12)
    # at the end of a run what is before and what little is after
    left[700:720] -= 3.0
    np.testing.assert_allclose(beside(run, left, slice(985, 999))[980:], 0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("rows", "before", "after"),
    [
        ((700, 720), (670, 690), (730, 750)),  # as long as the stretch, ten samples of the filter away
        ((515, 535), (500, 505), (545, 565)),  # what there is of the run
        ((505, 525), (500, 501), (535, 555)),
        ((500, 520), (500, 501), (530, 550)),
        ((960, 980), (930, 950), (990, 1000)),
        ((985, 998), (962, 975), (999, 1000)),
        ((470, 490), (440, 460), (499, 500)),
    ],
)
def test_the_line_goes_through_the_means_before_and_after(
    rows: tuple[int, int], before: tuple[int, int], after: tuple[int, int]
) -> None:
    run = replace(samples((500, 500), joints=2), cutoff_hz=5.0)
    left = np.random.default_rng(2).normal(size=(1000, 2))
    t, (a, z) = run.motion.time, (slice(*before), slice(*after))
    slope = (left[z].mean(axis=0) - left[a].mean(axis=0)) / (t[z].mean() - t[a].mean())
    line = left[a].mean(axis=0) + slope * (t - t[a].mean())[:, None]
    found, near = beside(run, left, slice(*rows)), np.arange(1000)
    near = (near >= before[0]) & (near < after[1])
    np.testing.assert_allclose(found[near], (left - line)[near], atol=1e-9)
    # what is left at other times is what the stretch is judged by
    np.testing.assert_array_equal(found[~near], left[~near])
