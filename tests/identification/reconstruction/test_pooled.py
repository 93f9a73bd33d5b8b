"""The pooled regression of all joints is least squares on all rows, and a fold is judged by what the others say."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from scipy.stats import multivariate_normal

from armloop.identification.reconstruction.joint_sums import JointSums
from armloop.identification.reconstruction.pooled import Pooled, Prior, _at_rest
from armloop.laws.friction import KINDS, FrictionTerm
from armloop.regression.moments import Moments

TERMS = [FrictionTerm("offset"), FrictionTerm("sign"), FrictionTerm("viscous")]
SHARED, JOINTS, FOLDS, ROWS = 4, 2, 3, 50
NOISE = np.array([0.5, 2.0])


class Data:
    """Rows of two joints in three folds and one part that judges the model alone."""

    def __init__(self, seed: int = 0, friction: tuple[float, ...] = (0.3, 0.5, 1.0, -0.2, 0.4, 0.7)) -> None:
        rng = np.random.default_rng(seed)
        self.theta = np.array([1.0, -2.0, 0.5, 3.0, *friction])
        self.X = rng.normal(size=(JOINTS, FOLDS + 1, ROWS, SHARED + 3))
        # two terms of friction that are much alike, of which one would come out negative
        self.X[..., 5] = 0.9 * self.X[..., 6] + 0.3 * self.X[..., 5]
        truth = np.array(
            [np.concatenate([self.theta[:4], self.theta[4 + 3 * j : 7 + 3 * j]]) for j in range(2)]
        )
        self.y = np.einsum("jfrp,jp->jfr", self.X, truth) + NOISE[:, None, None] * rng.normal(
            size=(2, 4, ROWS)
        )
        self.judging = rng.uniform(size=(JOINTS, FOLDS + 1, ROWS)) < 0.6

    def sums(self) -> JointSums:
        def of(mask: np.ndarray) -> list[list[Moments]]:
            return [
                [Moments.of(self.X[j, f][mask[j, f]], self.y[j, f][mask[j, f]]) for f in range(FOLDS + 1)]
                for j in range(JOINTS)
            ]

        return JointSums(of(np.ones_like(self.judging)), of(self.judging))

    def pooled(self, **options: object) -> Pooled:
        return Pooled(self.sums(), [TERMS, TERMS], FOLDS, **options)  # type: ignore[arg-type]

    def rows(self, folds: list[int], choice: list[list[int]]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Stacked columns and torques of some folds, and the joint of each row."""
        size = SHARED + sum(map(len, choice))
        X, y, joint, start = [], [], [], SHARED
        for j, own in enumerate(choice):
            for f in folds:
                wide = np.zeros((ROWS, size))
                wide[:, :SHARED] = self.X[j, f, :, :SHARED]
                wide[:, start : start + len(own)] = self.X[j, f][:, [SHARED + k for k in own]]
                X.append(wide)
                y.append(self.y[j, f])
                joint += [j] * ROWS
            start += len(own)
        return np.vstack(X), np.concatenate(y), np.array(joint)

    def by_hand(self, folds: list[int], choice: list[list[int]]) -> tuple[np.ndarray, np.ndarray]:
        """Least squares with each joint weighted by its residual, three times over, and the weights."""
        X, y, joint = self.rows(folds, choice)
        variance = np.array([np.mean(y[joint == j] ** 2) for j in range(JOINTS)])
        for last in (False, False, False, True):
            weight = 1 / np.sqrt(variance[joint])
            theta = np.linalg.lstsq(X * weight[:, None], y * weight, rcond=None)[0]
            if not last:
                variance = np.array([np.mean((y - X @ theta)[joint == j] ** 2) for j in range(JOINTS)])
        return theta, 1 / variance


EVERY = [[0, 1, 2], [0, 1, 2]]
SOME = [[2], [0, 1]]


@pytest.mark.parametrize("choice", [EVERY, SOME, [[], []]])
def test_it_is_least_squares_weighted_by_what_each_joint_leaves(choice: list[list[int]]) -> None:
    data = Data()
    solution = data.pooled().solve(choice)
    theta, weights = data.by_hand([0, 1, 2], choice)
    np.testing.assert_allclose(solution.theta, theta, rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(solution.weights, weights, rtol=1e-4)
    X, y, joint = data.rows([0, 1, 2], choice)
    np.testing.assert_allclose(
        solution.G, (X.T * weights[joint]) @ X, rtol=1e-4, atol=1e-4 * solution.G.max()
    )
    np.testing.assert_allclose(
        solution.b, (X.T * weights[joint]) @ y, rtol=1e-4, atol=1e-4 * np.abs(solution.b).max()
    )
    assert solution.repeats == 1.0


def test_what_judges_the_model_is_fitted_only_where_that_is_asked_for() -> None:
    data = Data()
    apart, all_in = (data.pooled().solve(EVERY, held_out=held) for held in (False, True))
    np.testing.assert_allclose(all_in.theta, data.by_hand([0, 1, 2, 3], EVERY)[0], rtol=1e-4, atol=1e-5)
    data.y[:, 3] += 100.0
    again = data.pooled().solve(EVERY)
    np.testing.assert_array_equal(again.theta, apart.theta)
    assert not np.allclose(data.pooled().solve(EVERY, held_out=True).theta, all_in.theta)


@pytest.mark.parametrize("choice", [EVERY, SOME])
def test_a_fold_is_judged_by_a_regression_of_the_others_on_the_samples_that_judge(
    choice: list[list[int]],
) -> None:
    data, weights = Data(), 1 / NOISE**2
    pooled = data.pooled()
    errors = pooled.held_out(choice, weights)
    assert errors.shape == (FOLDS, JOINTS)
    for fold in range(FOLDS):
        X, y, joint = data.rows([f for f in range(FOLDS) if f != fold], choice)
        w = np.sqrt(weights[joint])
        theta = np.linalg.lstsq(X * w[:, None], y * w, rcond=None)[0]
        X, y, joint = data.rows([fold], choice)
        left = (y - X @ theta) ** 2
        for j in range(JOINTS):
            mask = data.judging[j, fold]
            assert errors[fold, j] == pytest.approx(left[joint == j][mask].sum(), rel=1e-4)
            assert pooled.counts[fold, j] == mask.sum()
            assert pooled.squares[fold, j] == pytest.approx((data.y[j, fold][mask] ** 2).sum())


def test_relative_errors_are_those_of_what_judges_the_model() -> None:
    data = Data()
    theta = data.pooled().solve(SOME).theta
    X, y, joint = data.rows([3], SOME)
    expected = [
        np.sqrt(np.sum((y - X @ theta)[joint == j] ** 2) / np.sum(y[joint == j] ** 2)) for j in range(2)
    ]
    np.testing.assert_allclose(data.pooled().relative_errors(theta, SOME), expected, rtol=1e-6)
    data.y[1, 3], data.X[1, 3] = 0.0, 0.0
    found = data.pooled().relative_errors(theta, SOME)
    assert found[0] == pytest.approx(expected[0]) and np.isnan(found[1])
    fitted_alone = JointSums(
        [own[:FOLDS] for own in data.sums().parts], [own[:FOLDS] for own in data.sums().judges]
    )
    assert np.isnan(Pooled(fitted_alone, [TERMS, TERMS], FOLDS).relative_errors(theta, SOME)).all()


def test_a_prior_counts_as_a_measurement_of_so_many_repeats() -> None:
    data, prior = Data(), Prior(np.diag([50.0, 0.0, 5.0, 1.0]), np.array([2.0, 9.0, -1.0, 0.0]))
    solution = data.pooled(repeats=4.0).solve(EVERY, prior)
    X, y, joint = data.rows([0, 1, 2], EVERY)
    w = solution.weights[joint]
    G = (X.T * w) @ X
    G[:4, :4] += 4 * prior.precision
    b = (X.T * w) @ y
    b[:4] += 4 * prior.precision @ prior.centre
    np.testing.assert_allclose(solution.theta, np.linalg.solve(G, b), rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(solution.G, G, rtol=1e-5, atol=1e-4)
    assert solution.repeats == 4.0
    held = data.pooled(repeats=4.0).held_out(EVERY, solution.weights, prior)
    assert not np.allclose(held, data.pooled(repeats=4.0).held_out(EVERY, solution.weights), rtol=1e-3)


@pytest.mark.parametrize("seed", range(3))
def test_passive_friction_is_non_negative_least_squares_but_for_offsets(seed: int) -> None:
    data = Data(seed, (-0.5, -0.6, 1.0, -0.3, 0.8, -0.5))
    solution = data.pooled(passive=True).solve(EVERY)
    assert solution.theta[4] < 0 and solution.theta[7] < 0
    assert (solution.theta[[5, 6, 8, 9]] >= 0).all() and (solution.theta[[5, 6, 8, 9]] == 0).any()
    X, y, joint = data.rows([0, 1, 2], EVERY)
    w = np.sqrt(solution.weights[joint])
    lower = np.full(10, -np.inf)
    lower[[5, 6, 8, 9]] = 0.0
    expected = lsq_linear(X * w[:, None], y * w, (lower, np.full(10, np.inf)), tol=1e-12).x
    np.testing.assert_allclose(solution.theta, expected, rtol=1e-4, atol=1e-5)
    free = data.pooled(passive=False).solve(EVERY).theta
    assert free[[5, 6, 8, 9]].min() < 0


@pytest.mark.parametrize("passive", [True, False])
def test_shared_coefficients_that_are_held_are_not_negative(passive: bool) -> None:
    """Of the four the second is -2; the others are what least squares make of it."""
    data = Data()
    held = np.array([True, True, False, False])
    theta = data.pooled(held=held, passive=passive).solve(EVERY).theta
    free = data.pooled(passive=passive).solve(EVERY).theta
    assert free[1] < -1.9 and theta[1] == 0.0 and theta[0] > 0.0
    X, y, joint = data.rows([0, 1, 2], EVERY)
    weight = np.sqrt(data.pooled(held=held, passive=passive).solve(EVERY).weights)[joint]
    low = np.where([*held, *([False, passive, passive] * 2)], 0.0, -np.inf)
    best = lsq_linear(X * weight[:, None], y * weight, (low, np.inf), tol=1e-12)
    np.testing.assert_allclose(theta, best.x, rtol=1e-3, atol=1e-4)


def test_the_evidence_of_a_prior_is_the_probability_of_the_data() -> None:
    data, weights = Data(), np.array([2.0, 0.3])
    # no friction: all coefficients have the prior, and y is Gaussian
    X, y, joint = data.rows([0, 1, 2], [[], []])
    differences, by_hand = [], []
    for precision, centre in ((0.5, 0.0), (4.0, 1.0), (0.01, -3.0)):
        prior = Prior(precision * np.eye(4) + 0.1 * precision, np.full(4, centre))
        differences.append(data.pooled(repeats=2.0).evidence([[], []], weights, prior))
        covariance = np.diag(2.0 / weights[joint]) + X @ np.linalg.inv(prior.precision) @ X.T
        by_hand.append(multivariate_normal(X @ prior.centre, covariance).logpdf(y))
    np.testing.assert_allclose(np.diff(differences), np.diff(by_hand), rtol=1e-4)


def test_a_choice_is_by_the_places_of_its_terms_and_sums_add_up() -> None:
    data = Data()
    pooled = data.pooled()
    assert pooled.choice([[TERMS[2]], [TERMS[0], TERMS[1]]]) == SOME
    assert pooled.everything == EVERY
    assert pooled.shared == SHARED
    both = data.sums() + data.sums()
    for one, two in zip(data.sums().judges[1], both.judges[1], strict=True):
        np.testing.assert_allclose(two.G, 2 * one.G)
        assert two.count == 2 * one.count
    for one, two in zip(data.sums().parts[0], both.parts[0], strict=True):
        np.testing.assert_allclose(two.b, 2 * one.b)
        assert two.yy == pytest.approx(2 * one.yy)


class TestTermsThatNothingExcites:
    """A Stribeck fall is one at the onset of sliding and next to nothing, 1e-90 maybe, at any speed above."""

    TERMS = (FrictionTerm("offset"), FrictionTerm("viscous"), FrictionTerm("stribeck_peak", parameter=0.1))

    def pooled(self, slowest: list[float], passive: bool, seed: int = 0) -> Pooled:
        """Of one joint whose speeds begin with the slowest of each fold."""
        rng, parts = np.random.default_rng(seed), []
        for low in slowest:
            v = np.append(low, rng.uniform(1.0, 2.0, 40))
            X = np.column_stack([rng.normal(size=41), np.ones(41), v, np.exp(-((v / 0.1) ** 2))])
            parts.append(Moments.of(X, X @ [1.0, 0.3, 0.5, 0.0] + 0.01 * rng.normal(size=41)))
        sums = JointSums([parts], [parts])
        return Pooled(sums, [list(self.TERMS)], len(slowest), passive=passive)

    @pytest.mark.parametrize("passive", [True, False])
    def test_they_stay_zero_and_cost_nothing_where_the_joint_is_slow(self, passive: bool) -> None:
        pooled = self.pooled([1.5, 1.5, 0.0], passive)
        with_fall, without = [[0, 1, 2]], [[0, 1]]
        weights = pooled.solve(without).weights
        # of the fold in which it creeps the others say nothing
        expected = pooled.held_out(without, weights)[2]
        np.testing.assert_allclose(
            pooled.held_out(with_fall, weights)[2], expected, rtol=1e-6
        )  # the ridge's size
        fast = self.pooled([1.5, 1.5], passive)
        theta = fast.solve(with_fall).theta
        assert theta[3] == 0.0
        np.testing.assert_allclose(theta[:3], fast.solve(without).theta, rtol=1e-6)

    @pytest.mark.parametrize("repeats", [1.0, 4.0])
    def test_one_sample_at_the_onset_of_sliding_excites(self, repeats: float) -> None:
        rng = np.random.default_rng(1)
        for squares, excited in ((1.01 * repeats, True), (0.99 * repeats, False)):
            fall = np.append(np.full(4, np.sqrt(squares / 4)), np.zeros(40))
            X = np.column_stack([rng.normal(size=44), np.ones(44), rng.uniform(1, 2, 44), fall])
            part = Moments.of(X, X @ [1.0, 0.3, 0.5, 0.7])
            pooled = Pooled(JointSums([[part]], [[part]]), [list(self.TERMS)], 1, repeats)
            assert pooled.solve([[0, 1, 2]]).theta[3] == pytest.approx(0.7 if excited else 0.0, rel=1e-4)

    def test_what_grows_with_speed_or_load_is_excited_however_little(self) -> None:
        terms = [FrictionTerm("viscous"), FrictionTerm("load_sign"), FrictionTerm("cubic")]
        X = 1e-6 * np.random.default_rng(2).normal(size=(40, 4))
        part = Moments.of(X, X @ [1.0, 0.3, 0.5, 0.7])
        pooled = Pooled(JointSums([[part]], [[part]]), [terms])
        np.testing.assert_allclose(pooled.solve([[0, 1, 2]]).theta, [1.0, 0.3, 0.5, 0.7], rtol=1e-4)

    def test_it_is_by_its_own_squares_that_a_term_is_excited(self) -> None:
        """Beside two shared columns, one of them large."""
        rng = np.random.default_rng(3)
        X = np.column_stack([*rng.normal(size=(2, 44)), np.ones(44), rng.uniform(1, 2, 44), np.zeros(44)])
        X[0, 4] = 0.9
        part = Moments.of(X, X @ [1.0, -1.0, 0.3, 0.5, 0.7])
        pooled = Pooled(JointSums([[part]], [[part]]), [list(self.TERMS)])
        assert pooled.solve([[0, 1, 2]]).theta[4] == 0.0

    def test_at_the_onset_of_sliding_a_term_is_its_direction_or_nothing(self) -> None:
        """Without time: what fades with it has gone."""
        once = {"smooth_sign", "offset", "stribeck_peak", "hysteresis", "sign", "both_ways"}
        found = {kind for kind in KINDS if _at_rest(FrictionTerm(kind, parameter=0.2))}
        assert found - {"fading_sign"} == once
        assert {_at_rest(FrictionTerm(kind, parameter=0.2)) for kind in once} == {1.0}


def test_one_fold_is_fitted_and_the_rest_judges_unless_said_otherwise() -> None:
    data = Data()
    sums = data.sums()
    pooled = Pooled(sums, [TERMS, TERMS])
    np.testing.assert_allclose(pooled.solve(SOME).theta, data.by_hand([0], SOME)[0], rtol=1e-4, atol=1e-5)
    # what nothing was fitted to is met by nothing
    errors = pooled.held_out(SOME, np.ones(2))
    np.testing.assert_allclose(errors, pooled.squares, rtol=1e-12)
    assert errors.shape == (1, 2)


@pytest.mark.parametrize("unit", [1e4, 1e-4])
def test_the_unit_of_torques_changes_no_relative_error(unit: float) -> None:
    data, other = Data(), Data()
    other.y *= unit
    usual, scaled = data.pooled(), other.pooled()
    theta, again = usual.solve(EVERY).theta, scaled.solve(EVERY).theta
    np.testing.assert_allclose(again, unit * theta, rtol=1e-6)
    np.testing.assert_allclose(
        scaled.relative_errors(again, EVERY), usual.relative_errors(theta, EVERY), rtol=1e-6
    )


def test_weights_begin_with_the_torques_and_follow_what_is_left() -> None:
    """Few rows and unequal joints, so that three rounds are not the end of it."""
    rng = np.random.default_rng(4)
    X = rng.normal(size=(2, 9, 3))
    y = X @ [1.0, -1.0, 0.5] + rng.normal(size=(2, 9)) * [[0.2], [40.0]]
    parts = [[Moments.of(X[j], y[j])] for j in range(2)]
    found = Pooled(JointSums(parts, parts), [[], []]).solve([[], []])
    weights = 9 / np.sum(y**2, axis=1)
    for last in (False, False, False, True):
        G = np.einsum("j,jni,njk->ik", weights, X, np.swapaxes(X, 0, 1))
        theta = np.linalg.solve(G, np.einsum("j,jni,jn->i", weights, X, y))
        if not last:
            weights = 9 / np.sum((y - X @ theta) ** 2, axis=1)
    # but for the ridge of 1e-7
    np.testing.assert_allclose(found.theta, theta, rtol=1e-6)
    np.testing.assert_allclose(found.weights, weights, rtol=1e-6)


def test_an_exact_joint_weighs_by_round_off_and_one_of_a_single_sample_by_its_error() -> None:
    rng = np.random.default_rng(5)
    X = rng.normal(size=(20, 2))
    exact, one = Moments.of(X, X @ [1.0, 2.0]), Moments.of(np.zeros((1, 2)), np.array([3.0]))
    none = Moments.none(2)
    parts = [[exact], [one], [none]]
    weights = Pooled(JointSums(parts, parts), [[], [], []]).solve([[], [], []]).weights
    assert weights[:2] == pytest.approx([20 / (1e-12 * exact.yy), 1 / 9], rel=1e-2)
    assert np.isfinite(weights[2])
