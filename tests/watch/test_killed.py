"""kill -9 at any moment: the next call makes good what is missing, to the byte."""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest
from operation import contents

from armloop.cli import main

pytestmark = pytest.mark.slow

KILLS = 20
# Everything is imported once, and each call is a fork of that, so that the kill falls into the work. No thread may run
# before a fork: that is why this is a process of its own.
DRIVER = """
import os, random, shutil, signal, sys, time
import armloop.commands.watch, armloop.watch, armloop.reports.watch_tables, pyarrow.parquet, scipy.signal
from pathlib import Path
from armloop.cli import main

kills, takes, store, words = int(sys.argv[1]), float(sys.argv[2]), Path(sys.argv[3]), sys.argv[4:]
rng, killed = random.Random(0), 0
for attempt in range(5 * kills):
    child = os.fork()
    if child == 0:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        os._exit(main(["watch", *words, "--store", str(store)]))
    # most of a call is reading logs, of which each kill leaves fewer to do: aim at what is left
    left = 1.0 - len(list(store.glob("sums/*/*/*.parquet"))) / 40
    time.sleep(rng.uniform(0.0, 0.3) * takes * max(left, 0.1))
    os.kill(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        killed += 1
    else:  # it had come to its end: begin again
        shutil.rmtree(store)
    if killed == kills:
        break
print(killed)
"""


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory, fleet: Path) -> Path:
    """One arm's logs, so that a call takes a second or two and has an alarm."""
    root = tmp_path_factory.mktemp("small")
    shutil.copytree(fleet / "logs" / "loaded", root / "logs" / "loaded")
    shutil.copytree(fleet / "models", root / "models")
    (root / "logs" / "loaded" / "broken.csv").write_text("time\n", encoding="utf-8")
    return root


@pytest.mark.long
def test_killed_at_random_moments(small: Path, tmp_path: Path) -> None:
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    words = ["--models", str(small / "models"), "--logs", str(small / "logs"), "--sums-only"]
    began = time.monotonic()
    assert main(["watch", *words, "--store", str(whole)]) == 3
    takes = time.monotonic() - began
    done = subprocess.run(
        [sys.executable, "-c", DRIVER, str(KILLS), str(takes), str(broken), *words],
        capture_output=True,
        text=True,
        check=True,
        timeout=300,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )
    assert done.stdout.split() == [str(KILLS)], done.stderr
    assert main(["watch", *words, "--store", str(broken)]) in (0, 3)
    assert contents(broken) == contents(whole)


def test_an_alarm_that_was_not_told_is_told_by_the_next_call(small: Path, tmp_path: Path) -> None:
    store = tmp_path / "store"
    words = [
        "--models",
        str(small / "models"),
        "--logs",
        str(small / "logs"),
        "--sums-only",
        "--store",
        str(store),
    ]
    assert main(["watch", *words]) == 3
    (store / "announced.json").unlink()
    assert main(["watch", *words]) == 3
    assert main(["watch", *words]) == 0


def test_two_at_once_are_refused(small: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import fcntl

    from armloop.watch.store import Store

    Store(tmp_path / "store")
    with (tmp_path / "store" / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        words = ["--models", str(small / "models"), "--logs", str(small / "logs")]
        assert main(["watch", *words, "--store", str(tmp_path / "store")]) == 2
    assert "another armloop watch is at work" in capsys.readouterr().err
