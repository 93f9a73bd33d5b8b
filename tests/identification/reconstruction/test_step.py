"""One step's regression piece by piece: its candidates, its friction, what is refined, and what comes of the fits."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from armloop.data.motion import Motion
from armloop.features.wave_moments import WaveProducts
from armloop.identification.reconstruction import step as steps
from armloop.identification.reconstruction.step import PARTS, Part, StepPlan, candidates_of
from armloop.laws.friction import FrictionTerm
from armloop.regression.moments import Moments
from armloop.util.errors import ExcitationError


def plan(*friction: str, parts: tuple[Part, ...] = PARTS[:2], **of: Any) -> StepPlan:
    return StepPlan(parts, of.get("orders", ((1, 1),)), friction, (1,), of.get("still", 0))


def test_a_plan_is_named_for_its_steps() -> None:
    assert plan().name == "step 1+2" and plan(parts=PARTS[2:]).name == "step 3"
    assert [steps._second_order(part, 2) for part in PARTS] == [2, 2, 1]
    assert steps._second_order(PARTS[2], 0) == 0


def test_candidates_belong_to_the_first_step_that_has_them_and_to_their_orders() -> None:
    """A joint that turns: 1, cos and sin of it and of twice it, and these times its speed and its square."""
    found = candidates_of((True,), plan(orders=((1, 1), (2, 2))))
    assert found.size == 5 * 3
    assert [int((found.step == k).sum()) for k in (1, 2)] == [5, 10]
    counts = {
        orders: len(found.subset(orders)) for orders in ((0, 0), (1, 0), (1, 1), (2, 1), (1, 2), (2, 2))
    }
    assert counts == {(0, 0): 1, (1, 0): 3, (1, 1): 6, (2, 1): 10, (1, 2): 9, (2, 2): 15}
    # what stands still is looked for to a higher order: cos and sin of three times it at every order
    more = candidates_of((True,), plan(orders=((1, 1),), still=3))
    assert more.size == 7 + 3 and len(more.subset((1, 1))) == 10 and len(more.subset((0, 0))) == 7
    # the orders of the one and of the other may differ
    assert candidates_of((True,), plan(orders=((2, 1),))).size == 5 * 2
    assert len(candidates_of((True,), StepPlan(PARTS[:1], ((1, 0),), (), (1,))).subset((0, 0))) == 1
    # accelerations are linear, whatever the orders
    assert candidates_of((True,), plan(parts=PARTS[2:], orders=((1, 2),))).second.max() == 1


def test_candidates_are_products_of_waves_and_rates() -> None:
    found = candidates_of((True,), plan(orders=((2, 2),)))
    q, v = np.random.default_rng(0).normal(size=(2, 40, 1))
    motion = Motion(np.arange(40.0), q, v, 0 * q, np.array([0]))
    columns = WaveProducts(found.factors, found.index).columns(motion)
    waves = np.hstack([1 + 0 * q, np.cos(q), np.sin(q), np.cos(2 * q), np.sin(2 * q)])
    expected = np.hstack([waves, waves * v, waves * v**2])
    # each is one of the others', up to its sign and size
    alike = np.abs(
        (columns / np.linalg.norm(columns, axis=0)).T @ (expected / np.linalg.norm(expected, axis=0))
    )
    assert columns.shape == expected.shape and np.sum(alike > 1 - 1e-12) == 15


def test_stribeck_velocities_go_from_a_hundredth_to_one_each_by_the_same_factor() -> None:
    """A geometric grid of four decimals, of sixty."""
    assert len(steps.STRIBECK_GRID) == 60
    np.testing.assert_allclose(steps.STRIBECK_GRID, 0.01 * 100 ** (np.arange(60) / 59), atol=0.5001e-4)
    assert all(round(v, 4) == v for v in steps.STRIBECK_GRID)


class TestFriction:
    @staticmethod
    def found(
        v: np.ndarray, moving: np.ndarray, *kinds: str, turning: tuple[bool, ...] = (True, True)
    ) -> Any:
        usable = SimpleNamespace(moving=moving, motion=SimpleNamespace(v=v))

        class Choice(SimpleNamespace):
            def __call__(self, chunk: Any) -> Any:
                return usable

        choice: Any = Choice(
            inherited=SimpleNamespace(arm=SimpleNamespace(joints=range(v.shape[1]), revolute=turning))
        )
        data: Any = SimpleNamespace(reference=None)
        return steps._friction(data, choice, plan(*kinds))

    def test_every_joint_has_the_fixed_terms(self) -> None:
        fixed = (FrictionTerm("sign"), FrictionTerm("viscous"))
        nothing = np.zeros((0, 2))
        assert self.found(nothing, nothing.astype(bool), "sign", "viscous") == (fixed, fixed)

    def test_stribeck_velocities_below_the_slowest_fiftieth_of_the_speeds_are_not_tried(self) -> None:
        """Of the samples in which the joint moves."""
        grid = steps.STRIBECK_GRID
        between = 0.5 * (grid[1] + grid[2])
        v = np.full((101, 2), -9.0)
        v[:3, 0] = [0.0, 0.0, between]  # the quantile of 0.02 of 101 samples is the third
        v[3:6, 1] = 1e-9
        moving = np.ones((101, 2), dtype=bool)
        moving[3:6, 1] = False
        first, second = self.found(v, moving, "stribeck", "sign")
        assert first == (FrictionTerm("sign"), *(FrictionTerm("stribeck", parameter=x) for x in grid[2:]))
        assert second == (FrictionTerm("sign"),)
        moving[:, 1] = False
        assert len(self.found(v, moving, "stribeck")[1]) == len(grid)
        # of a joint that slides, in m/s
        (_, sliding) = self.found(v, moving, "stribeck", turning=(True, False))
        assert [term.parameter for term in sliding] == [0.1 * x for x in grid]


def test_fits_of_which_hardly_anything_is_left_are_refined_on_the_samples() -> None:
    """y = 2 x, of four samples; a fit of 2 + e leaves e² in parts of the signal's."""
    X = np.array([[1.0], [-1.0], [1.0], [-1.0]])
    moments = Moments.of(X, 2 * X[:, 0])
    joint: Any = SimpleNamespace(all=moments, scale=2.0)
    support = np.array([0])
    asked: list[float] = []

    def gradients(fits: Any) -> Any:
        asked.append(fits[0].beta[0])
        return (np.array([4 * (2.0 - fits[0].beta[0])]),)

    for error, refined in ((0.9, True), (1.1, False)):
        asked.clear()
        beta = np.array([2.0 + 2 * error * np.sqrt(steps._EXACT)])
        (fit,) = steps._corrected([steps.Fit(support, beta)], [joint], gradients)
        assert len(asked) == (steps._CORRECTIONS if refined else 0)
        assert (fit.beta[0] == pytest.approx(2.0, abs=1e-12)) == refined
        assert refined or fit.beta[0] == beta[0]


def test_what_is_kept_of_the_fits_goes_to_its_step_and_its_joint() -> None:
    """Two joints; three candidates, of the steps 1, 1 and 2; friction from the fourth column on."""
    kept: list[list[int]] = []

    def only(rows: np.ndarray) -> Any:
        kept.append(rows.tolist())
        return SimpleNamespace(index=rows[:, None], factors=SimpleNamespace(waves=()))

    laws = ((FrictionTerm("sign"), FrictionTerm("viscous")), (FrictionTerm("offset"),))
    columns: Any = SimpleNamespace(library=SimpleNamespace(size=3, only=only), friction=laws)
    fits = [
        steps.Fit(np.array([0, 2, 4]), np.array([1.0, 2.0, 3.0])),
        steps.Fit(np.array([2, 3]), np.array([4.0, 5.0])),
    ]
    terms, friction = steps._collect(fits, np.array([1, 1, 2]), columns, plan())
    assert kept == [[0], [2]]
    assert [(t.step, t.coefficients.tolist()) for t in terms] == [(1, [[1.0, 0.0]]), (2, [[2.0, 4.0]])]
    assert friction == [[FrictionTerm("viscous", 3.0)], [FrictionTerm("offset", 5.0)]]


def test_a_joint_must_have_thirty_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    sums: Any = SimpleNamespace(samples=lambda j: 29 + j)
    columns: Any = SimpleNamespace(library=SimpleNamespace(size=0), friction=((), ()))
    monkeypatch.setattr(steps, "Problems", lambda columns, sums: None)
    with pytest.raises(ExcitationError, match="joint 1 has 29 usable samples, at least 30 are needed"):
        steps._joints(columns, sums, plan())


def test_the_profiled_column_is_the_one_that_leaves_least() -> None:
    rng = np.random.default_rng(0)
    X = rng.normal(size=(200, 5))
    y = X[:, 0] + 0.4 * X[:, 2] - 2.0 * X[:, 3] + 0.5 * X[:, 4]
    moments = Moments.of(X, y)
    joint: Any = SimpleNamespace(profile=np.array([2, 3, 4]))
    profiled = steps._Joint._profiled
    assert profiled(joint, moments, np.array([0])).tolist() == [3]
    # beside it, the next
    joint.profile = np.array([2, 4])
    assert profiled(joint, moments, np.array([0, 3])).tolist() == [4]
    joint.profile = np.zeros(0, dtype=int)
    assert profiled(joint, moments, np.array([0])).tolist() == []


@pytest.mark.parametrize(("whole", "asked", "given"), [(True, True, 2), (True, False, 0), (False, True, 0)])
def test_an_estimator_that_asks_for_parts_gets_those_of_all_samples(
    whole: bool, asked: bool, given: int
) -> None:
    rng = np.random.default_rng(0)
    X, y = rng.normal(size=(60, 3)), rng.normal(size=60)
    fitted, every = Moments.of(X[:40], y[:40]), Moments.of(X, y)
    none = np.zeros(0, dtype=np.intp)
    joint = steps._Joint(fitted, every, 3, np.ones(3, dtype=bool), none, none, 1.0)
    seen: list[Any] = []

    def fit(moments: Moments, forced: Any, power: float, parts: Any) -> Any:
        seen.append(parts)
        return np.arange(3), np.zeros(3)

    sparse: Any = SimpleNamespace(
        how=SimpleNamespace(needs_parts=asked, shrinks=False),
        fit=fit,
        prune=lambda moments, support, forced, power: support,
    )
    joint.select(every if whole else fitted, np.arange(3), sparse)
    # with no velocity to be profiled, once
    assert [len(parts) for parts in seen] == [given]
    for part, rows in zip(seen[0], (slice(40), slice(40, 60)), strict=False):
        np.testing.assert_allclose(part.G, X[rows].T @ X[rows], atol=1e-12)
