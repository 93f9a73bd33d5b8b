"""Chosen terms are regressed on filtered columns: friction's parameters come back from varying motion alone."""

from dataclasses import replace

import numpy as np
import pytest

from armloop.data.signals import preprocess
from armloop.identification.reconstruction.data import Data
from armloop.identification.reconstruction.found import Found
from armloop.identification.reconstruction.options import Options
from armloop.identification.reconstruction.refit import refit
from armloop.regression.sparse import Sparse
from armloop_paper.simulated import (
    COULOMB,
    STATIC,
    STRIBECK,
    VISCOUS,
    Disturbance,
    collection,
    true_model,
)


@pytest.fixture(scope="module")
def varying():
    return collection(0, poses=2, segments=2, seconds=40.0).logs(Disturbance("coloured", coloured=0.01), 1)[
        2:
    ]


def biased():
    """What columns that are not filtered give: f_s a tenth too low, v_s half too high."""
    truth = true_model()
    friction = [
        [
            replace(t, coefficient=0.9 * t.coefficient, parameter=1.5 * t.parameter) if t.step else t
            for t in law
        ]
        for law in truth.friction.terms
    ]
    return Found(truth.arm, list(truth.components), friction)


def test_friction_comes_back_from_varying_motion_alone(varying):
    found = biased()
    data = Data.of(preprocess(varying, true_model().conditioning), Options())
    assert refit(found, data, Sparse("evidence").how)
    for j in range(3):
        law = found.law.stribeck_parameters(j)
        assert law["static"] == pytest.approx(STATIC[j], rel=0.04)
        assert law["coulomb"] == pytest.approx(COULOMB[j], rel=0.06)
        assert law["viscous"] == pytest.approx(VISCOUS[j], rel=0.03)
        assert law["stribeck_velocity"] == pytest.approx(STRIBECK, rel=0.3)


def test_shrunken_and_unfiltered_coefficients_are_left_alone(varying):
    found, samples = biased(), preprocess(varying, true_model().conditioning)
    before = found.law
    assert not refit(found, Data.of(samples, Options()), Sparse("lasso").how)
    assert not refit(found, Data.of(replace(samples, cutoff_hz=0.0), Options()), Sparse("evidence").how)
    assert found.law == before


def test_held_out_samples_are_not_used(varying):
    samples = preprocess(varying, true_model().conditioning)
    data = Data.of(samples, Options())
    tau = np.where(data.reference.held_out[:, None], 1e3, samples.tau)
    one, other = biased(), biased()
    refit(one, data, Sparse("evidence").how)
    refit(other, Data.of(replace(samples, tau=tau), Options()), Sparse("evidence").how)
    assert one.law == other.law
