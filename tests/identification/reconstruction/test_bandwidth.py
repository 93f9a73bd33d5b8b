"""The corner of the low-pass follows the noise and the speed of the data, judged on one torque for all corners."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import fourier_motion, friction, measured, rigid_torque, standing, three_axis

from armloop.cli import main
from armloop.data.filters import LowPass, filter_reach
from armloop.data.log import MotionLog, read_log, write_log
from armloop.data.signals import Conditioning, as_torque, preprocess
from armloop.features.rigid_body import BaseParameters
from armloop.identification.reconstruction import bandwidth, reconstruct
from armloop.identification.reconstruction.bandwidth import Bandwidth, Table, choose_bandwidth
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
    # what is no measurement is told by the log it is in
    np.testing.assert_allclose(together.trials, apart.trials, rtol=1e-3)


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


def test_a_block_is_judged_with_what_the_blocks_beside_it_showed_alone() -> None:
    """Noise, and columns enough to fit much of it: what was fitted would leave less than all, what was not leaves more."""
    rng = np.random.default_rng(4)
    instants, joints, columns = 400, 2, 160
    table = Table(
        rng.standard_normal((instants, joints, columns)),
        rng.standard_normal((instants, joints)),
        np.arange(instants) // 10,
        np.ones((instants, joints), dtype=bool),
        standing(instants, joints),
        1,
    )
    # of R rows and p columns, what is fitted leaves 1 − p/R of the energy, what is not 1 + p/(R − p − 1)
    left = bandwidth._held_out(table)
    rows = instants * joints / 2
    np.testing.assert_allclose(left**2, 1 + columns / (rows - columns - 1), rtol=0.25)


def test_columns_of_any_unit_are_solved_and_what_nothing_determines_is_shared_or_none() -> None:
    rng = np.random.default_rng(5)
    X, y = rng.normal(size=(30, 3)) * [1e-6, 1.0, 1e6], rng.normal(size=30)
    expected = np.linalg.lstsq(X, y)[0]
    np.testing.assert_allclose(bandwidth.determined_solution(X, y), expected, rtol=1e-5)
    twice = np.column_stack([X, X[:, 1], np.zeros(30)])
    shared = [expected[0], expected[1] / 2, expected[2], expected[1] / 2, 0.0]
    np.testing.assert_allclose(bandwidth.determined_solution(twice, y), shared, rtol=1e-5)


def test_the_ridge_is_a_ten_millionth_of_a_column_s_squares() -> None:
    rng = np.random.default_rng(6)
    X, y = 3.0 * np.linalg.qr(rng.normal(size=(30, 3)))[0], rng.normal(size=30)
    np.testing.assert_allclose(bandwidth.determined_solution(X, y), X.T @ y / 9 / (1 + 1e-7), rtol=1e-11)


def test_joints_weigh_by_their_torques_first_then_by_what_is_left_of_blocks_left_out() -> None:
    rng = np.random.default_rng(8)
    N, columns = 60, rng.normal(size=(60, 2, 4))
    tau = columns @ [1.0, -2.0, 3.0, -4.0] + rng.normal(size=(N, 2)) * [0.5, 5.0]
    table = Table(columns, tau, np.arange(N) // 5, rng.random((N, 2)) > 0.2, standing(N, 2), 1)

    def sizes(x: np.ndarray) -> Any:
        return np.sqrt((x**2).sum(axis=0, where=table.moving) / table.moving.sum(axis=0))

    left = tau
    for _ in range(2):
        size, before = sizes(left), left
        left = np.zeros_like(before)
        for judged in (table.blocks % 2 == 0, table.blocks % 2 == 1):
            rows = table.moving & ~judged[:, None]
            theta = np.linalg.lstsq((columns / size[:, None])[rows], (tau / size)[rows])[0]
            left[judged] = (tau - columns @ theta)[judged]
    np.testing.assert_allclose(bandwidth._held_out(table), sizes(left), rtol=1e-5)


def test_every_third_instant_of_two_logs() -> None:
    motion = replace(standing(10, 1), q=np.arange(10.0)[:, None], starts=np.array([0, 4]))
    whole = Table(motion.q[:, :, None], motion.q, np.arange(10), motion.q > 2, motion, 2)
    thin = whole.every(3)
    taken = [0.0, 3.0, 6.0, 9.0]
    assert thin.tau[:, 0].tolist() == thin.columns[:, 0, 0].tolist() == thin.motion.q[:, 0].tolist() == taken
    assert thin.blocks.tolist() == taken and thin.moving[:, 0].tolist() == [False, True, True, True]
    # of the first log 0 and 3, of the second 6 and 9
    assert thin.motion.starts.tolist() == [0, 2] and thin.stride == 6


class TestPieces:
    @pytest.fixture
    def compared(self, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Any]:
        """What is chosen where the regressions at the corners leave so much of 2 N·m (joints 1 and 2) and 4 (joint 3)."""

        def chosen(
            left: list[list[float]], counted: tuple[int, ...] = (100, 100, 100), seconds: float = 40
        ) -> Any:
            moving = np.arange(100)[:, None] < np.array(counted)
            tables = iter(range(len(left)))
            asked: list[float] = []

            def table_at(
                logs: Any, arm: Any, base: Any, how: Any, corner: float, corners: Any, aside: Any
            ) -> Any:
                asked.append(corner)
                k = next(tables)
                return replace(
                    Table(
                        np.full(1, k),
                        np.tile([2.0, 2.0, 4.0], (100, 1)) * (1 + 6 * k),
                        np.zeros(100, dtype=int),
                        moving,
                        standing(100, 3),
                        1,
                    ),
                    moving=moving if k == 0 else ~moving,
                )

            def held_out(table: Table) -> Any:
                # the same samples and torques at every corner
                assert (table.moving == moving).all() and (table.tau == [2.0, 2.0, 4.0]).all()
                return np.array(left[int(table.columns[0])])

            monkeypatch.setattr(bandwidth, "table_at", table_at)
            monkeypatch.setattr(bandwidth, "_held_out", held_out)
            found = choose_bandwidth([run(seconds=seconds)], three_axis(), TEN_HZ)
            assert asked in ([10.0, 7.1, 5.0, 3.5, 2.5], [])
            return found

        return chosen

    def test_the_highest_corner_whose_error_is_within_two_hundredths_of_the_least(
        self, compared: Callable[..., Any]
    ) -> None:
        even = [[0.2, 0.2, 0.4]] * 4
        for excess, corner in ((1.019, 10.0), (1.021, 7.1)):
            assert compared([[0.2 * excess, 0.2 * excess, 0.4 * excess], *even]).cutoff_hz == corner
        # the geometric mean over joints, each by its own torque
        found = compared([[0.2, 0.8, 0.4], *even])
        assert [error for _, error in found.trials] == pytest.approx([0.1 * 4 ** (1 / 3), *[0.1] * 4])
        assert [corner for corner, _ in found.trials] == [10.0, 7.1, 5.0, 3.5, 2.5]
        # a joint without error has one of round-off
        found = compared([[0.0, 0.2, 0.4], *even])
        assert found.trials[0][1] == pytest.approx((1e-12 * 0.1 * 0.1) ** (1 / 3))

    def test_joints_of_fewer_than_a_hundred_samples_do_not_count(self, compared: Callable[..., Any]) -> None:
        worse = [[0.4, 0.2, 0.4], *[[0.2, 0.2, 0.4]] * 4]
        assert compared(worse).cutoff_hz == 7.1
        assert compared(worse, (99, 100, 100)).cutoff_hz == 10.0
        assert len(compared(worse, (99, 100, 100)).trials) == 5
        assert compared(worse, (99, 99, 99)) == Bandwidth(10.0)

    def test_a_log_lasts_more_than_four_periods_of_the_lowest_corner(
        self, compared: Callable[..., Any]
    ) -> None:
        # 4 / 2.5 Hz
        even = [[0.2, 0.2, 0.4]] * 5
        assert compared(even, seconds=1.61).trials == () and len(compared(even, seconds=1.62).trials) == 5

    def test_every_corner_sees_the_logs_that_are_long_enough_for_the_lowest(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Of three logs that begin at 100 s the second is shorter; without a table at one corner the highest stands."""
        asked: list[Any] = []
        logs = [run(seed, seconds=seconds) for seed, seconds in ((0, 12.0), (1, 1.0), (2, 12.0))]
        logs = [replace(log, time=log.time + 100.0) for log in logs]

        def table_at(own: Any, arm: Any, base: Any, how: Any, corner: float, *rest: Any) -> Any:
            assert base.names == BaseParameters.of_arm(three_axis(), rotors=True).names
            asked.append((corner, [log.name for log in own], *rest))
            table = Table(*[np.zeros((200, 3))] * 2, np.zeros(200, dtype=int), *[None] * 3)  # type: ignore[arg-type]
            table = replace(table, moving=np.ones((200, 3), dtype=bool), motion=standing(200, 3), stride=1)
            return None if corner == asked[0][0] * 0.5 else table

        def intervals(own: Any, filters: Any, options: Any) -> Any:
            asked.append([how.cutoff_hz for how in filters])
            return ["first", "second", "third"]

        monkeypatch.setattr(bandwidth, "table_at", table_at)
        monkeypatch.setattr(bandwidth, "held_out_intervals", intervals)
        monkeypatch.setattr(bandwidth, "_held_out", lambda table: np.ones(3))
        named = [replace(log, name=f"log {k}") for k, log in enumerate(logs)]
        how = replace(TEN_HZ, cutoff_hz=9.999)
        corners = [9.999, 7.099, 5.0, 3.5, 2.5]
        below = [0.9 * corner for corner in corners]  # what is regressed then
        for libraries, filters in (((), below), ((replace(how, cutoff_hz=4.0),), [4.0, *below[3:]])):
            asked.clear()
            choose_bandwidth(named, three_axis(), how, libraries=libraries)
            assert sorted(asked[0], reverse=True) == filters
            assert [one[0] for one in asked[1:]] == corners
            assert all(one[1:] == (["log 0", "log 2"], corners, ["first", "third"]) for one in asked[1:])
        monkeypatch.setattr(bandwidth, "held_out_intervals", lambda *_: ["first", "second", "third"])
        asked.clear()
        assert choose_bandwidth(named, three_axis(), TEN_HZ) == Bandwidth(10.0) and len(asked) == 5
        # one log that is no series is enough to ask for none
        monkeypatch.setattr(bandwidth, "is_time_series", lambda q, runs: q is not named[1].q)
        monkeypatch.setattr(bandwidth, "placed_runs", lambda logs: list(enumerate(logs)))
        asked.clear()
        assert choose_bandwidth(named, three_axis(), TEN_HZ) == Bandwidth(10.0) and not asked

    def test_blocks_are_numbered_on_from_log_to_log(self) -> None:
        base = BaseParameters.of_arm(three_axis())
        table = bandwidth.table_at([run(seconds=6.5)] * 3, three_axis(), base, TEN_HZ, 10.0, [10.0])
        assert table is not None
        first = np.searchsorted(table.motion.starts, np.arange(table.motion.samples), side="right") - 1
        numbers = [np.unique(table.blocks[first == k]).tolist() for k in range(3)]
        count = len(numbers[0])
        assert numbers == [[count * k + i for i in range(count)] for k in range(3)] and count > 4

    def test_a_corner_is_a_number_of_three_decimals(self) -> None:
        log: Any = SimpleNamespace(period=0.00777, samples=10, runs=lambda: [slice(0, 10)])
        log.read, log.select = lambda: log, lambda rows: log
        # 0.4 / 0.00777 s
        assert bandwidth.highest_corner([log], replace(TEN_HZ, cutoff_hz=100.0)) == 51.48

    def test_a_library_keeps_a_lower_corner_of_its_own(self) -> None:
        assert Bandwidth(5.0).suited(TEN_HZ).cutoff_hz == 4.5
        assert Bandwidth(5.0).suited(replace(TEN_HZ, cutoff_hz=4.0)).cutoff_hz == 4.0
        assert Bandwidth(5.0).notes() == []

    def test_a_corner_stays_below_half_of_the_sample_rate(self) -> None:
        log = run(seconds=2.0)
        bandwidth.check_nyquist([log], 49.99)
        with pytest.raises(LogError):
            bandwidth.check_nyquist([log], 50 - 1e-5)
        assert bandwidth.highest_corner([log, run(seconds=2.0, rate=20.0)], TEN_HZ) == 8.0
        assert bandwidth.highest_corner([log], TEN_HZ) == 10.0

    def test_the_root_mean_square_of_nothing_is_none(self) -> None:
        assert bandwidth.root_mean_square(np.zeros(0)) == 0.0
        assert bandwidth.root_mean_square(np.array([3.0, -4.0])) == pytest.approx(np.sqrt(12.5))


def test_what_is_regressed_at_a_corner() -> None:
    log, arm = run(seconds=10.0), three_axis()
    base = BaseParameters.of_arm(arm, rotors=True)
    aside = [np.array([[4.0, 5.0]])]
    table = bandwidth.table_at([log], arm, base, TEN_HZ, 10.0, [10.0, 2.5], aside)
    samples = as_torque(preprocess([log], replace(TEN_HZ, oversampling=1e9)))
    motion = samples.motion
    # from where the lowest corner smears nothing in that is not there, by a sample more
    margin = filter_reach(2.5) + 0.01
    elapsed = motion.time - log.time[0]
    used = (
        (elapsed > margin)
        & (elapsed < 9.99 - margin)
        & ((motion.time < 4 - margin) | (motion.time > 5 + margin))
    )
    assert table is not None
    np.testing.assert_array_equal(table.tau, samples.tau[used])
    v, N = motion.v[used], int(used.sum())
    assert table.columns.shape == (N, 3, base.count + 9)
    faded = np.sign(motion.v) * (1 - np.exp(-((motion.v / 0.01) ** 2)))
    for j in range(3):
        own = base.count + 3 * j
        np.testing.assert_allclose(
            table.columns[:, j, own], LowPass(10.0, samples.period)(faded)[used, j], atol=1e-9
        )
        np.testing.assert_array_equal(table.columns[:, j, own + 1], v[:, j])
        assert (table.columns[:, j, own + 2] == 1).all()
        others = np.delete(table.columns[:, j, base.count :], slice(3 * j, 3 * j + 3), axis=1)
        assert not others.any()
    blocks = (motion.time[used] - motion.time[used][0]).astype(int)
    np.testing.assert_array_equal(table.blocks, blocks)
    np.testing.assert_array_equal(table.moving, np.abs(v) > 0.05 * np.abs(v).max(axis=0))
    twice = bandwidth.table_at([log, log], arm, base, TEN_HZ, 10.0, [10.0, 2.5], aside * 2)
    assert twice is not None
    np.testing.assert_array_equal(twice.blocks, np.concatenate([blocks, blocks + blocks[-1] + 1]))


def test_a_log_with_nothing_beyond_the_filters_reach_adds_nothing() -> None:
    arm = three_axis()
    base, log = BaseParameters.of_arm(arm, rotors=True), run(seconds=10.0)
    tables = [
        bandwidth.table_at(logs, arm, base, TEN_HZ, 10.0, [10.0, 1.0])
        for logs in ([log], [run(seconds=1.0), log, run(seconds=1.0)])
    ]
    assert tables[0] is not None and tables[1] is not None
    np.testing.assert_array_equal(tables[0].columns, tables[1].columns)
    np.testing.assert_array_equal(tables[0].blocks, tables[1].blocks)
    # whenever it began, but for a sample at each end whose time is rounded
    late = bandwidth.table_at([replace(log, time=log.time + 64.0)], arm, base, TEN_HZ, 10.0, [10.0, 1.0])
    assert late is not None
    shared = np.abs(np.subtract.outer(late.motion.time - 64.0, tables[0].motion.time)) < 1e-3
    assert shared.sum() >= max(len(tables[0].tau), len(late.tau)) - 2
    here, there = np.nonzero(shared)
    np.testing.assert_allclose(late.columns[here], tables[0].columns[there], atol=1e-6)
    assert bandwidth.table_at([run(seconds=1.0)], arm, base, TEN_HZ, 10.0, [10.0, 1.0]) is None


@pytest.mark.parametrize(("samples", "stride"), [(6000, 2), (5990, 1)])
def test_nine_thousand_rows_are_enough(samples: int, stride: int) -> None:
    log, arm = run(seconds=samples / 100), three_axis()
    table = bandwidth.table_at([log], arm, BaseParameters.of_arm(arm, rotors=True), TEN_HZ, 5.0, [5.0])
    assert log.samples == samples and table is not None and table.stride == stride


def test_many_samples_are_thinned_to_the_same_instants_at_every_corner(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    log, arm = run(seconds=10.0), three_axis()
    base = BaseParameters.of_arm(arm, rotors=True)
    whole = bandwidth.table_at([log], arm, base, TEN_HZ, 10.0, [10.0])
    # 1000 samples of three joints: every third instant
    monkeypatch.setattr(bandwidth, "_ROWS", 1000)
    thin = [bandwidth.table_at([log], arm, base, TEN_HZ, corner, [10.0, 5.0]) for corner in (10.0, 5.0)]
    assert whole is not None and thin[0] is not None and thin[1] is not None
    offset = np.flatnonzero((whole.tau == thin[0].tau[0]).all(axis=1))[0]
    np.testing.assert_array_equal(thin[0].tau, whole.tau[offset::3][: len(thin[0].tau)])
    assert len(thin[0].tau) == len(thin[1].tau)
    np.testing.assert_allclose(
        thin[0].columns[:, 0, base.count + 1], thin[1].columns[:, 0, base.count + 1], atol=0.2
    )
