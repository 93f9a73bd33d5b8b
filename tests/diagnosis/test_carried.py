"""A load that is picked up and put down: its mass, where its centre is, and when; and what is none."""

from __future__ import annotations

import sys
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rubbing_arm import model_with_baseline, motion_of, torque
from synthetic import measured, three_axis

from armloop.data.log import MotionLog
from armloop.data.motion import Motion
from armloop.data.signals import preprocess
from armloop.diagnosis import Diagnosis, diagnose, load_direction
from armloop.diagnosis import carried as carrying
from armloop.diagnosis.account import Account, best_account
from armloop.diagnosis.carried import account_with_load, find_carried
from armloop.diagnosis.contacts import without
from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.load_direction import pulls_down
from armloop.diagnosis.next_run import next_run
from armloop.laws.effects import Context, effect, hypotheses
from armloop.laws.effects.carried_load import CarriedLoad
from armloop.laws.effects.onset import Onset
from armloop.laws.effects.payload import Payload
from armloop.laws.effects.spells import Interval
from armloop.model import ReconstructedModel
from armloop.reports.findings import findings
from armloop.robot.kinematics import tool_jacobian
from armloop.util.progress import silent

LOAD = {"mass": 0.4, "com": [0.03, -0.02, 0.05], "own_inertia": 0.0}
TIMES = [(2.5, 7.0), (11.0, 16.0), (21.0, 24.5)]


def run(
    seed: int, loads: list[tuple[float, float]], seconds: float = 30.0, load: dict[str, Any] | None = None
) -> MotionLog:
    """A measured run in which the load is carried in intervals."""
    motion = motion_of(seed, seconds)
    tau = torque(motion)
    extra = Payload().torque(Context(three_axis(), motion), load or LOAD)
    for first, last in loads:
        inside = (motion.time >= first) & (motion.time < last)
        tau[inside] += extra[inside]
    return replace(measured(motion, tau, seed, 0.01), name=f"run{seed}")


def push_of(motion: Motion, pushed: dict[str, Any]) -> np.ndarray:
    """(N, n) torque of a force on the centre of the load, in the base frame."""
    arm = three_axis().with_tool_at(LOAD["com"])
    return effect("external_contact", None).torque(Context(arm, motion), pushed)


@pytest.fixture(scope="module")
def model() -> ReconstructedModel:
    return model_with_baseline()


Accounts = tuple[Evidence, Account, Account | None]


@pytest.fixture(scope="module")
def whole(model: ReconstructedModel) -> tuple[Diagnosis, Accounts]:
    """The diagnosis of a run in which the load comes and goes, and what it weighed: see below."""
    module, weighed = sys.modules[diagnose.__module__], []

    def best(whole: Evidence, *given: Any) -> Account:
        weighed[:] = [whole, best_account(whole, *given)]
        return weighed[1]

    def loaded(*given: Any) -> Account | None:
        weighed.append(account_with_load(*given))
        return weighed[2]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "best_account", best)
        patch.setattr(module, "account_with_load", loaded)
        found = diagnose(model, [run(1, TIMES)], jobs=1)
    return found, tuple(weighed)


@pytest.fixture(scope="module")
def carried(whole: tuple[Diagnosis, Accounts]) -> Diagnosis:
    """What is found of that run."""
    return whole[0]


def evidence(model: ReconstructedModel, *logs: MotionLog) -> Evidence:
    return Evidence.of(model, preprocess(list(logs), model.conditioning), hypotheses(model.arm))


@pytest.fixture(scope="module")
def accounts(whole: tuple[Diagnosis, Accounts]) -> Accounts:
    """The evidence of that run, the best account of it without a load, and with one."""
    return whole[1]


@pytest.mark.parametrize("seed", [1, *(pytest.param(k, marks=pytest.mark.long) for k in (2, 3))])
def test_a_load_carried_at_times_is_found_with_its_mass_and_when(
    model: ReconstructedModel, carried: Diagnosis, seed: int
) -> None:
    found = carried if seed == 1 else diagnose(model, [run(seed, TIMES)], jobs=1)
    assert found.verdict == "effects_found" and found.named == [("carried_load", None)]
    (entry,) = found.to_dict()["effects"]
    p = entry["parameters"]
    assert entry["when"] == "event" and entry["share"] > 0.95 and entry["alternatives"] == []
    assert abs(p["mass"]["value"] - 0.4) < max(4 * p["mass"]["std_error"], 0.01)
    com = np.abs(np.array(p["com"]["value"]) - LOAD["com"])
    assert (com < np.maximum(4 * np.array(p["com"]["std_error"]), 0.005)).all()
    np.testing.assert_allclose(
        np.column_stack([p["picked_up"]["value"], p["put_down"]["value"]]), TIMES, atol=0.1
    )
    error = found.errors()
    assert max(np.divide(error["after"], error["noise_floor"])) < 2
    assert max(np.divide(error["before"], error["noise_floor"])) > 3
    (words,) = findings(found)
    assert "kg on the last link" in words and "carried from 2.5 to 7.0, 11.0 to 16.0, 21.0 to 24.5 s" in words


@pytest.mark.parametrize("seed", [5, *(pytest.param(k, marks=pytest.mark.long) for k in (6, 7))])
def test_what_was_gripped_and_let_go_once_is_a_load_and_no_push(model: ReconstructedModel, seed: int) -> None:
    """A push, too, comes and goes; the force of a load points straight down."""
    ((first, last),) = times = [(8.0, 14.0)]
    found = diagnose(model, [run(seed, times)], jobs=1)
    assert found.named == [("carried_load", None)] and found.contacts == []
    (added,) = found.outcome.added()
    ends = np.hstack([added.parameters[key].value for key in ("picked_up", "put_down")])
    np.testing.assert_allclose(ends, (first, last), atol=0.1)
    assert abs(float(np.asarray(added.parameters["mass"].value)) - 0.4) < 0.01
    log = run(seed, [])
    push = push_of(motion_of(seed, 30.0), {"start": first, "end": last, "force": [1.6, -1.2, -2.0]})
    found = diagnose(model, [replace(log, tau=log.tau + push)], jobs=1)
    assert {name for name, _ in found.named} <= {"external_contact", "external_torque"} and found.contacts


@pytest.mark.parametrize(("sideways", "weight"), [(0.0, True), (0.08, True), (0.12, False), (0.5, False)])
def test_a_weight_pulls_straight_down(model: ReconstructedModel, sideways: float, weight: bool) -> None:
    """As far as the direction of gravity is known; along the plane that the joints do not feel nobody knows."""
    given = evidence(model, run(3, [(8.0, 14.0)]))
    load, _ = find_carried(given) or (None, None)
    assert load is not None
    there = load.carried(given.samples.motion)
    time = given.samples.motion.time
    assert there[(time > 8.1) & (time < 13.9)].all() and not there[(time < 7.9) | (time > 14.1)].any()
    force = sideways * 9.81 * LOAD["mass"] * np.array([0.6, 0.8, 0.0])
    pushed = {"start": 8.0, "end": 14.0, "force": force}
    tilted = replace(given.samples, tau=given.samples.tau + push_of(given.samples.motion, pushed))
    known = carrying.Known.of(replace(given, samples=tilted), [load], [carrying._shape(load)])
    assert pulls_down(known, there) is weight


def test_what_is_not_known_to_be_a_push_may_be_a_weight(
    model: ReconstructedModel, accounts: Accounts, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A horizontal force must be real; it is asked of the load's centre; and what does not hang is no load."""
    whole, account, _ = accounts
    load, _ = find_carried(without(whole, [])) or (None, None)
    assert load is not None
    known = carrying.Known.of(without(whole, []), [load], [carrying._shape(load)])
    there, asked = load.carried(whole.samples.motion), list[np.ndarray]()

    def jacobian(arm: Any, q: np.ndarray) -> np.ndarray:
        asked.append(arm.X_tool[:3, 3])
        return tool_jacobian(arm, q)

    monkeypatch.setattr(load_direction, "tool_jacobian", jacobian)
    monkeypatch.setattr(load_direction, "_UPRIGHT", 0.0)
    for errors, weight in ((2.9, True), (3.1, False)):
        monkeypatch.setattr(load_direction, "deviate", lambda *_, errors=errors: errors)
        assert pulls_down(known, there) is weight
    X_tool = three_axis().X_tool
    np.testing.assert_allclose(asked[0], X_tool[:3, :3] @ LOAD["com"] + X_tool[:3, 3], atol=0.01)
    monkeypatch.setattr(carrying, "pulls_down", lambda *_: False)
    assert account_with_load(whole, account, silent, 1) is None


def test_the_augmented_model_knows_it_in_that_log_alone_and_no_controller_supplies_it(
    model: ReconstructedModel, carried: Diagnosis
) -> None:
    log, other = run(1, TIMES), run(2, [])
    augmented = carried.model
    motions = [preprocess([one], model.conditioning).motion for one in (log, other)]
    added = [augmented.predict(motion) - model.predict(motion) for motion in motions]
    inside = np.logical_or.reduce(
        [(motions[0].time > a + 0.1) & (motions[0].time < b - 0.1) for a, b in TIMES]
    )
    assert np.abs(added[0][inside]).max() > 0.5 and not added[1].any()
    q, v, vdot = motions[0].q[200], motions[0].v[200], motions[0].vdot[200]
    np.testing.assert_array_equal(augmented.feedforward(q, v, vdot), model.feedforward(q, v, vdot))


def test_a_tool_that_was_taken_off_is_a_body_less(model: ReconstructedModel) -> None:
    motion = motion_of(4, 30.0)
    tau = torque(motion) - Payload().torque(Context(three_axis(), motion), LOAD)
    found = diagnose(model, [measured(motion, tau, 4, 0.01)], jobs=1)
    assert found.named == [("payload", None)] and found.unlisted is None
    (added,) = found.outcome.added()
    mass, com = (np.asarray(added.parameters[key].value) for key in ("mass", "com"))
    assert abs(float(mass) + 0.4) < 0.005
    np.testing.assert_allclose(com, LOAD["com"], atol=0.005)
    assert "no longer a body that the model has, of" in added.effect.sentence(added.parameters)
    # the augmented model is that of the bare arm
    left = found.model.predict(motion) - tau
    assert (np.sqrt((left[50:-50] ** 2).mean(axis=0)) < 0.1 * np.sqrt((tau**2).mean(axis=0))).all()


def test_no_next_run_would_tell_more_of_what_was_carried(carried: Diagnosis) -> None:
    assert next_run(carried) is None


@pytest.mark.long
@pytest.mark.parametrize(("seed", "level"), [(4, 0.5), (6, 1.5)])
def test_what_is_beside_a_load_is_found_too(model: ReconstructedModel, seed: int, level: float) -> None:
    """The load that is found first has soaked up some of it, and seems to be there at other times."""
    log, motion = run(seed, TIMES), motion_of(seed, 30.0)
    more = torque(motion, level) - torque(motion)
    found = diagnose(model, [replace(log, tau=log.tau + more)], jobs=1)
    # the stronger of the two first
    assert sorted(found.named) == [("carried_load", None), ("coulomb_friction", 2)] and found.unlisted is None
    given = {added.effect.name: added.parameters for added in found.outcome.added()}
    load, friction = given["carried_load"], given["coulomb_friction"]
    assert abs(float(np.asarray(load["mass"].value)) - 0.4) < 0.01
    assert abs(float(np.asarray(friction["level"].value)) - level) < 0.02
    times = np.column_stack([load["picked_up"].value, load["put_down"].value])
    np.testing.assert_allclose(times, TIMES, atol=0.1)


@pytest.mark.parametrize(
    ("left", "law", "events", "named", "asked"),
    [
        (3.9, None, [], [], False),
        (4.1, None, [], [], True),
        (0.0, "a law", [], [], True),
        (0.0, None, [], [], False),
        (0.0, None, [None], [], True),
        (0.0, None, [2], [], True),
        (0.0, None, [], ["coulomb_friction"], False),
        (0.0, None, [], ["coulomb_friction", "payload"], True),
    ],
)
def test_it_is_asked_where_much_is_left_a_load_is_named_or_something_came_and_went(
    left: float, law: str | None, events: list[int | None], named: list[str], asked: bool
) -> None:
    score = SimpleNamespace(energy=np.array([0.0, 10 * left]), rows=np.array([10, 10]))
    found = [SimpleNamespace(effect=effect(name, None if name == "payload" else 1)) for name in named]
    account: Any = SimpleNamespace(
        unlisted=law,
        outcome=SimpleNamespace(found=found, after=SimpleNamespace(score=score)),
        contacts=[SimpleNamespace(added=SimpleNamespace(effect=SimpleNamespace(joint=j))) for j in events],
    )
    assert carrying._is_asked(account) is asked


def test_a_load_of_moments_alone_is_none(model: ReconstructedModel, monkeypatch: pytest.MonkeyPatch) -> None:
    given = evidence(model, run(1, TIMES))
    assert find_carried(given) is not None
    monkeypatch.setattr("armloop.diagnosis.two_states._SHORTEST", 9.0)
    assert find_carried(given) is None


@pytest.mark.parametrize("seed", [*(pytest.param(k, marks=pytest.mark.long) for k in (1, 2)), 3])
def test_a_load_that_is_there_all_the_time_or_never_is_not_carried(
    model: ReconstructedModel, seed: int
) -> None:
    assert diagnose(model, [run(seed, [(0.0, 99.0)])], jobs=1).named == [("payload", None)]
    assert diagnose(model, [run(seed, [])], jobs=1).verdict == "no_effect"
    assert find_carried(evidence(model, run(seed, []))) is None
    assert find_carried(evidence(model, run(seed, [(0.0, 99.0)]))) is None


def test_a_load_in_one_of_two_logs_is_carried_in_that(model: ReconstructedModel) -> None:
    found = find_carried(evidence(model, run(5, [], 20.0), run(6, [(0.0, 99.0)], 20.0)))
    assert found is not None
    load, unknown = found
    (interval,) = load.intervals
    assert interval.end - interval.start > 19.5 and not unknown.any()
    samples = preprocess([run(5, [], 20.0), run(6, [], 20.0)], model.conditioning)
    columns = load.columns(Context(model.arm, samples.motion), 0.0)
    second = samples.motion.starts[1]
    assert not columns[:second].any() and columns[second:].any(axis=(1, 2)).all()


def test_parameters_are_as_many_and_in_order() -> None:
    kind = type(effect("carried_load", None))
    good = {"picked_up": [1.0, 4.0], "put_down": [2.0, 5.0]}
    assert kind.fault(good) == ""
    for bad in ({"put_down": [2.0]}, {"put_down": [2.0, 4.0]}, {"picked_up": [], "put_down": []}):
        assert "put_down must come after" in kind.fault({**good, **bad})


def test_a_start_of_too_few_samples_explains_nothing(
    model: ReconstructedModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    judged = evidence(model, run(1, TIMES))

    def few(y: np.ndarray, *_: Any) -> list[np.ndarray]:
        return [np.arange(len(y)) < 3]

    monkeypatch.setattr("armloop.diagnosis.two_states._starts", few)
    assert find_carried(judged) is None


def test_a_load_at_the_cost_of_other_joints_is_none(
    accounts: Accounts, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However much it removes of all joints together."""
    whole, account, with_load = accounts
    asked: list[Any] = []

    def leaves_more(loaded: Any, plain: Any, least: np.ndarray) -> bool:
        asked.append((loaded, plain, least))
        return True

    assert with_load is not None
    monkeypatch.setattr("armloop.diagnosis.beside.leaves_more", leaves_more)
    assert account_with_load(whole, account, silent, 1) is None
    ((loaded, plain, least),) = asked
    np.testing.assert_array_equal(loaded.rows, plain.rows)
    assert loaded.error < plain.error / 4 and (least >= 0.4 * plain.rows).all()


def test_what_is_left_of_samples_that_a_load_leaves_out_speaks_for_none(
    accounts: Accounts, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A load must explain what is left elsewhere: then nothing is searched anew for one that came and went in these."""
    whole, account, _ = accounts
    found = find_carried(without(whole, []))
    assert found is not None
    monkeypatch.setattr(carrying, "find_carried", lambda _: found)
    searched: list[Any] = []

    def beside(*given: Any) -> Any:
        searched.append(given)
        raise InterruptedError

    monkeypatch.setattr(carrying, "account_beside", beside)
    with pytest.raises(InterruptedError):
        account_with_load(whole, account, silent, 1)
    load, unknown = found
    size = np.abs(account.remaining()).sum(axis=1)
    rest = np.broadcast_to((size > np.quantile(size, 0.5))[:, None], unknown.shape)
    monkeypatch.setattr(carrying, "find_carried", lambda _: (load, unknown | rest))
    assert account_with_load(whole, account, silent, 1) is None and len(searched) == 1


@pytest.mark.parametrize(
    ("before", "left", "most"), [(10.0, 5.0, True), (10.0, 5.1, False), (-10.0, -6.0, False)]
)
def test_of_what_is_no_more_than_the_baseline_a_load_explains_nothing(
    before: float, left: float, most: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(carrying, "_excess", lambda account, rows: before)
    nothing: Any = None
    assert carrying._explains_most(left, nothing, nothing) is most


def test_the_account_with_a_load_is_one_of_the_model_as_it_is(
    model: ReconstructedModel, accounts: Accounts
) -> None:
    """What remains of it is what the model leaves with the load once, not twice."""
    whole, _, found = accounts
    assert found is not None and found.whole.model is model
    assert [each.effect.name for each in found.outcome.found] == ["carried_load"]
    left = np.sqrt(np.mean((found.remaining() / whole.scale)[found.evidence.rows] ** 2))
    assert left < 1.5 < np.sqrt(np.mean((whole.residual([]) / whole.scale)[found.evidence.rows] ** 2)) / 2


@pytest.mark.parametrize(
    ("times", "word", "instant"),
    [
        ((12.0, 29.9), "since", 12.0),
        ((0.1, 12.0), "until", 12.0),
        ((5.0, 12.0), "", 0.0),
        ((0.1, 29.9), "", 0.0),
    ],
)
def test_a_load_that_nobody_saw_put_down_is_a_payload_since_then(
    times: tuple[float, float], word: str, instant: float
) -> None:
    """Nor picked up: it was there until it was put down."""
    log = run(1, [])
    motion = preprocess([log], model_with_baseline().conditioning).motion
    at = int(np.argmin(np.abs(motion.time - times[0])))
    load = CarriedLoad(intervals=(Interval(*times, tuple(motion.q[at].tolist())),), error=0.1)
    stated = carrying._stated(load, motion, [log])
    if not word:
        assert stated.effect is load
        return
    onset = stated.effect.onset
    assert stated.effect.name == "payload" and isinstance(onset, Onset)
    assert (onset.word, onset.time, onset.error, onset.log) == (word, instant, 0.1, "run1")
    then = int(np.argmin(np.abs(motion.time - instant)))
    assert onset.posture == tuple(motion.q[then].tolist())
    twice = CarriedLoad(intervals=(Interval(1.0, 2.0, load.intervals[0].posture), *load.intervals))
    assert carrying._stated(twice, motion, [log]).effect is twice


def test_a_load_that_is_kept_is_a_payload_since_it_was_picked_up(model: ReconstructedModel) -> None:
    found = diagnose(model, [run(8, [(12.0, 99.0)])], jobs=1)
    assert found.named == [("payload", None)]
    (entry,) = found.to_dict()["effects"]
    assert entry["since"]["value"] == pytest.approx(12.0, abs=0.2)
