"""Chosen terms are regressed on filtered columns: friction's parameters come back from varying motion alone."""

from dataclasses import replace
from importlib import import_module
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from armloop.data.signals import preprocess
from armloop.identification.reconstruction.data import Data
from armloop.identification.reconstruction.found import Found
from armloop.identification.reconstruction.options import Options
from armloop.identification.reconstruction.refit import refit
from armloop.laws.friction import FrictionLaw, FrictionTerm
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

refits = import_module("armloop.identification.reconstruction.refit")


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


class TestWhatIsKept:
    """Two joints whose v_s a refit moves by given factors."""

    def refitted(
        self, monkeypatch: pytest.MonkeyPatch, first: float, second: float, falls: bool = True, **of: Any
    ) -> tuple[bool, list[float]]:
        def laws(*speeds: float) -> FrictionLaw:
            return FrictionLaw(
                tuple((FrictionTerm("viscous", s), FrictionTerm("stribeck", s, s)) for s in speeds)
            )

        def solve(before: Any, assembled: Any) -> Any:
            if of.get("singular"):
                raise np.linalg.LinAlgError
            return SimpleNamespace(
                components=before.components, friction=laws(0.1 * first, 0.1 * second)
            ), falls

        monkeypatch.setattr(refits, "solve", solve)
        before = SimpleNamespace(components=["bodies"], friction=laws(0.1, 0.1))
        found: Any = SimpleNamespace(model=lambda: before, law=before.friction, regressed_by=None)
        data: Any = SimpleNamespace(
            reference=SimpleNamespace(samples=SimpleNamespace(cutoff_hz=of.get("cutoff", 1.0)))
        )
        estimator: Any = SimpleNamespace(least_squares=True)
        done = refit(found, data, estimator)
        friction = getattr(found, "friction", found.law.terms)
        return done, [law[1].parameter / 0.1 for law in friction]

    def test_a_joint_whose_stribeck_velocity_runs_away_keeps_what_it_had(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        for first, second, kept in ((2.4, 0.41, (2.4, 0.41)), (2.6, 1.5, (1, 1.5)), (1.5, 0.39, (1.5, 1))):
            assert self.refitted(monkeypatch, first, second) == (True, pytest.approx(kept))
        assert self.refitted(monkeypatch, 2.6, 0.39) == (False, pytest.approx([1, 1]))

    def test_nothing_changes_where_the_error_would_not_fall(self, monkeypatch: pytest.MonkeyPatch) -> None:
        assert self.refitted(monkeypatch, 1.5, 1.5, falls=False) == (False, [1, 1])
        assert self.refitted(monkeypatch, 1.5, 1.5, singular=True) == (False, [1, 1])
        assert self.refitted(monkeypatch, 1.5, 1.5, cutoff=0.0) == (False, [1, 1])
