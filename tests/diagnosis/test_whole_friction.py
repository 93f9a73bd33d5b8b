"""A joint whose friction has grown as a whole: its Coulomb, viscous and Stribeck parts are told together."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

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
from armloop.diagnosis import Diagnosis, diagnose, outcomes, trials
from armloop.diagnosis.evidence import FOLDS, Evidence, Stacked, Whitening
from armloop.diagnosis.fit import Proportion, Shape, fit
from armloop.diagnosis.friction_as_a_whole import friction_of
from armloop.diagnosis.outcomes import Found, Outcome, hypotheses_of, others_than, without_effect
from armloop.diagnosis.posterior import log_posterior
from armloop.diagnosis.search import _Search
from armloop.diagnosis.trials import Hypotheses, Known
from armloop.identification.reconstruction import Options, reconstruct
from armloop.laws.effects import Estimate, effect, hypotheses
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import AddedEffect, ReconstructedModel
from armloop.reports.findings import findings

Array = NDArray[np.float64]
#: What the friction of joint 2 has grown by, in parts of it.
MORE = 0.8
LAWS = ("coulomb_friction", "viscous_friction", "stribeck_friction")
#: Dry friction of joint 2, and its rise at low speed.
DRY, RISE = COULOMB[1], STATIC[1] - COULOMB[1]


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


def run(seed: int, more: float = 0.0, of_drag: float | None = None) -> MotionLog:
    """The friction of joint 2 grown by these parts of what it was, its viscous part by another."""
    motion = from_point_to_point(seed)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)
    tau[:, 1] += more * friction(motion.v)[:, 1]
    if of_drag is not None:
        tau[:, 1] += (of_drag - more) * VISCOUS[1] * motion.v[:, 1]
    return measured(motion, tau, seed, name=f"run_{seed}")


@pytest.fixture(scope="module")
def model() -> ReconstructedModel:
    options = Options(parts=False)
    return reconstruct([run(1), run(2)], three_axis(), library="rigid-body", options=options).model


def parts(found: Diagnosis) -> dict[str, Any]:
    return {a.effect.name: next(iter(a.parameters.values())) for a in found.outcome.added()}


@pytest.mark.parametrize(
    "seed", [11, pytest.param(12, marks=pytest.mark.long), pytest.param(13, marks=pytest.mark.long)]
)
def test_all_parts_are_told_within_their_errors(model: ReconstructedModel, seed: int) -> None:
    """Each has grown by a part of its own."""
    found = diagnose(model, [run(seed, MORE, of_drag=1.6)], jobs=1)
    assert {(name, 2) for name in LAWS} == set(found.named)
    added, truth = parts(found), dict(zip(LAWS, (MORE * DRY, 1.6 * VISCOUS[1], MORE * RISE), strict=True))
    for name, size in truth.items():
        error = float(np.asarray(added[name].std_error))
        assert abs(float(np.asarray(added[name].value)) - size) < 4 * error < 2 * size
    (grown,) = [reason for reason in found.reasons if reason.endswith("times what the model has")]
    told = re.search(r"viscous friction is ([\d.]+) times", grown)
    assert told and abs(float(told[1]) - 2.6) < 0.05
    # none removes much beside the others
    assert found.outcome.together > 0.99
    words = findings(found)
    assert any(text.startswith("Together they remove") for text in words)
    assert sum("Beside the others it removes" in text for text in words) == 3
    assert not any("growth" in each for each in found.to_dict()["effects"])


@pytest.mark.parametrize("seed", [11, *(pytest.param(k, marks=pytest.mark.long) for k in (12, 13, 14, 15))])
def test_growth_as_a_whole_is_one_number(model: ReconstructedModel, seed: int) -> None:
    found = diagnose(model, [run(seed, MORE)], jobs=1)
    assert [(name, 2) for name in LAWS] == found.named
    (growth,) = found.outcome.growths().values()
    # far better known than any part by itself is
    assert abs(growth.value - MORE) < 4 * growth.std_error < 0.1 * MORE
    has, added = {part.effect: part for part in friction_of(found.evidence, 1)}, parts(found)
    for name, size in zip(LAWS, (DRY, VISCOUS[1], RISE), strict=True):
        own = added[name]
        assert own.value == pytest.approx(growth.value * has[name].size)
        spread = np.hypot(growth.std_error * has[name].size, growth.value * has[name].std_error)
        assert own.std_error == pytest.approx(spread) and abs(own.value - MORE * size) < 4 * own.std_error
    assert added["stribeck_friction"].std_error < 0.1 * MORE * RISE
    for each in found.to_dict()["effects"]:
        assert each["growth"] == growth.to_dict() and each["share"] > 0.98
    words = findings(found)
    assert len(words) == 1
    told = re.match(
        r"Found: all friction of joint 2 is ([\d.]+) ± [\d.]+ times what the model has, coulomb ", words[0]
    )
    assert told and abs(float(told[1]) - 1 - growth.value) < 1e-3
    assert not any("what the model has" in reason for reason in found.reasons)
    # the whole law is in the model, where the joint slides
    motion = from_point_to_point(seed + 50)
    sliding = np.abs(motion.v[:, 1]) > 0.01
    before, after = (of.predict(motion, sensors=False)[sliding, 1] for of in (model, found.model))
    np.testing.assert_allclose(after - before, MORE * friction(motion.v)[sliding, 1], rtol=0.05)


@pytest.mark.parametrize("name", LAWS[:2])
def test_one_part_alone_is_no_growth_as_a_whole(model: ReconstructedModel, name: str) -> None:
    motion, log = from_point_to_point(11), run(11)
    more = DRY * np.sign(motion.v[:, 1]) if name == LAWS[0] else VISCOUS[1] * motion.v[:, 1]
    tau = log.tau + MORE * np.outer(more, [0.0, 1.0, 0.0])
    assert diagnose(model, [replace(log, tau=tau)], jobs=1).named == [(name, 2)]


def test_laws_that_lie_between_them_give_way_to_all_three(model: ReconstructedModel) -> None:
    samples = preprocess([run(11, MORE)], model.conditioning)
    evidence = Evidence.of(model, samples, hypotheses(model.arm))
    with Hypotheses(evidence, jobs=1) as panel:
        search = _Search(evidence, lambda text: None, panel, [])
        between = [effect("coulomb_friction", 2), effect("quadratic_drag", 2)]
        found = [Found(one, Shape.fixed(0.0), 0.0) for one in between]
        (each, several), (likely, whole) = search._whole_friction(found)
        assert all(
            [f.effect.place for f in every] == [(name, 2, None) for name in LAWS]
            for every in (several, whole)
        )
        assert [len({f.shape.proportion for f in every}) for every in (several, whole)] == [1, 3]
        fit = Known.of(evidence, between, [Shape.fixed(0.0)] * 2).fit
        assert each > log_posterior(evidence, fit.score, between)
        # two parameters less, of which the odds are told
        assert likely - each > 2 * np.log(len(hypotheses(model.arm))) - 2
        # of a joint of which nothing rubs, or where one of them is barred, there is none
        assert not list(search._whole_friction([Found(effect("torque_offset", 2), Shape.fixed(0.0), 0.0)]))
        search.barred = [("viscous_friction", 2, None)]
        assert not list(search._whole_friction(found))
        # one factor is of one kind
        search.barred, search.most = [], 2
        ((_, every),) = search._whole_friction(found)
        assert [f.shape for f in every] == [f.shape for f in whole]
        search.most = 0
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


def terms(*given: tuple[str, float, float]) -> FrictionLaw:
    return FrictionLaw((tuple(FrictionTerm(*each) for each in given),))


def known_of(law: FrictionLaw, *effects: AddedEffect, uncertainty: Any = None, day: Any = ()) -> Any:
    model = SimpleNamespace(friction=law, effects=(*effects, *day), uncertainty=uncertainty or {})
    nothing = np.zeros(0)
    return SimpleNamespace(model=model, whitening=Whitening(nothing, nothing, nothing, day) if day else None)


def given(name: str, **values: float) -> AddedEffect:
    return AddedEffect(effect(name, 1), {key: Estimate(x, 0.1, "") for key, x in values.items()})


EQUATION_34 = terms(("sign", 2.0, 0.0), ("viscous", 3.0, 0.0), ("stribeck_peak", 1.0, 0.1))


@pytest.mark.parametrize(
    ("law", "effects", "wanted"),
    [
        (EQUATION_34, [], [2.0, 3.0, 1.0]),
        (terms(("sign", 2.0, 0.0), ("viscous", 3.0, 0.0)), [], [2.0, 3.0]),
        # what fades in and what remembers is one level while it slides
        (
            terms(("smooth_sign", 1.5, 0.003), ("hysteresis", 0.5, 0.001), ("viscous", 3.0, 0.0)),
            [],
            [2.0, 3.0],
        ),
        (EQUATION_34, [given("coulomb_friction", level=-0.5)], [1.5, 3.0, 1.0]),
        (EQUATION_34, [given("viscous_friction", coefficient=2.0)], [2.0, 5.0, 1.0]),
        (EQUATION_34, [given("stribeck_friction", static_excess=1.0, velocity=0.1)], [2.0, 3.0, 2.0]),
        # of falls at two speeds the larger tells where
        (EQUATION_34, [given("stribeck_friction", static_excess=0.5, velocity=0.2)], [2.0, 3.0, 1.5]),
        (EQUATION_34, [given("quadratic_drag", coefficient=1.0)], [2.0, 3.0, 1.0, 1.0]),
        (
            terms(
                ("sign", 2.0, 0.0),
                ("viscous", 3.0, 0.0),
                ("stribeck_peak", 1.0, 0.1),
                ("quadratic", 4.0, 0.0),
            ),
            [],
            [2.0, 3.0, 1.0, 4.0],
        ),
        # a rise from the static level
        (terms(("sign", 3.0, 0.0), ("viscous", 3.0, 0.0), ("stribeck", -1.0, 0.1)), [], [2.0, 3.0, 1.0]),
        (
            terms(("sign", 2.0, 0.0), ("viscous_forward", 4.0, 0.0), ("viscous_backward", 2.0, 0.0)),
            [],
            [2.0, 3.0],
        ),
        (terms(("sign", 2.0, 0.0), ("offset", 9.0, 0.0)), [], [2.0]),
        (terms(("sign", 2.0, 0.0), ("cubic", 9.0, 0.0)), [], []),
        (EQUATION_34, [given("friction_asymmetry", level=1.0)], []),
        (EQUATION_34, [given("presliding_hysteresis", level=1.0, width=0.01)], []),
        (EQUATION_34, [given("coulomb_friction", level=-2.5)], []),
        # an inertia rubs nowhere
        (EQUATION_34, [given("rotor_inertia", inertia=1.0)], [2.0, 3.0, 1.0]),
        (terms(), [], []),
    ],
)
def test_what_a_joint_has_is_all_that_slides(law: FrictionLaw, effects: Any, wanted: list[float]) -> None:
    parts = friction_of(known_of(law, *effects), 0)
    assert [part.size for part in parts] == pytest.approx(wanted)
    assert [part.effect for part in parts] == [*LAWS, "quadratic_drag"][: len(wanted)]
    assert [part.velocity for part in parts] == [0.0, 0.0, 0.1, 0.0][: len(wanted)]
    assert not any(part.std_error for part in parts)


def test_a_fall_that_the_model_was_given_is_the_joints() -> None:
    plain = terms(("sign", 2.0, 0.0), ("viscous", 3.0, 0.0))
    fallen = given("stribeck_friction", static_excess=1.0, velocity=0.2)
    assert friction_of(known_of(plain, fallen), 0)[-1][:2] == ("stribeck_friction", 1.0)
    assert friction_of(known_of(plain, fallen), 0)[-1].velocity == 0.2


def test_what_grows_with_the_load_is_a_part() -> None:
    law = terms(("sign", 2.0, 0.0), ("load_smooth_sign", 0.1, 0.01), ("load_hysteresis", 0.05, 0.001))
    assert [tuple(part) for part in friction_of(known_of(law), 0)] == [
        ("coulomb_friction", 2.0, 0.0, 0.0),
        ("load_dependent_friction", pytest.approx(0.15), 0.0, 0.0),
    ]


def test_friction_of_the_day_is_beside_it() -> None:
    day = [given("viscous_friction", coefficient=-1.0)]
    assert [part.size for part in friction_of(known_of(EQUATION_34, day=day), 0)] == [2.0, 3.0, 1.0]
    before = given("viscous_friction", coefficient=1.0)
    assert [part.size for part in friction_of(known_of(EQUATION_34, before, day=day), 0)] == [2.0, 4.0, 1.0]


def test_errors_of_what_a_joint_has_are_the_models() -> None:
    law = {
        key: {"value": 1.0, "std_error": x}
        for key, x in (("coulomb", 3.0), ("viscous", 1.0), ("static", 4.0))
    }
    parts = friction_of(known_of(EQUATION_34, uncertainty={"stribeck": [law]}), 0)
    assert [part.std_error for part in parts] == [3.0, 1.0, 5.0]
    for short in ([], [{}], None):
        assert not any(
            part.std_error for part in friction_of(known_of(EQUATION_34, uncertainty={"stribeck": short}), 0)
        )


def test_effects_in_proportion_have_one_free_parameter() -> None:
    """Columns 1, 2 and 3 of three effects, the first by itself; the others are one of 4 x + 5 y."""
    rng = np.random.default_rng(3)
    X, fold = rng.normal(size=(60, 3)), np.arange(60) % FOLDS
    y = X @ [2.0, 4 * 0.7, 5 * 0.7]
    own, *tied = (effect(name, 1) for name in ("torque_offset", *LAWS[:2]))
    columns = dict(zip(("torque_offset", *LAWS[:2]), X.T[:, :, None], strict=True))
    block, none = np.arange(60), np.zeros((60, 0))

    def stack(residual: Array, parts: Any) -> Stacked:
        return Stacked(np.hstack(parts), residual, block, fold, 0 * block, 1, 0 * block, none)

    evidence: Any = SimpleNamespace(
        weighted=lambda effect, shape: columns[effect.name],
        stack=stack,
        tried=lambda effect: [0.0],
        model=SimpleNamespace(arm=three_axis(), effects=()),
    )
    shapes = [Shape.fixed(0.0), *(Shape.fixed(0.0, Proportion(*each)) for each in ((4.0, 0.4), (5.0, 0.0)))]
    noisy = y + 0.01 * rng.normal(size=60)
    for effects, order in (((own, *tied), [0, 1, 2]), ((tied[0], own, tied[1]), [1, 0, 2])):
        fitted = fit(evidence, noisy, effects, [shapes[k] for k in order])
        assert fitted.stacked.X.shape == (60, 2) and fitted.score.complexity == 2
        first, last = (next(k for k, e in enumerate(effects) if e is one) for one in tied)
        growth = fitted.growth(first)
        assert growth is not None and growth == fitted.growth(last) and growth.unit == "1"
        assert fitted.growth(order.index(0)) is None
        assert growth.value == pytest.approx(0.7, abs=4 * growth.std_error) and growth.std_error < 1e-3
        values = [next(iter(p.values())) for p in fitted.parameters]
        assert [values[k].value for k in (first, last)] == pytest.approx([4 * growth.value, 5 * growth.value])
        # one knows what the joint has but for its error, of the other exactly
        spread = np.hypot(4 * growth.std_error, 0.4 * growth.value)
        assert [values[k].std_error for k in (first, last)] == pytest.approx([spread, 5 * growth.std_error])
        # each is as clear as their one parameter is, however well it is known what the joint has
        assert fitted.clear[first] == pytest.approx(fitted.clear[last])
        assert fitted.clear[first] == pytest.approx(growth.value / growth.std_error)
        assert fitted.clear_together([first, last]) == pytest.approx(fitted.clear_together([first]))
        # they are one number in that, too, where it is hardly clear
        noise = y + 30.0 * np.random.default_rng(4).normal(size=60)
        hardly = fit(evidence, noise, effects, [shapes[k] for k in order])
        assert hardly.clear_together([first, last]) == pytest.approx(hardly.clear_together([first]))
        assert hardly.clear_together([first]) < 5


def test_friction_that_has_fallen_as_a_whole_is_no_set_that_can_be(model: ReconstructedModel) -> None:
    """No arm has a Stribeck part below zero, and a change of one is not told from its absence."""
    for more, told in ((MORE, 3), (-0.4, 0)):
        evidence = Evidence.of(model, preprocess([run(11, more)], model.conditioning), hypotheses(model.arm))
        search = _Search(evidence, lambda text: None, cast(Any, None), [])
        assert len(search._in_proportion([], 2)) == told


def test_one_part_alone_is_not_asked_by_a_factor() -> None:
    law, search = (
        terms(("sign", 2.0, 0.0)),
        SimpleNamespace(evidence=known_of(terms(("sign", 2.0, 0.0))), barred=[]),
    )
    assert len(friction_of(known_of(law), 0)) == 1 and _Search._in_proportion(cast(Any, search), [], 1) == []


def test_what_goes_together_is_not_exchanged_in_parts() -> None:
    """Two of a joint make way for two others, but not two of which neither is there without the other."""
    asked: list[Any] = []
    search: Any = SimpleNamespace(_two_for=lambda found, some, joints, value: asked.append(some) or [])
    own, tied = Shape.fixed(0.0), Shape.fixed(0.0, Proportion(2.0))
    for shape, pairs in ((own, 1), (tied, 0)):
        asked.clear()
        found = [Found(effect(name, 1), shape, 0.0) for name in LAWS[:2]]
        assert list(_Search._exchanges(search, found, 0.0)) == [] and len(asked) == pairs


def test_an_effect_goes_with_those_that_it_is_in_proportion_to(monkeypatch: pytest.MonkeyPatch) -> None:
    tied = Shape.fixed(0.0, Proportion(2.0))
    every = [Found(effect(name, 1), tied, 0.0) for name in LAWS[:2]]
    every.append(Found(effect("payload", None), Shape.fixed(0.0), 0.0))
    monkeypatch.setattr(outcomes, "known_with", lambda evidence, found: SimpleNamespace(fit=len(found)))
    whole = Outcome(every, cast(Any, None), cast(Any, None))
    assert [f.effect.name for f in without_effect(cast(Any, None), whole, every[1]).found] == ["payload"]
    assert len(without_effect(cast(Any, None), whole, every[2]).found) == 2


def test_what_is_in_proportion_goes_together() -> None:
    tied = Shape.fixed(0.0, Proportion(2.0))
    drag, dry = (Found(effect(name, 1), tied, 0.0) for name in LAWS[1::-1])
    other, apart = Found(effect(LAWS[1], 2), tied, 0.0), Found(effect(LAWS[2], 1), Shape.fixed(0.0), 0.0)
    every = [drag, other, dry, apart]
    assert hypotheses_of(every) == [drag.effect, other.effect, apart.effect]
    assert [others_than(every, k) for k in range(4)] == [
        [other, apart],
        [drag, dry, apart],
        [other, apart],
        [drag, other, dry],
    ]
