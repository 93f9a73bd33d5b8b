"""How one step's regression is put together: what each part is asked, and what is reported of the answers."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from armloop.features.double_feature_set import DoubleFeatureSet
from armloop.identification.reconstruction import step as steps
from armloop.identification.reconstruction.step import PARTS, StepPlan, candidates_of
from armloop.laws.friction import FrictionTerm
from armloop.regression.moments import Moments

LAWS = (
    FrictionTerm("sign"),
    FrictionTerm("stribeck", parameter=0.1),
    FrictionTerm("stribeck", parameter=0.2),
)


class Scripted:
    """Stands for the estimator: it takes the columns that it is told to, and notes what it is asked."""

    def __init__(self, supports: list[list[int]], drop: int | None = None, shrinks: bool = False) -> None:
        self.supports, self.drop = list(supports), drop
        self.how = SimpleNamespace(needs_parts=False, shrinks=shrinks)
        self.asked: list[tuple[list[float], list[int], float]] = []
        self.pruned: list[tuple[list[int], list[int], float]] = []

    def fit(self, moments: Moments, forced: Any, power: float, parts: Any) -> Any:
        self.asked.append((moments.b.tolist(), forced.tolist(), power))
        local = self.supports.pop(0) if len(self.supports) > 1 else self.supports[0]
        return np.array(local), 7.0 + np.arange(len(local))

    def prune(self, moments: Moments, support: Any, doubtful: Any, power: float) -> Any:
        self.pruned.append((support.tolist(), doubtful.tolist(), power))
        return support[support != self.drop]


class TestSelection:
    """Three library columns, one fixed friction column (3) and two of which one is profiled (4 and 5)."""

    @staticmethod
    def joint(x: Any) -> Any:
        rng = np.random.default_rng(0)
        X = np.linalg.qr(rng.normal(size=(60, 6)))[0]
        moments = Moments.of(X, X @ np.array(x))
        every, three = np.ones(3, dtype=bool), np.array([3])
        joint = steps._Joint(moments, moments, 3, every, three, np.array([4, 5]), 0.5)
        return joint, moments

    def test_the_library_stands_before_friction_that_is_not_asked(self) -> None:
        joint, moments = self.joint([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
        joint.distinct[1] = False
        sparse: Any = Scripted([[0, 2, 3]])
        fit = joint.select(moments, np.array([0, 1, 2]), sparse)
        # its columns are 0 and 2, the fixed 3 and the profiled 5; again with the one that was chosen, then it is settled
        assert [(np.round(b).tolist(), forced, power) for b, forced, power in sparse.asked] == [
            ([1.0, 3.0, 4.0, 6.0], [2, 3], 0.25)
        ] * 2
        assert sparse.pruned == [([0, 3, 5], [3, 5], 0.25)]
        assert fit.support.tolist() == [0, 3, 5]
        np.testing.assert_allclose(fit.beta, [1.0, 4.0, 6.0], atol=1e-9)

    def test_three_times_at_most_is_a_velocity_profiled(self) -> None:
        """Each time the other one, beside what was chosen before."""
        joint, moments = self.joint([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
        profiled = []

        def other(self: Any, moments: Moments, base: Any) -> Any:
            profiled.append(base.tolist())
            return np.array([4 + len(profiled) % 2])

        sparse: Any = Scripted([[0, 3], [1, 2, 3], [0, 2, 3]])
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(steps._Joint, "_profiled", other)
            joint.select(moments, np.array([0, 1]), sparse)
        assert profiled == [[3], [3, 0], [3, 1]] and len(sparse.asked) == 3

    def test_shrunk_coefficients_stay_where_no_column_goes(self) -> None:
        joint, moments = self.joint([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
        shrunk = [7.0, 8.0, 9.0]
        for shrinks, drop, expected in (
            (True, None, shrunk),
            (True, 5, [1.0, 4.0]),
            (False, None, [1.0, 4.0, 6.0]),
        ):
            sparse: Any = Scripted([[0, 1, 2]], drop, shrinks)
            np.testing.assert_allclose(joint.select(moments, np.array([0]), sparse).beta, expected, atol=1e-9)


def test_a_joint_has_the_columns_that_are_alive_and_no_others_function(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rng = np.random.default_rng(1)
    X = rng.normal(size=(50, 6))
    X[:, 1] = X[:, 3]  # the fixed friction term
    X[:, 3:] *= 0.05  # squares far below one
    X[:, 4] = 0.0
    every, fitted = Moments.of(X, X[:, 0]), Moments.of(X[:20], X[:20, 0])
    asked = []

    def problems(columns: Any, sums: Any) -> Any:
        return SimpleNamespace(
            moments=lambda j, choosing=None: (
                asked.append((j, choosing)) or {None: every, False: fitted}[choosing]
            )
        )

    def twins(factors: Any, index: Any, laws: Any, joint: int) -> Any:
        assert laws == [LAWS[0], LAWS[2]] and joint == 0
        return np.array([False, False, True])

    monkeypatch.setattr(steps, "Problems", problems)
    monkeypatch.setattr(steps, "twins", twins)
    library = SimpleNamespace(size=3, factors=None, index=None)
    sums: Any = SimpleNamespace(samples=lambda j: 30, scale=lambda j: 2.5)
    plan = StepPlan(PARTS[:1], ((1, 0),), (), (1,))
    (joint,) = steps._joints(SimpleNamespace(library=library, friction=(LAWS,)), sums, plan)  # type: ignore[arg-type]
    assert joint.all is every and joint.fit is fitted and (joint.size, joint.scale) == (3, 2.5)
    assert joint.fixed.tolist() == [3] and joint.profile.tolist() == [5]
    assert joint.distinct.tolist() == [True, False, False]


class TestWholeStep:
    """Two joints, two parts and two orders, with the regression faked."""

    PLAN = StepPlan(PARTS[:2], ((1, 1), (2, 1)), ("sign",), (1, 2))
    REVOLUTE = (True, True)

    @pytest.fixture
    def noted(self, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
        noted: dict[str, Any] = {"fits": [], "after": []}
        joints = [SimpleNamespace(fit=f"fit {j}", all=f"all {j}", scale=2.0 + j) for j in range(2)]

        def fit(joint: Any, moments: str, library: Any, options: Any) -> Any:
            noted["fits"].append((moments, len(library)))
            return f"{moments} of {len(library)}"

        def collected(final: Any, step: Any, columns: Any, plan: Any) -> Any:
            noted["final"] = final
            counts = np.array([[1.0, 0.0], [2.0, 0.5], [0.0, 3.0]])
            terms = [SimpleNamespace(coefficients=counts[:2]), SimpleNamespace(coefficients=counts)]
            first, second = FrictionTerm("sign", 1.0), FrictionTerm("viscous", 1.0)
            assert (first.step, second.step) == (1, 2)
            return terms, [[first, second], [first, first]]

        def corrected(fits: Any, joints: Any, gradients: Any) -> Any:
            noted["after"].append("corrected")
            return fits

        def without(data: Any, choice: Any, columns: Any, fits: Any, snr: Any) -> Any:
            noted["after"].append(snr)
            return fits

        monkeypatch.setattr(steps, "_joints", lambda columns, sums, plan: joints)
        monkeypatch.setattr(steps, "_friction", lambda data, choice, plan: ((), ()))
        monkeypatch.setattr(steps, "_fit", fit)
        monkeypatch.setattr(steps, "_collect", collected)
        monkeypatch.setattr(steps, "_corrected", corrected)
        monkeypatch.setattr(steps, "without_attenuation", without)
        return noted

    def regressed(self, noted: dict[str, Any], best: int, shrinks: bool = False, snr: Any = None) -> Any:
        errors = np.array([[1.0, 3.0], [0.25, 0.75]])
        tried = SimpleNamespace(smallest=lambda: best, errors=errors)
        counts = {None: [50, 9], True: [20, 0], False: [30, 9]}
        sums = SimpleNamespace(samples=lambda j, choosing=None: counts[choosing][j])

        def summed(function: Any) -> Any:
            if function.func is steps.StepSums.of:
                return sums
            noted["tried"] = function.keywords["fits"], function.keywords["weights"].tolist()
            return tried

        data: Any = SimpleNamespace(sum=summed)
        options: Any = SimpleNamespace(sparse=SimpleNamespace(how=SimpleNamespace(shrinks=shrinks)), snr=snr)
        return steps.regress_step(data, self.REVOLUTE, None, self.PLAN, options)  # type: ignore[arg-type]

    def test_orders_are_judged_by_each_joints_errors_relative_to_its_torque(
        self, noted: dict[str, Any]
    ) -> None:
        candidates = candidates_of(self.REVOLUTE, self.PLAN)
        few, all_ = len(candidates.subset((1, 1))), len(candidates.subset((2, 1)))
        assert 0 < few < all_ == candidates.size
        for best, size in ((0, few), (1, all_)):
            noted["fits"].clear()
            self.regressed(noted, best)
            fits, weights = noted["tried"]
            assert fits == [[f"fit {j} of {k}" for k in (few, all_)] for j in (0, 1)]
            # of no sample that chooses there is one
            assert weights == [1 / (4 * 20), 1 / 9]
            assert noted["final"] == [f"all {j} of {size}" for j in (0, 1)]

    def test_a_report_counts_what_was_looked_for_and_found(self, noted: dict[str, Any]) -> None:
        candidates = candidates_of(self.REVOLUTE, self.PLAN)
        for best, (N1, N2) in enumerate(self.PLAN.orders):
            _, _, reports = self.regressed(noted, best)
            chosen = candidates.subset((N1, N2))
            for report, part in zip(reports, PARTS[:2], strict=True):
                assert (report.step, report.orders) == (part.step, [N1, N2])
                whole = DoubleFeatureSet(self.REVOLUTE, N1, N2, part.second, independent=False).size
                assert report.candidates == whole >= report.independent
                assert report.independent == np.sum(candidates.step[chosen] == part.step)
                assert report.samples == [50, 9]
                assert report.trials == [
                    ([1, 1], pytest.approx(np.sqrt(2.0))),
                    ([2, 1], pytest.approx(np.sqrt(0.5))),
                ]
            # terms of the library, and of the joint's friction those of the step
            assert [report.terms for report in reports] == [[2 + 1, 1 + 2], [2 + 1, 2 + 0]]

    def test_shrunk_fits_are_not_refined_and_noise_is_corrected_where_it_is_known(
        self, noted: dict[str, Any]
    ) -> None:
        for shrinks, snr, expected in (
            (False, None, ["corrected"]),
            (True, None, []),
            (False, 30.0, ["corrected", 30.0]),
        ):
            noted["after"].clear()
            self.regressed(noted, 0, shrinks, snr)
            assert noted["after"] == expected


def test_one_joint_that_is_met_to_round_off_has_all_refined() -> None:
    """Relative to its torque's squares and its samples."""
    X = np.ones((4, 1))
    support = np.array([0])
    joints: Any = [SimpleNamespace(all=Moments.of(X, 3 * X[:, 0]), scale=scale) for scale in (3.0, 1e5)]
    asked = []

    def gradients(fits: Any) -> Any:
        asked.append(1)
        return (np.zeros(1), np.zeros(1))

    # errors of e leave e² of each sample: 1e-9 of the torque's squares
    def left(first: float, second: float) -> int:
        asked.clear()
        fits = [steps.Fit(support, np.array([3 + error])) for error in (first, second)]
        steps._corrected(fits, joints, gradients)
        return len(asked)

    one, two = 3 * np.sqrt(1e-9), 1e5 * np.sqrt(1e-9)
    assert left(1.1 * one, 1.1 * two) == 0
    assert left(0.9 * one, 1.1 * two) == left(1.1 * one, 0.9 * two) == 3
