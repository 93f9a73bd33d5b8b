"""The simulated comparison: what it says where the answer is known."""

import numpy as np
from numpy.testing import assert_allclose

from armloop.data.motion import Motion
from armloop.experiment.design import Regression, amount_needed, data_ratio


def motion(q: np.ndarray) -> Motion:
    t = 0.1 * np.arange(len(q))
    return Motion(t, q, q, q, np.array([0]))


def columns(of: Motion) -> np.ndarray:
    return of.q[:, None, :]


def test_amount_needed_interpolates_along_powers() -> None:
    errors = 1 / np.sqrt(np.arange(1.0, 9.0))
    assert_allclose(
        [amount_needed(errors, goal) for goal in (2.0, 1.0, 3**-0.5, 2.5**-0.5)], [0.25, 1, 3, 2.5]
    )
    assert amount_needed(errors, 0.1) == np.inf


def test_what_one_trajectory_does_not_excite_is_not_known() -> None:
    """Trajectories that move one joint each: no single one determines both coefficients, however strong."""
    rng = np.random.default_rng(0)
    both = motion(rng.normal(size=(50, 2)))
    first, second = (motion(10 * both.q * side) for side in ([1.0, 0.0], [0.0, 1.0]))
    regression = Regression.of(columns, ["a", "b"], np.ones(1), [both])
    ratio = data_ratio(regression, both, [first] * 3 + [second] * 3, 0, noises=300)
    assert not np.isfinite(ratio.random[:, :, 0]).any()
    assert np.isfinite(ratio.random[:, :, -1]).all()
    assert ratio.to_dict()["error"]["random"][0] is None
    only = data_ratio(regression, both, [first] * 4, 0)
    assert only.median == np.inf and only.to_dict()["median"] is None
