"""What a sensor or a bus did not measure is replaced or left out, and what the arm did is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armloop.data import dropouts
from armloop.data.dropouts import repaired
from armloop.data.log import MotionLog
from armloop.data.recorded import Recorded
from armloop.data.signals import Conditioning, preprocess

RATE = 250.0


def a_log(seed: int = 0, noise: float = 0.01, seconds: float = 20.0) -> MotionLog:
    """Two joints in sines with friction that steps, noisy v and tau."""
    rng = np.random.default_rng(seed)
    time = np.arange(0, seconds, 1 / RATE)
    w = 2 * np.pi * np.array([0.3, 0.5])
    phase = np.multiply.outer(time, w)
    q, v = np.sin(phase), w * np.cos(phase)
    tau = 5 * np.sin(q) + 2 * np.sign(v) - w**2 * q
    return MotionLog(
        time, q, v + 0.01 * rng.normal(size=v.shape), tau + noise * rng.normal(size=tau.shape), name="run"
    )


def recorded(log: MotionLog) -> Recorded:
    return Recorded(log.time, log.q, log.v, log.tau, log.vdot, log.runs(), log.v_derived)


def said(log: MotionLog) -> list[str]:
    return [f"{found.columns} {found.text}" for found in dropouts.dropouts(recorded(log))]


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.2])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_what_an_arm_does_is_left_as_it_is(seed: int, noise: float) -> None:
    log = a_log(seed, noise)
    for one in (
        log,
        replace(log, tau=np.round(log.tau / 0.05) * 0.05),
        replace(log, tau=0.01 * np.round(log.tau)),
    ):
        fresh = repaired(recorded(one))
        assert fresh.q is one.q and fresh.v is one.v and fresh.tau is one.tau and fresh.lost is None
        assert said(one) == []


class TestSpikes:
    ROWS = (200, 1400, 3100)

    @pytest.mark.parametrize("width", [1, 2])
    def test_of_one_or_two_samples_are_replaced(self, width: int) -> None:
        log = a_log()
        tau, spiked = log.tau.copy(), [k + i for k in self.ROWS for i in range(width)]
        tau[spiked, 1] += 4.0
        worn = replace(log, tau=tau)
        fresh = repaired(recorded(worn))
        np.testing.assert_allclose(fresh.tau[spiked, 1], log.tau[spiked, 1], atol=0.3)
        others = np.delete(np.arange(log.samples), spiked)
        np.testing.assert_array_equal(fresh.tau[others], log.tau[others])
        assert (
            worn.tau is tau and (tau[spiked, 1] != fresh.tau[spiked, 1]).all()
        )  # what was given is not changed
        (words,) = said(worn)
        assert words.startswith(
            f"column tau2 has spikes of one or two samples, {3 * width} in all, of up to 4"
        )

    def test_one_is_replaced_without_a_word(self) -> None:
        log = a_log()
        tau = log.tau.copy()
        tau[700, 0] -= 3.0
        worn = replace(log, tau=tau)
        assert abs(repaired(recorded(worn)).tau[700, 0] - log.tau[700, 0]) < 0.3 and said(worn) == []

    @pytest.mark.parametrize("seed", [0, 1, 2])
    def test_rows_that_are_not_as_far_apart_as_others_have_none_but_those_that_are(self, seed: int) -> None:
        """Stamps of 3, 4 and 5 ms, true or not, of a joint that swings with hardly any noise."""
        rng = np.random.default_rng(seed)
        gaps = rng.choice([3, 4, 4, 4, 4, 4, 4, 4, 4, 5], 5000)
        gaps[[k + i for k in self.ROWS for i in (0, 1)]] = 5  # between two long ones a spike ends farther on
        time = 0.001 * np.cumsum(gaps)
        even = np.linspace(time[0], time[-1], 5000)
        for taken in (time, even):
            q = (np.sin(0.5 * taken) + 1e-6 * rng.normal(size=5000))[:, None]
            log = MotionLog(time, q, 0.5 * np.cos(0.5 * taken)[:, None], np.sin(3 * q), name="run")
            assert repaired(recorded(log)).q is log.q and said(log) == []
            spiked = log.q.copy()
            spiked[list(self.ROWS)] += 0.002
            fresh = repaired(recorded(replace(log, q=spiked)))
            rows = np.flatnonzero((fresh.q != spiked).any(axis=1)).tolist()
            assert rows == [*self.ROWS]
            # what lies beside it, at the same instant, not between it
            assert np.abs(fresh.q - log.q)[rows].max() < (1e-5 if taken is time else 1e-3)

    @pytest.mark.parametrize("seed", [0, 1, 2, 3])
    def test_rows_that_are_one_already_have_none(self, seed: int) -> None:
        """Stamps off by up to two fifths of a period, in order: some nearly coincide, and are on a line since."""
        rng = np.random.default_rng(seed)
        even = np.arange(0, 20.0, 1 / RATE)
        q = (np.sin(0.5 * even) + 1e-6 * rng.normal(size=len(even)))[:, None]
        stamps = even + rng.uniform(-0.4, 0.4, len(even)) / RATE
        log = MotionLog(stamps, q, 0.5 * np.cos(0.5 * even)[:, None], np.sin(3 * q), name="run")
        (line,) = said(log)
        assert line.startswith("column time has rows nearer to another")

    def test_three_samples_a_step_and_noise_are_none(self) -> None:
        log = a_log()
        for change in ("wide", "step", "many", "between runs"):
            tau, time = log.tau.copy(), log.time.copy()
            if change == "wide":
                tau[900:903, 0] += 3.0
            elif change == "step":
                tau[900:, 0] += 3.0
            elif change == "many":
                tau[np.random.default_rng(1).choice(log.samples, log.samples // 30, replace=False), 0] += 3.0
            else:  # the last sample of a run and the first of the next are not beside each other
                time[901:] += 5.0
                tau[900, 0] += 3.0
            worn = replace(log, tau=tau, time=time)
            assert repaired(recorded(worn)).tau is tau, change

    def test_what_several_columns_do_at_once_is_a_jerk_unless_a_position_jumps_too(self) -> None:
        log = a_log()
        q, v, tau = log.q.copy(), log.v.copy(), log.tau.copy()
        tau[900] += [3.0, -3.0]
        v[901, 0] += 1.0
        assert repaired(recorded(replace(log, v=v, tau=tau))).tau is tau
        q[900, 0] += 0.05
        fresh = repaired(recorded(replace(log, q=q, v=v, tau=tau)))
        for mine, own in ((fresh.q, log.q), (fresh.tau, log.tau)):
            np.testing.assert_allclose(mine[899:903], own[899:903], atol=0.3)

    def test_a_speed_with_which_the_position_moves_is_none(self) -> None:
        log = a_log()
        v, q = log.v.copy(), log.q.copy()
        v[900, 0] += 2.0
        assert abs(repaired(recorded(replace(log, v=v))).v[900, 0] - log.v[900, 0]) < 0.1
        q[900:, 0] += 4.0 / RATE
        moved = replace(log, q=q, v=v)
        assert repaired(recorded(moved)).v is v

    def test_a_derived_speed_follows_the_position(self) -> None:
        log = a_log()
        rough = log.q + 1e-5 * np.random.default_rng(3).normal(size=log.q.shape)
        rough[900, 1] += 0.05
        worn = MotionLog.from_arrays(log.time, rough, log.tau)
        fresh = repaired(recorded(worn))
        clean = np.gradient(np.sin(2 * np.pi * 0.5 * log.time), log.time)
        assert np.abs(worn.v[895:905, 1] - clean[895:905]).max() > 5
        np.testing.assert_allclose(fresh.v[895:905, 1], clean[895:905], atol=0.02)


class TestStuck:
    def test_a_torque_that_stands_still_while_its_joint_moves_is_lost(self) -> None:
        for noise in (0.01, 0.2):
            log = a_log(noise=noise)
            tau = log.tau.copy()
            tau[1000:1060, 0], tau[3000:3040, 0] = tau[1000, 0], tau[3000, 0]
            worn = replace(log, tau=tau)
            fresh = repaired(recorded(worn))
            assert fresh.lost is not None and not fresh.lost[:, 1].any()
            assert np.flatnonzero(fresh.lost[:, 0]).tolist() == [*range(1000, 1060), *range(3000, 3040)]
            (words,) = said(worn)
            assert words.startswith(
                "column tau1 stands still to the last digit while the joint moves 2 times, 0.39 s"
            )

    def test_rest_zero_and_rounding_are_no_faults(self) -> None:
        log = a_log()
        still, nothing, rounded = (log.tau.copy() for _ in range(3))
        still[1000:1040, 0], nothing[1000:1040, 0] = still[1000, 0], 0.0
        v = log.v.copy()
        v[1000:1040, 0] = 0.0
        rounded = 0.1 * np.round(rounded / 0.1)
        assert repaired(recorded(replace(log, v=v, tau=still))).lost is None
        assert repaired(recorded(replace(log, tau=nothing))).lost is None
        assert repaired(recorded(replace(log, tau=rounded))).lost is None
        # a joint that rests, but for the rounding of its speed
        v[1000:1040, 0] = 1e-3 * (np.arange(40) % 3)
        assert repaired(recorded(replace(log, v=v, tau=still))).lost is None

    def test_between_two_runs_nothing_is_repeated(self) -> None:
        log = a_log()
        tau, time = log.tau.copy(), log.time.copy()
        tau[1000:1010, 0] = tau[1000, 0]
        assert repaired(recorded(replace(log, tau=tau))).lost is not None
        time[1005:] += 5.0
        assert repaired(recorded(replace(log, time=time, tau=tau))).lost is None

    def test_a_torque_that_is_cut_off_is_lost_at_its_extremes(self) -> None:
        log = a_log()
        top = 0.6 * np.abs(log.tau[:, 1]).max()
        tau = log.tau.copy()
        tau[:, 1] = np.clip(tau[:, 1], -top, top)
        fresh = repaired(recorded(replace(log, tau=tau)))
        assert fresh.lost is not None
        np.testing.assert_array_equal(fresh.lost[:, 1], np.abs(log.tau[:, 1]) >= top)
        assert not fresh.lost[:, 0].any()
        assert (
            sum("saturates" in words for words in said(replace(log, tau=tau)))
            == len(said(replace(log, tau=tau)))
            == 2
        )


class TestRepeatedRows:
    def test_are_bridged_and_a_torque_repeated_for_longer_is_lost(self) -> None:
        log = a_log()
        q, v, tau = log.q.copy(), log.v.copy(), log.tau.copy()
        for first, last in ((1000, 1003), (2000, 2006)):
            for x in (q, v, tau):
                x[first:last] = x[first]
        worn = replace(log, q=q, v=v, tau=tau)
        fresh = repaired(recorded(worn))
        np.testing.assert_allclose(fresh.q, log.q, atol=4e-3)
        np.testing.assert_allclose(fresh.v[1990:2030], log.v[1990:2030], atol=0.1)
        np.testing.assert_allclose(fresh.tau[1000:1003], log.tau[1000:1003], atol=0.2)
        assert fresh.lost is not None
        assert np.flatnonzero(fresh.lost.all(axis=1)).tolist() == list(range(2000, 2006))
        assert said(worn)[0].startswith("columns q, v repeat the row before in 7 rows while the arm moves")

    def test_for_too_long_or_to_the_end_are_another_fault(self) -> None:
        log = a_log()
        for first, last, repeats in ((1000, 1025, 24), (1000, 1027, 0), (log.samples - 5, log.samples, 0)):
            q, v = log.q.copy(), log.v.copy()
            q[first:last], v[first:last] = q[first], v[first]
            held = replace(recorded(log), q=q, v=v)
            assert len(dropouts._held(held)) == repeats, (first, last)

    def test_of_an_arm_at_rest_say_nothing(self) -> None:
        log = a_log()
        q, v = log.q.copy(), log.v.copy()
        q[1000:1004], v[1000:1004] = q[1000], 0.0
        resting = replace(log, q=q, v=v)
        assert repaired(recorded(resting)).q is resting.q

    def test_a_log_written_faster_than_it_was_measured_is_drawn_through_its_measurements(self) -> None:
        slow = a_log(noise=0.0)
        often = slow.select(slice(0, None, 4))
        held = np.repeat(np.arange(often.samples), 4)[: slow.samples]
        worn = MotionLog(slow.time, often.q[held], often.v[held], often.tau[held], name="held")
        fresh = repaired(recorded(worn))
        inner = slice(0, slow.samples - 8)
        assert np.abs(fresh.q - slow.q)[inner].max() < 0.1 * np.abs(worn.q - slow.q)[inner].max()
        assert fresh.lost is None


def test_lost_torques_count_for_nothing_as_far_as_the_filter_smears_them() -> None:
    log = a_log()
    tau = log.tau.copy()
    tau[2000:2060, 0] = tau[2000, 0]
    how = Conditioning(cutoff_hz=5.0)
    clean, worn = preprocess([log], how), preprocess([replace(log, tau=tau)], how)
    assert clean.unknown is None and worn.unknown is not None
    time = worn.motion.time
    lost = (time >= log.time[2000] - how.reach - 1e-9) & (time <= log.time[2059] + how.reach + 1e-9)
    np.testing.assert_array_equal(worn.unknown[:, 0], lost)
    assert not worn.unknown[:, 1].any()
    np.testing.assert_array_equal(worn.moving, clean.moving & ~worn.unknown)
    # beyond the reach next to nothing is left of the fault
    off = np.abs(worn.tau - clean.tau)[:, 0]
    assert off[~lost].max() < 0.1 * off.max()


def test_they_are_sought_once_a_log_however_often_it_is_conditioned(monkeypatch: pytest.MonkeyPatch) -> None:
    sought: list[Recorded] = []
    large = dropouts._large

    def counted(steps: np.ndarray, resolution: float) -> tuple[float, np.ndarray]:
        sought.append(log.record)
        return large(steps, resolution)

    monkeypatch.setattr(dropouts, "_large", counted)
    log = a_log()
    for cutoff in (10.0, 5.0, 2.0):
        preprocess([log], Conditioning(cutoff_hz=cutoff))
    assert len(sought) == 2 * 6  # two clocks, six columns
    preprocess([replace(log, tau=log.tau + 1.0)], Conditioning())
    assert len(sought) == 2 * 2 * 6
