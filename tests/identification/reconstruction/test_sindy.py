"""The one-shot baseline really is pysindy's, and worse than the stepwise method on the same data."""

from dataclasses import replace

import numpy as np
import pysindy
import pytest
from synthetic import conditioned_samples, three_axis

from armloop.data.blocks import folds
from armloop.identification.reconstruction.data import Data
from armloop.identification.reconstruction.options import Options
from armloop.identification.reconstruction.sindy import sindy
from armloop.identification.reconstruction.stepwise import stepwise_on
from armloop.regression.sparse import Sparse
from armloop.util.errors import InputError
from armloop.util.progress import silent

OPTIONS = Options(sparse=Sparse(correlation=1.0), max_order=1)


@pytest.fixture(scope="module")
def samples():
    return conditioned_samples((600, 1200, 1200), noise=0.01, with_friction=True)


def test_the_baseline_goes_through_pysindy(samples, monkeypatch):
    shapes = []
    fit = pysindy.SINDy.fit

    def counted(self, x, t, **options):
        shapes.append(x.shape)
        assert isinstance(self.optimizer, pysindy.STLSQ)
        return fit(self, x, t, **options)

    monkeypatch.setattr(pysindy.SINDy, "fit", counted)
    held = folds(samples, 5, 1.0) == 0
    found = sindy(three_axis(), samples, held, OPTIONS, silent)
    assert shapes and all(columns == 196 + 3 for _, columns in shapes)
    (report,) = found.reports
    assert (report.orders, report.candidates, report.independent) == ([1, 2], 196, 196)


def test_the_baseline_has_more_terms_and_larger_errors(samples):
    held = folds(samples, 5, 1.0) == 0
    results = []
    one_shot, in_steps = (Options(sparse=Sparse(correlation=1.0), max_order=order) for order in (1, 2))
    for found in (
        sindy(three_axis(), samples, held, one_shot, silent),
        stepwise_on(three_axis(), Data.of(samples, in_steps, held), in_steps, silent),
    ):
        miss = (found.torque(samples.motion) - samples.tau)[held]
        terms = np.sum([report.terms for report in found.reports])
        results.append((terms, np.sqrt((miss**2).mean(axis=0))))
    (many, large), (few, small) = results
    assert many > 1.3 * few
    assert (large > 1.3 * small).all()
    assert (large < 0.3 * samples.tau.std(axis=0)).all()  # but a fair baseline


def test_held_out_samples_are_not_fitted_by_the_baseline(samples):
    held = folds(samples, 5, 1.0) == 0
    spoilt = replace(samples, tau=np.where(held[:, None], 1e3, samples.tau))
    one, other = (sindy(three_axis(), s, held, OPTIONS, silent) for s in (samples, spoilt))
    np.testing.assert_array_equal(one.components[0].coefficients, other.components[0].coefficients)


def test_the_lowest_order_is_tried_however_many_candidates_are_allowed(samples):
    held = folds(samples, 5, 1.0) == 0
    found = sindy(three_axis(), samples, held, Options(max_candidates=3), silent)
    assert [report.orders for report in found.reports] == [[1, 2]]


def test_more_candidates_than_can_be_given_are_refused(samples, monkeypatch):
    monkeypatch.setattr("armloop.identification.reconstruction.sindy._MOST_CANDIDATES", 100)
    with pytest.raises(InputError, match=r"one-shot regression of 3 joints has .* use --method stepwise"):
        sindy(three_axis(), samples, folds(samples, 5, 1.0) == 0, Options(), silent)
