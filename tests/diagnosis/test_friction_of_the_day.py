"""Drives that warm up: what changed in a run is told beside friction that differs from log to log."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import fractional_matrix_power
from synthetic import fourier_motion, friction, measured, rigid_torque, three_axis

from armloop.data.log import MotionLog
from armloop.data.signals import preprocess
from armloop.diagnosis import diagnose, friction_of_the_day
from armloop.diagnosis.beside import known_by
from armloop.diagnosis.evidence import Evidence, Whitening
from armloop.diagnosis.friction_of_the_day import of_the_day, says_more
from armloop.diagnosis.zeros import predicted
from armloop.identification.reconstruction import Options, reconstruct
from armloop.laws.effects import effect, hypotheses
from armloop.laws.effects.base import Estimate
from armloop.model import AddedEffect, ReconstructedModel

#: By how much the grease of three days differs, and how much thinner or thicker it is than in the mean.
VISCOUS, DAYS = np.array([4.0, 3.0, 1.0]), (0.0, 0.15, 0.4)


def run(seed: int, warmth: float, gain: float = 1.0, dry: float = 0.0, push: float = 0.0) -> MotionLog:
    """A run on a day; what joint 2 reads of its torque, its dry friction, and what pushes it for a second."""
    motion = fourier_motion(30.0, 100.0, seed)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)
    tau += warmth * VISCOUS * motion.v
    tau[:, 1] += dry * np.sign(motion.v[:, 1]) + push * ((motion.time > 12) & (motion.time < 13))
    tau[:, 1] *= gain
    return measured(motion, tau, seed, name=f"run_{seed}")


@pytest.fixture(scope="module")
def model() -> ReconstructedModel:
    logs = [run(k, day) for k, day in enumerate(DAYS, 1)]
    return reconstruct(logs, three_axis(), library="rigid-body", options=Options(parts=False)).model


def evidence(model: ReconstructedModel, log: MotionLog) -> Evidence:
    return Evidence.of(model, preprocess([log], model.conditioning), hypotheses(model.arm))


def test_friction_differs_by_more_than_the_model_leaves(model: ReconstructedModel) -> None:
    whole = evidence(model, run(7, 0.1))
    found = of_the_day(whole)
    assert model.uncertainty["between_logs_known"] == "different" and found is not None
    day, _ = found
    assert (day.scale < 0.5 * whole.scale).all()
    # what is taken off is friction: what the model leaves else is its own residual
    assert np.sqrt(np.mean(day.residual([])[day.rows] ** 2)) < 2 * np.sqrt(np.mean(day.scale**2))


@pytest.mark.parametrize("day", [-0.1, 0.2, 0.5])
def test_friction_of_another_day_is_no_change(model: ReconstructedModel, day: float) -> None:
    found = diagnose(model, [run(8, day)], jobs=1)
    assert found.named == [] and friction_of_the_day._SAID not in found.reasons
    (said,) = [reason for reason in found.reasons if reason.endswith("nothing more was found")]
    parts = [float(part) for part in said.split("joint by joint, ")[1].split(" %")[0].split(", ")]
    # what the model leaves of a log that it knows, in parts of the baseline that is printed
    rmse = np.array(found.model.baseline["rmse"])
    np.testing.assert_allclose(parts, 100 * rmse / found.errors()["noise_floor"], atol=0.5)


def test_a_gain_is_told_by_itself_and_the_model_is_as_it_was_made(model: ReconstructedModel) -> None:
    found = diagnose(model, [run(9, 0.3, gain=1.1)], jobs=1)
    assert found.named == [("torque_gain", 2)] and found.reasons[0] == friction_of_the_day._SAID
    gain = found.outcome.added()[0].parameters["gain"]
    assert abs(float(np.asarray(gain.value)) - 1.1) < 3 * float(np.asarray(gain.std_error)) < 0.02
    assert [added.effect.name for added in found.model.effects] == ["torque_gain"]
    assert found.model.uncertainty["between_logs"] == model.uncertainty["between_logs"]


def test_dry_friction_is_told_where_drives_that_warm_up_differ_by_viscous_friction(
    model: ReconstructedModel,
) -> None:
    """Found beside the friction of the day, of which it is no part then."""
    found = diagnose(model, [run(10, 0.3, dry=0.8)], jobs=1)
    assert found.named == [("coulomb_friction", 2)]
    level = found.outcome.added()[0].parameters["level"]
    assert abs(float(np.asarray(level.value)) - 0.8) < 3 * float(np.asarray(level.std_error)) < 0.2
    # nor does what is left hold any of it
    assert (np.array(found.errors()["after"]) < 1.5 * found.evidence.scale).all()


def test_a_push_is_seen_that_friction_of_another_day_would_hide(model: ReconstructedModel) -> None:
    (event,) = diagnose(model, [run(9, 0.3, push=3.0)], jobs=1).contacts
    start, end = (float(np.asarray(event.added.parameters[key].value)) for key in ("start", "end"))
    assert event.added.effect.joint == 2 and abs(start - 12) < 0.3 and abs(end - 13) < 0.3


def test_what_was_found_is_no_part_of_the_friction_that_is_taken_off(model: ReconstructedModel) -> None:
    whole = evidence(model, run(10, 0.3, dry=0.8))
    known = AddedEffect(effect("coulomb_friction", 2), {"level": Estimate(0.8, 0.04, "N*m")})
    levels = []
    for beside in ([], [known]):
        found = of_the_day(whole, beside)
        assert found is not None and found[0].whitening is not None
        # which of the model's effects it is is known: it is no part of what a joint had
        assert [found[0].whitening.are(a) for a in found[0].model.effects] == [True] * len(found[1])
        assert not found[0].whitening.are(known)
        levels += [a.values["level"] for a in found[1] if a.effect.place == known.effect.place]
    assert 0.4 < levels[0] - levels[1] < 0.9  # robustly, and a part of it goes with the viscous coefficient


def test_a_search_beside_something_found_is_beside_the_friction_as_well(model: ReconstructedModel) -> None:
    found = of_the_day(evidence(model, run(7, 0.1)))
    assert found is not None
    load = AddedEffect(effect("torque_offset", 1), {"offset": Estimate(0.1, 0.01, "N*m")})
    seen = known_by(found[0], [load])
    assert seen.whitening is found[0].whitening and seen.model.effects[-1] is load


def test_a_joint_whose_residual_remembers_tells_less_of_its_friction(model: ReconstructedModel) -> None:
    whole = evidence(model, run(7, 0.1))
    joints = [{**one, "correlation_time": 0.5} for one in model.baseline["joints"] or [{}] * 3]
    slow = replace(whole, model=replace(model, baseline={**model.baseline, "joints": joints}))
    found = of_the_day(slow)
    assert found is not None and found[0].whitening is not None
    time = whole.samples.motion.time[whole.rows[:, 0]]
    assert found[0].whitening.memories[0] == pytest.approx(0.5 / np.median(np.diff(time)))


@pytest.mark.parametrize(("part", "asked"), [(0.6, True), (0.4, False)])
def test_friction_of_the_day_is_asked_for_from_half_of_the_baseline_on(
    part: float, asked: bool, model: ReconstructedModel
) -> None:
    alone = replace(model, uncertainty={**model.uncertainty, "between_logs": None})
    log = run(7, 0.1)
    bare, whole = evidence(alone, log), evidence(model, log)
    between = np.sqrt(whole.scale**2 - bare.scale**2)
    # of every joint that part of what the whole comes to
    times = (part / np.sqrt(1 - part**2) * bare.scale / between) ** 2
    less = [(x * np.array(T)).tolist() for x, T in zip(times, model.uncertainty["between_logs"], strict=True)]
    found = of_the_day(evidence(replace(model, uncertainty={**model.uncertainty, "between_logs": less}), log))
    assert (found is not None) is asked


def test_rows_are_whitened_by_the_covariance_of_a_mixed_model() -> None:
    rng, memory = np.random.default_rng(0), 3.0
    columns = rng.normal(size=(40, 2, 2)) * [5.0, 0.3]
    rows, scale = rng.random((40, 2)) < 0.7, np.array([0.5, 2.0])
    whitening = Whitening(columns, np.array([memory, 1.0]), np.zeros((40, 2)))
    U, part = whitening.of(rows, scale)[0]
    Z = columns[rows[:, 0], 0] / 0.5
    root = fractional_matrix_power(np.eye(len(Z)) + Z @ Z.T / memory, -0.5)
    np.testing.assert_allclose(np.eye(len(Z)) - (U * part) @ U.T, root, atol=1e-9)


def test_rows_have_what_was_taken_off_and_every_part_of_a_regression_is_freed(
    model: ReconstructedModel,
) -> None:
    whole = evidence(model, run(7, 0.1))
    found = of_the_day(whole)
    assert found is not None
    day = found[0]
    (U, part), j = day._random[0], 0
    own = day.stacking[2] == j
    free = np.eye(int(own.sum())) - (U * part) @ U.T
    y = (whole.residual([])[day.rows] / day.scale[day.stacking[2]])[own]
    np.testing.assert_allclose(day.stack(day.residual([]), []).y[own], free @ y, atol=1e-8)
    plain = replace(day, whitening=None)
    for name, joint in (("coulomb_friction", 1), ("payload", None)):
        kind = next(e for e in day.asked if e.name == name and e.joint == joint)
        X = plain.weighted(kind, 0.0)[own]
        np.testing.assert_allclose(day.weighted(kind, 0.0)[own], free @ X, atol=1e-8 * np.abs(X).max())
    errors = plain.stack(plain.residual([]), []).model_errors[own]
    np.testing.assert_allclose(day.stack(day.residual([]), []).model_errors[own], free @ errors, atol=1e-8)


def test_friction_of_the_day_is_predicted_as_far_as_rows_tell_it_and_a_burst_is_none() -> None:
    rng = np.random.default_rng(1)
    Z = rng.normal(size=(2000, 2))
    y = Z @ [1.5, -0.5] + rng.normal(size=2000)
    y[100:160] += 40.0 * np.sign(Z[100:160, 0])
    np.testing.assert_allclose(predicted(Z, y, np.ones(2), 1.0), [1.5, -0.5], atol=0.1)
    # of rows that all say the same there are few: drawn to none by as much as Student's t tells of them, 5/7 of a normal row
    drawn = np.array([1.5, -0.5]) / (1 + 7 / 5)
    np.testing.assert_allclose(predicted(Z, y, np.ones(2), 2000.0), drawn, atol=0.1)


def test_friction_that_logs_do_not_tell_or_that_is_small_is_no_matter(model: ReconstructedModel) -> None:
    log = run(7, 0.1)
    for known in ("assumed", "alike"):
        other = replace(model, uncertainty={**model.uncertainty, "between_logs_known": known})
        assert of_the_day(evidence(other, log)) is None
    small = [None if T is None else (1e-4 * np.array(T)).tolist() for T in model.uncertainty["between_logs"]]
    assert (
        of_the_day(evidence(replace(model, uncertainty={**model.uncertainty, "between_logs": small}), log))
        is None
    )


def told(laws: list[str], events: int = 0, verdict: str = "effects_found", unlisted: int = 0) -> Any:
    found = [SimpleNamespace(effect=SimpleNamespace(place=(name, None, None), name=name)) for name in laws]
    outcome = SimpleNamespace(found=found)
    return SimpleNamespace(
        verdict=verdict, laws=["a law"] * unlisted, outcome=outcome, contacts=["push"] * events
    )


@pytest.mark.parametrize(
    ("beside", "plain", "taken"),
    [
        (told(["payload", "coulomb_friction"]), told(["payload"]), True),
        (told(["elastic_cable"]), told(["coupling_spring"]), True),
        (told(["payload"]), told(["payload"]), True),
        (told(["payload"]), told(["payload", "viscous_friction"]), False),
        (told(["payload"]), told([]), True),
        (told(["carried_load"]), told(["payload"]), False),  # a body since 13 s, in three pieces
        (told(["carried_load", "torque_gain"]), told(["payload"]), True),
        (told([], 1), told([]), True),
        (told([], 2), told([], 1), False),
        (told(["payload"], 1), told(["payload"], 1), False),
        (told(["payload"]), told([], 7), True),
        (told([], 1), told(["payload"]), False),
        (told(["payload"], 1), told(["payload"]), True),
        (told(["payload"], verdict="no_effect"), told([]), False),
        (told(["payload"], unlisted=1), told([]), False),
    ],
)
def test_what_names_less_is_not_taken(beside: Any, plain: Any, taken: bool) -> None:
    assert says_more(beside, plain) is taken


@pytest.mark.parametrize("rubs", [False, True])
@pytest.mark.parametrize("more", [False, True])
def test_friction_is_taken_off_anew_beside_friction_that_was_found(
    rubs: bool, more: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    module, asked = import_module("armloop.diagnosis.diagnose"), list[Any]()
    added = [SimpleNamespace(effect=SimpleNamespace(rubs=rubs))]
    outcome = SimpleNamespace(added=lambda: added)

    def of_the_day(whole: Any, known: Any = ()) -> Any:
        asked.append(list(known))
        return f"day {len(asked)}", f"friction {len(asked)}"

    def verdict(whole: Any, logs: Any, progress: Any, jobs: Any) -> Any:
        return SimpleNamespace(of=whole, outcome=outcome), f"account of {whole}"

    monkeypatch.setattr(module, "preprocess", lambda logs, how: None)
    monkeypatch.setattr(module, "hypotheses", lambda arm: [])
    monkeypatch.setattr(module.Evidence, "of", lambda *_: "whole")
    monkeypatch.setattr(module, "of_the_day", of_the_day)
    monkeypatch.setattr(module, "_verdict", verdict)
    monkeypatch.setattr(module, "says_more", lambda found, other: more and other.of == "whole")
    monkeypatch.setattr(module, "of_that_day", lambda model, found, friction: (found.of, friction))
    monkeypatch.setattr(module, "of_no_other_day", lambda found, whole, day: found)
    monkeypatch.setattr(module, "with_growth", lambda model, found: found)
    model: Any = SimpleNamespace(conditioning=None, arm=None)
    found, account = module._judged(model, [], print, 1)
    assert asked == ([[], added] if rubs else [[]]) and account == "account of whole"
    last = len(asked)
    assert (found == (f"day {last}", f"friction {last}")) if more else found.of == "whole"
