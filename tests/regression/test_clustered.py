"""Covariances that clusters of correlated errors do not make too small."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from armloop.diagnosis.fit import covariance
from armloop.regression.clustered import clustered_covariance


def test_it_is_the_jackknife_over_clusters() -> None:
    """Each cluster left out in turn, and the fit made anew."""
    rng = np.random.default_rng(0)
    cluster = rng.integers(0, 7, 60)
    X = rng.normal(size=(60, 3)) * [1.0, 1e3, 1e-3]
    y = rng.normal(size=60)
    beta = np.linalg.lstsq(X, y, rcond=None)[0]
    fits = np.array([np.linalg.lstsq(X[cluster != k], y[cluster != k], rcond=None)[0] for k in range(7)])
    moved = fits - fits.mean(axis=0)
    assert clustered_covariance(X, y - X @ beta, cluster) == pytest.approx(moved.T @ moved * 6 / 7, rel=1e-5)


def test_what_all_rows_have_in_common_is_no_error() -> None:
    rng = np.random.default_rng(0)
    cluster, left = rng.integers(0, 7, 60), rng.normal(size=60)
    X = np.ones((60, 1))
    found = clustered_covariance(X, left - left.mean() + 3.0, cluster)
    assert found == pytest.approx(clustered_covariance(X, left - left.mean(), cluster), rel=1e-9)


def test_columns_that_are_nearly_one_are_held_by_a_ridge() -> None:
    """Ridge regression of unit columns without each cluster: rows of the ridge's root beside the data's."""
    rng = np.random.default_rng(0)
    cluster, x, y = rng.integers(0, 7, 60), rng.normal(size=60), rng.normal(size=60)
    X = np.column_stack([x, x + 1e-4 * rng.normal(size=60)])
    size = np.linalg.norm(X, axis=0)
    left = y - X @ np.linalg.lstsq(X, y, rcond=None)[0]
    fits = []
    for k in range(7):
        Z = np.vstack([X[cluster != k] / size, 1e-4 * np.eye(2)])
        fits.append(np.linalg.lstsq(Z, np.append(left[cluster != k], [0.0, 0.0]), rcond=None)[0] / size)
    moved = np.array(fits) - np.mean(fits, axis=0)
    assert clustered_covariance(X, left, cluster) == pytest.approx(moved.T @ moved * 6 / 7, rel=1e-5)


@pytest.mark.parametrize(("rows", "columns"), [(5, 0), (0, 0), (0, 2)])
def test_nothing_has_no_covariance(rows: int, columns: int) -> None:
    found = clustered_covariance(np.zeros((rows, columns)), np.ones(rows), np.arange(rows))
    assert found.shape == (columns, columns) and not found.any()


@pytest.mark.parametrize("misfit", [0.0, 2.0])
def test_what_comes_back_with_the_motion_does_not_average_out(misfit: float) -> None:
    """A slope over a place that is visited again and again, beside noise: a wave of it that no column knows.

    Without misfit both state the error; with it what the blocks state shrinks with the run, the error does not.
    """
    rng = np.random.default_rng(1)
    within: dict[str, list[bool]] = {"blocks": [], "both": []}
    for _ in range(150):
        q = np.sin(0.1 * np.arange(4000) + rng.uniform(0, 6))
        X, block = q[:, None], np.arange(4000) // 100
        wave = np.sin(rng.uniform(1, 4) * q + rng.uniform(0, 2 * np.pi))
        y = misfit * wave + rng.normal(size=4000)
        # what the wave really puts into the slope is the error that has to be stated
        beta = np.linalg.lstsq(X, y, rcond=None)[0]
        cell = np.searchsorted(np.quantile(q, [1 / 3, 2 / 3]), q)
        left = y - X @ beta
        rows: Any = SimpleNamespace(block=block, cell=cell, model_errors=np.zeros((4000, 0)))
        for name, spread in {
            "blocks": clustered_covariance(X, left, block),
            "both": covariance(X, left, rows),
        }.items():
            within[name].append(bool(abs(beta[0]) < 2 * np.sqrt(spread[0, 0])))
    stated = {name: float(np.mean(hits)) for name, hits in within.items()}
    if misfit:
        assert stated["blocks"] < 0.3 and stated["both"] > 2 * stated["blocks"], stated
    else:
        assert stated["blocks"] > 0.9 and stated["both"] > 0.9, stated
