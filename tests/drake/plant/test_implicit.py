"""The implicit step against its own conditions, on many random problems."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from armloop.drake.plant.implicit import ClampedLaw, implicit_torques
from armloop.laws.friction import Direction


def random_problem(rng, n):
    root = rng.normal(size=(n, n)) * rng.uniform(0.05, 2.0, n)[:, None]
    A = root @ root.T + 0.01 * np.eye(n)
    laws = [ClampedLaw(j, 0.0, 1e8, limit) for j, limit in enumerate(rng.uniform(0.0, 2.0, n))]
    if rng.random() < 0.5:
        pull = rng.normal(size=n) * 10.0 ** rng.uniform(-1, 3, n)
        laws += [ClampedLaw(j, pull[j], 1.1e4, rng.uniform(1.0, 40.0)) for j in range(n)]
    p = rng.normal(size=n) * 10.0 ** rng.uniform(-5, 0, n)
    pieces = rng.integers(-1, 2, len(laws)).tolist()
    return A, p, laws, pieces


@pytest.mark.parametrize("n", [1, 2, 3, 4, 7])
def test_torques_are_the_laws_at_the_velocity_they_lead_to(n):
    rng = np.random.default_rng(n)
    step = 1e-3
    for _ in range(400):
        A, p, laws, pieces = random_problem(rng, n)
        torques = np.array(implicit_torques(A.tolist(), p.tolist(), laws, pieces, step))
        w = np.linalg.solve(A, p + step * torques)
        expected, slope = np.zeros(n), np.zeros(n)
        for law in laws:
            expected[law.joint] += np.clip(law.command - law.slope * w[law.joint], -law.limit, law.limit)
            slope[law.joint] += law.slope
        # Laws are steep: what rounding leaves of w may not move them further than it explains.
        error = np.linalg.cond(A) * 1e-15 * np.linalg.norm(w + np.abs(np.linalg.inv(A)) @ np.abs(p))
        assert np.all(np.abs(torques - expected) < 1e-6 + slope * error)


def test_below_the_limit_a_joint_stands_and_above_it_slides():
    law = [ClampedLaw(0, 0.0, 1e8, 1.0)]
    for push, expected in ((0.4, -0.4), (-0.99, 0.99), (1.5, -1.0), (-3.0, 1.0)):
        torque = implicit_torques([[0.2]], [1e-3 * push], law, [0], 1e-3)
        assert_allclose(torque, [expected], rtol=1e-5)  # it creeps a little to stand


def test_a_wrong_guess_changes_nothing():
    A, p = [[0.3, 0.1], [0.1, 0.05]], [1e-3, -2e-3]
    laws = [ClampedLaw(0, 0.0, 1e8, 0.7), ClampedLaw(1, 0.0, 1e8, 0.4)]
    guesses = [implicit_torques(A, p, laws, [i, j], 1e-3) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    assert_allclose(guesses, np.tile(guesses[0], (9, 1)), rtol=1e-9)


def test_a_law_of_a_shared_motor_and_its_three_pieces():
    law = ClampedLaw(0, 2.0, 10.0, 1.0, 1, -0.5)
    assert law.speed([3.0, 4.0]) == 1.0 and law._replace(ratio=0.0).speed([3.0, 4.0]) == 3.0
    exact = law._replace(slope=8.0)
    # on the edge, 2 - 8 w = ±1, the law is steep still
    assert [exact.piece(w) for w in (0.0, 0.124, 0.125, 0.2, 0.375, 0.376)] == [1, 1, 0, 0, 0, -1]
    dry = ClampedLaw.dry(Direction(2, 1, 0.5), 3.0)
    assert dry == ClampedLaw(2, 0.0, 1e8, 3.0, 1, 0.5)
    # one joint's own law shares its motor with none, as the joint's own direction does
    assert ClampedLaw.dry(Direction(2), 3.0) == ClampedLaw(2, 0.0, 1e8, 3.0)


def test_a_shared_motor_acts_on_both_joints():
    """One step of two free masses whose difference in speed rubs: the torque is equal and opposite."""
    A, p = [[2.0, 0.0], [0.0, 1.0]], [2.0 * 3.0, 1.0 * 1.0]
    for pieces in ([-1], [0], [1]):
        tau = implicit_torques(A, p, [ClampedLaw(0, 0.0, 1e8, 5.0, 1, -1.0)], pieces, 1e-3)
        assert_allclose(tau, [-5.0, 5.0], rtol=1e-9)
        stuck = implicit_torques(A, [6.0, 2.999], [ClampedLaw(0, 0.0, 1e8, 5.0, 1, -1.0)], pieces, 1e-3)
        # together they go on with their mean speed: 8.999 / 3
        assert_allclose(stuck, [(2 * 8.999 / 3 - 6.0) / 1e-3, (8.999 / 3 - 2.999) / 1e-3], rtol=1e-4)
