"""What a corner of the low-pass is judged by, on numbers small enough to see through."""

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import noisy_run as run
from synthetic import standing, three_axis

from armloop.data.filters import LowPass, filter_reach
from armloop.data.signals import Conditioning, as_torque, preprocess
from armloop.features.rigid_body import BaseParameters
from armloop.identification.reconstruction import bandwidth
from armloop.identification.reconstruction.bandwidth import Bandwidth, Table, choose_bandwidth
from armloop.util.errors import LogError

TEN_HZ = Conditioning()


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


def test_a_run_between_every_third_instant_has_none() -> None:
    motion = replace(standing(9, 1), q=np.arange(9.0)[:, None], starts=np.array([0, 1, 2, 4, 6, 8]))
    whole = Table(motion.q[:, :, None], motion.q, np.arange(9), motion.q > 2, motion, 1)
    thin = whole.every(3)
    # 0, 3 and 6: of the first run, the third and the fifth
    assert thin.motion.q[:, 0].tolist() == [0.0, 3.0, 6.0] and thin.motion.starts.tolist() == [0, 1, 2]


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
        log.read, log.stretch = lambda: log, lambda rows: log
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
