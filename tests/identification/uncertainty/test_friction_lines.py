"""Coulomb level and viscous coefficient of any law, with the correlations of its elements in their errors."""

from collections.abc import Callable
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
    return friction_line(model, 0, names, of(covariance, 20.0), samples, np.abs(motion.v[:, 0]) > 0.05)


def of(covariance: np.ndarray, freedom: float) -> Callable[[np.ndarray], tuple[float, float]]:
    """Errors of sums by a covariance."""
    return lambda weights: (float(np.sqrt(weights @ covariance @ weights)), freedom)


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
    # least squares at a hundred speeds
    found = line([FrictionTerm("sign", 0.3), FrictionTerm("quadratic", 0.5)], np.zeros((2, 2)))
    v = np.linspace(*found["speeds"], 100)
    nearest = np.polyfit(v, 0.3 + 0.5 * v**2, 1)
    assert [found[key]["value"] for key in ("viscous", "coulomb")] == pytest.approx(nearest, rel=1e-9)
    assert line([], np.zeros((0, 0))) == {}


def test_the_line_is_that_of_speeds_at_which_the_direction_is_all_there() -> None:
    def speeds(*parameters: float) -> list[float]:
        law = [FrictionTerm("smooth_sign", 0.3, p) for p in parameters] or [FrictionTerm("sign", 0.3)]
        return line([*law, FrictionTerm("viscous", 1.0)], np.zeros((len(law) + 1,) * 2))["speeds"]

    v = np.abs(fourier_motion(20.0, 50.0, 1).v[:, 0])
    low, high = np.quantile(v[v > 0.05], [0.1, 0.95])
    assert speeds() == pytest.approx([low, high]) == speeds(1e-4)
    # three times the parameter of the slowest to fade in, and half of the range at most
    faded = 0.3 * high
    assert speeds(faded / 3, 1e-3) == pytest.approx([faded, high])
    assert speeds(1e-3, high) == pytest.approx([high / 2, high])


def test_the_stribeck_falls_own_velocity_has_its_part_in_the_error() -> None:
    law = [FrictionTerm("sign", 0.5), FrictionTerm("stribeck", 0.3, 0.4), FrictionTerm("viscous", 1.0)]
    model = replace(true_model(), friction=FrictionLaw((tuple(law), (), ())))
    motion = fourier_motion(20.0, 50.0, 1)
    samples = Samples(motion, np.zeros_like(motion.q), np.ones(motion.q.shape, dtype=bool), 0.02)
    rows = np.abs(motion.v[:, 0]) > 0.05
    names = [law[0].name(1), law[1].name(1), "v_s", law[2].name(1)]
    # the fall's velocity and the level that it falls from, correlated
    own = np.zeros((4, 4))
    own[np.ix_([0, 2], [0, 2])] = [[0.02**2, 0.6 * 0.02 * 0.05], [0.6 * 0.02 * 0.05, 0.05**2]]
    found = friction_line(model, 0, names, of(own, 12.34), samples, rows)

    def moved(level: float, by: float) -> dict:
        terms = (replace(law[0], coefficient=0.5 + level), replace(law[1], parameter=0.4 + by), law[2])
        other = replace(model, friction=FrictionLaw((terms, (), ())))
        return friction_line(other, 0, names, of(own, 12.34), samples, rows)

    for key in ("coulomb", "viscous"):
        slopes = [
            (moved(*step)[key]["value"] - moved(*-step)[key]["value"]) / 2e-4 for step in 1e-4 * np.eye(2)
        ]
        variance = slopes @ own[np.ix_([0, 2], [0, 2])] @ slopes
        assert found[key]["std_error"] == pytest.approx(np.sqrt(variance), rel=1e-3)
        assert found[key]["degrees_of_freedom"] == 12.3
    nothing = friction_line(model, 0, names, of(own, 9.0), samples, np.zeros_like(rows))
    assert nothing == {}


def test_what_grows_with_the_load_and_what_is_constant_is_no_part_of_it() -> None:
    plain = line([FrictionTerm("sign", 0.5), FrictionTerm("viscous", 1.0)], np.zeros((2, 2)))
    more = [
        FrictionTerm("sign", 0.5),
        FrictionTerm("viscous", 1.0),
        FrictionTerm("load_sign", 0.2),
        FrictionTerm("offset", 9.0),
    ]
    found = line(more, np.zeros((4, 4)))
    assert found["coulomb"]["value"] == pytest.approx(plain["coulomb"]["value"])
    assert found["viscous"]["value"] == pytest.approx(plain["viscous"]["value"])
    slid = line([FrictionTerm("hysteresis", 0.5, 0.01), FrictionTerm("viscous", 1.0)], np.zeros((2, 2)))
    assert slid["coulomb"]["value"] == pytest.approx(0.5) and slid["viscous"]["value"] == pytest.approx(1.0)
