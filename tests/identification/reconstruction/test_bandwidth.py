"""The corner of the low-pass follows the noise and the speed of the data, judged on one torque for all corners."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic import fourier_motion, friction, measured, rigid_torque, three_axis

from armloop.cli import main
from armloop.data.log import MotionLog, read_log, write_log
from armloop.data.signals import Conditioning
from armloop.identification.reconstruction import bandwidth, reconstruct
from armloop.identification.reconstruction.bandwidth import Table, choose_bandwidth
from armloop.identification.reconstruction.options import Options
from armloop.model import load_model
from armloop.robot.arm import load_arm
from armloop.util.errors import LogError

TEN_HZ = Conditioning()


def run(seed: int = 1, rate: float = 100.0, noise: float = 0.0, seconds: float = 40.0) -> MotionLog:
    """A run whose v has white noise of so many rad/s."""
    motion = fourier_motion(seconds, rate, seed)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)
    log = measured(motion, tau, seed)
    return replace(log, v=log.v + noise * np.random.default_rng(seed).normal(size=log.v.shape))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_clean_data_keep_the_bandwidth_and_noisy_ones_do_not(seed: int) -> None:
    clean = choose_bandwidth([run(seed)], three_axis(), TEN_HZ)
    noisy = choose_bandwidth([run(seed, noise=0.3)], three_axis(), TEN_HZ)
    assert clean.cutoff_hz == 10.0 and clean.notes() == []
    assert noisy.cutoff_hz <= 5.0
    errors = dict(noisy.trials)
    assert errors[noisy.cutoff_hz] < 0.8 * errors[10.0]
    (note,) = noisy.notes()
    assert f"low-pass of {noisy.cutoff_hz:.3g} Hz, chosen by cross-validation" in note


def test_smoothing_the_torque_alone_gains_nothing() -> None:
    """White noise on the torque is the same for every corner: it must not favour a low one."""
    log = run()
    tau = log.tau + 0.5 * log.tau.std(axis=0) * np.random.default_rng(4).normal(size=log.tau.shape)
    assert choose_bandwidth([replace(log, tau=tau)], three_axis(), TEN_HZ).cutoff_hz >= 7.0


def test_the_corner_is_kept_below_the_sample_rate() -> None:
    slow = run(rate=20.0, seconds=120.0)
    found = choose_bandwidth([slow], three_axis(), TEN_HZ)
    assert found.trials[0][0] == pytest.approx(8.0) and found.cutoff_hz <= 8.0


def test_samples_that_are_no_series_and_too_few_keep_the_usual_corner() -> None:
    rng = np.random.default_rng(0)
    q = rng.uniform(-1, 1, (500, 3))
    drawn = MotionLog(np.arange(500) * 0.01, q, q[::-1], q, vdot=q)
    assert choose_bandwidth([drawn], three_axis(), TEN_HZ).cutoff_hz == 10.0
    assert choose_bandwidth([run(seconds=1.0)], three_axis(), TEN_HZ).cutoff_hz == 10.0
    with_short = choose_bandwidth([run(noise=0.3), run(seconds=1.4)], three_axis(), TEN_HZ)
    assert with_short.trials == choose_bandwidth([run(noise=0.3)], three_axis(), TEN_HZ).trials


def test_the_model_keeps_the_corner_that_was_chosen(tmp_path: Path) -> None:
    logs = [run(seed, noise=0.3) for seed in (1, 2)]
    logs[1] = replace(logs[1], name="other")
    how = Options(standard_errors=False, parts=False, friction=("coulomb", "viscous"))
    found = reconstruct(logs, three_axis(), library="rigid-body", options=how)
    found.model.save(tmp_path / "model.json")
    model = load_model(tmp_path / "model.json")
    chosen = model.history["bandwidth"]
    assert model.conditioning.cutoff_hz == chosen["cutoff_hz"] <= 5.0
    assert any("chosen by cross-validation" in note for note in found.notes)


def test_an_explicit_corner_stands_and_must_lie_below_the_nyquist_rate(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = run(noise=0.3)
    how = Options(standard_errors=False, parts=False, friction=("coulomb", "viscous"))
    found = reconstruct([log], three_axis(), library="rigid-body", conditioning=TEN_HZ, options=how)
    assert found.model.conditioning.cutoff_hz == 10.0
    with pytest.raises(
        LogError, match=r"run: a cutoff of 50 Hz is not below 50 Hz, half of the 100 samples a second"
    ):
        reconstruct([log], three_axis(), conditioning=Conditioning(cutoff_hz=50.0))
    write_log(tmp_path / "run.csv", log)
    for command in (["reconstruct", "--out", str(tmp_path / "model.json")], ["crossvalidate"]):
        arguments = [
            command[0],
            str(tmp_path / "run.csv"),
            "--arm",
            "three_axis",
            "--cutoff",
            "80",
            *command[1:],
        ]
        assert main(arguments) == 2
        assert "a cutoff of 80 Hz is not below 50 Hz" in capsys.readouterr().err
    assert not (tmp_path / "model.json").exists()


@pytest.mark.measured
def test_measured_arms_get_the_corner_that_suits_them(measured: Path) -> None:
    pendulum = [read_log(path, quiet=True) for path in sorted(measured.glob("double_pendulum/sysid_*.csv"))]
    arm = load_arm(measured / "double_pendulum" / "double_pendulum.urdf")
    found = choose_bandwidth(pendulum, arm, TEN_HZ)
    errors = dict(found.trials)
    assert 3.5 <= found.cutoff_hz <= 6.0 and errors[found.cutoff_hz] < 0.7 * errors[10.0]
    shared = Conditioning(cutoff_hz=9.5)
    ur10e = [read_log(path) for path in sorted(measured.glob("ur10e/noload*.csv"))]
    assert choose_bandwidth(ur10e, load_arm(measured / "ur10e" / "ur10e.urdf"), shared).cutoff_hz == 9.5
    panda = [read_log(measured / "panda" / "exciting_1a.csv", quiet=True)]
    assert (
        4.5 <= choose_bandwidth(panda, load_arm(measured / "panda" / "panda.urdf"), shared).cutoff_hz <= 9.5
    )


def test_a_block_is_judged_with_what_the_blocks_beside_it_showed_alone() -> None:
    """Noise, and columns enough to fit much of it: what was fitted would leave less than all, what was not leaves more."""
    rng = np.random.default_rng(4)
    instants, joints, columns = 400, 2, 160
    table = Table(
        rng.standard_normal((instants, joints, columns)),
        rng.standard_normal((instants, joints)),
        np.arange(instants) // 10,
        np.ones((instants, joints), dtype=bool),
    )
    # of R rows and p columns, what is fitted leaves 1 − p/R of the energy, what is not 1 + p/(R − p − 1)
    left = bandwidth._held_out(table)
    rows = instants * joints / 2
    np.testing.assert_allclose(left**2, 1 + columns / (rows - columns - 1), rtol=0.25)
