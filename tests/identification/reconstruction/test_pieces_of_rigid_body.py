"""How base parameters are put together with friction and laws, what physics is asked, what is reported: all of it faked."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import fourier_motion, three_axis

from armloop.features.rigid_body import BaseParameters
from armloop.identification.reconstruction import rigid_body
from armloop.identification.reconstruction.found import Found
from armloop.identification.reconstruction.physical import PhysicalSolution
from armloop.laws.friction import FrictionTerm
from armloop.robot.kinematics import nominal_parameters

BASE = BaseParameters.of_arm(three_axis(), rotors=True)
LAWS = [
    [FrictionTerm("offset"), FrictionTerm("viscous")],
    [FrictionTerm("sign")],
    [FrictionTerm("viscous"), FrictionTerm("quadratic")],
]


def added(q: np.ndarray) -> np.ndarray:
    """(P, 3, 3, 2) mass matrices of two coefficients of laws."""
    out = np.zeros((len(q), 3, 3, 2))
    out[:, 0, 0, 0], out[:, 1, 2, 1], out[:, 2, 1, 1] = 1.0, np.sin(q[:, 0]), np.sin(q[:, 0])
    return out


class Laws:
    """Two coefficients: the first is found to be an inertia, the second is said to be negative for no arm."""

    count = 2
    passive = np.array([False, True])

    def mass(self, arm: Any, q: np.ndarray) -> np.ndarray:
        return added(q)

    def inertial(self, arm: Any, q: np.ndarray) -> list[bool]:
        return [True, False]

    def added(self, arm: Any, theta: np.ndarray, covariance: str) -> Any:
        return [(theta.tolist(), covariance)]

    def notes(self, effects: Any) -> list[str]:
        return [f"laws {effects[0][0]}"]


class TestWhole:
    @pytest.fixture
    def asked(self, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
        asked: dict[str, Any] = {"physical": True, "accepted": True, "realizable": [], "positive": []}
        negative = np.flatnonzero(BASE.positive)[:2]
        asked["negative"] = negative

        def solved(held_out: bool) -> Any:
            theta = np.concatenate([np.full(BASE.count, 0.5), [7.0, 8.0], 1.0 + np.arange(5.0)])
            theta[negative] = -1.0, -2.0
            return SimpleNamespace(theta=theta + 0.25 * held_out)

        survey = SimpleNamespace(
            fitted=np.full(3, 200),
            products=lambda count: np.eye(count),
            load=lambda count, weights_of: np.zeros(count),
            sliding=np.array([5, 6, 7]),
        )
        training = SimpleNamespace(survey=survey, memory=3.0)
        ladder = SimpleNamespace(laws=LAWS, comparisons=[], notes=["ladder"], solved=solved)

        class Fitting:
            covariance = "covariance"

            def __init__(self, arm: Any, given: Any, design: Any, priors: Any, *rest: Any) -> None:
                assert given is training and len(priors) == 7

            def chosen(self) -> Any:
                return ladder, Laws()

        def realizable(solution: Any, arm: Any, base: Any, nominal: Any, positive: Any, memory: float) -> Any:
            asked["realizable"].append((solution.theta, positive.tolist(), memory))
            nominal_links = np.concatenate([nominal_parameters(arm), np.zeros(3)])
            np.testing.assert_array_equal(nominal, nominal_links)
            theta = solution.theta.copy()
            theta[negative[0]] = 0.0
            return SimpleNamespace(
                accepted=asked["accepted"],
                theta=theta,
                full=base.to_full(theta[: base.count], nominal),
                to_dict=lambda names: {
                    "chi_square": 9.0,
                    "by_chance": 5.0,
                    "farthest": "m1",
                    "std_errors": 4.0,
                },
            )

        def physical(solution: Any, shape: Any, friction: Any, insist: bool, memory: float) -> Any:
            asked["positive"].append((friction, insist, memory))
            return PhysicalSolution(np.where(solution.theta < 0, 0.125, solution.theta), 2)

        monkeypatch.setattr(
            rigid_body, "Training", SimpleNamespace(of=lambda data, design, options: training)
        )
        monkeypatch.setattr(rigid_body, "Fitting", Fitting)
        monkeypatch.setattr(rigid_body, "realizable_solution", realizable)
        monkeypatch.setattr(rigid_body, "physical_solution", physical)
        monkeypatch.setattr(rigid_body.Design, "loaded", lambda self, load: self)
        return asked

    @staticmethod
    def found(asked: dict[str, Any]) -> Found:
        data: Any = SimpleNamespace(
            reference=SimpleNamespace(samples=SimpleNamespace(motion=fourier_motion(2.0, 50.0, 1)))
        )
        options: Any = SimpleNamespace(physical=asked["physical"], insist=False)
        return rigid_body.rigid_body(three_axis(), data, options, lambda text: None)

    def test_each_part_has_its_coefficients_and_the_last_fit_is_of_all_data(
        self, asked: dict[str, Any]
    ) -> None:
        asked["physical"] = False
        found = self.found(asked)
        assert found.final is not None
        for own, more in ((found, 0.0), (found.final, 0.25)):
            (body,) = own.components
            expected = np.full(BASE.count, 0.5)
            expected[asked["negative"]] = -1.0, -2.0
            np.testing.assert_allclose(body.values, expected + more)  # type: ignore[attr-defined]
            assert own.effects == (([7.0 + more, 8.0 + more], "covariance"),)  # type: ignore[comparison-overlap]
            assert [[t.coefficient for t in law] for law in own.friction] == [
                [1.0 + more, 2.0 + more],
                [3.0 + more],
                [4.0 + more, 5.0 + more],
            ]
            assert len(own.history["inertial"]) == 30 and "held" not in own.history
        assert not asked["realizable"]

    def test_a_step_has_the_friction_that_is_known_by_then(self, asked: dict[str, Any]) -> None:
        found = self.found(asked)
        assert found.final is not None
        (body,) = found.final.components
        own = [len(body.terms(three_axis(), j)) for j in range(3)]  # type: ignore[attr-defined]
        steps = {1: [1, 1, 0], 2: [2, 1, 2], 3: [2, 1, 2]}
        assert [report.step for report in found.reports] == [1, 2, 3]
        for report in found.reports:
            assert report.terms == [a + b for a, b in zip(own, steps[report.step], strict=True)]
            assert (report.candidates, report.independent) == (BASE.count + 5, BASE.count)
            assert report.samples == [5, 6, 7]
        assert found.notes[2:] == ["ladder", "laws [7.25, 8.25]"]

    def test_bodies_that_can_exist_are_taken_where_the_data_allow_them(self, asked: dict[str, Any]) -> None:
        found = self.found(asked)
        first, second = (BASE.names[k] for k in asked["negative"])
        assert not asked["positive"] and len(asked["realizable"]) == 2
        _, positive, memory = asked["realizable"][0]
        # an inertia of laws, and all friction but an offset
        assert positive == [True, True, False, True, True, True, True] and memory == 3.0
        assert found.history["kept_positive"] == "everywhere" and found.history["constraints"] == 0
        assert found.history["held"] == {first: -1.0} and found.history["negative"] == {second: -2.0}
        (body,) = found.components
        assert body.values[asked["negative"]].tolist() == [0.0, -2.0]  # type: ignore[attr-defined]

    def test_else_m_is_kept_positive_where_it_matters(self, asked: dict[str, Any]) -> None:
        asked["accepted"] = False
        found = self.found(asked)
        assert asked["positive"] == [(LAWS, False, 3.0)] * 2
        assert found.history["kept_positive"] == "limits" and found.history["constraints"] == 2
        assert found.history["bodies"]["chi_square"] == 9.0
        names = [BASE.names[k] for k in asked["negative"]]
        assert found.history["held"] == dict(zip(names, (-1.0, -2.0), strict=True))
        assert found.history["negative"] == {}
        (body,) = found.components
        np.testing.assert_allclose(BASE.from_full(body.parameters), body.values, atol=1e-9)  # type: ignore[attr-defined]


def test_the_mass_matrix_is_that_of_bodies_and_of_laws() -> None:
    rng, laws = np.random.default_rng(0), Laws()
    theta, q = rng.normal(size=BASE.count + 2), rng.normal(size=(4, 3))
    body = rigid_body.body_of(three_axis(), BASE, laws, fourier_motion(2.0, 50.0, 1))  # type: ignore[arg-type]
    expected = rigid_body.mass_matrix(three_axis(), BASE, theta[:-2], q) + added(q) @ theta[-2:]
    np.testing.assert_allclose(body.mass(theta, q), expected, atol=1e-12)
    np.testing.assert_allclose(body.columns(q) @ theta, expected, atol=1e-8)
    assert body.positive.tolist() == [*BASE.positive.tolist(), False, True]


def test_links_may_differ_from_the_urdfs_by_half_decades_of_kilograms() -> None:
    arm = three_axis()
    nominal = np.concatenate([nominal_parameters(arm), np.zeros(3)])
    priors = rigid_body._priors(arm, BASE, nominal)
    kilograms = [float(name.split()[-2]) for name in priors]
    np.testing.assert_allclose(np.log10(kilograms), np.arange(-1, 2.5, 0.5), atol=0.03)
    length = np.mean([np.linalg.norm(arm.X_PF[j, :3, 3]) for j in (1, 2)])
    unit = np.concatenate([np.tile([1.0, *[length] * 3, *[length**2] * 6], 3), np.full(3, length**2)])
    for kg, prior in zip(kilograms, priors.values(), strict=True):
        covariance = BASE.grouping @ np.diag((kg * unit) ** 2) @ BASE.grouping.T
        np.testing.assert_allclose(prior.precision @ covariance, np.eye(BASE.count), atol=1e-6)
        np.testing.assert_allclose(prior.centre, BASE.from_full(nominal))
