"""The corner of the low-pass follows the noise and the speed of the data, judged on one torque for all corners."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic import noisy_run as run
from synthetic import three_axis

from armloop.cli import main
from armloop.data.log import MotionLog, read_log, write_log
from armloop.data.signals import Conditioning
from armloop.identification.reconstruction import bandwidth, reconstruct
from armloop.identification.reconstruction.bandwidth import choose_bandwidth
from armloop.identification.reconstruction.options import Options
from armloop.model import load_model
from armloop.robot.arm import load_arm
from armloop.util.errors import LogError

TEN_HZ = Conditioning()


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


def pieces(log: MotionLog, seconds: float) -> MotionLog:
    """The log in runs of so many seconds, with gaps between them."""
    return replace(log, time=log.time + np.floor(log.time / seconds))


def test_a_corner_that_leaves_out_short_runs_is_not_tried() -> None:
    """A filter of a corner f needs runs of 3/f, and what is regressed has 0.9 of the corner: 0.4 s hold 8.3 Hz and more."""
    noisy, short = run(noise=0.3), pieces(run(2, seconds=20.0), 0.4)
    assert bandwidth.left_out([noisy, short], TEN_HZ, 7.1) == pytest.approx(1 / 3, abs=0.01)
    assert bandwidth.left_out([noisy, short], TEN_HZ, 10.0) == 0.0
    assert choose_bandwidth([noisy], three_axis(), TEN_HZ).cutoff_hz <= 5.0
    found = choose_bandwidth([noisy, short], three_axis(), TEN_HZ)
    assert found.cutoff_hz == 10.0 and [corner for corner, _ in found.trials] == [10.0]
    # a twentieth of the samples does not decide
    few = pieces(run(2, seconds=2.0), 0.4)
    assert choose_bandwidth([noisy, few], three_axis(), TEN_HZ).cutoff_hz <= 5.0


def test_a_log_of_several_runs_tells_what_they_tell_as_logs() -> None:
    """In the longest run one joint moves; that alone would tell the links apart by noise."""
    alone = run(seed=4, seconds=20.0)
    some = np.array([1.0, 0.0, 0.0])
    still = replace(alone, q=alone.q * some, v=alone.v * some, tau=alone.tau * some)
    runs = [run(5, noise=0.1, seconds=15.0), still, run(6, noise=0.1, seconds=15.0)]
    times = np.concatenate([100.0 * k + one.time for k, one in enumerate(runs)])
    q, v, tau = (np.concatenate([getattr(one, key) for one in runs]) for key in ("q", "v", "tau"))
    joined = MotionLog(times, q, v, tau)
    assert len(joined.runs()) == 3
    apart, together = (choose_bandwidth(logs, three_axis(), TEN_HZ) for logs in (runs, [joined]))
    assert together.cutoff_hz == apart.cutoff_hz
    # what is no measurement, and how late v is, is told by the log that a run is in
    np.testing.assert_allclose(together.trials, apart.trials, rtol=2e-2)


def test_runs_that_are_left_out_are_said() -> None:
    logs = [replace(run(), name="long"), replace(pieces(run(2, seconds=20.0), 0.4), name="short")]
    how = Conditioning(cutoff_hz=5.0)
    options = Options(parts=False, standard_errors=False)
    made = reconstruct(logs, three_axis(), library="rigid-body", conditioning=how, options=options)
    (line,) = [note for note in made.notes if "left out (" in note]
    assert line.startswith(
        "33% of the samples lie in runs of less than 0.6 s, too short for a low-pass of 5 Hz"
    )
    assert "(short)" in line
    made = reconstruct(logs[:1], three_axis(), library="rigid-body", conditioning=how, options=options)
    assert not any("left out (" in note for note in made.notes)


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
    assert model.conditioning.cutoff_hz == pytest.approx(0.9 * chosen["cutoff_hz"])
    assert chosen["cutoff_hz"] <= 5.0
    assert any("chosen by cross-validation" in note for note in found.notes)


def test_an_explicit_corner_stands_and_must_lie_below_the_nyquist_rate(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = run(noise=0.3)
    how = Options(standard_errors=False, parts=False, friction=("coulomb", "viscous"))
    found = reconstruct([log], three_axis(), library="rigid-body", conditioning=TEN_HZ, options=how)
    assert found.model.conditioning.cutoff_hz == 10.0
    with pytest.raises(
        LogError, match=r"^log run: a cutoff of 50 Hz is not below 50 Hz, half of the 100 samples a second"
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
