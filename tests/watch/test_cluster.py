"""Over a Dask cluster, and with a worker killed in the middle, the store is the same to the byte."""

import os
import signal
import threading
import time
from pathlib import Path

import pytest
from operation import contents

from armloop.watch import Options, watch
from armloop.watch.sources import find_logs

distributed = pytest.importorskip("distributed")
pytestmark = [pytest.mark.slow, pytest.mark.long]
BESIDE = ("healthy", "2026-01-01")


@pytest.mark.filterwarnings("ignore")
def test_a_killed_worker_loses_nothing(fleet: Path, tmp_path: Path) -> None:
    # of one arm all, so that there is an alarm, and enough of another that both workers have to do
    files = [
        f for f in find_logs([fleet / "logs"]) if f.arm == "loaded" or (f.arm, f.path.name[:10]) == BESIDE
    ]
    plain = watch(fleet / "models", files, tmp_path / "plain", Options(full=False))
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:
        victim = next(iter(cluster.workers.values())).pid

        def kill() -> None:
            deadline = time.monotonic() + 60
            while time.monotonic() < deadline:
                if len(list((tmp_path / "killed").glob("sums/*/*/*.parquet"))) >= 5:
                    os.kill(victim, signal.SIGKILL)
                    return
                time.sleep(0.02)

        killer = threading.Thread(target=kill)
        killer.start()
        options = Options(full=False, scheduler=cluster.scheduler_address)
        outcome = watch(fleet / "models", files, tmp_path / "killed", options)
        killer.join()
    assert outcome.new == plain.new and len(plain.new) == 1
    mine, theirs = contents(tmp_path / "killed"), contents(tmp_path / "plain")
    # a draft of the killed worker may lie about until it is old enough to be nobody's
    assert {k: v for k, v in mine.items() if not k.endswith(".part")} == theirs
