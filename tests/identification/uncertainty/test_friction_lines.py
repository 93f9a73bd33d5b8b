"""Coulomb level and viscous coefficient of any law, with the correlations of its elements in their errors."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import fourier_motion

from armloop.data.motion import Samples
from armloop.identification.uncertainty.friction_lines import friction_line
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop_paper.simulated import true_model


def line(law: list[FrictionTerm], covariance: np.ndarray) -> dict:
    model = replace(true_model(), friction=FrictionLaw((tuple(law), (), ())))
    motion = fourier_motion(20.0, 50.0, 1)
    samples = Samples(motion, np.zeros_like(motion.q), np.ones(motion.q.shape, dtype=bool), 0.02)
    names = [term.name(1) for term in law]
    return friction_line(model, 0, names, covariance, 20.0, samples, np.abs(motion.v[:, 0]) > 0.05)


def test_elements_that_share_a_level_add_up_and_their_errors_cancel() -> None:
    law = [
        FrictionTerm("smooth_sign", 0.3, 0.003),
        FrictionTerm("smooth_sign", 0.2, 0.01),
        FrictionTerm("viscous", 1.5),
        FrictionTerm("offset", 0.4),
    ]
    # what one direction that fades in takes, the other gives: their sum is known well, neither is
    covariance = np.diag([1.0, 1.0, 0.04**2, 0.0])
    covariance[0, 1] = covariance[1, 0] = -1.0 + 0.5 * 0.02**2
    found = line(law, covariance)
    assert found["coulomb"]["value"] == pytest.approx(0.5, abs=1e-3)
    assert found["viscous"]["value"] == pytest.approx(1.5, abs=1e-3)
    assert found["coulomb"]["std_error"] == pytest.approx(0.02, rel=0.05)
    assert found["viscous"]["std_error"] == pytest.approx(0.04, rel=0.05)


def test_the_line_follows_a_law_that_is_none() -> None:
    found = line([FrictionTerm("smooth_sign", 0.3, 0.003), FrictionTerm("quadratic", 0.5)], np.zeros((2, 2)))
    low, high = found["speeds"]
    # the straight line nearest to v²/2 has the slope of its chord, and lies below zero at rest
    assert found["viscous"]["value"] == pytest.approx(0.5 * (low + high), rel=0.02)
    assert found["coulomb"]["value"] < 0.3
    assert line([], np.zeros((0, 0))) == {}
