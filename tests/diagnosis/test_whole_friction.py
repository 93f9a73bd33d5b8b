"""A joint whose friction has grown as a whole: its Coulomb, viscous and Stribeck parts are told together."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from synthetic import (
    COULOMB,
    STATIC,
    STRIBECK_VELOCITY,
    VISCOUS,
    friction,
    measured,
    rigid_torque,
    three_axis,
)

from armloop.data.log import MotionLog
from armloop.data.motion import Motion
from armloop.data.signals import preprocess
from armloop.diagnosis import diagnose, trials
from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.fit import Shape
from armloop.diagnosis.outcomes import Found
from armloop.diagnosis.posterior import log_posterior
from armloop.diagnosis.search import _Search
from armloop.diagnosis.trials import Hypotheses, Known
from armloop.identification.reconstruction import Options, reconstruct
from armloop.laws.effects import effect, hypotheses
from armloop.model import ReconstructedModel
from armloop.reports.findings import findings

Array = NDArray[np.float64]
#: What the friction of joint 2 has grown by, in parts of it.
MORE = 0.8
LAWS = ("coulomb_friction", "viscous_friction", "stribeck_friction")


def from_point_to_point(seed: int, seconds: float = 30.0, rate: float = 200.0) -> Motion:
    """Moves of minimum jerk between six places, at three paces, with a rest after each."""
    rng, step = np.random.default_rng(seed), 1 / rate
    places = rng.uniform(-1.0, 1.0, (6, 3))
    parts, k, time = list[tuple[Array, ...]](), 0, 0.0
    while time < seconds:
        start, way = places[k % 6], places[(k + 1) % 6] - places[k % 6]
        duration = max(float(np.abs(way).max()) * 1.875 / (1.6 * rng.choice([1.0, 0.6, 0.3])), 0.5)
        s = np.arange(0, 1, step / duration)
        q, v, vdot = (
            10 * s**3 - 15 * s**4 + 6 * s**5,
            30 * s**2 * (1 - s) ** 2,
            60 * s - 180 * s**2 + 120 * s**3,
        )
        parts.append(
            (start + np.outer(q, way), np.outer(v, way) / duration, np.outer(vdot, way) / duration**2)
        )
        rest = np.repeat((start + way)[None], int(0.3 * rate), axis=0)
        parts.append((rest, 0 * rest, 0 * rest))
        time, k = time + duration + 0.3, k + 1
    q, v, vdot = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Motion(np.arange(len(q)) * step, q, v, vdot, np.array([0]))


def run(seed: int, more: float = 0.0) -> MotionLog:
    motion = from_point_to_point(seed)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)
    tau[:, 1] += more * friction(motion.v)[:, 1]
    return measured(motion, tau, seed, name=f"run_{seed}")


@pytest.fixture(scope="module")
def model() -> ReconstructedModel:
    options = Options(parts=False)
    return reconstruct([run(1), run(2)], three_axis(), library="rigid-body", options=options).model


@pytest.mark.parametrize(
    "seed", [11, pytest.param(12, marks=pytest.mark.long), pytest.param(13, marks=pytest.mark.long)]
)
def test_all_parts_are_told_within_their_errors(model: ReconstructedModel, seed: int) -> None:
    found = diagnose(model, [run(seed, MORE)], jobs=1)
    assert {(name, 2) for name in LAWS} == set(found.named)
    added = {a.effect.name: a.parameters for a in found.outcome.added()}
    truth = {
        ("coulomb_friction", "level"): COULOMB[1],
        ("viscous_friction", "coefficient"): VISCOUS[1],
        ("stribeck_friction", "static_excess"): STATIC[1] - COULOMB[1],
    }
    for (name, key), size in truth.items():
        estimate = added[name][key]
        error = float(np.asarray(estimate.std_error))
        assert abs(float(np.asarray(estimate.value)) - MORE * size) < 4 * error < 2 * MORE * size
    assert added["stribeck_friction"]["velocity"].value == pytest.approx(STRIBECK_VELOCITY, rel=0.2)
    (grown,) = [reason for reason in found.reasons if reason.endswith("times what the model has")]
    assert grown.startswith("joint 2: ") and "viscous friction is 1.8" in grown
    # none removes much beside the others
    assert found.outcome.together > 0.99
    words = findings(found)
    assert any(text.startswith("Together they remove") for text in words)
    assert sum("Beside the others it removes" in text for text in words) == 3


def test_laws_that_lie_between_them_give_way_to_all_three(model: ReconstructedModel) -> None:
    samples = preprocess([run(11, MORE)], model.conditioning)
    evidence = Evidence.of(model, samples, hypotheses(model.arm))
    with Hypotheses(evidence, jobs=1) as panel:
        search = _Search(evidence, lambda text: None, panel, [])
        between = [effect("coulomb_friction", 2), effect("quadratic_drag", 2)]
        found = [Found(one, Shape.fixed(0.0), 0.0) for one in between]
        ((likely, whole),) = search._whole_friction(found)
        assert [f.effect.place for f in whole] == [(name, 2, None) for name in LAWS]
        fit = Known.of(evidence, between, [Shape.fixed(0.0)] * 2).fit
        assert likely > log_posterior(evidence, fit.score, between)
        # of a joint of which nothing rubs, or where one of them is barred, there is none
        assert not list(search._whole_friction([Found(effect("torque_offset", 2), Shape.fixed(0.0), 0.0)]))
        search.barred = [("viscous_friction", 2, None)]
        assert not list(search._whole_friction(found))
        search.barred, search.most = [], 2
        assert not list(search._whole_friction(found))


def test_a_models_falls_are_known(model: ReconstructedModel) -> None:
    context = model.context(from_point_to_point(3, 2.0), [effect("stribeck_friction", 2)])
    assert context.falls == tuple(map(model.friction.stribeck_velocity, range(3)))
    assert all(abs(fall / STRIBECK_VELOCITY - 1) < 0.3 for fall in context.falls)


def test_a_known_fall_is_the_usual_one() -> None:
    law: Any = effect("stribeck_friction", 2)
    motion = from_point_to_point(3)
    known: Any = SimpleNamespace(motion=motion, load=None, fading=(), falls=(0.0, 0.1, 0.0))
    unknown: Any = SimpleNamespace(motion=motion, load=None, fading=(), falls=(0.0, 0.0, 0.0))
    assert law.usual(known) == 0.1 and law.usual(unknown) is None
    assert law.shapes(known) == law.shapes(unknown)
    # there it has no derivative: of few slow samples any velocity nearby could be made to fit
    assert law.columns(known, 0.1).shape[1] == 1 and law.columns(known, 0.2).shape[1] == 2


@pytest.mark.parametrize(
    ("usual", "likelihoods", "possible", "taken"),
    [
        # judged on what no shape was chosen by, the likelier is taken
        (2.0, {2.0: 5.0, 3.0: 4.0}, {2.0, 3.0}, 2.0),
        (2.0, {2.0: 4.0, 3.0: 5.0}, {2.0, 3.0}, 3.0),
        (2.0, {2.0: 5.0, 3.0: 4.0}, {3.0}, 3.0),
        (2.0, {2.0: 4.0, 3.0: 5.0}, {2.0}, 2.0),
        (2.0, {2.0: 5.0, 3.0: 4.0}, set(), None),
        # beyond what the run shows, and where none is known, it is not asked
        (9.0, {3.0: 4.0}, {3.0}, 3.0),
        (None, {3.0: 4.0}, {3.0}, 3.0),
    ],
)
def test_what_is_known_beforehand_is_a_hypothesis_beside_the_best_of_the_grid(
    usual: float | None,
    likelihoods: dict[float, float],
    possible: set[float],
    taken: float | None,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fitted(evidence: Any, residual: Any, effects: Any, shapes: Any, columns: Any) -> Any:
        shape = shapes[-1].final
        return SimpleNamespace(
            shape=shape, score=likelihoods[shape], is_possible=lambda k, tried: shape in possible
        )

    monkeypatch.setattr(trials, "fit", fitted)
    monkeypatch.setattr(trials, "told", lambda score: score)
    monkeypatch.setattr(trials, "_best_shape", lambda known, effect, grid: Shape.fixed(3.0))
    monkeypatch.setattr(trials._Grid, "of", lambda *_: "a grid")
    one: Any = SimpleNamespace(indices=(0,), usual=lambda context: usual)
    evidence: Any = SimpleNamespace(
        rows=np.ones((4, 1), dtype=bool), tried=lambda effect: [1.0, 3.0, 4.0], context=None
    )
    known = Known(evidence, np.zeros((4, 1)), SimpleNamespace(effects=(), shapes=()))  # type: ignore[arg-type]
    trial: Any = known.trial(one)
    assert (None if trial is None else trial.shape) == taken
