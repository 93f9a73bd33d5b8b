"""How trials are fitted, refitted and refused, and what a diagnosis changes: on numbers one can see through."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.stats import norm

from armloop.diagnosis import compensation, fit, next_run, trials
from armloop.diagnosis.compensation import FeedforwardChange
from armloop.diagnosis.evidence import Stacked
from armloop.diagnosis.fit import Fit, Shape, Solution, deviate, wald_statistic
from armloop.diagnosis.trials import Known
from armloop.laws.effects import Estimate
from armloop.regression.clustered import clustered_covariance


class TestRefits:
    @staticmethod
    def known(
        found: list[tuple[float, float]], effects: list[Any], monkeypatch: pytest.MonkeyPatch
    ) -> tuple[Known, int]:
        """What is known if the fits, one after the other, leave such errors and find such values (±1); how many are made."""
        made = iter(found)
        fits: list[Any] = []

        def fitted(evidence: Any, residual: Any, effects: Any, shapes: Any) -> Any:
            fits.append((evidence, residual))
            error, value = next(made)
            score = SimpleNamespace(error=error)
            parameters = ({"x": Estimate(value, 1.0, "1")},)
            return SimpleNamespace(score=score, effects=(), parameters=parameters, added=list)

        monkeypatch.setattr(trials, "fit", fitted)
        monkeypatch.setattr(trials, "lead", lambda worse, better: worse.error - better.error)
        evidence: Any = SimpleNamespace(residual=lambda added: 0)
        evidence.knowing = lambda added: SimpleNamespace(unexplained=len(fits))
        return Known.of(evidence, effects, [None] * len(effects)), len(fits)  # type: ignore[list-item]

    def test_effects_are_fitted_anew_with_what_they_change_of_each_other(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        known, fits = self.known([(30.0, 8.0), (20.0, 9.0), (20.1, 9.8), (20.0, 9.85)], [None], monkeypatch)
        # until the parameters stay, whether or not they leave less: the last fit changes them by a twentieth of an error
        assert known.fit.score.error == 20.1 and fits == 4 and known.residual == 2
        known, fits = self.known([(3.0, 8.0), (3.0, 8.0)], [None], monkeypatch)
        assert known.fit.score.error == 3.0 and fits == 2 and known.residual == 0
        # by chance a fit may leave more, by more than that it went astray
        known, fits = self.known([(30.0, 8.0), (20.0, 9.0), (22.5, 11.0)], [None], monkeypatch)
        assert known.fit.score.error == 20.0 and known.residual == 1
        assert self.known([(3.0, 8.0)], [], monkeypatch)[1] == 1


class TestCovariance:
    """Of coefficients: what blocks show, what cells show beyond it, and what the model itself does not know."""

    @staticmethod
    def problem(model_errors: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray, Stacked]:
        rng = np.random.default_rng(4)
        X, left = rng.normal(size=(400, 2)), rng.normal(size=400)
        block, cell, own = np.arange(400) // 10, np.arange(400) % 7, np.zeros((400, 0))
        own = own if model_errors is None else model_errors
        return X, left, Stacked(X, left, block, block % 2, 0 * block, 1, cell, own)

    def test_what_no_column_shows_has_infinite_variance_and_spoils_nothing_else(self) -> None:
        X, left, rows = self.problem()
        found = fit.covariance(np.insert(X, 1, 1e-15 * X[:, 0], axis=1), left, rows)
        assert found[1, 1] == np.inf and not found[1, [0, 2]].any()
        np.testing.assert_allclose(
            found[np.ix_([0, 2], [0, 2])], fit.covariance(X, left, rows), rtol=1e-6, atol=1e-9
        )

    def test_blocks_and_cells_count_once_what_they_have_in_common(self) -> None:
        X, left, rows = self.problem()
        same = replace(rows, cell=rows.block)
        by_block = clustered_covariance(X, left, rows.block)
        np.testing.assert_allclose(fit.covariance(X, left, same), by_block, rtol=1e-9)
        # an error that comes back with the motion, of one column alone, is more than blocks show
        again = X[:, 0] * np.random.default_rng(5).normal(size=7)[rows.cell]
        one = replace(rows, block=np.arange(400))
        found = fit.covariance(X[:, :1], again, one)
        each = [clustered_covariance(X[:, :1], again, x) for x in (one.block, rows.cell)]
        np.testing.assert_allclose(found, each[1], rtol=1e-9)  # a row a block: what is common is the block
        assert each[1][0, 0] > 5 * each[0][0, 0]

    def test_what_the_model_may_err_by_in_the_direction_of_a_law_is_an_error_of_the_law(self) -> None:
        X, left, rows = self.problem()
        along = X @ np.array([[0.3, 0.0], [-0.1, 2.0]])
        across = np.linalg.qr(np.hstack([X, np.ones((400, 1))]))[0][:, 2:]
        own = fit.covariance(X, left, replace(rows, model_errors=np.hstack([along, 5 * across])))
        expected = fit.covariance(X, left, rows) + np.array([[0.09, -0.03], [-0.03, 4.01]])
        np.testing.assert_allclose(own, expected, rtol=1e-6)


def best_shape(known: Known, effect: Any, shapes: list[float]) -> Shape:
    return trials._best_shape(known, effect, trials._Grid.of(known, effect, shapes))


class TestTrials:
    @pytest.mark.parametrize(
        ("of", "made"),
        [
            ({}, True),
            ({"indices": ()}, True),
            ({"indices": (0, 1)}, False),  # the second joint rests
            ({"indices": (1,)}, False),
            ({"shapes": []}, False),
            ({"shapes": [1.0, 2.0]}, True),
            ({"plausible": False}, False),
            ({"resolved": False}, False),
        ],
    )
    def test_an_effect_must_show_be_plausible_and_resolved(
        self, of: dict[str, Any], made: bool, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        effect: Any = SimpleNamespace(
            indices=of.get("indices", (0,)),
            shapes=lambda context: of.get("shapes", [5.0]),
            usual=lambda context: None,
            possible=lambda arm, parameters, had: of.get("plausible", True),
            resolved=lambda parameters, shapes: of.get("resolved", True),
            estimates=lambda arm, free, spread, value: {},
        )
        asked: list[Any] = []

        def fitted(evidence: Any, residual: Any, effects: Any, shapes: Any, known: Any) -> Any:
            asked.append((effects, shapes, known))
            solution = Solution(np.zeros(2), [np.zeros(1)] * 2, np.eye(2), [0.0] * 2)
            nothing: Any = SimpleNamespace(X=np.zeros((0, 2)), y=np.zeros(0))
            return Fit(cast(Any, None), tuple(effects), tuple(shapes), solution, np.zeros((2, 0)), nothing)

        monkeypatch.setattr(trials, "fit", fitted)
        chosen = Shape(2.0, (1.0, 2.0))
        monkeypatch.setattr(trials, "_best_shape", lambda known, effect, grid: chosen)
        monkeypatch.setattr(trials._Grid, "of", lambda *_: SimpleNamespace())
        rows = np.zeros((4, 2), dtype=bool)
        rows[2, 0] = True
        evidence: Any = SimpleNamespace(
            rows=rows,
            context=None,
            tried=lambda effect: effect.shapes(None),
            model=SimpleNamespace(arm=None),
        )
        # what was known before is nothing beside it, and may be of either sign
        other: Any = SimpleNamespace(
            possible=lambda arm, parameters, had: False, estimates=lambda arm, free, spread, value: {}
        )
        current: Any = SimpleNamespace(effects=(other,), shapes=(Shape.fixed(0.0),))
        of_effects = Known(evidence, np.zeros((4, 2)), current)
        of_effects._columns[0, 0.0] = np.ones((1, 1))
        trial = of_effects.trial(effect)
        assert (trial is not None) == made
        if made:
            shape = chosen if "shapes" in of else Shape.fixed(5.0)
            # with the columns of what was known before
            assert asked == [([other, effect], [Shape.fixed(0.0), shape], of_effects._columns)]

    @pytest.mark.parametrize(
        ("bare", "with_errors", "possible"), [(True, False, True), (False, True, True), (False, False, False)]
    )
    def test_what_is_possible_within_its_errors_is_possible(
        self, bare: bool, with_errors: bool, possible: bool
    ) -> None:
        """The second of two effects, of two free parameters with variances 2 and 3; of the first there are one, and 1."""
        told: list[np.ndarray] = []

        def estimates(arm: Any, free: Any, spread: np.ndarray, value: float) -> Any:
            told.append(spread)
            return {"surely": not spread.any(), "free": free, "value": value}

        def plausible(arm: Any, mine: Any, had: Any) -> bool:
            assert (mine["free"].tolist(), mine["value"]) == ([5.0, 6.0], 8.0)
            return bare if mine["surely"] else with_errors

        of: Any = SimpleNamespace(
            estimates=estimates, possible=plausible, resolved=lambda mine, tried: tried == [8.0]
        )
        first: Any = SimpleNamespace(estimates=lambda *_: {})
        free = [np.array([4.0]), np.array([5.0, 6.0])]
        nothing: Any = None
        solution = Solution(np.zeros(3), free, np.eye(3), [7.0, 8.0])
        made = Fit(nothing, (first, of), (Shape.fixed(0.0),) * 2, solution, np.zeros((2, 0)), nothing)
        vars(made)["_spread"] = [np.eye(1), np.diag([2.0, 3.0])]
        assert made.is_possible(-1, [8.0]) is possible and not made.is_possible(1, [9.0])
        assert not told[0].any() and told[0].shape == (2, 2)

    def test_every_effect_has_its_own_block_of_the_covariance(self, monkeypatch: pytest.MonkeyPatch) -> None:
        whole = np.arange(9.0).reshape(3, 3)
        asked: list[Any] = []
        monkeypatch.setattr(fit, "covariance", lambda X, left, rows: asked.append((X, left)) or whole)
        J = np.array([[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]])
        rows: Any = SimpleNamespace(X=np.ones((2, 3)), y=np.array([10.0, 20.0]))
        solution = Solution(np.array([1.0, 2.0, 3.0]), [np.zeros(1), np.zeros(2)], J, [0.0, 0.0])
        effects, shapes = cast(Any, (None, None)), (Shape.fixed(0.0),) * 2
        own, other = Fit(cast(Any, None), effects, shapes, solution, np.zeros((2, 0)), rows)._spread
        np.testing.assert_array_equal(own, [[0.0]])
        np.testing.assert_array_equal(other, [[4.0, 5.0], [7.0, 8.0]])
        ((X, left),) = asked
        np.testing.assert_array_equal(X, [[1.0, 2.0, 3.0]] * 2)
        np.testing.assert_array_equal(left, [4.0, 14.0])

    def test_a_shape_is_chosen_on_all_blocks_and_without_each_fold(self) -> None:
        t = np.linspace(0, 2 * np.pi, 80, endpoint=False)
        shapes = [1.0, 2.0, 3.0]
        fold = np.repeat([0, 1], 40)
        # of two joints the second shows it: twice an angle in the first fold, half as much of thrice it in the other
        y = np.where(fold == 0, np.sin(2 * t), 0.5 * np.sin(3 * t))
        stacked = SimpleNamespace(joint=np.repeat([0, 1], 80))
        first = np.sin(t)
        current: Any = SimpleNamespace(
            stacked=stacked,
            held_out=np.concatenate([first, y]),
            outside=np.tile(np.concatenate([first, y]), (2, 1)),
        )
        evidence: Any = SimpleNamespace(
            smoothed=lambda effect, shape: np.sin(shape * t)[:, None],
            rows=np.ones((80, 2), dtype=bool),
            independent=slice(None),
            scale=np.array([1.0, 0.1]),
            fold=fold,
            context=None,
        )
        known = Known(evidence, np.zeros((80, 2)), current)
        linear = {
            "start": lambda beta: beta,
            "embed": lambda x: (x, np.eye(len(x))),
            "between": lambda *_: (),
        }
        effect: Any = SimpleNamespace(indices=(1,), usual=lambda context: None, **linear)
        assert best_shape(known, effect, shapes) == Shape(2.0, (3.0, 2.0))
        effect.indices = (0,)
        assert best_shape(known, effect, shapes) == Shape(1.0, (1.0, 1.0))
        # what is left without a fold chooses for it
        current.outside[0] = np.concatenate([first, np.sin(t)])
        effect.indices = (1,)
        assert best_shape(known, effect, shapes) == Shape(2.0, (1.0, 2.0))

    def test_a_shape_is_chosen_with_the_coefficients_that_are_given(self) -> None:
        """The first column's is one, as of a delay's secant: minus that of the first shape would leave nothing at all."""
        t = np.linspace(0, 2 * np.pi, 80, endpoint=False)
        y, fold = np.sin(t), np.repeat([0, 1], 40)
        columns = {
            1.0: np.column_stack([-y, np.cos(5 * t)]),
            2.0: np.column_stack([0.5 * y, 0.2 * y + np.cos(5 * t)]),
        }
        current: Any = SimpleNamespace(
            stacked=SimpleNamespace(joint=np.zeros(80, dtype=int)), held_out=y, outside=np.tile(y, (2, 1))
        )
        evidence: Any = SimpleNamespace(
            smoothed=lambda effect, shape: columns[shape],
            rows=np.ones((80, 1), dtype=bool),
            independent=slice(None),
            scale=np.ones(1),
            fold=fold,
            context=None,
        )
        effect: Any = SimpleNamespace(
            indices=(0,),
            start=lambda beta: beta[-1:],
            embed=lambda x: (np.array([1.0, x[0]]), np.array([[0.0], [1.0]])),
            **{"between": lambda *_: (), "usual": lambda context: None},
        )
        known = Known(evidence, np.zeros((80, 1)), current)
        assert best_shape(known, effect, [1.0, 2.0]) == Shape(2.0, (2.0, 2.0))

    def test_columns_that_are_large_and_alike_are_one(self) -> None:
        """As of presliding on the log of another arm, whose torques are many times the model's noise."""
        t = np.linspace(0, 2 * np.pi, 80, endpoint=False)
        y, fold = np.sin(t), np.repeat([0, 1], 40)
        current: Any = SimpleNamespace(
            stacked=SimpleNamespace(joint=np.zeros(80, dtype=int)), held_out=y, outside=np.tile(y, (2, 1))
        )
        evidence: Any = SimpleNamespace(
            smoothed=lambda effect, shape: np.repeat(4096.0 * np.sin(shape * t)[:, None], 2, axis=1),
            rows=np.ones((80, 1), dtype=bool),
            independent=slice(None),
            scale=np.ones(1),
            fold=fold,
            context=None,
        )
        effect: Any = SimpleNamespace(
            joint=1,
            indices=[0],
            start=lambda beta: beta,
            embed=lambda x: (x, np.eye(len(x))),
            **{"between": lambda *_: (), "usual": lambda context: None},
        )
        known = Known(evidence, np.zeros((80, 1)), current)
        assert best_shape(known, effect, [2.0, 1.0]) == Shape(1.0, (1.0, 1.0))

    @pytest.mark.parametrize(
        ("order", "noise", "chosen"),
        [
            (2.5, 0.0, 2.5),
            (2.4, 0.0, 2.4),
            # by a hundredth of what it explains: the whole number stands for it
            (2.015, 0.0, 2.0),
            # by less than what so few blocks may show by chance
            (2.4, 1.6, 2.0),
            (2.1, 0.05, 2.1),
        ],
    )
    def test_what_lies_between_is_chosen_where_it_leaves_clearly_less(
        self, order: float, noise: float, chosen: float
    ) -> None:
        t = np.linspace(0, 2 * np.pi, 800, endpoint=False)
        y = np.sin(order * t) + noise * np.random.default_rng(1).normal(size=800)
        fold = np.tile([0, 1], 400)
        current: Any = SimpleNamespace(
            stacked=SimpleNamespace(joint=np.zeros(800, dtype=int)), held_out=y, outside=np.tile(y, (2, 1))
        )
        evidence: Any = SimpleNamespace(
            # the whole orders need a column less
            smoothed=lambda effect, shape: np.column_stack(
                [np.sin(shape * t), np.cos(shape * t), *([] if shape % 1 == 0 else [0 * t])]
            ),
            rows=np.ones((800, 1), dtype=bool),
            independent=slice(None),
            scale=np.ones(1),
            fold=fold,
            blocks=np.arange(800) // 40,
            context=None,
        )
        effect: Any = SimpleNamespace(
            indices=(0,),
            start=lambda beta: beta,
            embed=lambda x: (x, np.eye(len(x))),
            usual=lambda context: None,
            between=lambda context, shape: [
                shape - 0.1,
                shape + 0.1,
                shape + 0.4,
                shape + 0.5,
                shape + 0.015,
            ],
        )
        known = Known(evidence, np.zeros((800, 1)), current)
        found = best_shape(known, effect, [1.0, 2.0, 3.0])
        assert found.final == pytest.approx(chosen) and found.without == pytest.approx((chosen, chosen))
        if noise < 1.0:
            # what leaves least counts where it is asked whether it is worth a fit
            first = trials._Grid.of(known, effect, [1.0, 2.0, 3.0]).first(known, effect)
            assert first == pytest.approx(order)


def test_a_shape_is_not_refined_beyond_what_is_tried() -> None:
    effect: Any = SimpleNamespace(shapes=[1.0, 3.0, 2.0])
    evidence: Any = SimpleNamespace(tried=lambda effect: effect.shapes)
    assert [fit._bounded(effect, evidence, x) for x in (0.5, 1.5, 3.5)] == [1.0, 1.5, 3.0]
    effect.shapes = [1.0]
    assert fit._bounded(effect, evidence, 7.0) == 7.0


def test_standard_errors_fall_with_the_size_of_columns_and_their_correlation() -> None:
    def stage(*columns: list[float]) -> Any:
        X = np.array(columns).T
        return SimpleNamespace(columns=lambda effect, shape: X[:, :2] if effect == "both" else X[:, 2:])

    laws: Any = [SimpleNamespace(effect="both", shape=0.0), SimpleNamespace(effect="one", shape=0.0)]
    run = stage([1, 0, 0, 0], [0, 2, 0, 0], [0, 0, 1, 0])
    # the first two grow by 2 and by 8; of the third a part of 0.6 is like the first
    then = stage([2, 0, 0, 0], [0, 16, 0, 0], [0, 0, 5, 0])
    assert next_run._sharper(run, then, laws) == [("both", pytest.approx(0.25)), ("one", pytest.approx(0.2))]
    alike = stage([1, 0, 0, 0], [0, 2, 0, 0], [0.6, 0, 0.8, 0])
    (_, both), (_, one) = next_run._sharper(run, alike, laws)
    assert one == pytest.approx(1 / 0.8) and both == pytest.approx(np.sqrt(1 / 0.8))


def test_of_what_no_motion_shows_there_is_no_standard_error() -> None:
    """The height of a load on an arm whose axes are all vertical."""

    def stage(*columns: list[float]) -> Any:
        X = np.array(columns).T
        return SimpleNamespace(columns=lambda effect, shape: X[:, :2] if effect == "load" else X[:, 2:])

    laws: Any = [SimpleNamespace(effect="load", shape=0.0), SimpleNamespace(effect="height", shape=0.0)]
    run, then = stage([1, 0, 0], [0, 0, 0], [0, 0, 1e-12]), stage([2, 0, 0], [0, 0, 0], [0, 0, 5])
    assert next_run._sharper(run, then, laws) == [("load", pytest.approx(0.5))]
    # nor is there one of what the run has shown and the next one does not
    run = stage([1, 0, 0], [0, 1, 0], [0, 0, 1e-12])
    assert next_run._sharper(run, then, laws) == [("load", pytest.approx(0.5))]


def test_what_feedforward_changes_along_a_run() -> None:
    change = FeedforwardChange(np.arange(2), np.array([[3.0, -1.0], [-4.0, 1.0]]))
    assert change.rms.tolist() == pytest.approx([np.sqrt(12.5), 1.0]) and change.largest.tolist() == [
        4.0,
        1.0,
    ]
    N = 5000
    values = np.arange(float(N))[:, None]
    motion = SimpleNamespace(samples=N, q=values, v=2 * values, vdot=3 * values)
    samples: Any = SimpleNamespace(motion=motion, moving=values > 2500)
    before: Any = SimpleNamespace(drive=lambda: lambda q, v, vdot, slip: q + 10 * v + 100 * vdot)
    after: Any = SimpleNamespace(
        drive=lambda: lambda q, v, vdot, slip: 2 * q + 10 * v + 100 * vdot + 1000 * slip
    )
    found = compensation.feedforward_change(before, after, samples)
    assert len(found.rows) == 2000 and found.rows[[0, -1]].tolist() == [0, N - 1]
    expected = np.where(found.rows > 2500, 2001.0, 1.0) * found.rows
    np.testing.assert_allclose(found.torque[:, 0], expected)
    motion.samples = 3
    assert compensation.feedforward_change(before, after, samples).rows.tolist() == [0, 1, 2]


class TestTogether:
    """Whether coefficients are zero, all together: Wald's test."""

    def test_it_is_the_square_of_what_decorrelates_them(self) -> None:
        rng = np.random.default_rng(0)
        A = rng.normal(size=(3, 3))
        x, spread = rng.normal(size=3), A @ A.T
        expected = float(np.sum(np.linalg.solve(np.linalg.cholesky(spread), x) ** 2))
        assert wald_statistic(x, spread) == (pytest.approx(expected, rel=1e-5), 3)
        # in other units it is the same
        units = np.array([1e-4, 1.0, 1e5])
        assert wald_statistic(units * x, np.outer(units, units) * spread) == (
            pytest.approx(expected, rel=1e-5),
            3,
        )

    def test_what_nobody_knows_says_nothing(self) -> None:
        spread = np.diag([4.0, np.inf, 0.0])
        assert wald_statistic(np.array([3.0, 7.0, 7.0]), spread) == (pytest.approx(9 / 4, rel=1e-6), 1)
        assert wald_statistic(np.array([7.0]), np.array([[np.inf]])) == (0.0, 0) and deviate(0.0, 0) == 0.0

    def test_two_that_are_alike_may_be_plain_though_neither_is(self) -> None:
        spread = np.array([[1.0, -0.99], [-0.99, 1.0]])  # their sum is known to 0.14
        chi_square, freedom = wald_statistic(np.array([0.5, 0.5]), spread)
        assert chi_square == pytest.approx(0.5 / 0.01, rel=1e-5) and freedom == 2

    def test_as_unlikely_as_a_normal_variable(self) -> None:
        for z in (0.1, 1.0, 3.0, 8.0):
            assert deviate(z * z, 1) == pytest.approx(z, rel=1e-9)
        assert deviate(-2 * np.log(0.0027), 2) == pytest.approx(norm.isf(0.0027 / 2), rel=1e-9)
        assert deviate(1e6, 3) == pytest.approx(1e3)  # beyond what a chance can be told by
