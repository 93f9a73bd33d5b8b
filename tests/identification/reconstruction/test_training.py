"""Which samples are surveyed, and into which sums each is dealt, by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from armloop.data.motion import Motion, Samples
from armloop.identification.reconstruction import training
from armloop.identification.reconstruction.inner_folds import InnerFolds
from armloop.identification.reconstruction.joint_sums import JointSums
from armloop.identification.reconstruction.shared import PLAIN_FRICTION
from armloop.identification.reconstruction.training import Survey, Training
from armloop.regression.moments import Moments

SLIDES = np.array([[1, 0], [1, 1], [0, 1], [0, 0], [1, 1], [1, 0]], dtype=bool)
FAST = np.array([[1, 0], [0, 1], [0, 0], [1, 1], [0, 1], [1, 0]], dtype=bool)
HELD_OUT = np.array([0, 0, 1, 0, 0, 1], dtype=bool)


@pytest.fixture
def chunk(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Six samples of two joints in two runs; the third and the last are held out."""
    monkeypatch.setattr(training, "sliding_rows", lambda samples: SLIDES.copy())
    monkeypatch.setattr(training, "fast_rows", lambda samples: FAST.copy())
    v = np.array([[1.0, 5], [-2, -6], [3, 7], [9, 9], [-4, 8], [5, 9]])
    motion = Motion(np.arange(6.0), v, v, v, np.array([0, 2]))
    samples = Samples(motion, v, SLIDES, 1.0)
    return SimpleNamespace(samples=samples, held_out=HELD_OUT, blocks=np.array([4, 4, 5, 5, 6, 6]))


def test_samples_are_dealt_by_their_speed_or_all_together(chunk: Any) -> None:
    dealt = training._by_speed(chunk)
    assert dealt.label.tolist() == [[0, -1], [1, 0], [-1, -1], [-1, -1], [1, 0], [-1, -1]]
    assert dealt.count == 2 and dealt.judges.tolist() == [True] * 6
    dealt = training._at_once(chunk)
    assert dealt.label.tolist() == [[0, -1], [0, 0], [-1, -1], [-1, -1], [0, 0], [-1, -1]]
    assert dealt.count == 1 and dealt.judges.tolist() == [True] * 6


def test_or_by_inner_folds_what_judges_the_model_into_one_more(chunk: Any) -> None:
    asked: list[list[bool]] = []
    judges = np.array([1, 1, 0, 1, 0, 1], dtype=bool)

    def deal(samples: Any, used: Any) -> Any:
        asked.append(used.tolist())
        return np.array([2, 0, 1, 1, 2, 0]), judges

    def used(samples: Any, rows: Any) -> int:
        asked.append(rows.tolist())
        return 17

    folds: Any = SimpleNamespace(count=3, deal=deal, used=used)
    dealt = training._by_fold(chunk, {4: folds})
    assert dealt.label.tolist() == [[2, -1], [0, 0], [-1, 3], [-1, -1], [2, 2], [3, -1]]
    assert dealt.count == 4 and dealt.judges.tolist() == judges.tolist()
    assert training._used(chunk, folds) == (4, 17)
    # used is what some joint fits
    assert asked == [[True, True, False, False, True, False]] * 2


def test_a_survey_counts_what_slides_and_what_of_it_is_fitted(
    chunk: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    sums = JointSums([[Moments(2 * np.eye(3), np.zeros(3), 1.0, 2.0)] * 2], [[]])
    monkeypatch.setattr(JointSums, "of", lambda *_: sums)
    nothing: Any = None
    one = Survey.of(chunk, nothing)
    assert one.lengths == (2, 1)
    assert one.fitted.tolist() == [3, 2] and one.sliding.tolist() == [4, 3]
    assert one.products(2).tolist() == [[4.0, 0.0], [0.0, 4.0]]
    more = Survey(
        JointSums([[sums.parts[0][0] + sums.parts[0][0]] * 2], [[]]), (5,), np.ones(2), np.full(2, 2)
    )
    both = one + more
    assert both.lengths == (2, 1, 5) and both.fitted.tolist() == [4, 3] and both.sliding.tolist() == [6, 5]
    assert both.products(3).tolist() == (12.0 * np.eye(3)).tolist()


def of(lengths: tuple[int, ...], period: float = 0.1, reach: float = 0.25, **data: Any) -> Training:
    reference = SimpleNamespace(samples=SimpleNamespace(period=period, reach=reach, cutoff_hz=0.0))
    given: Any = SimpleNamespace(reference=reference, **data)
    options: Any = SimpleNamespace(correlation_seconds=0.7, block_seconds=4.0)
    survey: Any = SimpleNamespace(lengths=lengths)
    return Training(given, options, survey)


def test_how_much_there_is_and_how_much_of_it_is_new() -> None:
    assert not of((300, 300)).plenty and of((300, 301)).plenty
    assert of((1,)).memory == pytest.approx(7.0)
    assert of((1,)).repeats == 2.5 and of((1,), reach=0.05).repeats == 1.0


def test_the_slowest_of_what_is_fitted(chunk: Any) -> None:
    made = of((1,), window=lambda most: chunk)
    # |v| of joint 1: 1, 2, 4; of joint 2: 6, 8
    assert made.slowest(0.0).tolist() == [1.0, 6.0]
    assert made.slowest(0.5).tolist() == [2.0, 7.0]
    assert of((1,), window=lambda most: SimpleNamespace(most=most)).window.most == 150_000  # type: ignore[attr-defined]


def test_each_chunk_knows_how_many_blocks_came_before_it() -> None:
    made = of((301, 300), map=lambda function, what: iter([(0, 2), (7, 3), (20, 1)]))
    assert made._folds == (
        5,
        {0: InnerFolds(5, 3.005, 0), 7: InnerFolds(5, 3.005, 2), 20: InnerFolds(5, 3.005, 5)},
    )
    # no more folds than blocks
    assert of((301, 300), map=lambda function, what: iter([(0, 3)]))._folds == (
        3,
        {0: InnerFolds(3, 3.005, 0)},
    )


def test_a_weight_is_no_offset_of_the_friction_that_stands_in() -> None:
    """One joint whose torque is a weight, of which the motion beside the offset tells a half, and friction."""
    rng = np.random.default_rng(0)
    weight = 9.81 + 0.01 * rng.normal(size=400)
    rubs = rng.normal(size=(400, len(PLAIN_FRICTION)))
    place = [term.kind for term in PLAIN_FRICTION].index("offset")
    rubs[:, place] = 1.0
    X = np.column_stack([weight, rubs])
    # a disturbance that is like the little that moves
    y = 2.0 * weight - 100.0 * (weight - 9.81)
    sums = JointSums(
        [[Moments.of(X, y), Moments.none(X.shape[1])]], [[Moments.of(X, y), Moments.none(X.shape[1])]]
    )
    survey = Survey(sums, (400,), np.array([400]), np.array([400]))
    assert survey.load(1)[0] < -50
    assert survey.load(1, [0])[0] == pytest.approx(2.0, abs=0.1)
