"""Least squares by moments against `numpy.linalg.lstsq` and pysindy: time, memory and held-out error.

The data are the paper's for the three-axis arm (Sect. 4.2): 1,000 static, 10,000 constant-velocity and 10,000 varying
samples without noise. One shot: 21,000 samples, the paper's 5,880 candidates, three joints. Steps: 28, 2,100 and 840
candidates, each step inheriting the last. Every contender runs in a process of its own with one thread; times are CPU
seconds, best of the repetitions where a run is short. For the moments they contain everything from the samples to the
coefficients; for `lstsq` only the solution, not the filling of its matrix. Memory is the peak of the process, and in
brackets what it grew by.

    python benchmarks/moments_against_lstsq.py [--quick]
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np

from armloop.data.motion import Motion
from armloop.features.angle_sums import AngleSums
from armloop.features.double_feature_set import DoubleFeatureSet
from armloop.features.wave_moments import WaveProducts
from armloop.reports.tables import table
from armloop_paper.refined import refined

Array = np.ndarray
CONDITIONS = ("static", "constant_velocity", "varying")
REVOLUTE = (True, True, True)
ONE_SHOT = (4, 2, "both")
STEPS = ((2, 0, "none"), (4, 2, "velocity"), (4, 1, "acceleration"))
CONTENDERS = ("moments", "lstsq", "pysindy")
#: Ridge of pysindy's STLSQ, whose threshold is 0: without one its normal equations are singular. Its refit without
#: the ridge is left out, which would be `lstsq` once more.
RIDGE = 1e-9


def main() -> None:
    """Run every contender on both tasks and print the tables."""
    parser = argparse.ArgumentParser(description="least squares by moments against lstsq and pysindy")
    parser.add_argument("--quick", action="store_true", help="orders up to 2 only (the error stays)")
    parser.add_argument("--contender", choices=CONTENDERS, help=argparse.SUPPRESS)
    parser.add_argument("--task", choices=("one_shot", "steps"), help=argparse.SUPPRESS)
    parser.add_argument("--data", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.contender:
        print(json.dumps(run(options.contender, options.task, options.data, options.quick)))
        return
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder) / "data.npz"
        write_data(data)
        results = {task: {c: child(c, task, data, options.quick) for c in CONTENDERS} for task in TASKS}
    for task, title in TASKS.items():
        show(title, results[task])
    print()
    for contender in ("lstsq", "moments"):
        ratio = results["one_shot"][contender]["seconds"] / results["steps"][contender]["seconds"]
        print(f"one shot takes {ratio:.1f} times as long as the steps by {contender} (paper: 15.5)")
    floor = results["one_shot"]["moments"]
    print(
        f"one shot by moments: {floor['seconds']:.2f} s; its matrix product ({floor['product']:.1f} Gflop at "
        f"{floor['gemm']:.0f} Gflop/s) and factorisation ({floor['cholesky']:.1f} Gflop at {floor['potrf']:.0f} Gflop/s) "
        f"alone: {floor['floor']:.2f} s, {100 * floor['floor'] / floor['seconds']:.0f} % of it"
    )


TASKS = {"one_shot": "One shot", "steps": "The three steps together"}


def show(title: str, results: dict[str, dict]) -> None:
    """Print one task's table."""
    ours, rows = results["moments"], []
    for name, result in results.items():
        rows.append(
            [
                name,
                result["candidates"],
                f"{result['seconds']:.3g} s",
                f"{result['seconds'] / ours['seconds']:.1f}",
                f"{max(result['held_out']):.1e}",
                f"{result['peak']:.0f} MB ({result['growth']:.0f})",
                f"{result['peak'] / ours['peak']:.1f} ({result['growth'] / ours['growth']:.1f})",
            ]
        )
    header = ["", "candidates", "CPU time", "times ours", "held-out error", "peak memory", "times ours"]
    print(table(header, rows, title))


def child(contender: str, task: str, data: Path, quick: bool) -> dict:
    """One contender in its own process with one thread."""
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    command = [sys.executable, __file__, "--contender", contender, "--task", task, "--data", str(data)]
    answer = subprocess.run(
        command + ["--quick"] * quick,
        env={**os.environ, **threads},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    result = json.loads(answer.stdout)
    print(f"  … {task}, {contender}: {result['seconds']:.3g} s", file=sys.stderr)
    return result


def write_data(path: Path) -> None:
    """Samples to fit (seed 1) and held-out ones (seed 2), written for the contenders."""
    from armloop.drake.experiments.scenarios import load_plant
    from armloop.experiment.sampling import inverse_dynamics_samples

    plant = load_plant("three_axis")
    arrays = {}
    for name, seed, counts in (("fit", 1, (1000, 10000, 10000)), ("check", 2, (5000, 5000, 5000))):
        logs = inverse_dynamics_samples(plant.arm, plant.config.ranges, counts, seed)
        for condition, log in logs.items():
            arrays[f"{name}_{condition}"] = np.stack([log.q, log.v, log.vdot, log.tau])
    np.savez(path, **arrays)


def run(contender: str, task: str, data: Path, quick: bool) -> dict:
    """Solve a task: CPU seconds, held-out error per joint, peak memory."""
    if contender == "pysindy":
        import pysindy  # noqa: F401  (what it loads is not what it needs to solve)
    with np.load(data) as file:
        arrays = {name: file[name] for name in file.files}
    solve = {"moments": by_moments, "lstsq": by_lstsq, "pysindy": by_pysindy}[contender]
    before = peak()
    if task == "one_shot":
        orders = lowered(ONE_SHOT, quick)
        fit, check = (together(arrays, part) for part in ("fit", "check"))
        seconds, predict, candidates = solve(*fit, orders)
        miss, scale = predict(check[0]) - check[1], check[1]
    else:
        seconds, candidates, predictors = 0.0, "", []
        for condition, orders in zip(CONDITIONS, STEPS, strict=True):
            motion, tau = unpack(arrays[f"fit_{condition}"])
            remainder = tau - sum(predict(motion) for predict in predictors)
            taken, predict, count = solve(motion, remainder, lowered(orders, quick))
            seconds += taken
            predictors.append(predict)
            candidates += f"{'/' * bool(candidates)}{count}"
        motion, scale = unpack(arrays["check_varying"])
        miss = sum(predict(motion) for predict in predictors) - scale
    grown = peak()
    held_out = np.sqrt(np.mean(miss**2, axis=0) / np.mean(scale**2, axis=0))
    answer = {
        "seconds": seconds,
        "candidates": candidates,
        "held_out": held_out.tolist(),
        "peak": grown,
        "growth": grown - before,
    }
    return answer | (floor(orders, len(fit[1])) if contender == "moments" and task == "one_shot" else {})


def lowered(orders: tuple[int, int, str], quick: bool) -> tuple[int, int, str]:
    """Orders of a quick run."""
    return (min(orders[0], 2), *orders[1:]) if quick else orders


def by_moments(motion: Motion, tau: Array, orders: tuple[int, int, str]) -> tuple:
    """The same functions as the paper's candidates, looked-up normal equations, refined on the data."""

    def solve() -> tuple[WaveProducts, Array]:
        library = AngleSums(REVOLUTE, *orders)
        waves = WaveProducts(library.factors, library.index)
        sums = waves.sums(motion, tau)
        gram = waves.gram(sums)
        return waves, refined(
            gram, sums.cross, lambda beta: waves.adjoint(motion, tau - waves.apply(motion, beta))
        )

    seconds, (waves, beta) = best_of(3, solve)
    size = DoubleFeatureSet(REVOLUTE, *orders, independent=False).size
    return seconds, lambda at: waves.apply(at, beta), size


def by_lstsq(motion: Motion, tau: Array, orders: tuple[int, int, str]) -> tuple:
    """The paper's candidates as columns of a matrix, solved by singular values."""
    library = DoubleFeatureSet(REVOLUTE, *orders, independent=False)
    X = library.columns(motion)
    seconds, beta = best_of(1, lambda: np.linalg.lstsq(X, tau, rcond=None)[0])
    return seconds, lambda at: in_pieces(library, at, beta), library.size


def by_pysindy(motion: Motion, tau: Array, orders: tuple[int, int, str]) -> tuple:
    """The paper's candidates by pysindy: a product of two polynomial libraries, regressed by STLSQ."""
    import pysindy
    from pysindy.feature_library.base import TensoredLibrary

    N1, N2, second = orders
    rates = {"none": (), "velocity": ("v",), "acceleration": ("vdot",), "both": ("v", "vdot")}[second]

    def inputs(at: Motion) -> Array:
        return np.hstack([np.sin(at.q), np.cos(at.q), *(getattr(at, rate) for rate in rates)])

    columns = inputs(motion).shape[1]
    first = pysindy.PolynomialLibrary(degree=N1)
    library = first
    if N2:
        parts = [first, pysindy.PolynomialLibrary(degree=N2)]
        uses = [list(range(6)), list(range(6, columns))]
        library = TensoredLibrary(parts, uses)
    model = pysindy.SINDy(
        optimizer=pysindy.STLSQ(threshold=0.0, alpha=RIDGE * len(tau), max_iter=1, unbias=False),
        feature_library=library,
    )

    def solve() -> object:
        with warnings.catch_warnings():
            # An ill-conditioned library shows in the held-out error.
            warnings.simplefilter("ignore")
            return model.fit(inputs(motion), t=1.0, x_dot=tau)

    seconds, _ = best_of(1, solve)
    size = model.coefficients().shape[1]
    return seconds, lambda at: np.asarray(model.predict(inputs(at))), size


def best_of(repeats: int, solve) -> tuple:
    """CPU seconds of the fastest repetition, and the answer."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        answer = solve()
        times.append(time.process_time() - start)
    return min(times), answer


def in_pieces(library: DoubleFeatureSet, motion: Motion, beta: Array) -> Array:
    """Predictions without the whole matrix, so that checking does not count as memory."""
    pieces = [slice(i, i + 1000) for i in range(0, motion.samples, 1000)]
    return np.vstack([library.columns(cut(motion, piece)) @ beta for piece in pieces])


def cut(motion: Motion, rows: slice) -> Motion:
    """Some samples."""
    return Motion(motion.time[rows], motion.q[rows], motion.v[rows], motion.vdot[rows], np.array([0]))


def unpack(stacked: Array) -> tuple[Motion, Array]:
    """A motion and its torques."""
    q, v, vdot, tau = stacked
    return Motion(np.arange(float(len(q))), q, v, vdot, np.array([0])), tau


def together(arrays: dict[str, Array], part: str) -> tuple[Motion, Array]:
    """All conditions one after the other."""
    return unpack(np.concatenate([arrays[f"{part}_{condition}"] for condition in CONDITIONS], axis=1))


def peak() -> float:
    """The largest memory this process has had so far, MB; getrusage would count its parent's, too."""
    status = Path("/proc/self/status").read_text()
    return int(next(line for line in status.splitlines() if line.startswith("VmHWM")).split()[1]) / 1024


def floor(orders: tuple[int, int, str], samples: int) -> dict:
    """What the matrix product and the factorisation alone would take at this machine's rates."""
    from scipy.linalg.lapack import dpotrf

    library = AngleSums(REVOLUTE, *orders)
    waves = WaveProducts(library.factors, library.index)
    shape = waves.sums(cut_zero(), np.zeros((1, 1))).table.shape
    product, cholesky = 2e-9 * shape[0] * shape[1] * samples, 1e-9 * library.size**3 / 3
    A, B = np.random.default_rng(0).normal(size=(2, 1500, 1500))
    gemm = 2e-9 * 1500**3 / best_of(3, lambda: A @ B)[0]
    G = np.eye(library.size) + 1e-3

    def factorise() -> None:
        dpotrf(G.copy().T, lower=1, overwrite_a=1, clean=0)

    potrf = cholesky / (best_of(3, factorise)[0] - best_of(3, G.copy)[0])
    return {
        "product": product,
        "cholesky": cholesky,
        "gemm": gemm,
        "potrf": potrf,
        "floor": product / gemm + cholesky / potrf,
    }


def cut_zero() -> Motion:
    """One sample, to ask for shapes."""
    return Motion(np.zeros(1), *np.zeros((3, 1, 3)), np.array([0]))


if __name__ == "__main__":
    main()
