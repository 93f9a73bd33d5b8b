"""How terms of energies are searched, and when the terms of the steps are chosen anew, on numbers one can see through."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import three_axis

from armloop.data.motion import Motion, Samples
from armloop.features.rigid_body import BaseParameters
from armloop.identification.reconstruction import lagrangian, revision, rigid_body
from armloop.identification.reconstruction.revision import Leftover
from armloop.laws.friction import FrictionTerm
from armloop.model.components import SparseTerms
from armloop.regression.moments import Moments


def moments(beta: list[float], noise: float = 0.0, seed: int = 0) -> Moments:
    """Of columns that are orthogonal, and what they make, with noise."""
    rng = np.random.default_rng(seed)
    X = np.linalg.qr(rng.normal(size=(200, len(beta))))[0]
    return Moments.of(X, X @ np.array(beta) + noise * rng.normal(size=200))


class TestSearchOfEnergies:
    NONE = np.zeros(0, dtype=int)

    def test_terms_are_added_while_held_out_data_gain_and_few_are_as_good(self) -> None:
        fit, judge = moments([3.0, 0.0, 1.0, 0.0, 2.0]), moments([3.0, 0.0, 1.0, 0.0, 2.0], seed=1)
        found = lagrangian._greedy(fit, judge, self.NONE, 5)
        assert sorted(found.tolist()) == [0, 2, 4]
        # what is forced stays, whatever it is worth, and comes first
        found = lagrangian._greedy(fit, judge, np.array([3]), 5)
        assert found[0] == 3 and sorted(found.tolist()) == [0, 2, 3, 4]
        # columns after the first few are no candidates
        assert sorted(lagrangian._greedy(fit, judge, self.NONE, 4).tolist()) == [0, 2]
        # a hundredth of the error: not worth a term; a fiftieth is
        for size, taken in ((0.08, [0, 2]), (0.2, [0, 1, 2])):
            beta = [3.0, size, 1.0, 0.0]
            found = lagrangian._greedy(moments(beta, 0.1), moments(beta, 0.1, seed=1), self.NONE, 4)
            assert set(taken) <= {*found.tolist(), *([] if taken == [0, 1, 2] else [1])}
            assert (1 in found) == (1 in taken)

    def test_a_look_alike_is_exchanged_for_what_it_stood_in_for(self) -> None:
        rng = np.random.default_rng(2)
        X = rng.normal(size=(300, 4))
        X[:, 1] = X[:, 0] + 0.1 * X[:, 1]
        fit = Moments.of(X, X @ np.array([2.0, 0.0, 1.0, 0.0]))
        everything = np.arange(4)
        assert lagrangian._swap(fit, np.array([1, 2]), 0, everything).tolist() == [0, 2]
        # not where it is fixed; and what is right already is left alone
        assert lagrangian._swap(fit, np.array([1, 2]), 1, everything).tolist() == [1, 2]
        assert lagrangian._swap(fit, np.array([2, 0]), 0, everything).tolist() == [2, 0]

    def test_what_became_superfluous_goes_the_weakest_first(self) -> None:
        fit = moments([3.0, 0.1, 1.0, 0.2])
        asked: list[list[int]] = []

        def held_out(support: Any) -> float:
            asked.append(support.tolist())
            return 2.0 if 3 not in support else 1.0

        support = np.arange(4)
        assert lagrangian._prune(fit, support, self.NONE, held_out, 1.0).tolist() == [0, 2, 3]
        assert asked == [[0, 2, 3], [0, 2]]
        assert lagrangian._prune(fit, support, np.array([1]), held_out, 1.0).tolist() == [0, 1, 2, 3]
        assert lagrangian._prune(fit, support, self.NONE, held_out, 2.0).tolist() == []
        assert lagrangian._prune(fit, support, support, held_out, 2.0).tolist() == [0, 1, 2, 3]


class TestRevision:
    @staticmethod
    def left(products: Any, squares: Any, pairs: Any) -> Leftover:
        ones = np.ones(2)
        return Leftover(*(np.array(x, dtype=float) for x in (products, squares, pairs)), 8 * ones, 100 * ones)

    def test_the_worst_part_that_repeats_against_the_noise_of_all_conditions(self) -> None:
        pairs = [[200, 200], [100, 200], [99, 200]]
        # noise of joint 1: (130 + 20 + 0)/399; what repeats: 0.1, 0.8 and, of too few pairs, nothing
        left = self.left([[20, 0], [80, 0], [99, 0]], [[150, 60], [100, 60], [99, 60]], pairs)
        share, joint, condition = left.worst()
        assert (joint, condition) == (0, 2) and share == pytest.approx(0.8 / (0.8 + 150 / 399))
        left = self.left([[0, 0], [0, 0], [0, 150]], [[9, 150], [9, 150], [9, 150]], pairs)
        assert left.worst() == (pytest.approx(0.75 / (0.75 + 0.5)), 1, 3)

    def test_sums_add_up_and_schwarzs_criterion_counts_terms(self) -> None:
        left = self.left(*np.ones((3, 3, 2)))
        twice = left + left
        assert (
            twice.total.tolist() == [16, 16]
            and twice.count.tolist() == [200, 200]
            and (twice.pairs == 2).all()
        )
        # 25 independent samples a joint
        expected = 2 * 25 * np.log(8.0) + np.log(25) * 5
        assert left.criterion(np.array([2.0, 3.0]), 4.0) == pytest.approx(expected)
        assert left.criterion(np.array([2.0, 3.0]), 80.0) == pytest.approx(4 * np.log(8.0) + np.log(2) * 5)

    def test_pairs_are_a_period_of_the_corner_apart_in_one_run_and_condition(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        N = 12
        motion = Motion(np.arange(N) * 0.1, *np.zeros((3, N, 1)), np.array([0, 6]))
        samples = Samples(motion, np.zeros((N, 1)), np.ones((N, 1), dtype=bool), 0.1, 5.0)
        r = np.arange(1.0, N + 1)[:, None]
        monkeypatch.setattr(revision, "residual", lambda model, samples: r)
        condition = np.array([1, 1, 1, 1, 2, 2, 3, 3, 3, 3, 3, 3])
        held_out = np.zeros(N, dtype=bool)
        held_out[11] = True
        samples.moving[8] = False
        chunk: Any = SimpleNamespace(samples=samples, held_out=held_out, independent=np.arange(N) % 2 == 0)
        model: Any = None
        found = Leftover.of(chunk, model, lambda motion: condition)  # type: ignore[arg-type]
        # two samples apart: (1, 3), (2, 4) | none | (7, 9) rests at its end, (8, 10), (9, 11) rests, (10, 12) is held out
        assert found.pairs.ravel().tolist() == [2, 0, 1]
        assert found.products.ravel().tolist() == [1 * 3 + 2 * 4, 0, 8 * 10]
        assert found.squares.ravel().tolist() == [(1 + 9 + 4 + 16) / 2, 0, (64 + 100) / 2]
        assert found.total.tolist() == [1 + 9 + 25 + 49 + 121] and found.count.tolist() == [5]

    def test_the_number_of_terms(self) -> None:
        terms = SparseTerms(1, np.zeros((2, 1), dtype=int), np.array([[1.0, 0.0], [2.0, 0.5]]), ())
        found: Any = SimpleNamespace(friction=[[FrictionTerm("viscous")], []], components=[terms, terms])
        assert revision._counts(found).tolist() == [5.0, 2.0]

    @pytest.mark.parametrize(
        ("orders", "most", "expected"),
        [
            ((3, 1, 1), 9, [(1, 2), (2, 2)]),
            ((3, 1, 3), 9, [(1, 2), (2, 2), (3, 2)]),
            ((3, 3, 1), 2, [(1, 2), (2, 2)]),
            ((2, 2, 2), 0, [(1, 2)]),
        ],
    )
    def test_positions_keep_their_order_and_the_others_what_later_steps_chose(
        self, orders: tuple[int, ...], most: int, expected: list[tuple[int, int]]
    ) -> None:
        found: Any = SimpleNamespace(reports=[SimpleNamespace(orders=[order, 2]) for order in orders])
        options: Any = SimpleNamespace(max_order=most, max_candidates=10**6)
        plan = revision._plan((True,), found, options)
        assert list(plan.orders) == expected and plan.still == orders[0]
        options.max_candidates = 0
        assert list(revision._plan((True,), found, options).orders) == [(1, 2)]


def test_priors_are_the_drawings_by_so_many_kilograms() -> None:
    arm = three_axis()
    base = BaseParameters.of_arm(arm, rotors=True)
    nominal = np.linspace(1.0, 2.0, 11 * arm.n)
    priors = rigid_body._priors(arm, base, nominal)
    assert len(priors) == 7
    one, ten = priors["links as in the URDF ± 1 kg"], priors["links as in the URDF ± 10 kg"]
    np.testing.assert_allclose(ten.precision, one.precision / 100)
    np.testing.assert_allclose(one.centre, base.from_full(nominal))
    # masses by 1 kg, first moments by that times a typical link's length, inertias by that times its square
    length = np.mean([np.linalg.norm(X[:3, 3]) for X in arm.X_PF[1:]])
    unit = np.concatenate([np.tile([1, *[length] * 3, *[length**2] * 6], 3), np.full(3, length**2)])
    covariance = base.grouping @ np.diag(unit**2) @ base.grouping.T
    np.testing.assert_allclose(np.linalg.inv(one.precision), covariance, rtol=1e-6, atol=1e-12)
