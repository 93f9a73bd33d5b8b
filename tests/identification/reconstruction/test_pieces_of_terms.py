"""How terms of energies are searched, on numbers one can see through."""

from __future__ import annotations

from typing import Any

import numpy as np
from synthetic import three_axis

from armloop.features.rigid_body import BaseParameters
from armloop.identification.reconstruction import lagrangian, rigid_body
from armloop.regression.moments import Moments
from armloop.robot.arm import load_arm


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


def test_of_a_slide_the_motor_adds_a_mass_whatever_the_arms_lengths() -> None:
    arm = load_arm("scara")
    base = BaseParameters.of_arm(arm, rotors=True)
    prior = rigid_body._priors(arm, base, np.zeros(11 * arm.n))["links as in the URDF ± 1 kg"]
    length = np.mean([np.linalg.norm(X[:3, 3]) for X in arm.X_PF[1:]])
    unit = np.concatenate(
        [np.tile([1, *[length] * 3, *[length**2] * 6], arm.n), np.where(arm.revolute, length**2, 1.0)]
    )
    assert not arm.revolute.all()
    covariance = base.grouping @ np.diag(unit**2) @ base.grouping.T
    np.testing.assert_allclose(np.linalg.inv(prior.precision), covariance, rtol=1e-6, atol=1e-12)


def test_of_a_single_joint_what_is_not_known_lies_a_metre_away() -> None:
    arm = load_arm("three_axis", lock={"joint_2": 0.0, "joint_3": 0.0})
    base = BaseParameters.of_arm(arm, rotors=True)
    prior = rigid_body._priors(arm, base, np.zeros(11 * arm.n))["links as in the URDF ± 1 kg"]
    np.testing.assert_allclose(np.linalg.inv(prior.precision), base.grouping @ base.grouping.T)
