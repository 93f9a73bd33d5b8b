"""The same function on many chunks: one after the other, in processes of this machine, or on a Dask cluster.

Answers come back in the order of the chunks whoever computed them, so that sums of them are the same to the bit
for any number of workers.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from functools import reduce
from multiprocessing import get_context
from operator import add
from typing import Any, Protocol, TypeVar

from armloop.errors import InputError

Chunk = TypeVar("Chunk")
Answer = TypeVar("Answer")

#: Seconds that a scheduler has to answer.
PATIENCE = 10.0
#: Chunks handed to each worker of a cluster ahead of what has been taken back, so that answers do not pile up.
_AHEAD = 4


class Workers(Protocol):
    """Who applies a function to chunks."""

    def map(self, function: Callable[[Chunk], Answer], chunks: Sequence[Chunk]) -> Iterator[Answer]:
        """Yield the answers in the order of the chunks; exceptions of the function come through."""
        ...

    def close(self) -> None:
        """Let go of what was opened."""
        ...


def map_reduce(workers: Workers, function: Callable[[Chunk], Answer], chunks: Sequence[Chunk]) -> Answer:
    """Sum of the function's answers over the chunks (at least one); only the running sum is kept."""
    answers: Iterator[Any] = workers.map(function, chunks)
    return reduce(add, answers)


class Serial:
    """In this process."""

    def map(self, function: Callable[[Chunk], Answer], chunks: Sequence[Chunk]) -> Iterator[Answer]:
        return map(function, chunks)

    def close(self) -> None:
        pass


class Processes:
    """In forked processes, one BLAS thread each; they inherit function and chunks, only answers are copied.

    Args:
        jobs: how many; all cores by default.
    """

    def __init__(self, jobs: int | None = None) -> None:
        self.jobs = jobs or len(os.sched_getaffinity(0))

    def map(self, function: Callable[[Chunk], Answer], chunks: Sequence[Chunk]) -> Iterator[Answer]:
        jobs = min(self.jobs, len(chunks))
        if jobs <= 1:
            yield from map(function, chunks)
            return
        with _inherited(function, chunks) as key:
            with ProcessPoolExecutor(jobs, get_context("fork"), _one_thread) as pool:
                yield from pool.map(_call, [key] * len(chunks), range(len(chunks)))

    def close(self) -> None:
        pass


class Cluster:
    """On the workers of a Dask scheduler, which must have this package and see the same files.

    Args:
        address: of the scheduler, such as ``tcp://10.0.0.7:8786``.

    Raises:
        InputError: Dask is not installed, or nothing answers at the address.
    """

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client
        except ImportError as error:
            raise InputError(
                "--scheduler needs Dask, which is not installed; install the extra: armloop[dask]"
            ) from error
        try:
            self.client = Client(address, timeout=PATIENCE, set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            raise InputError(
                f"--scheduler {address}: no Dask scheduler answers there; give an address like tcp://10.0.0.7:8786"
            ) from error

    def map(self, function: Callable[[Chunk], Answer], chunks: Sequence[Chunk]) -> Iterator[Answer]:
        most = _AHEAD * max(1, len(self.client.scheduler_info()["workers"]))
        shared = self.client.scatter([function], broadcast=True, hash=False)[0]
        futures: list[Any] = []
        following = iter(chunks)
        for chunk in following:
            futures.append(self.client.submit(_apply, shared, chunk, pure=False))
            if len(futures) == most:
                yield futures.pop(0).result()
        for future in futures:
            yield future.result()

    def close(self) -> None:
        self.client.close()


def _apply(function: Callable[[Chunk], Answer], chunk: Chunk) -> Answer:
    with _threads():
        return function(chunk)


#: What forked processes inherit: functions and chunks that need not be picklable, nor copied.
_INHERITED: dict[int, tuple[Callable[[Any], Any], Sequence[Any]]] = {}


@contextmanager
def _inherited(function: Callable[[Any], Any], chunks: Sequence[Any]) -> Iterator[int]:
    key = max(_INHERITED, default=0) + 1
    _INHERITED[key] = (function, chunks)
    try:
        yield key
    finally:
        del _INHERITED[key]


def _call(key: int, index: int) -> Any:
    function, chunks = _INHERITED[key]
    return function(chunks[index])


def _threads() -> Any:
    from threadpoolctl import threadpool_limits

    return threadpool_limits(1)


def _one_thread() -> None:
    _threads()
