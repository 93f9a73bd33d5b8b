"""Where the steps leave more than noise, all terms are chosen once more on all samples."""

from dataclasses import replace

import numpy as np
import pytest

from armloop.data.regimes import sort_samples
from armloop.data.signals import as_torque, preprocess
from armloop.identification.reconstruction.data import Data
from armloop.identification.reconstruction.fitted import fitted_rows
from armloop.identification.reconstruction.found import Found
from armloop.identification.reconstruction.nearest_regime import Sorter
from armloop.identification.reconstruction.options import Options, StepReport
from armloop.identification.reconstruction.revision import Leftover, revised
from armloop.model import ReconstructedModel
from armloop.model.components import SparseTerms
from armloop.regression.sparse import Sparse
from armloop.util.progress import silent
from armloop_paper.simulated import Disturbance, collection, true_model

OPTIONS = Options(max_order=2, standard_errors=False)
REVOLUTE = (True, True, True)
ORDERS = ([2, 0], [1, 2], [1, 1])


@pytest.fixture(scope="module")
def data() -> Data:
    """Creeping, constant and varying velocity."""
    logs = collection(0, poses=40, segments=40, seconds=20.0).logs(Disturbance("white", white=0.01), 1)
    return Data.of(preprocess(logs, true_model().conditioning), OPTIONS)


@pytest.fixture(scope="module")
def steps(data: Data) -> Found:
    """What faultless steps would find."""
    truth, samples = true_model(), data.reference.samples
    return Found(
        truth.arm,
        list(truth.components),
        [list(law) for law in truth.friction.terms],
        [StepReport(k, orders, 1, 1, [1] * 3, [1] * 3) for k, orders in enumerate(ORDERS, 1)],
        sorter=Sorter(samples, sort_samples(as_torque(samples).motion).condition),
    )


def leftover(found: Found, data: Data) -> Leftover:
    assert found.sorter is not None
    model = ReconstructedModel(found.arm, tuple(found.components), found.law)
    return Leftover.of(data.reference, model, found.sorter)


def spoilt(found: Found) -> Found:
    """With a fifth of gravity missing, which no later step would look for."""
    first, *others = found.components
    assert isinstance(first, SparseTerms)
    return replace(found, components=[replace(first, coefficients=0.8 * first.coefficients), *others])


def test_noise_is_no_reason(data: Data, steps: Found) -> None:
    assert leftover(steps, data).worst()[0] < 0.5
    assert revised(steps, data, REVOLUTE, OPTIONS, silent) is steps


def test_an_inherited_mistake_is_mended(data: Data, steps: Found) -> None:
    bad = spoilt(steps)
    before = leftover(bad, data)
    assert before.worst()[0] > 0.9
    good = revised(bad, data, REVOLUTE, OPTIONS, silent)
    after = leftover(good, data)
    assert after.worst()[0] < 0.5 and (after.total < 0.1 * before.total)[1:].all()
    assert "is no noise" in good.notes[0]
    assert [report.step for report in good.reports] == [1, 2, 3]
    assert {component.step for component in good.components} == {1, 2, 3}
    # standard errors have to know that every sample told something of every term
    (fit,) = fitted_rows(data.reference, good, shared=False)
    assert fit.steps == (1, 2, 3)
    assert len(fitted_rows(data.reference, bad, shared=False)) == 3


def test_other_estimators_and_unfiltered_samples_are_left_alone(data: Data, steps: Found) -> None:
    bad = spoilt(steps)
    lasso = replace(OPTIONS, sparse=Sparse("lasso"))
    assert revised(bad, data, REVOLUTE, lasso, silent) is bad
    chunk = data.reference
    raw = replace(data, reference=replace(chunk, samples=replace(chunk.samples, cutoff_hz=0.0)))
    assert revised(bad, raw, REVOLUTE, OPTIONS, silent) is bad
    assert revised(replace(bad, sorter=None), data, REVOLUTE, OPTIONS, silent).components is bad.components


def test_leftovers_add_over_chunks(data: Data, steps: Found) -> None:
    one = leftover(steps, data)
    two = one + one
    assert two.worst() == pytest.approx(one.worst())
    np.testing.assert_allclose(two.total, 2 * one.total)
