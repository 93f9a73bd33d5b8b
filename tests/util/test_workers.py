"""Whoever applies a function to chunks, the answers are the same and come in order."""

import gc
import os
import subprocess
import sys
from collections.abc import Iterator
from functools import reduce
from multiprocessing import get_context
from operator import add
from typing import Any

import numpy as np
import pytest

from armloop.util import workers
from armloop.util.errors import InputError, LogError
from armloop.util.workers import Cluster, Processes, Serial, Workers


@pytest.fixture(scope="module")
def cluster() -> Iterator[Cluster]:
    """Two processes of their own, reached by the address of their scheduler."""
    from distributed import LocalCluster

    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as processes:
        client = Cluster(processes.scheduler_address)
        yield client
        client.close()


@pytest.fixture(params=["serial", "processes", "cluster"])
def anyone(request: pytest.FixtureRequest) -> Any:
    if request.param == "cluster":
        return request.getfixturevalue("cluster")
    return Serial() if request.param == "serial" else Processes(2)


def test_answers_come_in_order_and_sums_are_equal_to_the_bit(anyone: Workers) -> None:
    chunks = [np.random.default_rng(seed).normal(size=100) for seed in range(30)]
    for answer, chunk in zip(anyone.map(lambda x: 2 * x, chunks), chunks, strict=True):
        np.testing.assert_array_equal(answer, 2 * chunk)
    total, serial = (reduce(add, workers.map(lambda x: x**3, chunks)) for workers in (anyone, Serial()))
    np.testing.assert_array_equal(total, serial)


def test_a_fault_found_by_a_worker_is_the_users(anyone: Workers) -> None:
    def check(x: float) -> float:
        if x > 2:
            raise LogError(f"file.csv: row {x:g} is wrong")
        return x

    with pytest.raises(LogError, match=r"file\.csv: row 3 is wrong"):
        list(anyone.map(check, [1.0, 3.0, 2.0, 5.0]))
    assert list(anyone.map(check, [1.0, 2.0])) == [1.0, 2.0]


def test_processes_really_are_others_with_one_thread() -> None:
    from threadpoolctl import threadpool_info

    def look(_: int) -> tuple[int, int]:
        return os.getpid(), max(info["num_threads"] for info in threadpool_info())

    answers = list(Processes(2).map(look, range(8)))
    assert os.getpid() not in {process for process, _ in answers}
    assert {threads for _, threads in answers} == {1}
    assert Processes().jobs == len(os.sched_getaffinity(0))


def test_without_dask_or_a_scheduler_one_line_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers, "PATIENCE", 0.3)
    with pytest.raises(InputError, match=r"--scheduler tcp://127\.0\.0\.1:9: no Dask scheduler answers"):
        Cluster("tcp://127.0.0.1:9")
    with pytest.raises(InputError, match="no Dask scheduler answers"):
        Cluster("nonsense://x")
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"install the extra: armloop\[dask\]"):
        Cluster("tcp://127.0.0.1:9")


def test_however_many_work_each_has_one_blas_thread() -> None:
    """The number of threads decides in which order a product is summed, and so its last digits."""
    import numpy as np
    from threadpoolctl import threadpool_info, threadpool_limits

    def threads(chunk: int) -> int:
        np.ones((2, 2)) @ np.ones((2, 2))
        return max(pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas")

    with threadpool_limits(2):
        for workers in (Serial(), Processes(1), Processes(2)):
            assert list(workers.map(threads, [0, 1])) == [1, 1]


LOADED_LATER = """
import numpy, threadpoolctl
from armloop.util.workers import single_threaded

def threads():
    return [pool["num_threads"] for pool in threadpoolctl.threadpool_info()]

for libraries in (1, 2):
    assert threads() == [2] * libraries, threads()
    with single_threaded():
        assert threads() == [1] * libraries, threads()
    import scipy.linalg
assert threads() == [2, 2], threads()
"""


def test_a_library_with_threads_that_is_loaded_later_has_one_too() -> None:
    """Which libraries there are is not asked at every call, but after every import; scipy has a BLAS of its own."""
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "2", "OMP_NUM_THREADS": "2"}
    subprocess.run([sys.executable, "-c", LOADED_LATER], env=environment, check=True)


def test_a_team_keeps_what_each_has_computed() -> None:
    """Of eleven every process does the same ones whenever it is asked, so that it need not do them again."""
    from armloop.util.workers import Team

    with Team(set(), 3) as team:
        first = team.map(_known_before, "a", 11, lambda done: None)
        again = team.map(_known_before, "b", 11, lambda done: None)
    assert [k for k, _, _ in first] == list(range(11))
    assert not any(known for _, known, _ in first) and all(known for _, known, _ in again)
    assert [task for _, _, task in again] == ["b"] * 11


def test_a_teams_fault_is_the_users_and_ends_it() -> None:
    from armloop.util.workers import Team

    for jobs in (1, 2):
        with pytest.raises(LogError, match="row 3"), Team(None, jobs) as team:
            team.map(_wrong_at_three, None, 5, lambda done: None)


def test_within_a_pool_nobody_makes_a_team() -> None:
    assert list(Processes(2).map(lambda k: _team_of_eight(), [0, 1])) == [1, 1]


def _known_before(held: set[int], task: str, k: int) -> tuple[int, bool, str]:
    known = k in held
    held.add(k)
    return k, known, task


def _wrong_at_three(held: None, task: None, k: int) -> int:
    if k == 3:
        raise LogError(f"file.csv: row {k} is wrong")
    return k


def _team_of_eight() -> int:
    from armloop.util.workers import Team

    return Team(None, 8).jobs


def test_a_process_does_not_look_for_garbage_in_what_it_inherited() -> None:
    """That would copy every page of it: memory of each process, not of all together."""
    before = gc.get_freeze_count()
    assert list(Processes(2).map(lambda _: gc.get_freeze_count() > 10_000, range(2))) == [True, True]
    assert gc.get_freeze_count() == before


def _within(of: int) -> list[list[int]]:
    """What a pool and a team of so many processes answer."""
    with workers.Team(None, of) as team:
        shared = team.map(lambda held, task, k: k + task, 1, of, lambda done: None)
    return [list(Processes(of).map(lambda k: k + 1, range(of))), shared]


def test_a_daemonic_process_such_as_a_pools_of_the_user_works_alone() -> None:
    """It may have no children of its own."""
    with get_context("fork").Pool(1) as pool:
        assert pool.apply(_within, (3,)) == [[1, 2, 3]] * 2
