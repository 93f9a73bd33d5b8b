"""Least squares in three steps against least squares in one shot, on the paper's SCARA simulation (Table 2).

Both solve the same data with `numpy.linalg.lstsq` at the paper's orders, in one run and one thread, so that
only the ratio counts: the paper's times give 1.48 s / 0.1165 s = 12.7.
"""

from __future__ import annotations

import time

import numpy as np
from threadpoolctl import threadpool_limits

from armloop.data.log import MotionLog
from armloop.data.motion import Motion
from armloop.drake.experiments.scenarios import load_plant
from armloop.experiment.sampling import inverse_dynamics_samples
from armloop.features.double_feature_set import DoubleFeatureSet
from armloop.reports.tables import table

STEPS = (("static", 1, 0, "none"), ("constant_velocity", 1, 2, "velocity"), ("varying", 1, 1, "acceleration"))
REPEATS = 5


def motion_of(log: MotionLog) -> Motion:
    """The states of a simulated log as one motion."""
    assert log.vdot is not None
    return Motion(log.time, log.q, log.v, log.vdot, np.array([0]))


def seconds(X: np.ndarray, tau: np.ndarray) -> float:
    """Best of several solves of all joints at once."""
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        np.linalg.lstsq(X, tau, rcond=None)
        times.append(time.perf_counter() - start)
    return min(times)


def main() -> None:
    """Time both and print the table."""
    plant = load_plant("scara")
    revolute = tuple(bool(r) for r in plant.arm.revolute)
    logs = inverse_dynamics_samples(plant.arm, plant.config.ranges, (2000, 4000, 4000), seed=1)
    rows, total = [], 0.0
    with threadpool_limits(1):
        for name, N1, N2, second in STEPS:
            X = DoubleFeatureSet(revolute, N1, N2, second, independent=False).columns(motion_of(logs[name]))
            taken = seconds(X, logs[name].tau)
            total += taken
            rows.append([name, X.shape[1], X.shape[0], f"{1e3 * taken:.2f} ms"])
        parts = [
            DoubleFeatureSet(revolute, 1, 2, "both", independent=False).columns(motion_of(log))
            for log in logs.values()
        ]
        X, tau = np.vstack(parts), np.vstack([log.tau for log in logs.values()])
        one_shot = seconds(X, tau)
    rows.append(["one shot", X.shape[1], X.shape[0], f"{1e3 * one_shot:.2f} ms"])
    print(table(["regression", "candidates", "samples", "time"], rows, "SCARA, least squares"))
    print(f"the steps together are {one_shot / total:.1f} times faster than one shot (paper: 12.7)")


if __name__ == "__main__":
    main()
