"""What a model leaves, sum by sum, what of it is no noise, and what is looked for then."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from armloop.data.motion import Motion, Samples
from armloop.identification.reconstruction import Options, revision
from armloop.identification.reconstruction.data import Chunk
from armloop.identification.reconstruction.found import Found
from armloop.identification.reconstruction.options import StepReport
from armloop.identification.reconstruction.revision import Leftover, revised
from armloop.identification.reconstruction.step import PARTS
from armloop.laws.friction import FrictionTerm
from armloop.model.components import SparseTerms
from armloop.util.progress import silent

N, STARTS = 60, [0, 25]
RNG = np.random.default_rng(5)
LEFT = RNG.normal(size=(N, 2))
CONDITION = RNG.integers(0, 4, 12).repeat(5)
MOVING = RNG.random((N, 2)) < 0.9
HELD_OUT = np.arange(N) % 20 == 7
INDEPENDENT = np.arange(N) % 3 == 0


def leftover(cutoff_hz: float, monkeypatch: pytest.MonkeyPatch) -> Leftover:
    """Of sixty samples, 0.1 s apart, in two runs."""
    motion = Motion(0.1 * np.arange(N), *np.zeros((3, N, 2)), np.array(STARTS))
    samples = Samples(motion, np.zeros((N, 2)), MOVING, 0.1, cutoff_hz)
    nobody = np.zeros(N, dtype=bool)
    chunk = Chunk(samples, np.zeros(N, dtype=int), HELD_OUT, nobody, INDEPENDENT)
    monkeypatch.setattr(revision, "residual", lambda model, samples: LEFT)
    model: Any = None
    sorter: Any = lambda motion: CONDITION  # noqa: E731
    return Leftover.of(chunk, model, sorter)


@pytest.mark.parametrize(("cutoff_hz", "lag"), [(5.0, 2), (1.0, 10), (9.0, 1), (50.0, 1)])
def test_pairs_are_a_period_of_the_filter_apart_in_one_run_and_one_condition(
    cutoff_hz: float, lag: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = leftover(cutoff_hz, monkeypatch)
    sums = np.zeros((3, 3, 2))
    for k in range(N - lag):
        if (k < STARTS[1]) != (k + lag < STARTS[1]) or CONDITION[k] != CONDITION[k + lag]:
            continue
        if HELD_OUT[k] or HELD_OUT[k + lag] or CONDITION[k] == 0:
            continue
        for j in range(2):
            if MOVING[k, j] and MOVING[k + lag, j]:
                a, b = LEFT[k, j], LEFT[k + lag, j]
                sums[:, CONDITION[k] - 1, j] += a * b, (a * a + b * b) / 2, 1
    np.testing.assert_allclose(found.products, sums[0], atol=1e-12)
    np.testing.assert_allclose(found.squares, sums[1], atol=1e-12)
    np.testing.assert_array_equal(found.pairs, sums[2])
    usable = MOVING & ~HELD_OUT[:, None] & INDEPENDENT[:, None]
    np.testing.assert_allclose(found.total, (np.where(usable, LEFT, 0.0) ** 2).sum(axis=0))
    np.testing.assert_array_equal(found.count, usable.sum(axis=0))


def of(products: Any, squares: Any, pairs: Any) -> Leftover:
    """Three conditions by two joints."""
    return Leftover(
        *(np.array(each, dtype=float) for each in (products, squares, pairs)), np.ones(2), np.ones(2)
    )


def test_what_repeats_is_set_against_the_joints_noise_in_all_conditions() -> None:
    pairs = [[100, 100], [200, 100], [100, 100]]
    # noise: (100 + 260 - 60) / 400 = 0.75 of joint 1; of 2 (100 + 100 + 500 - 100) / 300 = 2
    left = of([[30, 0], [30, 0], [0, 100]], [[100, 100], [160, 100], [100, 500]], pairs)
    # 0.3, 0.15 and 0 of joint 1 repeat; 0, 0 and 1 of joint 2
    assert left.worst() == (pytest.approx(1 / 3), 1, 3)
    left = of([[90, 0], [30, 0], [0, 100]], [[160, 100], [160, 100], [100, 500]], pairs)
    assert left.worst() == (pytest.approx(0.9 / (0.9 + 0.75)), 0, 1)


def test_ninety_nine_pairs_say_nothing() -> None:
    squares = [[200, 0], [100, 0], [0, 0]]
    assert of([[200, 0], [50, 0], [0, 0]], squares, [[99, 0], [100, 0], [0, 0]]).worst() == (
        pytest.approx(0.5 / (0.5 + 50 / 199)),
        0,
        2,
    )
    assert of([[200, 0], [50, 0], [0, 0]], squares, [[100, 0], [100, 0], [0, 0]]).worst() == (
        pytest.approx(2 / (2 + 50 / 200)),
        0,
        1,
    )
    # and nothing at all is no noise: no division by it
    assert of(*np.zeros((3, 3, 2))).worst() == (0.0, 0, 1)
    # products above their squares by rounding leave no noise, not less
    assert (
        of([[150, 0]] + 2 * [[0, 0]], [[100, 0]] + 2 * [[0, 0]], [[100, 0]] + 2 * [[0, 0]]).worst()[0] == 1.0
    )


def test_schwarzs_criterion_counts_independent_samples() -> None:
    none = np.zeros((3, 2))
    left = Leftover(none, none, none, np.array([4.0, 0.5]), np.array([30.0, 3.0]))
    expected = 15 * np.log(4.0) + 7 * np.log(15.0) + 2 * np.log(0.5) + 5 * np.log(2.0)
    assert left.criterion(np.array([7.0, 5.0]), 2.0) == pytest.approx(expected)


def found(*orders: list[int] | None) -> Any:
    return SimpleNamespace(reports=[SimpleNamespace(orders=each) for each in orders])


@pytest.mark.parametrize(
    ("orders", "most", "tried", "still"),
    [
        (([4, 0], [1, 2], [1, 1]), 9, ((1, 2), (2, 2)), 4),  # two at least
        (([2, 0], [3, 2], [1, 1]), 9, ((1, 2), (2, 2), (3, 2)), 2),
        (([2, 0], [1, 2], [3, 1]), 9, ((1, 2), (2, 2), (3, 2)), 2),
        (([1, 0], [3, 2], [3, 1]), 2, ((1, 2), (2, 2)), 1),
        (([1, 0], [3, 2], [3, 1]), 1, ((1, 2),), 1),
        ((None, None, None), 0, ((1, 2),), 1),
    ],
)
def test_orders_up_to_what_the_later_steps_chose(orders: Any, most: int, tried: Any, still: int) -> None:
    plan = revision._plan((True, True), found(*orders), Options(max_order=most))
    assert (plan.orders, plan.still) == (tried, still)
    assert (plan.parts, plan.conditions) == (PARTS, (1, 2, 3))
    assert plan.friction == ("sign", "viscous", "stribeck")


def test_no_more_candidates_than_are_allowed() -> None:
    steps = found([1, 0], [2, 2], [2, 1])
    whole = revision.candidates_of((True, True), revision._plan((True, True), steps, Options(max_order=2)))
    first, second = (len(whole.subset(order)) for order in ((1, 2), (2, 2)))
    assert first < second
    for limit, tried in (
        (second, ((1, 2), (2, 2))),
        (second - 1, ((1, 2),)),
        (first, ((1, 2),)),
        (first - 1, ((1, 2),)),
    ):
        plan = revision._plan((True, True), steps, Options(max_order=2, max_candidates=limit))
        assert plan.orders == tried


def test_terms_are_counted_by_joint() -> None:
    terms = SparseTerms(1, np.array([[1], [2]]), np.array([[1.0, 0.0], [2.0, 3.0]]))
    other: Any = SimpleNamespace()
    law = [FrictionTerm("sign", 1.0)]
    given: Any = SimpleNamespace(friction=[law, []], components=[terms, other, terms])
    assert revision._counts(given).tolist() == [5.0, 2.0]


@pytest.mark.parametrize(("share", "asked"), [(0.5, False), (0.51, True)])
def test_half_of_what_is_left_may_repeat(share: float, asked: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    def regress(*_: Any) -> Any:
        raise LookupError

    monkeypatch.setattr(revision, "regress_step", regress)
    monkeypatch.setattr(Found, "model", lambda found: None)
    monkeypatch.setattr(Leftover, "worst", lambda self: (share, 0, 1))
    samples = SimpleNamespace(cutoff_hz=1.0)
    data: Any = SimpleNamespace(
        reference=SimpleNamespace(samples=samples), sum=lambda function: of(*np.zeros((3, 3, 2)))
    )
    arm, sorter = None, object()
    steps = Found(arm, [], [[], []], found([1, 0], [1, 2], [1, 1]).reports, sorter=sorter)  # type: ignore[arg-type]
    if asked:
        with pytest.raises(LookupError):
            revised(steps, data, (True, True), Options(), silent)
    else:
        assert revised(steps, data, (True, True), Options(), silent) is steps


@pytest.mark.parametrize(("criterion", "better"), [(1.0, True), (2.0, False), (3.0, False)])
@pytest.mark.parametrize("velocities", [[2, 2], None])
def test_what_is_regressed_together_must_be_worth_its_terms(
    criterion: float, better: bool, velocities: list[int] | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    reports = [StepReport(k, [1, 1], 9, 9, [1], [5]) for k in (1, 2, 3)]
    orders = [9, 9], velocities, [8, 8]
    new = [
        replace(report, orders=own, terms=[4 + k], samples=[7])
        for k, (report, own) in enumerate(zip(reports, orders, strict=True))
    ]
    monkeypatch.setattr(revision, "regress_step", lambda *_: (["terms"], [["law"]], new))
    monkeypatch.setattr(Found, "model", lambda found: None)
    monkeypatch.setattr(revision, "_counts", lambda found: None)
    monkeypatch.setattr(revision, "refit", lambda *_: better)
    leftovers = iter(
        SimpleNamespace(worst=lambda: (0.6, 2, 1), criterion=lambda counts, correlation, value=value: value)
        for value in (2.0, criterion)
    )
    data: Any = SimpleNamespace(
        reference=SimpleNamespace(samples=SimpleNamespace(cutoff_hz=1.0)),
        sum=lambda function: next(leftovers),
    )
    arm, sorter = None, object()
    steps = Found(arm, [], [[]], reports, sorter=sorter, notes=["before"])  # type: ignore[arg-type]
    found = revised(steps, data, (True,), Options(), silent)
    if not better:
        assert found is steps
        return
    assert (found.together, found.components, found.friction) == (True, ["terms"], [["law"]])
    assert [(r.step, r.orders, r.terms, r.samples) for r in found.reports] == [
        (k, [1, 1], [3 + k], [7]) for k in (1, 2, 3)
    ]
    assert found.notes[0].startswith("60% of what the steps leave at joint 3 ")
    assert found.notes[0].endswith(f"N1 = 1 for positions, {2 if velocities else 0} for velocities")
    assert found.notes[1:] == [revision.REFITTED]


def test_sums_of_two_chunks_are_added_each_to_its_own() -> None:
    one = Leftover(*(np.full((3, 2), float(k)) for k in range(5)))
    assert [float(each[0, 0]) for each in vars(one + one).values()] == [0.0, 2.0, 4.0, 6.0, 8.0]


def test_steps_that_were_not_sorted_or_samples_without_a_filter_are_left_alone() -> None:
    arm: Any = None
    for sorter, cutoff_hz in ((None, 1.0), (object(), 0.0)):
        data: Any = SimpleNamespace(reference=SimpleNamespace(samples=SimpleNamespace(cutoff_hz=cutoff_hz)))
        steps = Found(arm, [], [[]], [], sorter=sorter)  # type: ignore[arg-type]
        assert revised(steps, data, (True,), Options(), silent) is steps
