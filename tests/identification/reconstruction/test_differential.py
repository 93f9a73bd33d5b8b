"""Two motors of a differential are there together or not at all, and what both have in common is no one's."""

from __future__ import annotations

import numpy as np
import pytest

from armloop.identification.reconstruction.differential import both
from armloop.identification.reconstruction.projected import Projected, Rows
from armloop.util.arrays import Array

N, FOLDS, NEW, WORTH = 3000, 5, 2e-3, 0.05


def wrist(
    dry: tuple[float, float], viscous: tuple[float, float], seed: int = 0
) -> tuple[Projected, list[Array]]:
    """Two joints with dampings of their own, and motors of the sum and of the difference of their speeds."""
    rng = np.random.default_rng(seed)
    v = rng.normal(size=(N, 2))
    columns, tau = [], np.zeros((N, 2))
    for ratio, f, c in zip((1.0, -1.0), dry, viscous, strict=True):
        w, sides = v[:, 0] + ratio * v[:, 1], np.array([1.0, ratio])
        law = np.stack([np.outer(w, sides), np.outer(np.sign(w), sides)], axis=2)
        columns.append(law)
        tau += law @ [c, f]
    tau += 0.3 * v + 0.1 * rng.normal(size=(N, 2))
    sample, joint = np.tile(np.arange(N), 2), np.repeat([0, 1], N)
    block = sample // 30
    order = np.lexsort((sample, block % FOLDS, joint))
    sample, joint, block = sample[order], joint[order], block[order]
    X = np.zeros((2 * N, 2))
    X[np.arange(2 * N), joint] = v[sample, joint]
    rows = Rows(sample, joint, np.ones(2 * N), block % FOLDS, block, np.ones(2 * N, dtype=bool))
    return Projected(X, tau[sample, joint], rows, (np.zeros((2, 2)), np.zeros(2)), X), columns


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("viscous", "kept"),
    [((0.5, 0.2), [[True, True], [False, True]]), ((0.2, 0.5), [[False, True], [True, True]])],
)
def test_a_difference_of_dampings_is_of_the_motor_that_has_more(
    viscous: tuple[float, float], kept: list[list[bool]], seed: int
) -> None:
    found = both(*wrist((0.4, 0.3), viscous, seed), NEW, WORTH)
    assert found is not None
    assert [mask.tolist() for mask in found[0]] == kept
    truth = [0.3, 0.4, 0.3] if kept[0][0] else [0.4, 0.3, 0.3]
    errors = np.sqrt(np.diag(found[1].covariance))
    assert (np.abs(found[1].coefficients - truth) < 4 * errors).all() and errors.max() < 0.02


@pytest.mark.parametrize("dry", [(0.4, -0.3), (-0.1, 0.4)])
def test_a_motor_that_drives_is_none(dry: tuple[float, float]) -> None:
    """Though its damping be plain."""
    for seed in range(3):
        assert both(*wrist(dry, (0.2, 0.5), seed), NEW, WORTH) is None


@pytest.mark.parametrize("dry", [(0.4, 0.0), (0.0, 0.4), (0.0, 0.0), (0.4, -0.3)])
def test_one_motor_is_no_differential(dry: tuple[float, float]) -> None:
    for seed in range(3):
        assert both(*wrist(dry, (0.2, 0.2), seed), NEW, WORTH) is None
