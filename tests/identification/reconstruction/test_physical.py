"""M(q) is kept positive definite where searches find it negative, and what they leave is said."""

import numpy as np
import pytest
from scipy.stats import chi2

from armloop.data.motion import Motion
from armloop.identification.reconstruction import physical
from armloop.identification.reconstruction.physical import (
    Body,
    PhysicalSolution,
    physical_solution,
    physics_notes,
)
from armloop.identification.reconstruction.pooled import Solution
from armloop.laws.friction import FrictionTerm
from armloop.regression.constrained import TooCostly
from armloop.util.errors import ExcitationError


def columns(q: np.ndarray) -> np.ndarray:
    """(P, 1, 1, 2) of M(q) = a + b cos 3q: dips that lie three times in a turn."""
    return np.stack([np.ones_like(q), np.cos(3 * q)], axis=2)[:, None]


def solved(a: float, b: float) -> PhysicalSolution:
    """The data say a and b, seen at rest in one posture, where M(q) is positive."""
    body = Body(
        columns,
        lambda theta, q: columns(q) @ theta,
        np.zeros((1, 1)),
        -np.ones(1),
        np.ones(1),
        np.zeros(2, dtype=bool),
    )
    theta = np.array([a, b])
    return physical_solution(Solution(theta, np.eye(2), theta, np.ones(1)), body, [[]], insist=True)


def test_m_is_kept_positive_over_all_limits():
    kept = solved(1.0, 1.5)
    assert kept.where == "limits" and kept.binding == 1 and kept.left is None
    assert (columns(np.linspace(-1, 1, 500)[:, None]) @ kept.theta > 0).all()
    assert physics_notes(kept.to_dict()) == ["conditions that keep M(q) positive definite and bind: 1"]


def test_coefficients_that_are_positive_already_are_left_alone():
    kept = solved(2.0, 1.5)
    assert kept.binding == 0 and kept.theta.tolist() == [2.0, 1.5]


def test_where_searches_end_too_early_the_best_so_far_is_kept_and_the_place_is_said(
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setattr(physical, "_SEARCHES", 1)
    monkeypatch.setattr(physical, "_BEYOND", 0)
    kept = solved(1.0, 1.5)
    assert kept.left is not None and columns(kept.left[None])[0, 0, 0] @ kept.theta < 0
    assert any(f"but for q = ({kept.left[0]:.2f})" in note for note in physics_notes(kept.to_dict()))


def test_no_physical_solution_is_a_fault_of_the_motion(monkeypatch: pytest.MonkeyPatch):
    def fail(*_):
        raise ArithmeticError("nnls: maximum iterations reached")

    monkeypatch.setattr(physical, "constrained_least_squares", fail)
    with pytest.raises(
        ExcitationError,
        match=r"ended without any \(.+\), as where the motion tells too little.*--no-physical",
    ):
        solved(1.0, 1.5)


def arm_of_one(seen: list[float], positive: tuple[bool, ...] = (False, False)) -> Body:
    return Body(
        columns,
        lambda theta, q: columns(q) @ theta,
        np.array(seen)[:, None],
        -np.ones(1),
        np.ones(1),
        np.array(positive),
    )


def test_postures_are_spread_over_the_whole_motion() -> None:
    q = np.arange(237.0)[:, None]
    motion = Motion(q[:, 0], q, q, q, np.array([0]))
    found = physical.postures(motion)[:, 0]
    assert len(found) == 60 and found[0] == 0 and found[-1] == 236 and (np.diff(found) == 4).all()


def test_conditions_are_rows_that_violate_them() -> None:
    mass = columns(np.array([[0.0], [np.pi / 3]]))  # a + b and a - b
    laws = [[FrictionTerm("offset"), FrictionTerm("viscous")]]
    cuts = physical.physical_cuts(mass, np.array([[0.25, 0.0]]), laws, np.array([False, True]))
    assert cuts(np.array([1.0, 0.5, -9.0, 0.0])).shape == (0, 4)
    np.testing.assert_allclose(cuts(np.array([1.0, 0.8, 0.0, 0.0])), [[0.75, -1.0, 0.0, 0.0]], atol=1e-12)
    # signs are kept all together: of b and the viscous coefficient, not of the offset
    np.testing.assert_allclose(cuts(np.array([9.0, 0.0, -1.0, -2e-9])), [[0, 1, 0, 0], [0, 0, 0, 1]])
    assert len(cuts(np.array([9.0, 0.0, -1.0, -0.9e-9]))) == 0
    # what round-off makes of a condition that is met violates nothing
    for below, violated in ((0.9e-9, 0), (1.1e-9, 1)):
        assert len(cuts(np.array([1.0, 0.75 + below, 0.0, 0.0]))) == violated
    free = physical.physical_cuts(mass, np.zeros((1, 2)), [])
    np.testing.assert_allclose(free(np.array([0.0, -1.0])), [[1.0, 1.0]])


def test_the_cost_of_coefficients_is_the_squared_error_but_for_a_constant() -> None:
    G, b = np.array([[2.0, 1.0], [1.0, 3.0]]), np.array([1.0, -1.0])
    solution = Solution(np.zeros(2), G, b, np.ones(1))
    assert physical._cost(solution, np.array([1.0, 2.0])) == 18 - 2 * (1 - 2)


def test_held_and_bound_coefficients_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = np.array([[1.0, 0.0, 0.0], [0.6, 0.8, 0.0], [0.6, 0.8, 1e-4], [0.0, 0.6, 0.8]])
    theta = np.array([0.9e-9, 0.0, 1.0])
    monkeypatch.setattr(physical, "_within", lambda *_: (theta, rows))
    solution = Solution(theta, np.eye(3), theta, np.ones(1))
    body = arm_of_one([0.0], (True, False))

    def binding() -> int:
        return physical._kept_positive(
            solution, body, [[FrictionTerm("viscous")]], np.zeros((1, 1)), None, 1.0
        )[1]

    # two rows of several coefficients, for the third is one of them but for round-off, and a held coefficient
    assert binding() == 3
    theta[0] = 1.1e-9
    assert binding() == 2
    rows[2, 2] = 4e-3
    assert binding() == 3


def test_what_is_contradicted_by_more_than_chance_is_kept_at_the_motions_postures_or_not_at_all(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    theta = np.array([1.0, 2.0])
    solution = Solution(theta, np.eye(2), theta, np.ones(1))
    asked: list[int] = []

    def kept(insist: bool = False, memory: float = 1.0, binding: int = 2, **cost: float) -> str:
        """So much more squared error over the limits and at the motion's postures, with so many conditions."""

        def moved(_: object, body: object, laws: object, q: np.ndarray, rng: object, most: float) -> object:
            where = "trained" if rng is None else "limits"
            asked.append(len(q))
            return theta + np.array([np.sqrt(cost[where]), 0.0]), binding, None

        monkeypatch.setattr(physical, "_kept_positive", moved)
        return physical_solution(solution, arm_of_one([0.0] * 7), [[]], insist, memory).where

    # by chance in one of a thousand cases more than 13.8 (two degrees of freedom)
    assert kept(limits=13.7, trained=0.0) == "limits" and asked == [247]
    assert kept(limits=13.9, trained=13.7) == "trained" and asked[1:] == [247, 7]
    assert kept(limits=13.9, trained=13.9) == "free"
    free = physical_solution(solution, arm_of_one([0.0]), [[]])
    assert free.theta is theta and free.binding == 0
    # 10.8 with one, and where none is left in the end
    for binding in (0, 1):
        assert kept(binding=binding, limits=10.9, trained=10.7) == "trained"
    assert kept(insist=True, limits=99.0, trained=99.0) == "limits"
    # what is said again by samples that are correlated counts once
    assert kept(memory=10.0, limits=137.0, trained=0.0) == "limits"
    assert kept(memory=10.0, limits=139.0, trained=0.0) == "trained"


def test_postures_that_are_alike_are_one(monkeypatch: pytest.MonkeyPatch) -> None:
    places = np.array([[-0.9], [-0.81], [-0.79], [0.5], [0.6]])
    values = np.array([-2.0, -1.0, -0.5, 0.0, 0.1])
    monkeypatch.setattr(physical, "lowest", lambda mass, low, high, q, v, rng, starts: (values, places))
    found = physical._violated(arm_of_one([0.0]), np.ones(2), np.zeros((1, 2)), np.random.default_rng(0))
    # nearer than a twentieth of the range, 2 rad; M = 0 is no mass matrix either
    assert found[:, 0].tolist() == [-0.9, -0.79, 0.5]
    values += 1.0
    assert physical._violated(
        arm_of_one([0.0]), np.ones(2), np.zeros((1, 2)), np.random.default_rng(0)
    ).tolist() == [[-0.9]]
    values += 1.5
    assert physical._violated(
        arm_of_one([0.0]), np.ones(2), np.zeros((1, 2)), np.random.default_rng(0)
    ).shape == (0, 1)


def test_the_rows_that_bind_are_those_met_with_equality_of_unit_length() -> None:
    theta = np.array([2.0, 2.0, 5.0])
    solution = Solution(theta, np.eye(3), theta, np.ones(1))
    # of two addends of four each the sum is less, and more, than a ten-thousandth
    known = np.array([[2.0, -2.0 + 3.6e-4, 0.0], [2.0, -2.0 - 4.4e-4, 0.0]])
    kept, rows = physical._within(solution, lambda _: np.zeros((0, 3)), known, np.inf)
    assert kept.tolist() == theta.tolist()
    np.testing.assert_allclose(rows, known[:1] / np.linalg.norm(known[0]))
    # what is violated is met, and what was known to bind still does
    violated = np.array([0.0, 2.0, -1.0])
    kept, rows = physical._within(
        solution, lambda x: violated[None] if violated @ x < -1e-9 else np.zeros((0, 3)), known[:1], np.inf
    )
    np.testing.assert_allclose([kept @ violated, kept @ known[0]], 0.0, atol=1e-8)
    assert len(rows) == 2
    np.testing.assert_allclose(np.linalg.norm(rows, axis=1), 1.0)


@pytest.mark.parametrize(
    ("positive", "conditions"), [((False, False), 2), ((True, False), 3), ((True, True), 4)]
)
def test_a_search_ends_at_what_no_number_of_conditions_costs_by_chance(
    positive: tuple[bool, ...], conditions: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[float] = []

    def costly(*arguments: object) -> None:
        asked.append(float(str(arguments[-1])))
        raise TooCostly

    monkeypatch.setattr(physical, "_kept_positive", costly)
    theta = np.array([1.0, 2.0])
    solution = Solution(theta, np.eye(2), theta, np.ones(1), repeats=2.0)
    assert physical_solution(solution, arm_of_one([0.0], positive), [[]]).where == "free"
    assert asked == pytest.approx([2 * chi2.ppf(0.999, conditions)] * 2)
    physical_solution(solution, arm_of_one([0.0], positive), [[]], insist=True)
    assert asked[2:] == [np.inf, np.inf]


class TestArmOfTwo:
    """M(q) = diag(1 + b cos q1, c): negative about q1 = π, whatever q2."""

    @staticmethod
    def body() -> Body:
        def mass_columns(q: np.ndarray) -> np.ndarray:
            out = np.zeros((len(q), 2, 2, 3))
            out[:, 0, 0, 0], out[:, 0, 0, 1], out[:, 1, 1, 2] = 1.0, np.cos(q[:, 0]), 1.0
            return out

        high = np.array([4.0, 1.0])
        return Body(
            mass_columns,
            lambda theta, q: mass_columns(q) @ theta,
            np.zeros((1, 2)),
            -high,
            high,
            np.zeros(3, dtype=bool),
        )

    def test_postures_with_less_than_some_inertia_are_found_that_differ_in_some_joint(self) -> None:
        clear = np.zeros((2, 3))
        for least, found in ((0.04, False), (0.06, True)):
            clear[0, 0] = least
            rng, theta = np.random.default_rng(0), np.array([1.0, 0.95, 2.0])
            postures = physical._violated(self.body(), theta, clear, rng)
            assert (len(postures) > 0) == found and postures.shape[1] == 2
        # the least there is 0.05
        assert np.all(1 + 0.95 * np.cos(postures[:, 0]) <= 0.06)
        apart = np.abs(postures[:, None] - postures[None]) > 0.05 * np.array([8.0, 2.0])
        assert len(postures) > 2 and apart.any(axis=2).sum() == len(postures) * (len(postures) - 1)
        clear[:] = [[0.0, 0.0, 0.0], [2.1, 0.0, 0.0]]
        assert len(physical._violated(self.body(), theta, clear, np.random.default_rng(0)))

    def test_a_posture_is_left_where_m_is_negative_in_the_end(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Searches that never end keep what they found first; the coefficients that are kept at last decide."""
        monkeypatch.setattr(physical, "_violated", lambda *_: np.array([[np.pi, 0.0], [np.pi, 1.0]]))
        for b, negative in ((0.5, False), (1.5, True)):
            theta = np.array([1.0, b, 2.0])
            monkeypatch.setattr(physical, "_within", lambda *_, theta=theta: (theta, np.zeros((0, 3))))
            solution = Solution(theta, np.eye(3), theta, np.ones(1))
            _, binding, left = physical._kept_positive(
                solution, self.body(), [], np.zeros((1, 2)), np.random.default_rng(0), np.inf
            )
            assert binding == 0 and (left is not None) == negative
            assert left is None or left.tolist() == [np.pi, 0.0]


def test_what_is_left_free_is_said_with_the_inertias_that_are_negative() -> None:
    theta = np.zeros(1)
    wheres = (physical.EVERYWHERE, physical.LIMITS, physical.TRAINED, physical.FREE)
    assert [PhysicalSolution(theta, 0, where).to_dict()["contradicted"] for where in wheres] == [
        False
    ] * 3 + [True]
    (plain,) = physics_notes({"kept_positive": physical.FREE})
    assert plain.endswith("M(q) was left free")
    # no cause is known to be the one
    for cause in ("another unit or gain", "weight alone", "sensors that lag", "unlike the URDF's"):
        assert cause in plain
    (note,) = physics_notes({"kept_positive": physical.FREE, "negative": {"Izz3": -1.0, "m2": -2.0}})
    assert note == plain + "; negative, as for no arm: Izz3, m2"
