"""A fleet under watch: logs per second on one worker and on two, memory, and what is kept of an hour of operation.

Logs are simulated cheaply: the torque of the three-axis model on one of a few motions, an error as measured (coloured
noise, friction that differs by a per cent from log to log), and on five arms a joint's friction that grows by 1 % a day
from the thirtieth log on, ten logs a day. Workers are processes of this machine (`--jobs`); `--scheduler` maps the same
pieces over a Dask cluster. The rival is reading the raw logs anew whenever a window is asked about: bytes kept and time
per log stand beside theirs.

    python benchmarks/fleet.py [--arms 100] [--logs 100] [--seconds 20]
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
from scipy.signal import lfilter

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from operation import healthy_model  # noqa: E402
from synthetic import fourier_motion, friction, measured, rigid_torque, three_axis  # noqa: E402

from armloop.data.log import read_log, write_log  # noqa: E402

MOTIONS, WORN, FROM = 25, 5, 30
#: Runs the command and prints the peak memory of the process and of its workers, MB, and their processor time, s.
CHILD = """
import resource, sys
from armloop.cli import main
status = main(sys.argv[1:])
used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
print("peak", max(one.ru_maxrss for one in used) / 1024, file=sys.stderr)
print("processor", sum(one.ru_utime + one.ru_stime for one in used), file=sys.stderr)
sys.exit(status)
"""


def simulate(root: Path, arms: int, logs: int, seconds: float) -> None:
    """Write the fleet."""
    arm = three_axis()
    motions = [fourier_motion(seconds, 60.0, seed) for seed in range(MOTIONS)]
    rigid = [rigid_torque(arm, m.q, m.v, m.vdot) for m in motions]
    rubbing = [friction(m.v) for m in motions]
    model = healthy_model()
    (root / "models").mkdir(parents=True)
    for a in range(arms):
        name = f"arm{a:03d}"
        model.save(root / "models" / f"{name}.json")
        (root / "logs" / name).mkdir(parents=True)
        rng = np.random.default_rng([1, a])
        for k in range(logs):
            at = int(rng.integers(MOTIONS))
            motion, wear = motions[at], 1 + 0.01 * rng.standard_normal(3)
            if a < WORN:
                wear[a % 3] += 0.001 * max(0, k - FROM)
            tau = rigid[at] + rubbing[at] * wear + 0.03 * np.sin(2 * motion.q + 1) * [1.0, 2.0, 0.5]
            slow = lfilter([np.sqrt(1 - 0.95**2)], [1, -0.95], rng.standard_normal(tau.shape), axis=0)
            log = measured(motion, tau + 0.02 * np.sqrt((tau**2).mean(axis=0)) * slow, 1000 * a + k)
            when = datetime(2026, 1, 1) + timedelta(hours=2.4 * k)
            write_log(root / "logs" / name / f"{when:%Y-%m-%dT%H-%M-%S}.parquet", log)


def watch(root: Path, store: str, jobs: int, logs: list[str]) -> tuple[float, float, float, dict]:
    """Run the command; return seconds, peak memory in MB, seconds of processor time, and its answer."""
    words = [
        "watch",
        "--models",
        str(root / "models"),
        "--logs",
        *logs,
        "--store",
        str(root / store),
        "--json",
    ]
    began = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", CHILD, *words, "--sums-only", "--jobs", str(jobs)],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )
    took = time.perf_counter() - began
    if done.returncode not in (0, 3):
        raise SystemExit(done.stderr)
    peak, processor = (
        float(next(line.split()[1] for line in done.stderr.splitlines() if line.startswith(word)))
        for word in ("peak", "processor")
    )
    return took, peak, processor, json.loads(done.stdout)


def size(folder: Path) -> int:
    """Bytes of the files below a folder."""
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


def run() -> None:
    """Parse, simulate, watch, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--arms", type=int, default=100)
    parser.add_argument("--logs", type=int, default=100)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument(
        "--logs-in", type=Path, default=None, help="folder in which simulate() has put such a fleet before"
    )
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        root = Path(temporary)
        began = time.perf_counter()
        hours = options.arms * options.logs * options.seconds / 3600
        if options.logs_in is None:
            simulate(root, options.arms, options.logs, options.seconds)
        else:
            for part in ("models", "logs"):
                (root / part).symlink_to(options.logs_in.resolve() / part)
        count = options.arms * options.logs
        print(
            f"{count} logs of {options.arms} arms, {hours:.1f} h, simulated in {time.perf_counter() - began:.0f} s",
            flush=True,
        )
        # a folder with a tenth of the arms: start-up and memory of a small fleet, by one worker
        few = root / "few"
        few.mkdir()
        for path in sorted((root / "logs").iterdir())[: max(1, options.arms // 10)]:
            (few / path.name).symlink_to(path)
        names = sorted(path.name for path in few.iterdir())
        part = len(names) * options.logs
        one, small, busy, _ = watch(root, "one", 1, [str(few)])
        two, large, busier, answer = watch(root, "two", 2, [str(root / "logs")])
        again, _, _, same = watch(root, "two", 2, [str(root / "logs")])
        raw = sorted((root / "logs" / names[0]).iterdir())
        began = time.perf_counter()
        for path in raw[:20]:
            read_log(path)
        reading = (time.perf_counter() - began) / min(20, len(raw))
        kept, given = size(root / "two" / "sums"), size((root / "logs").resolve())
        found = sorted({alarm["arm"] for alarm in answer["new"]})
        worn = [f"arm{a:03d}" for a in range(min(WORN, options.arms))]
        rows = {
            "one worker": f"{part / one:8.1f} logs/s   {part} logs in {one:.0f} s, tests included; peak {small:.0f} MB",
            "two workers": f"{count / two:8.1f} logs/s   {count} logs in {two:.0f} s; peak {large:.0f} MB per process",
            "processor": f"{1e3 * busy / part:8.0f} ms of it per log by one worker, {1e3 * busier / count:.0f} ms by two",
            "nothing new": f"{count / again:8.1f} logs/s   looked at, hashed, known: {same['logs']['known']}",
            "reading raw": f"{1 / reading:8.1f} logs/s   only to have them in memory",
            "kept": f"{kept / hours / 1e6:8.2f} MB per hour of operation; the raw logs have {given / hours / 1e6:.2f}",
            "worn arms": f"{len(set(found) & set(worn)):8d} of {len(worn)} found",
            "others": f"{len(set(found) - set(worn)):8d} alarms in {hours:.0f} h; promised one in 1000 h of each",
        }
        for name, text in rows.items():
            print(f"{name:14s}{text}")
        for alarm in answer["new"]:
            effect = alarm["effects"][0] if alarm["effects"] else {"effect": "not named", "joint": None}
            what = f"{effect['effect']} joint {effect['joint']}, {alarm['course']['form']}"
            print(f"  {alarm['arm']}: {what}, since {alarm['since_log']}, alarm {alarm['log']}")
        day, rate = 10_000 * 86400 / options.seconds, count / busier
        print(
            f"on paper, 10,000 arms day and night in logs of {options.seconds:g} s: {day:.3g} logs and "
            f"{24e4 * kept / hours / 1e12:.2f} TB kept a day,\n{day / rate / 86400:.0f} workers with a processor each, "
            f"{rate:.1f} logs/s; one such log an hour from each: {2.4e5 / rate / 3600:.1f} worker hours and "
            f"{2.4e5 * kept / count / 1e9:.1f} GB a day"
        )


if __name__ == "__main__":
    run()
