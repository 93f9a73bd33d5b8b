"""What a model leaves of a part of its training data when the others alone are regressed."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import fourier_motion, measured, three_axis

from armloop.data.motion import Motion, Samples
from armloop.data.signals import Conditioning, independent_rows, preprocess, smooth
from armloop.identification.scoring import residual
from armloop.identification.uncertainty import Fitted
from armloop.identification.uncertainty.cross_fitting import cross_fitted, training_parts
from armloop.identification.uncertainty.solving import solve_given_terms
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import ReconstructedModel


def model(kinds: tuple[str, ...] = ("sign", "viscous")) -> ReconstructedModel:
    law = tuple(FrictionTerm(kind, 0.0) for kind in kinds)
    return ReconstructedModel(three_axis(), (), FrictionLaw((law,) * 3))


def training(levels: list[float], resting: int = 0, seconds: float = 8.0) -> Samples:
    """Logs with dry friction of one level each; in the first few joint 3 is at rest."""
    logs = []
    for seed, level in enumerate(levels, 1):
        motion = fourier_motion(seconds, 100.0, seed)
        if seed <= resting:
            motion.q[:, 2] = motion.v[:, 2] = motion.vdot[:, 2] = 0.0
        logs.append(measured(motion, level * np.sign(motion.v) + 0.2 * motion.v, seed, 0.02, name=f"{seed}"))
    return preprocess(logs, Conditioning())


def fit(
    samples: Samples, kinds: tuple[str, ...] = ("sign", "viscous")
) -> tuple[ReconstructedModel, list[Fitted]]:
    fitted = [Fitted((1, 2, 3), samples.moving & independent_rows(samples)[:, None])]
    return solve_given_terms(model(kinds), samples, fitted, 2)[0], fitted


def test_each_part_is_left_by_the_regression_of_the_others() -> None:
    samples = training([0.3, 0.5, 0.4, 0.9])
    found, fitted = fit(samples)
    parts = training_parts(samples.motion)
    left = cross_fitted(found, samples, fitted, parts)
    for part in range(4):
        mine = parts == part
        rest = [Fitted((1, 2, 3), fitted[0].rows & ~mine[:, None])]
        expected = residual(solve_given_terms(model(), samples, rest, 2)[0], samples)[mine]
        # a hundredth of what the part itself says stays
        np.testing.assert_allclose(left[mine], expected, atol=0.02 * np.abs(expected).max())
    # the level of the last log is .5 above the mean of the others, .375 above that of all
    last = parts == 3
    assert np.std(left[last]) > 1.25 * np.std(residual(found, samples)[last])


def test_a_part_has_no_say_in_what_it_leaves() -> None:
    samples = training([0.3, 0.5, 0.4])
    found, fitted = fit(samples)
    parts = training_parts(samples.motion)
    one = cross_fitted(found, samples, fitted, parts)
    shift = 0.1 * np.where((parts == 1)[:, None], smooth(samples, np.sign(samples.motion.v)), 0.0)
    shifted = replace(samples, tau=samples.tau + shift)
    again, _ = fit(shifted)
    other = cross_fitted(again, shifted, fitted, parts)
    mine = parts == 1
    # but for a hundredth: the model's own coefficients, which the others correct
    np.testing.assert_allclose((other - one)[mine], shift[mine], atol=0.003)
    assert np.abs((residual(again, shifted) - residual(found, samples))[mine] - shift[mine]).max() > 0.02


def test_what_the_other_parts_do_not_show_is_taken_as_the_whole_tells_it() -> None:
    samples = training([0.5] * 3, resting=2)
    found, fitted = fit(samples)
    left = cross_fitted(found, samples, fitted, training_parts(samples.motion))
    moving = samples.moving[:, 2] & ~samples.at_an_end
    assert np.std(left[moving, 2]) < 0.1
    np.testing.assert_allclose(left[moving, 2], residual(found, samples)[moving, 2], atol=0.02)


def test_a_stribeck_speed_takes_one_step() -> None:
    samples = training([0.3, 0.5, 0.4])
    kinds = ("sign", "viscous")
    law = (*(FrictionTerm(kind, 0.0) for kind in kinds), FrictionTerm("stribeck", 0.0, 0.3))
    start = ReconstructedModel(three_axis(), (), FrictionLaw((law,) * 3))
    fitted = [Fitted((1, 2, 3), samples.moving & independent_rows(samples)[:, None])]
    found, _ = solve_given_terms(start, samples, fitted, 1)
    left = cross_fitted(found, samples, fitted, training_parts(samples.motion))
    assert np.isfinite(left).all()


@pytest.mark.parametrize(
    ("logs", "seconds", "parts"), [(1, 30.0, 6), (2, 10.0, 6), (3, 10.0, 3), (16, 1.0, 16), (40, 1.0, 16)]
)
def test_logs_are_left_out_whole_and_few_are_cut(logs: int, seconds: float, parts: int) -> None:
    N = round(100 * seconds)
    time = np.concatenate([np.arange(N) / 100.0] * logs)
    nothing = np.zeros((len(time), 1))
    found = training_parts(Motion(time, nothing, nothing, nothing, np.arange(logs) * N))
    assert (np.diff(found) >= 0).all() and found[0] == 0 and len(np.unique(found)) == parts == found[-1] + 1
    if logs >= 3:
        assert all(len(set(found[k * N : (k + 1) * N])) == 1 for k in range(logs))
    assert np.ptp(np.bincount(found)) <= (N if logs >= 3 else 1)
