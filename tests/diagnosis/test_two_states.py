"""A hidden process of two states, by hand: the likeliest sequence, where it begins, and when."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from rubbing_arm import model_with_baseline, motion_of, torque
from synthetic import measured

from armloop.data.signals import preprocess
from armloop.diagnosis import two_states
from armloop.diagnosis.evidence import Evidence
from armloop.laws.effects import hypotheses


def test_the_likeliest_sequence_is_that_of_the_largest_total(monkeypatch: pytest.MonkeyPatch) -> None:
    """Against every sequence there is, in two runs."""
    monkeypatch.setattr(two_states, "_PRICE", 2.0)
    rng = np.random.default_rng(8)
    run = np.array([1] * 5 + [2] * 4)
    for _ in range(50):
        gains = 2 * rng.normal(size=9)
        every = [np.array(states, dtype=bool) for states in product((False, True), repeat=9)]
        most = max(two_states.worth(gains, states, run) for states in every)
        found = two_states.likeliest(gains, run)
        assert two_states.worth(gains, found, run) == pytest.approx(most)
    # a change between two runs costs nothing
    np.testing.assert_array_equal(two_states.likeliest(np.array([-0.1] * 5 + [0.1] * 4), run), run == 2)


def test_what_is_short_is_none_and_a_change_within_rest_is_where_it_explains_most() -> None:
    model, given = model_with_baseline(), motion_of(1, 30.0)
    run = measured(given, torque(given), 1, 0.01)
    own = Evidence.of(model, preprocess([run], model.conditioning), hypotheses(model.arm))
    kept, motion = own.kept, own.samples.motion
    # no sample counts from 10 to 12 s, as where the arm rests
    count = (motion.time[kept] < 10) | (motion.time[kept] > 12)
    rows = own.rows.copy()
    rows[kept[~count]] = False
    own = own.only(rows)
    time = motion.time[own.kept]
    run_of = np.ones(len(time), dtype=np.intp)
    loaded = (time > 10) | ((time > 4) & (time < 4.3))
    better = np.where(motion.time > 11.3, 1.0, -1.0)
    (interval,), unknown = two_states.intervals_of(own, loaded, run_of, better)
    assert interval.start == pytest.approx(11.3, abs=0.05) and interval.end == motion.time[-1]
    assert unknown[(motion.time > 10) & (motion.time < 12)].all()
    assert not unknown[(motion.time > 13) | ((motion.time > 5) & (motion.time < 9))].any()
    # nor where the samples on either side of a change hardly tell
    counted = np.where(loaded, 9.0, -9.0)
    counted[(time > 9) & (time < 13)] *= 1e-4
    early = (time > 9.5) & (time > 4.3)
    (interval,), _ = two_states.intervals_of(own, early, run_of, better, counted)
    assert interval.start == pytest.approx(11.3, abs=0.05) and interval.gap == pytest.approx(4.0, abs=0.1)
    (interval,), _ = two_states.intervals_of(own, ~early, run_of, -better, -counted)
    assert interval.end == pytest.approx(11.3, abs=0.05) and interval.gap == pytest.approx(4.0, abs=0.1)
    (interval,), _ = two_states.intervals_of(own, time < 10, run_of, -better)
    assert interval.start == motion.time[0] and interval.end == pytest.approx(11.3, abs=0.05)


def test_logs_whose_clocks_have_nothing_to_do_with_each_other() -> None:
    """One counts from 1970, the next from zero: where the residual is large is asked within each."""
    time = np.concatenate([1.7e9 + 0.1 * np.arange(50.0), 0.1 * np.arange(50.0)])
    run = np.repeat([1, 2], 50)
    y = np.zeros((100, 1))
    y[20:30], y[80:] = 1.0, 1.0
    _, large, small = two_states._starts(y, time, run)
    # averaged over half a second to either side
    assert (large == ~small).all()
    for first, last, beyond in ((16, 34, 36), (76, 100, 100)):
        assert large[first:last].all() and not large[first - 6 : first - 2].any()
        assert not large[beyond : beyond + 6].any()


def test_a_sample_that_hardly_tells_is_no_end_of_where_a_change_lies() -> None:
    """It is sure from where the log-likelihood is 4.5, three deviations, less; and no change moves beyond another."""
    gains = np.array([-9.0, -9, -0.1, -4, 0.1, 1, 3, 0.2, 0.3, 9, 9])
    assert two_states._sure(gains, 4, [4, 11]) == (1, 8)
    assert two_states._sure(gains, 4, [0, 4, 7]) == (1, 6)
    assert two_states._sure(gains[2:], 2, [2, 9]) == (0, 6)
    assert two_states._sure(np.array([-9.0, 9.0]), 1, [1, 2]) == (0, 1)
