"""The rules by which a trial is fitted and judged, each on numbers small enough to see through."""

from __future__ import annotations

import numpy as np

from armloop.diagnosis.evidence import FOLDS, Stacked
from armloop.diagnosis.fit import Fit
from armloop.diagnosis.judgement import SIGNIFICANCE, lead
from armloop.laws.effects import Estimate, effect
from armloop.regression.embedded import solve
from armloop.regression.moments import Moments


def left(held_out: np.ndarray, block: np.ndarray) -> Fit:
    """A fit of one joint that leaves this, with blocks as given."""
    rows = len(held_out)
    stacked = Stacked(np.zeros((rows, 0)), held_out, block, block % 2, np.zeros(rows, dtype=np.intp), 1)
    return Fit((), (), (), np.tile(held_out, (FOLDS, 1)), stacked)


def test_a_gain_that_lies_in_few_blocks_is_no_chance() -> None:
    """Friction that fades within the first sixth of a run, against the noise that stays."""
    rng = np.random.default_rng(1)
    block = np.repeat(np.arange(34), 60)
    noise = rng.normal(size=len(block))
    fades = 30.0 * np.exp(-block / 5.0)
    assert lead(left(noise + fades, block), left(noise, block)) > SIGNIFICANCE


def test_noise_has_no_lead() -> None:
    block = np.repeat(np.arange(34), 60)
    for seed in range(20):
        one, other = np.random.default_rng(seed).normal(size=(2, len(block)))
        assert lead(left(one, block), left(other, block)) < SIGNIFICANCE + 1


def test_a_column_of_rounding_errors_does_not_mislead_a_load() -> None:
    """The moment about a joint's own axis has no torque but what rounding leaves."""
    load = effect("payload", None)
    rng = np.random.default_rng(2)
    X = rng.normal(size=(500, 10))
    X[:, 2] *= 1e-17
    beta, _ = load.embed(np.array([0.5, 0.05, 0.0, 0.02, 0.0]))
    y = X @ beta + 0.01 * rng.normal(size=500)
    found = solve(Moments.of(X, y), [load], [10])[1][0]
    np.testing.assert_allclose(found[:2], [0.5, 0.05], atol=0.01)
    assert abs(found[2]) < 1.0


def test_a_width_beyond_what_was_tried_is_not_resolved() -> None:
    memory = effect("presliding_hysteresis", 1)
    for width, shown in ((1e-5, False), (1e-3, True), (1.0, False)):
        parameters = {"level": Estimate(1.0, 0.1, "N*m"), "width": Estimate(width, 0.0, "rad")}
        assert memory.resolved(parameters, [1e-4, 1e-2]) == shown
