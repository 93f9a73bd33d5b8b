"""Dynamic contexts of a coverage: which tests of a file execute which lines of the package, and how long each takes.

What the import, or a fixture of more than one test executes is put down to every test of the file. A test is left after
``ENOUGH`` seconds: it counts as slow, and what it executes later is not known.
"""

from __future__ import annotations

import ctypes
import functools
import hashlib
import json
import multiprocessing
import os
import signal
import sys
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from places import PACKAGE, ROOT

ARGUMENTS = [
    "-q",
    "-x",
    "-n",
    "0",
    "-m",
    "not long",
    "-p",
    "no:cacheprovider",
    f"--rootdir={ROOT}",
]
#: Where maps and results are kept.
KEPT = ROOT / "out" / "mutants"
#: Seconds of the processor after which a test is left while its lines are traced.
ENOUGH = 3.0
#: What such a test may take beyond.
WHOLE = 15.0
#: Seconds without any work after which a process waits for something that will not come.
WAITING = 300.0


@dataclass(frozen=True)
class Traced:
    """A test: how long it takes (s, while traced; of one that was left, at most), whether it is slow, by its mark or
    because it was left, and the lines it executes by the package's file."""

    name: str
    seconds: float
    slow: bool
    lines: dict[str, frozenset[int]]


class _Contexts:
    """A plugin of pytest that tells the tracer whose lines follow."""

    def __init__(self, tracer: Any) -> None:
        self.tracer, self.seconds, self.slow, self._test = tracer, dict[str, float](), set[str](), ""
        self.left = set[str]()
        signal.signal(signal.SIGPROF, self._leave)

    def _leave(self, *_: Any) -> None:
        if multiprocessing.active_children():  # they would be left with locks that nobody opens
            signal.setitimer(signal.ITIMER_PROF, 1.0)
            return
        self.slow.add(self._test)
        self.left.add(self._test)
        pytest.skip("enough")

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        # what a test finds in a cache it would else have executed
        for module in list(sys.modules.values()):
            if (getattr(module, "__file__", None) or "").startswith(
                str(ROOT)
            ) and "/.venv/" not in module.__file__:
                for each in list(vars(module).values()):
                    if isinstance(each, functools._lru_cache_wrapper):
                        each.cache_clear()
        self._test = item.nodeid
        self.tracer.switch_context(self._test)
        begin = time.process_time()
        result = yield
        self.seconds[item.nodeid] = time.process_time() - begin
        if self._test in self.left:
            self.seconds[self._test] += WHOLE
        if item.get_closest_marker("slow"):
            self.slow.add(item.nodeid)
        self.tracer.switch_context("")
        return result

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self) -> Iterator[None]:
        signal.setitimer(signal.ITIMER_PROF, ENOUGH)
        try:
            return (yield)
        except Exception:
            if self._test in self.left:  # a binding may make something else of being told to leave
                pytest.skip("enough")
            raise
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0.0)

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: Any) -> Iterator[None]:
        if fixturedef.scope != "function":
            self.tracer.switch_context("")
        result = yield
        self.tracer.switch_context(self._test)
        return result


def _trace(file: Path, out: Path) -> None:
    """In a process of its own: run the file's tests, and write which executed what."""
    import coverage

    sys.path.insert(0, str(ROOT / "src"))
    tracer = coverage.Coverage(
        data_file=None, config_file=False, source=[str(ROOT / PACKAGE)], messages=False
    )
    tracer.start()
    plugin = _Contexts(tracer)
    status = pytest.main([*ARGUMENTS, str(file)], plugins=[plugin])
    tracer.stop()
    if status not in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED):
        os._exit(1)
    data = tracer.get_data()
    lines: dict[str, dict[str, list[int]]] = defaultdict(dict)
    for path in data.measured_files():
        of_line = data.contexts_by_lineno(path)
        for line, contexts in of_line.items():
            for context in contexts:
                lines[context].setdefault(str(Path(path).relative_to(ROOT)), []).append(line)
    executed = {path for context, of in lines.items() if context for path in of}
    files = {path: _digest(ROOT / path) for path in sorted(executed)}
    out.write_text(
        json.dumps({"seconds": plugin.seconds, "slow": sorted(plugin.slow), "files": files, "lines": lines})
    )


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()[:24]


def _as_it_was(files: dict[str, str]) -> bool:
    return all((ROOT / path).exists() and _digest(ROOT / path) == content for path, content in files.items())


def ends_with_parent() -> None:
    """In a forked process: be killed when the one that made it ends (Linux: prctl PR_SET_PDEATHSIG)."""
    ctypes.CDLL(None).prctl(1, signal.SIGKILL)


def _worked(session: int) -> int:
    """Ticks of the processor's time that the processes of a session have had (Linux: proc_pid_stat(5))."""
    ticks = 0
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text(encoding="utf-8").rsplit(")", 1)[1].split()
        except OSError:
            continue  # it has ended
        if int(fields[3]) == session:  # its workers', too: while they work, it waits
            ticks += int(fields[11]) + int(fields[12])
    return ticks


def ended(child: int) -> int:
    """The exit status of a child, whose session is ended with it; of one that only waits, that of being killed."""
    worked, since = -1, time.monotonic()
    while not (done := os.waitpid(child, os.WNOHANG))[0] and time.monotonic() < since + WAITING:
        if (now := _worked(child)) != worked:
            worked, since = now, time.monotonic()
        time.sleep(0.02)
    try:
        os.killpg(child, signal.SIGKILL)
    except (ProcessLookupError, PermissionError):
        pass
    return os.waitstatus_to_exitcode((done if done[0] else os.waitpid(child, 0))[1])


def forked(function: Any, *arguments: Any) -> int:
    """The exit status of a function called in a forked process whose output goes nowhere; negative if it only waited."""
    child = os.fork()
    if not child:
        status = 1
        try:
            os.setsid()
            ends_with_parent()
            with open(os.devnull, "w") as nowhere, redirect_stdout(nowhere), redirect_stderr(nowhere):
                os.dup2(nowhere.fileno(), 1)
                os.dup2(nowhere.fileno(), 2)
                function(*arguments)
            status = 0
        finally:
            os._exit(status)
    return ended(child)


def traced(file: Path) -> list[Traced]:
    """The tests of a file, from what is kept if neither they nor what they execute have changed since."""
    content = hashlib.sha256()
    helpers = [*(ROOT / "tests").glob("*.py"), *file.parent.glob("conftest.py"), file]
    for path in sorted(helpers):
        content.update(path.read_bytes())
    name = "-".join(file.relative_to(ROOT / "tests").with_suffix("").parts)
    kept = KEPT / f"{name}-{content.hexdigest()[:24]}.json"
    if not (kept.exists() and _as_it_was(json.loads(kept.read_text())["files"])):
        KEPT.mkdir(parents=True, exist_ok=True)
        for former in KEPT.glob(f"{name}-????????????????????????.*"):
            former.unlink()
        # a test that is left may leave a lock that nobody opens: then once more
        status = next((s for _ in range(3) if (s := forked(_trace, file, kept)) >= 0), 1)
        if status:
            sys.exit(f"the tests of {file.relative_to(ROOT)} fail without any change")
    answer = json.loads(kept.read_text())
    shared = answer["lines"].get("", {})
    return [
        Traced(
            name,
            seconds,
            name in answer["slow"],
            {
                path: frozenset(own.get(path, [])) | frozenset(shared.get(path, []))
                for path in {*own, *shared}
            },
        )
        for name, seconds in answer["seconds"].items()
        for own in (answer["lines"].get(name, {}),)
    ]
