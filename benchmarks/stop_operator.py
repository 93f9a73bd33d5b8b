"""The stop operator over turns of the motion against its recursion sample by sample: wall time of six joints.

python benchmarks/stop_operator.py
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from armloop.laws.hysteresis import stop_operator
from armloop.reports.tables import table

SAMPLES = 100_000


def main() -> None:
    """Print the ratio."""
    q = np.random.default_rng(1).normal(size=(SAMPLES, 6)).cumsum(axis=0)
    ours, by_sample = best(lambda: stop_operator(q, 1.0)), best(lambda: recursion(q, 1.0))
    rows = [
        ["over turns", f"{ours:.3f} s", 1.0],
        ["sample by sample", f"{by_sample:.3f} s", by_sample / ours],
    ]
    print(table(["", "time", "times ours"], rows, f"Stop operator, {SAMPLES} samples of six joints"))


def recursion(q: np.ndarray, width: float) -> np.ndarray:
    """Its definition."""
    z = np.zeros_like(q)
    for k in range(1, len(q)):
        z[k] = np.clip(z[k - 1] + q[k] - q[k - 1], -width, width)
    return z / width


def best(of: Callable[[], object], repeats: int = 3) -> float:
    """Seconds of the fastest repetition."""
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        of()
        times.append(time.perf_counter() - begin)
    return min(times)


if __name__ == "__main__":
    main()
