"""A record whose torque is out of step with its motion at all joints alike is moved into step; nothing else is."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.signal import bilinear, lfilter
from synthetic import COULOMB, VISCOUS, fourier_motion, friction, measured, rigid_torque, three_axis

from armloop.data.log import MotionLog
from armloop.data.signals import FELT, Conditioning, preprocess
from armloop.diagnosis import diagnose
from armloop.identification.reconstruction import Options, Reconstruction, reconstruct
from armloop.identification.reconstruction import torque_lag as torque_lags
from armloop.identification.reconstruction.torque_lag import Beside, TorqueLag, torque_lag
from armloop.laws.friction import FrictionTerm
from armloop.laws.hysteresis import stop_operator
from armloop.model import load_model

DEAD = 0.008


def recorded(seed: int, dead: float | np.ndarray, seconds: float = 30.0) -> MotionLog:
    """A run whose torque is recorded so many seconds late, one number or one a joint."""
    motion = fourier_motion(seconds, 250.0, seed)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)
    late = [
        np.interp(motion.time - d, motion.time, x) for d, x in zip(np.resize(dead, 3), tau.T, strict=True)
    ]
    return measured(motion, np.column_stack(late), seed, name=f"run {seed}")


def found(dead: float | np.ndarray, seeds: tuple[int, ...] = (1, 2)) -> TorqueLag:
    logs = [recorded(seed, dead) for seed in seeds]
    return torque_lag(logs, three_axis(), Conditioning(8.5), [np.zeros((0, 2))] * len(logs), 2.0)


@cache
def model_of(dead: float) -> Reconstruction:
    return reconstruct([recorded(seed, dead) for seed in (1, 2, 3)], three_axis(), library="rigid-body")


@pytest.mark.parametrize("dead", [DEAD, -DEAD, 0.02])
def test_a_lag_of_all_joints_is_found(dead: float) -> None:
    late = found(dead)
    # a tenth of the lag: an eighth of a sample period
    assert late.seconds == pytest.approx(dead, abs=max(4 * late.std_error, 0.1 * DEAD))
    assert late.joints == pytest.approx(dead, abs=0.25 * DEAD)


@pytest.mark.parametrize("dead", [0.0, 0.0005, np.array([0.0, 0.02, 0.0]), np.array([0.01, -0.01, 0.005])])
def test_what_is_in_step_or_of_a_joint_alone_is_left(dead: float | np.ndarray) -> None:
    late = found(dead)
    assert late.seconds == 0.0 and late.notes() == []


@pytest.mark.parametrize(
    ("below", "error", "taken"),
    [
        (DEAD, 1e-4, DEAD),
        (0.52 * DEAD, 1e-4, 0.52 * DEAD),  # below half the corner an encoder's noise hides less of it
        (0.48 * DEAD, 1e-4, 0.0),  # what is half as large below half the corner is no lag
        (-DEAD, 1e-4, 0.0),
        (0.0, 0.51 * DEAD, DEAD),  # two standard errors
        (0.0, 0.49 * DEAD, 0.0),
        (0.9 * DEAD, 0.04 * DEAD, 0.9 * DEAD),  # two of the difference's
        (0.9 * DEAD, 0.06 * DEAD, DEAD),
    ],
)
def test_a_lag_is_the_same_at_all_frequencies(
    below: float, error: float, taken: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    def own(logs: Any, arm: Any, how: Conditioning, *_: Any) -> TorqueLag:
        whole = how.cutoff_hz == 8.5
        assert whole or how.cutoff_hz == 4.25
        return TorqueLag(DEAD if whole else below, 1e-5 if whole else error, np.zeros(3), 9.0)

    monkeypatch.setattr("armloop.identification.reconstruction.torque_lag._found", own)
    assert found(DEAD).seconds == taken


@pytest.mark.parametrize(
    ("odds", "below", "beside", "taken"),
    [
        (1.5, 9.0, None, 0.0),
        (1.5, 9.0, Beside(), 0.9 * DEAD),
        (9.0, 1.5, Beside(), 0.9 * DEAD),
        (1.5, 1.5, Beside(), 0.0),
    ],
)
def test_a_lag_that_was_taken_is_given_up_where_neither_corner_shows_it(
    odds: float, below: float, beside: Beside | None, taken: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    def own(logs: Any, arm: Any, how: Conditioning, *_: Any) -> TorqueLag:
        whole = how.cutoff_hz == 8.5
        return TorqueLag(DEAD if whole else 0.9 * DEAD, 1e-3, np.zeros(3), odds if whole else below)

    monkeypatch.setattr(torque_lags, "_found", own)
    given = [recorded(1, 0.0)], three_axis(), Conditioning(8.5), [np.zeros((0, 2))], 2.0
    assert torque_lag(*given, beside).seconds == taken


@pytest.mark.parametrize(("below", "taken"), [(0.0012, 0.0012), (0.0011, 0.0)])
def test_what_is_taken_of_two_corners_is_felt(below: float, taken: float) -> None:
    """A hundredth of a period of 8.5 Hz is 1.18 ms."""
    found, slow = (TorqueLag(seconds, 1e-5, np.zeros(3), 9.0) for seconds in (0.0013, below))
    assert torque_lags._agreed(found, slow, 8.5).seconds == taken


@pytest.mark.parametrize("dead", [-0.002, 0.002])
def test_a_late_speed_makes_no_lag_of_the_torque_below_half_the_corner(dead: float) -> None:
    """The speed's 2.2 ms are felt below 8.5 Hz, and just not below half of that."""
    late = []
    for seed in (1, 2):
        log = recorded(seed, dead)
        v = np.column_stack([np.interp(log.time - 0.0022, log.time, x) for x in log.v.T])
        late.append(replace(log, v=v))
    assert late[0].velocity_lag == pytest.approx(0.0022, abs=1e-4)
    assert 4.25 * late[0].velocity_lag < FELT < 8.5 * late[0].velocity_lag
    intervals = [np.zeros((0, 2))] * 2
    for corner in (8.5, 4.25):
        own = torque_lags._found(late, three_axis(), Conditioning(corner), intervals, 2.0, 8.5, Beside())
        assert own.seconds == pytest.approx(dead, abs=3e-4)


def test_of_fast_logs_as_much_motion_is_looked_at_as_of_slow_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of samples that the filter takes out anyway, a log at 1 kHz has more, and tells no more."""
    seen: list[float] = []

    def own(logs: Any, *_: Any) -> TorqueLag:
        seen.append(sum(float(np.ptp(log.time)) for log in logs))
        return TorqueLag(0.0, 1.0, np.zeros(3))

    monkeypatch.setattr(torque_lags, "_found", own)
    for rate in (250.0, 1000.0):
        time = np.arange(0, 100, 1 / rate)
        x = np.zeros((len(time), 3))
        logs = [MotionLog(time, x, x, x)] * 2
        torque_lag(logs, three_axis(), Conditioning(8.5), [np.zeros((0, 2))] * 2, 2.0)
    assert seen == pytest.approx([200.0, 200.0], rel=1e-3)


def test_both_corners_see_the_same_speed(monkeypatch: pytest.MonkeyPatch) -> None:
    corners: list[tuple[float, ...]] = []

    def own(
        logs: Any, arm: Any, how: Conditioning, aside: Any, seconds: float, felt_hz: float, beside: Any
    ) -> TorqueLag:
        corners.append((how.cutoff_hz, felt_hz, how.smear))
        return TorqueLag(0.01, 1e-4, np.full(3, 0.01), 9.0)

    monkeypatch.setattr(torque_lags, "_found", own)
    found = torque_lag([recorded(1, DEAD)], three_axis(), Conditioning(8.0), [np.zeros((0, 2))], 2.0)
    # what a joint that sticks shows before it moves is kept out twice as far below half the corner
    assert found.seconds == 0.01 and corners == [(8.0, 8.0, 0.5), (4.0, 8.0, 1.0)]


def test_held_out_blocks_take_no_part() -> None:
    logs, how = [recorded(seed, DEAD) for seed in (1, 2)], Conditioning(8.5)
    half = np.array([[10.0, 20.0]])
    spoilt = []
    for log in logs:
        tau = log.tau.copy()
        tau[(log.time > 11.0) & (log.time < 19.0)] *= -1.0
        spoilt.append(replace(log, tau=tau))
    clean, other = (torque_lag(some, three_axis(), how, [half] * 2, 2.0) for some in (logs, spoilt))
    assert other.seconds == pytest.approx(clean.seconds, rel=1e-6) and clean.seconds > 0


def test_the_model_is_of_the_arm_and_says_that_the_record_is_late(tmp_path: Path) -> None:
    result = model_of(DEAD)
    how = result.model.conditioning
    assert how.torque_lag == pytest.approx(DEAD, abs=0.1 * DEAD)
    assert any(f"recorded {1e3 * how.torque_lag:.2g} ±" in note and "later" in note for note in result.notes)
    assert result.model.history["torque_lag"]["seconds"] == how.torque_lag
    # what is left is less than a tenth
    assert abs(result.model.uncertainty["torque_lag"]) < 0.1 * DEAD
    for j, line in enumerate(result.model.uncertainty["stribeck"]):
        for name, true in (("coulomb", COULOMB), ("viscous", VISCOUS)):
            if name in line:
                assert line[name]["value"] == pytest.approx(true[j], abs=4 * line[name]["std_error"])
    assert result.model.uncertainty["friction_line"][0]["viscous"]["std_error"] < 0.02 * VISCOUS[0]
    result.model.save(tmp_path / "model.json")
    assert json.loads((tmp_path / "model.json").read_text())["conditioning"]["torque_lag"] == how.torque_lag
    assert load_model(tmp_path / "model.json").conditioning == how


def test_a_lag_that_is_stated_is_taken_as_it_is() -> None:
    """Of one log of a joint that hardly tells it, as of one of which nobody knows whether it is in step."""
    stated = reconstruct(
        [recorded(1, 0.02)],
        three_axis(),
        library="rigid-body",
        options=Options(parts=False, torque_lag=0.02),
    )
    assert stated.model.conditioning.torque_lag == 0.02
    assert "the torque is recorded 20 ms later than the motion, as stated: it is moved back" in " ".join(
        stated.notes
    )
    none = reconstruct(
        [recorded(1, 0.02)],
        three_axis(),
        library="rigid-body",
        options=Options(parts=False, torque_lag=0.0, standard_errors=False),
    )
    assert none.model.conditioning.torque_lag == 0.0 and not any("recorded" in note for note in none.notes)
    left = [max(made.held_out.moving["rmse"]) for made in (stated, none)]
    assert left[0] < 0.5 * left[1]


def test_a_late_record_asks_for_no_lower_corner() -> None:
    """As recorded, 50 ms of delay leave so much that a filter which takes most of the motion away leaves less."""
    late = [recorded(seed, 0.05) for seed in (1, 2)]
    options = Options(parts=False, standard_errors=False)
    made = reconstruct(late, three_axis(), library="rigid-body", options=options)
    conditioned = made.model.conditioning
    assert conditioned.torque_lag == pytest.approx(0.05, abs=0.1 * DEAD)
    assert conditioned.cutoff_hz == model_of(DEAD).model.conditioning.cutoff_hz


def test_the_recorders_own_lag_is_no_change_and_another_is() -> None:
    model = model_of(DEAD).model
    assert diagnose(model, [recorded(11, DEAD, 20.0)], jobs=1).named == []
    other = diagnose(model, [recorded(12, 3 * DEAD, 20.0)], jobs=1)
    assert other.named == [("time_delay", None)]
    (added,) = other.outcome.added()
    seconds = added.parameters["seconds"]
    assert seconds.value == pytest.approx(3 * DEAD - model.conditioning.torque_lag, abs=0.1 * DEAD)


@pytest.mark.filterwarnings("error")
def test_lags_without_error_have_a_mean() -> None:
    assert torque_lags._mean(np.full(3, 2e-3), np.zeros(3))[0] == pytest.approx(2e-3, rel=1e-3)


@pytest.mark.parametrize(
    ("lags", "errors", "mean"),
    [
        # two joints that agree, as no law that the regression lacks makes them
        ([17.4, 17.4], [0.5, 2.8], 17.4),
        # seven, of which the last wrist joint lacks much and tells nothing
        ([12.3, 17.5, 16.5, 14.8, -1.6, 12.6, -31.3], [0.9, 0.4, 1.1, 2.9, 4.3, 3.1, 3.2], 14.0),
        ([9.6, 6.1, 15.0, 9.2, 21.9, 2.1], [0.5, 2.2, 3.8, 0.8, 2.8, 2.4], 9.2),
        # what differs from joint to joint, lies near none, or is of one joint is none
        ([-2.5, -1.0, -9.9, -7.7], [1.0, 0.3, 1.1, 0.8], None),
        ([0.7, -4.7, -3.5, -4.8, -7.4, -1.3, -19.4], [0.4, 0.8, 0.5, 1.0, 1.5, 1.4, 2.3], None),
        ([0.4, 0.5, 0.3], [0.1, 0.1, 0.1], None),
        ([0.1, 20.0, -0.1], [0.2, 0.2, 0.2], None),
        ([20.0], [6.0], None),
    ],
)
def test_a_lag_is_one_that_most_joints_share(
    lags: list[float], errors: list[float], mean: float | None
) -> None:
    found, error, odds = torque_lags._mean(1e-3 * np.array(lags), 1e-3 * np.array(errors))
    assert TorqueLag(found, error, np.zeros(1), odds).clear == (mean is not None)
    if mean is not None:
        assert 1e3 * found == pytest.approx(mean, abs=0.5) and 1e3 * error < 2.5


def test_torque_is_moved_into_step_with_the_motion() -> None:
    late, none = recorded(5, 0.02), recorded(5, 0.0)
    moved = preprocess([late], Conditioning(8.5, torque_lag=0.02))
    assert moved.tau == pytest.approx(preprocess([none], Conditioning(8.5)).tau, abs=0.1)
    assert np.abs(preprocess([late], Conditioning(8.5)).tau - moved.tau).max() > 0.5
    with pytest.raises(ValueError, match="torque_lag"):
        Conditioning(torque_lag=np.nan)


def test_a_stuck_torque_is_left_out_where_it_was_measured() -> None:
    log = recorded(6, 0.0)
    tau = log.tau.copy()
    tau[2000:2100, 1] = tau[2000, 1]
    stuck = replace(log, tau=tau)
    plain, moved = (preprocess([stuck], Conditioning(8.5, torque_lag=lag)).moving[:, 1] for lag in (0.0, 0.2))
    time = preprocess([stuck], Conditioning(8.5)).motion.time
    centres = [float(np.mean(time[~own & (np.abs(time - 8.0) < 0.5)])) for own in (plain, moved)]
    assert centres[0] - centres[1] == pytest.approx(0.2, abs=0.02)


def shaken(seed: int, dead: float, step: float = 5e-4, stiff: float = 40.0) -> MotionLog:
    """A run whose stiff controller answers to a coarse encoder: the noise moves the arm by the complementary sensitivity."""
    motion = fourier_motion(40.0, 250.0, seed)
    noise = step * np.round(motion.q / step) - motion.q
    loop = bilinear([2 * stiff, stiff**2], [1.0, 2 * stiff, stiff**2], fs=250.0)
    q = motion.q - lfilter(*loop, noise, axis=0)
    v = np.gradient(q, motion.time, axis=0)
    vdot = np.gradient(v, motion.time, axis=0)
    tau = rigid_torque(three_axis(), q, v, vdot) + friction(v)
    late = np.column_stack([np.interp(motion.time - dead, motion.time, x) for x in tau.T])
    return replace(
        measured(motion, late, seed, name=f"run {seed}"),
        q=q + noise,
        v=np.gradient(q + noise, motion.time, axis=0),
    )


@pytest.mark.parametrize("dead", [DEAD, 0.0])
def test_noise_that_the_controller_answers_to_is_no_lag_and_hides_none(dead: float) -> None:
    logs = [shaken(seed, dead) for seed in (1, 2, 3)]
    late = torque_lag(logs, three_axis(), Conditioning(8.5), [np.zeros((0, 2))] * len(logs), 2.0)
    assert late.seconds == pytest.approx(dead, abs=3 * late.std_error if dead else 0.0)
    assert late.std_error < 0.25 * DEAD


def rippling(seed: int, order: float, size: float = 0.5, stiff: float = 30.0) -> MotionLog:
    """A run whose torque ripples, and whose arm gives way to that by the compliance of its control."""
    motion = fourier_motion(40.0, 250.0, seed)
    ripple = size * np.sin(order * motion.q + 0.8)
    yields = bilinear([1.0], [1.0, 2 * stiff, stiff**2], fs=250.0)
    q = motion.q - 5 * lfilter(*yields, ripple, axis=0)
    v = np.gradient(q, motion.time, axis=0)
    vdot = np.gradient(v, motion.time, axis=0)
    tau = rigid_torque(three_axis(), q, v, vdot) + friction(v) + ripple
    return replace(measured(motion, tau, seed, name=f"run {seed}"), q=q, v=v)


def test_ripples_that_the_controller_answers_to_are_no_lag_beside_them() -> None:
    logs = [rippling(seed, 60.0) for seed in (1, 2, 3)]
    given = logs, three_axis(), Conditioning(8.5), [np.zeros((0, 2))] * len(logs), 2.0
    assert np.abs(torque_lag(*given).joints).max() > 0.03
    beside = torque_lag(*given, Beside(dict.fromkeys((1, 2, 3), (60.0,))))
    assert beside.seconds == 0.0 and np.abs(beside.joints).max() < 5e-4


def bristly(seed: int) -> MotionLog:
    """A run whose friction, three times all else, sets in over bristles of 0.3 mrad."""
    motion = fourier_motion(40.0, 250.0, seed, size=0.3)
    stops = np.stack([stop_operator(q, 3e-4, motion.starts) for q in motion.q.T], axis=1)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot)
    tau = tau + 3 * stops * np.sqrt(np.mean(tau**2, axis=0)) + VISCOUS * motion.v
    return measured(motion, tau, seed, name=f"run {seed}")


def test_friction_of_which_no_usual_law_has_the_memory_is_no_lag_beside_it() -> None:
    logs = [bristly(seed) for seed in (1, 2, 3)]
    given = logs, three_axis(), Conditioning(8.5), [np.zeros((0, 2))] * len(logs), 2.0
    alone = torque_lag(*given)
    assert alone.joints.min() > 0.02 and alone.clear
    own = [[FrictionTerm("viscous"), FrictionTerm("hysteresis", parameter=3e-4)]] * 3
    assert torque_lag(*given, Beside(friction=own)).seconds == 0.0


def test_what_is_known_of_friction_is_regressed_once_where_it_acts_as_joints_turn() -> None:
    known = ["viscous", "hysteresis", "smooth_sign", "load_hysteresis"]
    own = [FrictionTerm(kind, parameter=p) for kind, p in zip(known, (0.0, 3e-4, 0.01, 1e-3), strict=True)]
    plain, more = Beside().terms(2), Beside(friction=[own, []]).terms(2)
    assert plain[0] == plain[1] == more[1] and more[0] == [*plain[0], own[1]]
