"""Parallel map over chunks: one after the other, in processes of this machine, or on a Dask cluster.

Answers come back in the order of the chunks whoever computed them, so that sums of them are the same to the bit
for any number of workers.
"""

from __future__ import annotations

import ctypes
import gc
import logging
import os
import re
import signal
import socket
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_EXCEPTION, Future, ProcessPoolExecutor, wait
from contextlib import AbstractContextManager, suppress
from functools import lru_cache, wraps
from multiprocessing import current_process, get_context
from threading import Thread
from typing import Any, ParamSpec, TypeVar

from armloop.util.errors import InputError
from armloop.util.quiet import quiet

Chunk = TypeVar("Chunk")
Answer = TypeVar("Answer")
Arguments = ParamSpec("Arguments")

#: Seconds that a scheduler has to answer.
PATIENCE = 10.0
#: Seconds that a connection to it may take.
_CONNECTED = 3.0
#: Chunks handed to each worker of a cluster ahead of what has been taken back, so that answers do not pile up.
_AHEAD = 4
#: Most processes of a team by default, for each keeps what it has computed; seconds between two looks at how far it is.
_TEAM, _LOOK = 4, 0.5

#: Whether this process is one of a pool's.
_forked = False


class Workers(ABC):
    """Who applies a function to chunks."""

    @abstractmethod
    def map(self, function: Callable[[Chunk], Answer], chunks: Sequence[Chunk]) -> Iterator[Answer]:
        """Yield the answers in the order of the chunks; exceptions of the function come through."""

    def close(self) -> None:  # noqa: B027
        """Let go of what was opened."""


class Serial(Workers):
    """In this process."""

    def map(self, function: Callable[[Chunk], Answer], chunks: Sequence[Chunk]) -> Iterator[Answer]:
        # With one BLAS thread, as in every other worker: how many there are decides the order of a product's sums.
        return (_apply(function, chunk) for chunk in chunks)


class Pool(ProcessPoolExecutor):
    """Forked processes with one BLAS thread each that end with the process that made them, however it ends.

    An exception in the ``with`` block, Ctrl-C among them, does not wait for what the processes are at.

    Args:
        jobs: how many.
        prepare, arguments: called in each process when it begins; inherited, so they need not be picklable.
    """

    def __init__(
        self, jobs: int, prepare: Callable[..., None] | None = None, arguments: tuple[Any, ...] = ()
    ) -> None:
        super().__init__(
            jobs, get_context("fork"), initializer=_begin, initargs=(os.getpid(), prepare, arguments)
        )

    def submit(self, function: Callable[..., Any], /, *arguments: Any, **named: Any) -> Future[Any]:
        # The first task forks the processes: until they ignore Ctrl-C themselves, it has to wait.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
        try:
            return super().submit(function, *arguments, **named)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)

    def __exit__(self, kind: type[BaseException] | None, *rest: Any) -> None:
        if kind is not None:
            for process in list((self._processes or {}).values()):
                process.kill()
        self.shutdown(wait=True, cancel_futures=kind is not None)


def _begin(parent: int, prepare: Callable[..., None] | None, arguments: tuple[Any, ...]) -> None:
    global _forked
    _forked = True
    gc.freeze()  # what was inherited is not looked through for garbage, which would copy all of it
    # Ctrl-C reaches every process of a terminal; the parent answers it, and ends these.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT, signal.SIGTERM})
    _die_with(parent)
    single_threaded()
    if prepare is not None:
        prepare(*arguments)


def _die_with(parent: int) -> None:
    """Be killed when the parent ends, even by SIGKILL (Linux: prctl PR_SET_PDEATHSIG)."""
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)
    if os.getppid() != parent:  # it has ended before it could be said
        os._exit(1)


def team_size(jobs: int | None = None) -> int:
    """How many processes work together: all cores by default, up to :data:`_TEAM`; within another pool's, this one alone."""
    alone = _forked or current_process().daemon
    return 1 if alone else jobs or min(len(os.sched_getaffinity(0)), _TEAM)


class Team:
    """Forked processes that keep what they have computed: of every list each does the same share.

    Args:
        held: what every process has; inherited, so it need not be picklable.
        jobs: how many, as of :func:`team_size`.
    """

    def __init__(self, held: Any, jobs: int | None = None) -> None:
        self.jobs = team_size(jobs)
        self._held = held
        if self.jobs > 1:
            fork = get_context("fork")
            self._done = fork.Value("i", 0)
            self._pool = Pool(
                self.jobs, _join, (held, fork.Value("i", 0), self._done, fork.Barrier(self.jobs))
            )

    def __enter__(self) -> Team:
        return self

    def __exit__(self, *raised: Any) -> None:
        if self.jobs > 1:
            self._pool.__exit__(*raised)

    def map(
        self, function: Callable[[Any, Any, int], Answer], task: Any, count: int, tell: Callable[[int], None]
    ) -> list[Answer]:
        """``function(held, task, k)`` for k below ``count``; exceptions of the function come through.

        Args:
            task: what they have in common; picklable, as the answers are.
            tell: called now and then with how many are done.
        """
        if self.jobs == 1:
            answers = []
            for k in range(count):
                tell(k)
                answers.append(function(self._held, task, k))
            return answers
        self._done.value = 0
        shares = [self._pool.submit(_share, function, task, count, self.jobs) for _ in range(self.jobs)]
        while wait(shares, _LOOK, FIRST_EXCEPTION).not_done and not any(
            s.done() and s.exception() for s in shares
        ):
            tell(self._done.value)
        given = dict(share.result() for share in shares)
        return [given[k % self.jobs][k // self.jobs] for k in range(count)]


class Processes(Workers):
    """In forked processes, all cores by default, one BLAS thread each; function and chunks are inherited, answers copied."""

    def __init__(self, jobs: int | None = None) -> None:
        self.jobs = jobs or len(os.sched_getaffinity(0))

    def map(self, function: Callable[[Chunk], Answer], chunks: Sequence[Chunk]) -> Iterator[Answer]:
        jobs = min(self.jobs, len(chunks))
        if jobs <= 1 or current_process().daemon:  # a daemonic process may have no children
            yield from Serial().map(function, chunks)
            return
        with Pool(jobs, _hold, (function, chunks)) as pool:
            yield from pool.map(_call, range(len(chunks)))


class Cluster(Workers):
    """On the workers of a Dask scheduler (``tcp://10.0.0.7:8786``), which must have this package and see the same files.

    Raises ``InputError`` where Dask is not installed, or nothing answers at the address.
    """

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client
        except ImportError as error:
            raise InputError(
                "--scheduler needs Dask, which is not installed; install the extra: armloop[dask]"
            ) from error
        _somebody_listens(address)
        # Dask waits without end for one that accepts a connection and says nothing.
        connecting: Future[Any] = Future()
        thread = Thread(target=_connect, args=(Client, address, connecting), daemon=True)
        thread.start()
        try:
            self.client = connecting.result(PATIENCE + 1)
        except (OSError, TimeoutError, ValueError) as error:
            raise InputError(_nobody(address)) from error
        if not self.client.scheduler_info()["workers"]:
            self.client.close()
            raise InputError(
                f"--scheduler {address}: the scheduler has no workers; start `dask worker {address}`"
            )

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


_ADDRESS = re.compile(r"(?:(?:tcp|tls)://)?(\[[0-9a-fA-F:.]+\]|[^/:\s]+):(\d{1,5})")


def _nobody(address: str) -> str:
    return f"--scheduler {address}: no Dask scheduler answers there; give an address like tcp://10.0.0.7:8786"


def _somebody_listens(address: str) -> None:
    """Refuse what is no address, and one at which nothing listens, at once: Dask would try for twice its patience."""
    found = _ADDRESS.fullmatch(address)
    if found is None or not 0 < int(found[2]) < 1 << 16:
        raise InputError(_nobody(address))
    try:
        socket.create_connection((found[1].strip("[]"), int(found[2])), _CONNECTED).close()
    except (OSError, UnicodeError) as error:
        raise InputError(_nobody(address)) from error


def _connect(client: Any, address: str, answer: Future[Any]) -> None:
    try:
        with quiet("distributed", logging.CRITICAL):
            answer.set_result(client(address, timeout=PATIENCE, set_as_default=False))
    except BaseException as error:
        answer.set_exception(error)


def _apply(function: Callable[[Chunk], Answer], chunk: Chunk) -> Answer:
    with single_threaded():
        return function(chunk)


#: What a forked process inherits: a function and chunks that need not be picklable, nor copied.
_held: tuple[Callable[[Any], Any], Sequence[Any]]


def _hold(function: Callable[[Any], Any], chunks: Sequence[Any]) -> None:
    global _held
    _held = function, chunks


def _call(index: int) -> Any:
    function, chunks = _held
    return function(chunks[index])


#: Of a process in a team: its number, what it holds, how many are done, and where all wait for each other.
_membership: tuple[int, Any, Any, Any]


def _join(held: Any, members: Any, done: Any, barrier: Any) -> None:
    global _membership
    with members.get_lock():
        number = members.value
        members.value += 1
    _membership = number, held, done, barrier


def _share(function: Callable[[Any, Any, int], Any], task: Any, count: int, of: int) -> tuple[int, list[Any]]:
    number, held, done, barrier = _membership
    barrier.wait()  # until each has one: else a quick process would take a second, and do its own share twice
    answers = []
    for k in range(number, count, of):
        answers.append(function(held, task, k))
        with done.get_lock():
            done.value += 1
    return number, answers


def one_thread(function: Callable[Arguments, Answer]) -> Callable[Arguments, Answer]:
    """The function with one BLAS thread: several wait for each other longer than they compute where matrices are small."""

    @wraps(function)
    def alone(*arguments: Arguments.args, **named: Arguments.kwargs) -> Answer:
        with single_threaded():
            return function(*arguments, **named)

    return alone


def single_threaded() -> AbstractContextManager[Any]:
    """One thread of BLAS and OpenMP, from now on and until the ``with`` block ends, if it is used in one."""
    limited: AbstractContextManager[Any] = _thread_pools(frozenset(sys.modules)).limit(limits=1)
    return limited


@lru_cache(maxsize=1)
def _thread_pools(modules: frozenset[str]) -> Any:
    """The libraries that have threads, sought anew only after an import: of all that are loaded it takes a while.

    Args:
        modules: names of what is imported, with which such libraries are loaded.
    """
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
