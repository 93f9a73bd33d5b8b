"""Mass matrices of base parameters, sums over joints, and what is said of energies that were found."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import three_axis

from armloop.data.motion import Motion
from armloop.features.rigid_body import BaseParameters
from armloop.identification.reconstruction import lagrangian, rigid_body
from armloop.identification.reconstruction.found import Found
from armloop.identification.reconstruction.sums import StepSums
from armloop.laws.friction import FrictionTerm
from armloop.regression.moments import Moments
from armloop.robot.arm import load_arm
from armloop.robot.newton_euler import mass_matrix


@pytest.mark.parametrize("name", ["three_axis", "scara"])
def test_mass_matrices_are_those_of_composite_bodies_and_rotors(name: str) -> None:
    arm = load_arm(name)
    n, rng = arm.n, np.random.default_rng(3)
    base = BaseParameters.of_arm(arm, rotors=True)
    values, q = rng.normal(size=base.count), rng.normal(size=(4, n))
    full = base.to_full(values)
    composite = mass_matrix(arm, full[: 10 * n])
    expected = np.array([np.asarray(composite(posture)) + np.diag(full[10 * n :]) for posture in q])
    found = rigid_body.mass_matrix(arm, base, values, q)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)
    columns = rigid_body.mass_columns(arm, base, q)
    assert columns.shape == (4, n, n, base.count)
    np.testing.assert_allclose(columns @ values, expected, rtol=1e-8, atol=1e-8)


def moments(size: int, seed: int, samples: int = 20) -> tuple[Any, Any, Moments]:
    rng = np.random.default_rng(seed)
    X, y = rng.normal(size=(samples, size)), rng.normal(size=samples)
    return X, y, Moments.of(X, y)


def test_energies_that_leave_a_tenth_of_the_torque_are_named() -> None:
    for errors in ([0.05, 0.15, np.nan], [np.nan] * 3):
        assert lagrangian._warnings(np.array(errors)) == []
    (note,) = lagrangian._warnings(np.array([0.05, 0.152, np.nan]))
    assert note.startswith("held-out nRMSE 0.10: the waves of the Lagrangian library do not suit")


def test_the_search_of_energies_ends_after_eight_additions_without_a_gain(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Every term gains a little where it is fitted, none on data left out but the first two."""
    asked: list[int] = []

    class Fit:
        yy = 1.0

        def losses(self, support: Any) -> Any:
            return 1.0, np.ones(len(support))

        def gains(self, support: Any, others: Any) -> Any:
            asked.append(len(support))
            return 0.5, np.linspace(1.0, 0.5, len(others))

        def solve(self, support: Any) -> Any:
            return support

    def of(errors: Any) -> Any:
        return SimpleNamespace(yy=1.0, squared_error=lambda beta, support: errors(len(support)))

    monkeypatch.setattr(lagrangian, "_swap", lambda fit, support, fixed, others: support)
    monkeypatch.setattr(lagrangian, "_prune", lambda fit, support, forced, held_out, enough: support)
    none, fit = np.zeros(0, dtype=int), Fit()
    found = lagrangian._greedy(fit, of(lambda size: 1.0 / (1 + min(size, 2))), none, 100)  # type: ignore[arg-type]
    assert found.tolist() == [0, 1] and len(asked) == 20
    # within a hundredth of the least error the fewest
    asked.clear()
    for spare, size in ((1.011, 2), (1.009, 1)):
        errors = {0: 9.0, 1: spare}
        found = lagrangian._greedy(fit, of(lambda size, errors=errors: errors.get(size, 1.0)), none, 100)  # type: ignore[arg-type,misc]
        assert len(found) == size
    # eighty at most
    asked.clear()
    assert len(lagrangian._greedy(fit, of(lambda size: 2.0**-size), none, 100)) == 34  # type: ignore[arg-type]
    asked.clear()
    assert len(lagrangian._greedy(fit, of(lambda size: 0.9**size), none, 100)) == 80  # type: ignore[arg-type]


def test_the_size_of_a_joints_torque_is_one_where_there_is_none() -> None:
    cells: Any = {(1, False): SimpleNamespace(count=3), (3, True): SimpleNamespace(count=5)}
    power = {(1, False): np.array([12.0, 99.0]), (3, True): np.array([20.0, 45.0])}
    sums = StepSums(cells, power)
    assert sums.scale(0) == 2.0 and sums.scale(1) == 3.0 and sums.scale(2) == 1.0
    assert (sums.samples(0), sums.samples(0, True), sums.samples(0, False), sums.samples(1)) == (8, 5, 3, 5)
    assert StepSums({(1, False): cells[(1, False)]}, {(1, False): np.zeros(2)}).scale(0) == 1.0


def test_effects_load_friction_if_they_load_the_joint() -> None:
    """A friction that is half of the load, beside a body of 3 N·m and effects of 1 and 10 N·m."""
    arm = three_axis()
    motion = Motion(np.arange(2.0), np.zeros((2, 3)), np.ones((2, 3)), np.zeros((2, 3)), np.array([0]))
    body: Any = SimpleNamespace(torque=lambda arm, motion, step: np.full((2, 3), 3.0))
    effects: Any = tuple(
        SimpleNamespace(
            effect=SimpleNamespace(
                load=load, sensor=False, needs_inertial=False, joint=None, order=lambda p: 0
            ),
            torque=lambda context, size=size: np.full((2, 3), size),
            values={},
        )
        for load, size in ((True, 1.0), (False, 10.0))
    )
    found = Found(arm, [body], [[FrictionTerm("load_sign", 0.5)]] * 3, effects=effects)
    np.testing.assert_allclose(found.torque(motion), 3.0 + 1.0 + 10.0 + 0.5 * 4.0)
    np.testing.assert_allclose(found.rigid(motion), 3.0)
    assert not Found(arm).rigid(motion).any()
