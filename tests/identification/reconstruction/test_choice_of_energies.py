"""Which terms of the energies are taken: the sums that are compared, the greedy search, exchanges and omissions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import reduce
from operator import iadd
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import three_axis

from armloop.data.motion import Motion, Samples
from armloop.features.lagrangian import EnergyTerms, candidates
from armloop.identification.reconstruction import lagrangian
from armloop.identification.reconstruction.data import Chunk
from armloop.identification.reconstruction.lagrangian import _Left, _Problem, _Problems
from armloop.identification.reconstruction.shared import FRICTION
from armloop.regression.moments import Moments
from armloop.util.errors import ExcitationError

NONE = np.zeros(0, dtype=np.intp)


def terms(*names: str) -> EnergyTerms:
    library = candidates(three_axis())
    return library.take(np.array([library.names.index(name) for name in names]))


def unfiltered(N: int, seed: int, speed: float = 1.0) -> Samples:
    """Random states that are no time series."""
    rng = np.random.default_rng(seed)
    q, v, vdot, tau = rng.normal(size=(4, N, 3))
    motion = Motion(np.arange(float(N)), q, speed * v, vdot, np.array([0]))
    return Samples(motion, tau, np.ones((N, 3), dtype=bool), 1.0, 0.0)


class TestSums:
    @pytest.mark.parametrize("at_once", [1, 6, 1000])
    def test_each_joint_has_the_terms_that_act_on_it_then_its_friction(
        self, at_once: int, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Whatever the number of rows that are evaluated, and added, at once."""
        library = terms("v1^2", "v2^2", "v3^2", "cos(q3)*v2*v3", "sin(q2)")
        acting = [[0], [1, 3, 4], [2, 3]]
        samples = unfiltered(40, 0)
        rows = np.random.default_rng(1).random((40, 3)) < 0.4
        monkeypatch.setattr(lagrangian, "_CHUNK", 7)
        monkeypatch.setattr(lagrangian, "_AT_ONCE", at_once)
        weights = np.array([1.0, 4.0, 0.5])
        found = _Problem.of(library, samples, rows, weights)
        columns, G, b, yy = library.columns(samples.motion), np.zeros((23, 23)), np.zeros(23), 0.0
        theta = np.random.default_rng(2).normal(size=23)
        chunk = Chunk(samples, *np.zeros((4, 40), dtype=np.intp))
        monkeypatch.setattr(lagrangian, "_used", lambda chunk: (rows, ~rows))
        left = _Left.of(chunk, library, theta)
        for j, acts in enumerate(acting):
            own, where = rows[:, j], np.array(acts + [5 + 6 * j + k for k in range(6)])
            rubs = np.column_stack([term.column(samples.motion, j) for term in FRICTION])
            X, y = np.hstack([columns[own, j][:, acts], rubs[own]]), samples.tau[own, j]
            G[np.ix_(where, where)] += weights[j] * X.T @ X
            b[where] += weights[j] * X.T @ y
            yy += weights[j] * y @ y
            rest = y - X @ theta[where]
            assert (left.squares[j], left.power[j]) == (pytest.approx(rest @ rest), pytest.approx(y @ y))
        np.testing.assert_allclose(found.moments.G, G, atol=1e-12)
        np.testing.assert_allclose(found.moments.b, b, atol=1e-12)
        assert (found.moments.yy, found.moments.count) == (pytest.approx(yy), rows.sum())
        assert found.counts.tolist() == left.counts.tolist() == rows.sum(axis=0).tolist()

    def test_no_error_of_a_joint_is_less_than_round_off(self) -> None:
        left = _Left(np.array([8.0, 0.0, 0.0]), np.array([1.0, 1e3, 0.0]), np.array([4.0, 10.0, 0.0]))
        assert left.errors == pytest.approx([2.0, 1e-8, 0.0])
        assert (left + left).errors == pytest.approx([2.0, 1e-8, 0.0])

    def test_what_slides_fast_and_tells_something_new_is_fitted_or_judges(self) -> None:
        samples = unfiltered(40, 0)
        samples.motion.v[:] = 0.011
        samples.motion.v[:5, 0] = -0.009
        samples.moving[5:11, 1] = False
        mask = np.zeros((3, 40), dtype=bool)
        mask[0, [3, 12, 20, 30]], mask[1, 20:], mask[2, ::2] = True, True, True
        chunk = Chunk(samples, np.zeros(40, dtype=np.intp), mask[0], mask[1], mask[2])
        found = _Problems.of(chunk, terms("v1^2", "v2^2", "v3^2"), np.ones(3))
        # of the even ones, 12 is held out before 20, and 20 and 30 after it; slow are 0, 2, 4 and at rest 6, 8, 10
        assert found.fit.counts.tolist() == [6.0, 6.0, 9.0] and found.fit.moments.count == 21.0
        assert found.judge.counts.tolist() == [8.0, 8.0, 8.0]
        once, twice = replace(found.fit.moments, G=found.fit.moments.G.copy()), reduce(iadd, [found, found])
        assert twice.fit.counts.tolist() == [12.0, 12.0, 18.0] and twice.judge.moments.count == 48.0
        for key in ("G", "b", "yy"):
            np.testing.assert_allclose(getattr(twice.fit.moments, key), 2 * getattr(once, key), atol=1e-12)


def test_a_constant_force_is_weight_where_a_slide_lifts_it_and_an_offset_elsewhere(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Inertias, weights and friction are always there; joints weigh by their torques, then by what is left of them."""
    degrees = np.array([[0, 0], [0, 0], [0, 1], [1, 0], [1, 1], [0, 2], [0, 1]])
    speeds = np.array([[0, 0], [1, 1], [-1, -1], [-1, -1], [-1, -1], [-1, -1], [0, 0]])
    library = EnergyTerms(np.zeros(2, dtype=bool), degrees, np.zeros(7, dtype=bool), speeds)
    total, rng = 7 + 2 * len(FRICTION), np.random.default_rng(0)
    offset = [term.kind for term in FRICTION].index("offset")
    assert offset == lagrangian._OFFSET
    whole = Moments.of(X := rng.normal(size=(60, total)), X[:, 4] + rng.normal(size=60))
    given: list[Any] = []

    def passed(function: Any, what: str) -> Any:
        given.append(function.keywords)
        if function.func == _Left.of:
            return _Left(np.array([3.0, 8.0]), np.ones(2), np.array([6.0, 4.0]))
        fit = _Problem(whole, np.array([5.0, 6.0]))
        return [_Problems(fit, replace(fit, moments=whole + whole))]

    data: Any = SimpleNamespace(sum=passed, map=passed)
    asked: list[tuple[Moments, Moments, list[int], int]] = []

    def greedy(own: Moments, other: Moments, forced: Any, count: int) -> Any:
        asked.append((own, other, forced.tolist(), count))
        return np.append(forced, 4 if len(asked) == 1 else 5)

    monkeypatch.setattr(lagrangian, "_greedy", greedy)
    for weighs, lifts in (([0], [3]), ([1], [2]), ([0, 1], [2, 3]), ([], [])):
        asked.clear()
        given.clear()
        weights = np.array([0.5, 0.25])
        chosen = lagrangian._choose(library, data, weights, weighs)
        assert chosen.tolist() == [0, 1, *lifts, 5]
        friction = [7 + 6 * j + k for j in range(2) for k in range(6) if k != offset or j not in weighs]
        assert [call[2:] for call in asked] == 2 * [([0, 1, *lifts, *friction], 7)]
        assert all((own, other.count) == (whole, 2 * whole.count) for own, other, *_ in asked)
        first, left, second = given
        # by the torque, then by what the terms of the first round leave of each joint
        assert (first["weights"] == weights).all() and second["weights"].tolist() == [2.0, 0.5]
        support = np.array([0, 1, *lifts, *friction, 4])
        energies = [0, 1, *lifts, 4]
        assert (left["library"].degrees == degrees[energies]).all()
        expected = whole.refitted(support)
        np.testing.assert_allclose(left["theta"], expected[[*energies, *range(7, total)]])
        assert (second["library"].degrees == degrees).all()
    # of many candidates those that gain most beside the first choice are asked again, and what it has
    monkeypatch.setattr(lagrangian, "_SCREENED", 1)
    gained = whole.gains(support, np.arange(7))[1]
    gained[support[support < 7]] = 0.0
    asked.clear()
    given.clear()
    lagrangian._choose(library, data, weights, [])
    near = sorted({0, 1, 4, int(np.argmax(gained))})
    assert (given[-1]["library"].degrees == degrees[near]).all() and asked[-1][3] == len(near)
    # what is always there has other places among them
    assert asked[-1][2] == [0, 1, *range(len(near), len(near) + 2 * len(FRICTION))]


def test_a_joint_that_never_slides_fast_is_told_by_its_number() -> None:
    library = EnergyTerms(np.zeros(2, dtype=bool), *np.zeros((3, 2, 2), dtype=int))
    fit = _Problem(Moments.of(np.ones((3, 2)), np.ones(3)), np.array([3.0, 0.0]))
    data: Any = SimpleNamespace(map=lambda function, what: [_Problems(fit, fit)])
    with pytest.raises(ExcitationError, match=r"^q2: no sample"):
        lagrangian._choose(library, data, np.ones(2), [])


class Faked:
    """Stands for the normal equations: squared errors of supports by their sizes, gains of all terms alike."""

    yy = 100.0

    def __init__(self, left: float = 1.0, gains: float = 1.0) -> None:
        self.left, self.gain, self.asked = left, gains, 0

    def gains(self, support: Any, others: Any) -> Any:
        self.asked += 1
        return self.left, np.full(len(others), self.gain)

    def losses(self, support: Any) -> Any:
        return self.left, np.ones(len(support))

    def solve(self, support: Any) -> Any:
        return support

    def judge(self, error: Callable[[int], float]) -> Any:
        return SimpleNamespace(yy=self.yy, squared_error=lambda beta, support: error(len(support)))


class TestGreedySearch:
    @pytest.fixture(autouse=True)
    def alone(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(lagrangian, "_swap", lambda fit, support, fixed, others: support)
        monkeypatch.setattr(lagrangian, "_prune", lambda fit, support, forced, held_out, enough: support)

    def search(self, fit: Any, error: Callable[[int], float], count: int = 40) -> list[int]:
        return lagrangian._greedy(fit, fit.judge(error), NONE, count).tolist()

    def test_it_ends_where_nothing_gains_or_round_off_is_left(self) -> None:
        for fit, asked in (
            (Faked(), 11),
            (Faked(gains=0.0), 1),
            (Faked(left=0.9e-8), 1),  # 1e-10 of the squares
            (Faked(left=1.1e-8), 11),
        ):
            self.search(fit, lambda size: 1.0 if size < 3 else 0.5)
            assert fit.asked == 2 * asked  # forward, and floating

    def test_what_stood_in_for_others_goes_once_they_are_there(self) -> None:
        """The torque is the sum of two columns; a third, which is nearly that sum, is taken first, and left again."""
        rng = np.random.default_rng(0)
        X = rng.normal(size=(400, 6))
        y = X[:, 0] + X[:, 1]
        X[:, 2] = y + 0.5 * rng.normal(size=400)
        fit, judge = Moments.of(X[:200], y[:200]), Moments.of(X[200:], y[200:])
        assert fit.gains(NONE)[1].argmax() == 2
        assert sorted(lagrangian._greedy(fit, judge, NONE, 6).tolist()) == [0, 1]

    def test_forced_columns_stay(self) -> None:
        rng = np.random.default_rng(0)
        X = rng.normal(size=(400, 6))
        y = X[:, 0] + X[:, 1]
        fit, judge = Moments.of(X[:200], y[:200]), Moments.of(X[200:], y[200:])
        assert lagrangian._greedy(fit, judge, np.array([4]), 4).tolist()[0] == 4

    def test_no_error_is_less_than_round_off(self) -> None:
        assert self.search(Faked(), lambda size: [1.0, 0.9e-8, 0.0][min(size, 2)]) == [0]
        assert self.search(Faked(), lambda size: [1.0, 1.1e-8, 0.0][min(size, 2)]) == [0, 1]

    def test_what_is_omitted_must_leave_no_more_than_the_best_nor_what_was_exchanged(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        given: list[float] = []

        def prune(fit: Any, support: Any, forced: Any, held_out: Any, enough: float) -> Any:
            given.append(enough)
            return support

        monkeypatch.setattr(lagrangian, "_prune", prune)
        errors = {0: 9.0, 70: 0.5, 80: 3.0}
        for exchanged, enough in ((70, 0.505), (80, 1.01)):
            monkeypatch.setattr(lagrangian, "_swap", lambda *_, size=exchanged: np.arange(size))
            self.search(Faked(), lambda size: errors.get(size, 1.0))
            assert given.pop() == pytest.approx(enough)


class TestExchanges:
    @staticmethod
    def orthogonal(*shares: float, rest: float = 0.0) -> Moments:
        """Orthonormal columns, each with its share of the squares, and what none of them has."""
        return Moments(np.eye(len(shares)), np.sqrt(shares), sum(shares) + rest, 10.0)

    def swapped(self, fit: Moments, support: list[int], fixed: int = 0) -> list[int]:
        return lagrangian._swap(fit, np.array(support), fixed, np.arange(len(fit.b))).tolist()

    def test_a_term_gives_way_to_one_that_removes_a_ten_thousandth_more(self) -> None:
        # 1 is left without the second
        for more, taken in ((1.1e-4, [1]), (0.9e-4, [0])):
            assert self.swapped(self.orthogonal(0.5, 0.5 + more, rest=0.5 - more), [0]) == taken

    def test_and_more_than_round_off(self) -> None:
        # of a million 1e-10 is 1e-4
        for error, taken in ((1.1e-4, [1]), (0.9e-4, [0])):
            fit = self.orthogonal(1e6 - error, 1e6)
            assert self.swapped(Moments(fit.G, fit.b, 1e6, 10.0), [0]) == taken

    def test_those_that_are_always_there_stay_and_none_is_taken_twice(self) -> None:
        fit = self.orthogonal(0.1, 0.2, 0.3, 0.4, rest=1.0)
        assert self.swapped(fit, [0, 1], fixed=1) == [0, 3]
        assert self.swapped(fit, [0, 1]) == [3, 2]
        assert self.swapped(fit, [1, 0], fixed=2) == [1, 0]

    def test_one_exchange_opens_the_way_for_another(self) -> None:
        """y is the sum of the first two columns: the second is worth its place once the fourth gave way."""
        X = np.array([[-1.0, 2.0, 0.0, -2.0], [1.0, 1.0, 2.0, -2.0], [-2.0, 2.0, -2.0, 0.0]])
        assert self.swapped(Moments.of(X, X[:, 0] + X[:, 1]), [2, 3]) == [0, 1]


class TestOmissions:
    def pruned(self, worth: list[float], forced: list[int], enough: float) -> list[int]:
        """Of so many terms; the held-out error is what those that are missing were worth."""
        fit: Any = SimpleNamespace(losses=lambda support: (0.0, np.array(worth)[support]))

        def held_out(support: Any) -> float:
            return float(sum(worth) - np.array(worth)[support].sum())

        support = np.arange(len(worth))
        return lagrangian._prune(fit, support, np.array(forced, dtype=int), held_out, enough).tolist()

    def test_the_weakest_go_first_for_as_long_as_the_error_allows(self) -> None:
        worth = [4.0, 1.0, 2.0, 0.5]
        assert self.pruned(worth, [], 0.4) == [0, 1, 2, 3]
        assert self.pruned(worth, [], 0.5) == [0, 1, 2]
        assert self.pruned(worth, [], 1.6) == [0, 2]
        assert self.pruned(worth, [], 3.5) == [0]
        assert self.pruned(worth, [3, 1], 2.1) == [0, 1, 3]
        assert self.pruned(worth, [0, 1, 2, 3], 99.0) == [0, 1, 2, 3]


def test_torques_must_have_as_many_independent_values_as_there_are_candidates() -> None:
    """Four per joint and period of the corner, of what lies within the runs."""
    log: Any = SimpleNamespace(
        time=np.array([0.0, 1.0, 2.0, 9.0, 9.5]), runs=lambda: [slice(0, 3), slice(3, 5)]
    )
    sources: Any = [SimpleNamespace(read=lambda: log)] * 2
    count, library = candidates(three_axis()).count, lagrangian.LagrangianLibrary()
    # 5 s of three joints: 60 values per hertz
    assert library.undetermined(three_axis(), sources, count / 60) == ""
    assert library.undetermined(three_axis(), sources, (count - 0.5) / 60) == (
        f"{count} candidates, but {count - 1} independent values of torque"
    )
