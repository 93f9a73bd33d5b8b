"""What counts as evidence, and when one fit beats another: each rule at its edge."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from armloop.data.blocks import halves
from armloop.data.motion import Motion, Samples
from armloop.diagnosis import evidence as evidences
from armloop.diagnosis.evidence import Evidence, Stacked
from armloop.diagnosis.fit import Fit, Shape, Solution
from armloop.diagnosis.judgement import (
    enough,
    gain,
    is_worth,
    lead,
    lead_of,
    times_enough,
)
from armloop.identification import standstill

NOTHING = Solution(np.zeros(0), (), np.zeros((0, 0)), ())


def samples(
    q: np.ndarray, moving: np.ndarray, starts: tuple[int, ...] = (0,), period: float = 0.01
) -> Samples:
    time = np.arange(len(q)) * period
    v = np.gradient(q, period, axis=0)
    return Samples(
        Motion(time, q, v, np.gradient(v, period, axis=0), np.array(starts)), 0 * q, moving, period
    )


def a_model(**history: Any) -> Any:
    return SimpleNamespace(history=history, arm=SimpleNamespace(n=2))


def test_a_joint_that_gets_nowhere_has_not_slid_however_it_shakes() -> None:
    q = np.zeros((100, 2))
    q[20:40, 0], q[60:80, 0] = np.linspace(0, 0.021, 20), np.linspace(0, 0.019, 20)
    q[:, 1] = np.linspace(0, 1, 100)
    moving = np.zeros((100, 2), dtype=bool)
    moving[20:40, 0] = moving[60:80, 0] = True
    moving[:, 1] = True
    # two parts in a thousand of half the range, 10 rad
    sliding = evidences._sliding(samples(q, moving), a_model(range=[[10.0, 10.0], [1, 1], [1, 1], [0, 0]]))
    assert np.flatnonzero(sliding[:, 0]).tolist() == list(range(20, 40))
    assert sliding[:, 1].all()
    # of a range that is unknown: two mrad
    assert evidences._sliding(samples(q, moving), a_model())[60:80, 0].all()
    assert not evidences._sliding(samples(0.1 * q, moving), a_model())[60:80, 0].any()
    # each run's stretch on its own: what lies between two runs is no way
    q[:, 0] = np.where(np.arange(100) < 30, 0.0, 1.0)
    moving[20:40, 0] = True
    sliding = evidences._sliding(samples(q, moving, (0, 30)), a_model())
    assert not sliding[:, 0].any()
    assert moving[20:40, 0].all()


def test_where_the_filter_still_shows_how_a_run_began_or_ended_nothing_is_judged(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its reach from the first and the last sample of each run; without a filter all counts."""
    time = np.array([0.0, 0.1, 0.19, 0.2, 0.39, 0.45, 0.6, 5.0, 5.15, 5.3, 5.6])
    motion = Motion(time, *np.zeros((3, 11, 2)), np.array([0, 7]))

    def at_an_end(reach: float) -> list[int]:
        monkeypatch.setattr(Samples, "reach", reach)
        samples = Samples(motion, np.zeros((11, 2)), np.ones((11, 2), dtype=bool), 0.1)
        return np.flatnonzero(samples.at_an_end).tolist()

    assert at_an_end(0.2) == [0, 1, 2, 5, 6, 7, 8, 10] and at_an_end(0.0) == []


def test_what_lies_far_outside_the_trained_range_is_not_judged() -> None:
    q, v, vdot = np.array([[1.0, 0.0]]), np.array([[0.0, -2.0]]), np.array([[0.5, 3.0]])
    motion = Motion(np.zeros(1), q, v, vdot, np.array([0]))

    def far(half: float, speed: float, acceleration: float, centre: float) -> list[bool]:
        ranges = [[x, x] for x in (half, speed, acceleration, centre)]
        return evidences.far_outside(motion, ranges)[0].tolist()

    assert far(1.0, 2.0, 3.0, 0.0) == [False, False]
    assert far(0.8, 2.0, 3.0, 0.0) == [True, False]
    assert far(0.84, 2.0, 3.0, 0.0) == [False, False]
    assert far(1.0, 1.6, 3.0, 0.0) == [False, True]
    assert far(1.0, 2.0, 2.4, 0.0) == [False, True]
    assert far(0.5, 2.0, 3.0, 0.5) == [False, False]
    assert far(0.1, 2.0, 3.0, 0.5) == [True, True]
    assert evidences.far_outside(motion, None).tolist() == [[False, False]]


def test_a_joint_creeps_below_a_hundredth_of_its_trained_speed() -> None:
    assert standstill.creep(a_model(range=[[1, 1], [2.0, 3.0], [1, 1], [0, 0]])).tolist() == [0.02, 0.03]
    assert standstill.creep(a_model()).tolist() == [1e-3, 1e-3]


@pytest.mark.parametrize(
    ("seconds", "length"), [(60.0, 1.5), (12.0, 1.5), (10.0, 1.25), (8.0, 1.0), (6.0, 0.75), (3.0, 0.7)]
)
def test_a_short_run_is_cut_into_shorter_blocks(seconds: float, length: float) -> None:
    N = round(seconds / 2 * 100) + 1
    time = np.concatenate([np.arange(N), np.arange(N) + 10 * N]) * 0.01
    motion = Motion(time, *np.zeros((3, 2 * N, 1)), np.array([0, N]))
    assert evidences._block_seconds(motion, 0.7) == pytest.approx(length)


@pytest.mark.parametrize(
    ("memories", "shortest"),
    [([0.06, 0.08], 0.8), ([0.01, 0.02], 0.75), ([0.01, 0.3], 1.0), ([0.01, None], 1.0), ([], 1.0)],
)
def test_of_the_shortest_block_a_tenth_is_remembered(memories: list[float | None], shortest: float) -> None:
    model: Any = SimpleNamespace(baseline={"joints": [{"correlation_time": each} for each in memories]})
    assert evidences.shortest_block(model) == pytest.approx(shortest)
    assert evidences.shortest_block(SimpleNamespace(baseline={})) == 1.0  # type: ignore[arg-type]


def an_evidence() -> Evidence:
    """Two joints and six samples, of which joint 2 counts in two and neither in the last."""
    motion = Motion(np.arange(6.0), *np.zeros((3, 6, 2)), np.array([0]))
    rows = np.array([[1, 0], [1, 1], [1, 0], [1, 0], [0, 1], [0, 0]], dtype=bool)
    given = Samples(motion, np.arange(12.0).reshape(6, 2), rows, 1.0)
    return Evidence(
        cast(Any, SimpleNamespace(uncertainty={})),
        given,
        np.array([2.0, 0.5]),
        np.ones(2),
        rows,
        np.array([0, 0, 1, 1, 2, 2]),
        cast(Any, None),
    )


def test_rows_are_weighed_by_what_the_model_leaves_of_each_joint(monkeypatch: pytest.MonkeyPatch) -> None:
    given = an_evidence()
    assert given.kept.tolist() == [0, 1, 2, 3, 4]
    assert given.stacking[0].tolist() == [0, 1, 1, 2, 3, 4]
    assert (given.fold == halves(given.blocks)).all()
    residual = np.arange(12.0).reshape(6, 2)
    columns = 100 + np.arange(12.0).reshape(6, 2, 1)
    vars(given).update(independent=np.arange(6), _model_errors=np.zeros((6, 0)))
    monkeypatch.setattr(Evidence, "smoothed", lambda self, effect, shape: shape * effect.columns)
    everywhere, of_joint_2 = SimpleNamespace(columns=columns), SimpleNamespace(columns=columns[:, 1], index=1)
    each: list[Any] = [given.weighted(cast(Any, everywhere), shape) for shape in (1.0, 2.0)]
    stacked = given.stack(residual, each)
    assert stacked.joint.tolist() == [0, 0, 1, 0, 0, 1]
    np.testing.assert_allclose(stacked.y, np.array([0, 2, 3, 4, 6, 9]) / np.array([2, 2, 0.5, 2, 2, 0.5]))
    x = np.array([100, 102, 103, 104, 106, 109]) / np.array([2, 2, 0.5, 2, 2, 0.5])
    np.testing.assert_allclose(stacked.X, np.column_stack([x, 2 * x]))
    on_joint_2 = given.weighted(cast(Any, of_joint_2), 2.0)
    np.testing.assert_allclose(on_joint_2[:, 0], 2 * x * (stacked.joint == 1))
    assert stacked.block.tolist() == [0, 0, 0, 1, 1, 2]
    assert (stacked.fold == halves(stacked.block)).all()
    assert given.stack(residual, []).X.shape == (6, 0)


def test_a_model_without_a_baseline_is_weighed_by_the_torque() -> None:
    rng = np.random.default_rng(0)
    tau = rng.normal(size=(400, 2)) * [3.0, 0.2]
    q = np.cumsum(rng.normal(size=(400, 2)), axis=0) * 0.01
    motion = Motion(np.arange(400) * 0.05, q, q, q, np.array([0]))
    given = Samples(motion, tau, np.ones((400, 2), dtype=bool), 0.05)
    own = 0.01 * np.sqrt(np.mean(tau**2, axis=0))

    def of(**baseline: Any) -> Evidence:
        context = SimpleNamespace(period=0.05)
        model: Any = SimpleNamespace(
            baseline=baseline,
            history={},
            uncertainty={},
            context=lambda motion, effects: context,
            arm=SimpleNamespace(n=2),
            effects=(),
            predict=lambda motion: 0 * motion.q,
        )
        return Evidence.of(model, given, [])

    np.testing.assert_allclose(of().scale, own, rtol=1e-6)
    np.testing.assert_allclose(of(rmse=[0.4, None]).scale, [0.4, own[1]], rtol=1e-6)
    # a baseline of round-off is none: at least a thousandth of a hundredth of the torque… of its own
    np.testing.assert_allclose(of(rmse=[1e-12, 0.4]).scale, [1e-3 * own[0], 0.4], rtol=1e-6)
    assert of(rmse=[0.4, 0.2]).variation.tolist() == [1.0, 1.0]
    np.testing.assert_allclose(of(rmse=[0.4, 0.2], worst=[0.8, 0.1]).variation, [4.0, 1.0])
    np.testing.assert_allclose(of(rmse=[0.4, 0.2], worst=[None, 0.4]).variation, [1.0, 4.0])


def left(held_out: Any, block: Any, joint: Any = None, complexity: int = 1, wrong: float = 99.0) -> Any:
    """A fit that leaves this on rows held out, and something wrong on the rows that it was fitted to."""
    held_out, block = np.asarray(held_out, dtype=float), np.asarray(block)
    joint = np.zeros(len(block), dtype=np.intp) if joint is None else np.asarray(joint)
    none = np.zeros((len(block), 0))
    stacked = Stacked(none, held_out, block, block % 2, joint, int(joint.max()) + 1, joint, none)
    outside = np.full((2, len(block)), wrong)
    outside[block % 2, np.arange(len(block))] = held_out
    effects = tuple(SimpleNamespace(complexity=1) for _ in range(complexity))
    shapes = (Shape.fixed(0.0),) * complexity
    return Fit(cast(Any, None), cast(Any, effects), shapes, NOTHING, outside, stacked).score


def test_only_what_was_held_out_judges() -> None:
    fit = left([1.0, 2.0, 3.0, 4.0], [0, 0, 1, 4], [0, 1, 1, 0], complexity=3)
    assert fit.errors.tolist() == [[1.0, 0.0, 16.0], [4.0, 9.0, 0.0]]
    assert fit.counts.tolist() == [[1, 0, 1], [1, 1, 0]]
    assert (fit.complexity, fit.error) == (3, 30.0)
    assert fit.rows.tolist() == [2, 2] and fit.energy.tolist() == [17.0, 13.0]
    # joint 1 shows in two of its blocks, joint 2 in two of its own
    assert fit.seen.tolist() == [2, 2]
    better = left([1.0, 1.0, 1.0, 1.0], [0, 0, 1, 4], [0, 1, 1, 0])
    assert gain(fit, better) == 26.0 and gain(better, fit) == -26.0
    evidence: Any = SimpleNamespace(variation=np.array([2.0, 4.0]))
    assert enough(evidence, fit).tolist() == [4.0, 8.0]
    assert times_enough(evidence, fit, better) == pytest.approx(15 / 4 + 11 / 8)
    assert Shape.fixed(3.0) == Shape(3.0, (3.0, 3.0))


def test_a_lead_is_the_differences_sum_in_standard_errors_over_blocks() -> None:
    worse, better = np.array([5.0, 7.0, 6.0, 9.0]), np.array([4.0, 4.0, 5.0, 5.0])
    rows = np.array([3.0, 3.0, 3.0, 2.0])
    difference, part = worse - better, (worse - better) / (worse + better + rows)
    expected = [d.sum() / (2 * d.std(ddof=1)) for d in (difference, part)]
    assert lead_of(worse, better, rows) == pytest.approx(max(expected))
    assert lead_of(better, worse, rows) == pytest.approx(max(-e for e in expected))


def test_the_likelihood_of_two_joints_adds_up_block_by_block() -> None:
    # errors are so unlike over blocks that only the likelihood tells
    block, joint = np.array([0, 0, 1, 1, 2, 2]), np.array([0, 1, 0, 0, 0, 1])
    worse, better = left([9.0, 1, 0, 0, 0, 5], block, joint), left([0.0, 1, 1, 0, 1, 0], block, joint)
    # joint 1 is seen in three blocks, joint 2 in two; rows 4 and 2
    likelier = 0.5 * (3 * np.log((81 + 4) / (2 + 4)) + 2 * np.log((26 + 2) / (1 + 2)))
    assert lead(worse, better) == pytest.approx(np.sqrt(2 * likelier))
    assert lead(better, worse) > -np.sqrt(2 * likelier)


BLOCK = np.repeat(np.arange(20), 10)


def spread(size: float, seed: int = 0) -> np.ndarray:
    noise = np.random.default_rng(seed).normal(size=200)
    return noise * size / np.sqrt(np.mean(noise**2))


@pytest.mark.parametrize(
    ("usual", "stretches", "worth"),
    # 2.1² - 1.2² is 2.97 baselines: of eight stretches eighteen times what they hold are no chance, of three eighty-five
    [
        (2.9 / 18.5, 8, True),
        (3.1 / 18.3, 8, False),
        (2.9 / 85, 3, True),
        (3.1 / 85, 3, False),
        (0.0, 8, False),
    ],
)
def test_or_more_than_what_looks_like_it_in_training(usual: float, stretches: int, worth: bool) -> None:
    law = {"removed": [4.0 * usual], "stretches": stretches}
    effect: Any = SimpleNamespace(place=("coulomb_friction", 1, None))
    evidence: Any = SimpleNamespace(
        variation=np.array([3.0]), scale=np.array([2.0]), null={effect.place: law}
    )
    before, after = left(spread(2.1), BLOCK), left(spread(1.2), BLOCK)
    assert is_worth(evidence, before, after, effect=effect) is worth
    # not of a law of which nobody knows, nor where it is chance
    assert not is_worth(evidence, before, after, effect=SimpleNamespace(place=("payload", None, None)))  # type: ignore[arg-type]
    assert not is_worth(evidence, after, before, effect=effect)


def test_a_gain_must_be_significant_and_more_than_the_model_itself_is_wrong_by() -> None:
    evidence: Any = SimpleNamespace(variation=np.array([3.0]))
    before = left(spread(2.1), BLOCK)
    assert is_worth(evidence, before, left(spread(1.0), BLOCK))
    # 2.1² - 1.2² is 2.97 baselines
    assert not is_worth(evidence, before, left(spread(1.2), BLOCK))
    assert not is_worth(evidence, left(spread(1.0), BLOCK), before)
    # a law that ties two joints: more than twice as much
    assert not is_worth(evidence, before, left(spread(1.0), BLOCK), joints=2)
    assert is_worth(evidence, left(spread(2.7), BLOCK), left(spread(1.0), BLOCK), joints=2)
    # by one row alone, out of two blocks, it is chance
    once = spread(1.0)[:20]
    once[0] = 9.0
    chance: Any = SimpleNamespace(variation=np.array([0.01]))
    assert not is_worth(chance, left(once, BLOCK[:20]), left(spread(1.0)[:20], BLOCK[:20]))


def test_what_the_filter_brings_of_a_standstill_is_a_cell_of_its_own() -> None:
    q = np.linspace(-1.0, 1.0, 200)[:, None] * [1.0, -1.0]
    motion = Motion(0.1 * np.arange(200.0), q, q, 0 * q, np.array([0, 100]))
    moving = np.ones((200, 2), dtype=bool)
    moving[95:100, 0] = False  # the first run ends at rest, and the second does not begin so
    samples = Samples(
        motion, q, moving, 0.1, 1.0
    )  # half a period of the corner, or five samples, are smeared
    cells = replace(an_evidence(), samples=samples, rows=moving)._cells
    of_rest = np.flatnonzero(cells[:, 0] == cells[99, 0])
    np.testing.assert_array_equal(of_rest, np.arange(90, 100))
    assert cells[99, 0] not in cells[:, 1]


def test_like_places_and_speeds_share_a_cell_and_joints_never_do() -> None:
    # every place of nine with every speed of nine: low, middle and high, back, slow and forth
    place, speed = (x.ravel().astype(float) for x in np.meshgrid(np.arange(9), np.arange(9)))
    q, v = np.column_stack([place, speed]), np.column_stack([speed, place])
    motion = Motion(np.arange(81.0), q, v, 0 * v, np.array([0]))
    rows = np.ones((81, 2), dtype=bool)
    given = replace(an_evidence(), samples=Samples(motion, q, rows, 1.0), rows=rows)
    cells = given._cells
    of_place: dict[int, set[tuple[int, int]]] = {}
    for cell, x, y in zip(cells[:, 0].tolist(), place, speed, strict=True):
        of_place.setdefault(cell, set()).add((round(x), round(y)))
    thirds = [set(range(3 * k, 3 * k + 3)) for k in range(3)]
    expected = [{(x, y) for x in low for y in slow} for low in thirds for slow in thirds]
    assert sorted(map(sorted, of_place.values())) == sorted(map(sorted, expected))
    assert len(np.unique(cells)) == 18 and not set(cells[:, 0]) & set(cells[:, 1])
