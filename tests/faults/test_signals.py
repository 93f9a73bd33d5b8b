"""Signals, a full disk and no memory: one line, nothing half-written, no worker that lives on."""

import errno
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from faults.conftest import contents

from armloop.cli import main
from armloop.data.log import read_log
from armloop.util.files import replacing

#: A command whose two workers are at work for a minute; what it imports itself takes no time.
# Whoever runs the tests in the background has Ctrl-C ignored, and children inherit that.
WORKING = """
import signal, sys, time
signal.signal(signal.SIGINT, signal.default_int_handler)
from armloop import cli
from armloop.util.files import replacing
from armloop.util.workers import Processes
import armloop.commands.evaluate as command
def run(options):
    with replacing("half.csv") as draft:
        draft.write_text("1")
        list(Processes(2).map(time.sleep, [60, 60]))
command.run = run
sys.exit(cli.main(["evaluate", "model.json", "run.csv"]))
"""


def start(place: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", WORKING],
        cwd=place,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONUNBUFFERED": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def children(pid: int) -> list[int]:
    found = []
    for task in Path(f"/proc/{pid}/task").iterdir():
        found += [int(child) for child in (task / "children").read_text().split()]
    return found


def wait_for(what: Callable[[], object], seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < end, "it did not come"
        time.sleep(0.05)


def alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.mark.parametrize(
    ("sent", "status", "said"),
    [
        (signal.SIGINT, 130, "armloop: interrupted\n"),
        (signal.SIGTERM, 143, "armloop: ended on request (SIGTERM)\n"),
        (signal.SIGKILL, -9, ""),
    ],
)
def test_a_signal_ends_workers_too_with_one_line(sent: int, status: int, said: str, place: Path) -> None:
    process = start(place)
    wait_for(lambda: len(children(process.pid)) >= 2)
    workers = children(process.pid)
    if sent == signal.SIGINT:
        os.killpg(process.pid, sent)  # as a terminal does
    else:
        process.send_signal(sent)
    _, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (status, said)
    wait_for(lambda: not any(map(alive, workers)), 10.0)
    assert not (place / "half.csv").exists()
    # what is killed cannot tidy up; the next draft does
    assert sent == signal.SIGKILL or not [path for path in contents(place) if path.endswith(".part")]
    with replacing(place / "half.csv") as draft:
        draft.write_text("2")
    assert not [path for path in contents(place) if path.endswith(".part")]


def test_an_answer_for_which_there_is_no_room_is_said_so(
    place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """What is written to the standard output alone has no name."""

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("armloop.commands.evaluate.run", full)
    assert main(["evaluate", "model.json", "run.csv"]) == 2
    assert capsys.readouterr().err == "armloop: No space left on device; make room, or write elsewhere\n"


def test_a_full_disk_is_one_line_and_leaves_nothing(
    place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    log = read_log(place / "run.csv")
    monkeypatch.setattr(
        "armloop.workflows.collect_logs", lambda *_: {"static": log.select(slice(0, 50)), "varying": log}
    )
    before, limit = contents(place), resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, limit[1]))
    try:
        status = main(["collect", "three_axis", "--out", "logs"])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limit)
    err = capsys.readouterr().err
    assert status == 2
    assert err.startswith("armloop: ") and err.count("\n") == 1 and "cannot be written" in err
    left = {path for path in contents(place) if path not in before and not path.endswith(".armloop")}
    assert left == {"logs/static.csv"}  # whole, for it was written before the disk was full


def test_too_little_memory_is_one_line(place: Path) -> None:
    program = """
import sys
from armloop import cli
import armloop.commands.evaluate as command
def run(options): raise MemoryError
command.run = run
sys.exit(cli.main(["evaluate", "model.json", "run.csv"]))
"""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False, cwd=place
    )
    assert done.returncode == 1
    assert done.stderr.startswith("armloop: not enough memory") and done.stderr.count("\n") == 1


def test_too_little_memory_for_a_library_is_one_line(monkeypatch, capsys) -> None:
    def missing(options: object) -> None:
        raise ImportError("libopenblas.so: failed to map segment from shared object")

    monkeypatch.setattr("armloop.commands.cluster.run", missing)
    assert main(["cluster", "run.csv"]) == 1
    assert capsys.readouterr().err.startswith("armloop: not enough memory")


def test_an_end_during_a_compiled_modules_import_is_no_fault(monkeypatch, capsys) -> None:
    """Such a module's import calls whatever interrupts it an ImportError."""

    def ended(options: object) -> None:
        raise ImportError("initialization failed") from KeyboardInterrupt()

    monkeypatch.setattr("armloop.commands.cluster.run", ended)
    assert main(["cluster", "run.csv"]) == 130
    assert capsys.readouterr().err == "armloop: interrupted\n"
