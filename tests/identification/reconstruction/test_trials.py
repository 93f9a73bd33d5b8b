"""Errors of candidate fits on blocks that choose, and gradients on all samples: plain sums over the samples."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from armloop.data.motion import Motion, Samples
from armloop.identification.reconstruction.sums import Usable
from armloop.identification.reconstruction.trials import Correction, Fit, HeldOut

N, JOINTS, COLUMNS = 40, 3, 5
RNG = np.random.default_rng(2)
TABLE = RNG.normal(size=(JOINTS, N, COLUMNS))
#: Three fits of each joint, with supports of their own.
FITS = [
    [
        Fit(np.array([0, 3]), RNG.normal(size=2)),
        Fit(np.array([4]), RNG.normal(size=1)),
        Fit(np.array([1, 2, 4]), np.ones(3)),
    ]
    for _ in range(JOINTS)
]


def usable(still: int | None = None) -> Usable:
    """Forty samples in ten blocks that are numbered with gaps; every third sample chooses."""
    motion = Motion(np.arange(N) * 1.0, *np.zeros((3, N, JOINTS)), np.array([0]))
    rest, moving = RNG.normal(size=(N, JOINTS)), RNG.random((N, JOINTS)) < 0.7
    if still is not None:
        moving[:, still] = False
    samples = Samples(motion, 9.0 + rest, moving, 1.0)
    validation = np.arange(N) % 3 == 0
    return Usable(
        samples, np.arange(N), motion, 9.0 + rest, rest, moving, validation, 2 * (np.arange(N) // 4)
    )


class Columns:
    """Values from a table; nobody asks for those of no sample."""

    def chosen(self, part: Usable, joint: int, support: Any) -> Any:
        assert len(part.places)
        return TABLE[joint][part.places][:, support]


def choice(given: Usable) -> Any:
    return lambda chunk: given


@pytest.mark.parametrize("still", [None, 0, 2])
def test_errors_are_summed_by_joint_and_their_differences_by_block(still: int | None) -> None:
    given, weights = usable(still), np.array([1.0, 2.0, 0.5])
    chunk: Any = None
    columns: Any = Columns()
    found = HeldOut.of(chunk, choice(given), columns, FITS, weights)
    errors, squares, blocks = np.zeros((3, JOINTS)), np.zeros((3, 3)), 0
    for j in range(JOINTS):
        for block in range(0, 20, 2):
            rows = (given.blocks == block) & given.validation & given.moving[:, j]
            if not rows.any():
                continue
            own = np.array(
                [
                    weights[j]
                    * np.sum((given.rest[rows, j] - TABLE[j][rows][:, fit.support] @ fit.beta) ** 2)
                    for fit in FITS[j]
                ]
            )
            errors[:, j] += own
            squares += (own[:, None] - own) ** 2
            blocks += 1
    np.testing.assert_allclose(found.errors, errors)
    np.testing.assert_allclose(found.squares, squares)
    assert found.blocks == blocks and (still is None or not errors[:, still].any())
    twice = found + replace(found, errors=2 * errors, squares=3 * squares, blocks=4 * blocks)
    np.testing.assert_allclose(twice.errors, 3 * errors)
    np.testing.assert_allclose(twice.squares, 4 * squares)
    assert twice.blocks == 5 * blocks


@pytest.mark.parametrize(("excess", "chosen"), [(1.999, 0), (2.001, 1)])
def test_one_standard_error_of_the_difference(excess: float, chosen: int) -> None:
    """Of five blocks with differences that add up to e and squares to S the error is √(S - e²/5)."""
    squares = np.zeros((2, 2))
    squares[0, 1] = squares[1, 0] = 4.0 + 4.0 / 5
    assert HeldOut(np.array([[3.0 + excess, 0.5], [3.0, 0.5]]), squares, 5).smallest() == chosen


def test_the_smallest_without_any_error_or_else_the_best() -> None:
    none = np.zeros((3, 3))
    for error, chosen in ((0.9e-20, 1), (1.1e-20, 2)):
        assert HeldOut(np.array([[1.0], [error], [0.0]]), none, 4).smallest() == chosen
    # rounding makes a variance of nothing negative
    assert HeldOut(np.array([[2.0], [1.0], [3.0]]), none, 4).smallest() == 1


@pytest.mark.parametrize("still", [None, 1])
def test_gradients_are_what_the_columns_see_of_what_is_left(still: int | None) -> None:
    given = usable(still)
    chunk: Any = None
    columns: Any = Columns()
    fits = [own[k] for k, own in enumerate(FITS)]
    found = Correction.of(chunk, choice(given), columns, fits)
    for j, fit in enumerate(fits):
        rows = given.moving[:, j]
        X = TABLE[j][rows][:, fit.support]
        np.testing.assert_allclose(found.gradients[j], X.T @ (given.rest[rows, j] - X @ fit.beta), atol=1e-12)
        assert found.gradients[j].shape == fit.support.shape
    twice = found + found
    assert len(twice.gradients) == JOINTS
    for once, sums in zip(found.gradients, twice.gradients, strict=True):
        np.testing.assert_allclose(sums, 2 * once)
