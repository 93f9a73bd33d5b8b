"""A log that no memory need hold: how fast it is reconstructed, and in how much memory.

Samples of the three-axis arm with friction and 1 % torque noise are drawn anew, from seeds, whenever a pass over the
data asks for them; a chunk holds static (creeping), constant-velocity and varying ones, 1 : 10 : 10 as in the paper.
Every size is reconstructed by the stepwise method in processes of its own; the time contains the drawing.

    python benchmarks/ten_million_samples.py [--samples 10000000] [--jobs 2] [--library rigid-body]
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import time
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from armloop.data.log import MotionLog
from armloop.data.pieces import PIECE
from armloop.data.signals import Conditioning
from armloop.identification.reconstruction import LIBRARIES, reconstruct
from armloop.reports.tables import table
from armloop.robot.arm import Arm, load_arm
from armloop.robot.kinematics import nominal_parameters
from armloop.robot.newton_euler import inverse_dynamics
from armloop.util.functions import NUMPY
from armloop.util.workers import Processes

LOWER, UPPER = np.array([-1.5, -1.0, -3.1]), np.array([1.5, 1.0, 3.1])
COULOMB, VISCOUS = np.array([0.557, 0.757, 0.585]), np.array([2.65, 1.82, 3.14])
STATIC, STRIBECK = 1.3 * COULOMB, 0.1
CREEP, FASTEST, STEEPEST, NOISE = 0.00175, 1.57, 3.1, 0.01
#: Samples whose torque is drawn at a time.
ROWS = 4096


@cache
def arm() -> Arm:
    """The paper's three-axis arm."""
    return load_arm("three_axis")


@dataclass(frozen=True)
class Drawn:
    """A chunk of a log that is drawn whenever it is read."""

    seed: int
    samples: int
    joints: int = 3

    @property
    def name(self) -> str:
        """What to call it."""
        return "drawn"

    def read(self) -> MotionLog:
        """The same samples every time."""
        rng, N = np.random.default_rng(self.seed), self.samples
        kind = np.searchsorted([N // 21, N // 21 * 11], np.arange(N), side="right")[:, None]
        q = rng.uniform(LOWER, UPPER, (N, 3))
        v = np.where(kind > 0, rng.uniform(-FASTEST, FASTEST, q.shape), rng.choice([-CREEP, CREEP], q.shape))
        vdot = rng.uniform(-STEEPEST, STEEPEST, q.shape) * (kind > 1)
        level = COULOMB + (STATIC - COULOMB) * np.exp(-((v / STRIBECK) ** 2))
        tau = rigid_body(q, v, vdot) + level * np.sign(v) + VISCOUS * v
        tau += NOISE * np.std(tau, axis=0) * rng.normal(size=q.shape)
        return MotionLog(np.arange(float(N)), q, v, tau, vdot, "drawn")


def rigid_body(q: np.ndarray, v: np.ndarray, vdot: np.ndarray) -> np.ndarray:
    """(N, 3) inverse dynamics of the arm's nominal links."""
    torque = inverse_dynamics(arm(), nominal_parameters(arm()), functions=NUMPY)
    # Some at a time: the recursion holds a hundred arrays, which would count as memory that a reconstruction needs.
    parts = ([list(x[k : k + ROWS].T) for x in (q, v, vdot)] for k in range(0, len(q), ROWS))
    return np.concatenate([np.array(torque(*part)).T for part in parts])


def chunks(samples: int) -> list[Drawn]:
    """Chunks of at most :data:`PIECE` samples, each with a seed of its own."""
    edges = np.linspace(0, samples, -(-samples // PIECE) + 1).astype(int)
    return [Drawn(seed, int(size)) for seed, size in enumerate(np.diff(edges))]


def run(samples: int, jobs: int, library: str) -> dict:
    """Reconstruct, and say how long it took, in how much memory, and what came out."""
    start = time.perf_counter()
    result = reconstruct(
        chunks(samples),
        arm(),
        library=library,
        conditioning=Conditioning(cutoff_hz=0),
        workers=Processes(jobs),
        in_memory=0,  # small logs, too, take the way of large ones here
    )
    seconds = time.perf_counter() - start
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return {
        "seconds": seconds,
        "cpu": sum(u.ru_utime + u.ru_stime for u in used),
        "main": peak(),
        "worker": resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024,
        "terms": np.sum([report.terms for report in result.reports], axis=0).tolist(),
        "nrmse": result.held_out.moving["nrmse"],
    }


def peak() -> float:
    """The largest memory this process has had so far, MB."""
    status = Path("/proc/self/status").read_text()
    return int(next(line for line in status.splitlines() if line.startswith("VmHWM")).split()[1]) / 1024


def main() -> None:
    """Run the sizes, each in a process of its own, and print the table."""
    parser = argparse.ArgumentParser(description="reconstruction in constant memory")
    parser.add_argument("--samples", type=int, default=1_000_000, help="largest size (%(default)s)")
    parser.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)), help="(%(default)s)")
    parser.add_argument("--library", choices=LIBRARIES, default="double-feature-set", help="(%(default)s)")
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        print(json.dumps(run(options.samples, options.jobs, options.library)))
        return
    rows = []
    sizes = [size for size in (100_000, 1_000_000, 10_000_000) if size < options.samples]
    for size in (*sizes, options.samples):
        command = [
            sys.executable,
            __file__,
            "--one",
            "--samples",
            str(size),
            "--jobs",
            str(options.jobs),
            "--library",
            options.library,
        ]
        threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
        answer = subprocess.run(
            command, env={**os.environ, **threads}, stdout=subprocess.PIPE, text=True, check=True
        )
        out = json.loads(answer.stdout)
        rows.append(
            [
                f"{size:,}",
                f"{out['seconds']:.1f} s",
                f"{out['cpu']:.1f} s",
                f"{size / out['seconds']:,.0f}",
                f"{out['main']:.0f} MB",
                f"{out['worker']:.0f} MB",
                "/".join(map(str, out["terms"])),
                "/".join(f"{100 * x:.2f} %" for x in out["nrmse"]),
            ]
        )
    header = [
        "samples",
        "time",
        "CPU time",
        "samples/s",
        "peak, main",
        "peak, worker",
        "terms",
        "held-out nRMSE",
    ]
    print(table(header, rows, f"{options.library}, {options.jobs} processes"))
    if options.samples < 10_000_000:
        print("ten million: python benchmarks/ten_million_samples.py --samples 10000000")


if __name__ == "__main__":
    main()
