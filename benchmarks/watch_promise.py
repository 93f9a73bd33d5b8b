"""Does `armloop watch` keep its promise on false alarms, and how soon does it find what has changed?

False alarms: histories of 200 units of ten minutes, each unit's blocks drawn with replacement from one healthy log (so
that what belongs to a log stays together, and blocks keep their dependence within), the logs drawn with replacement:
operation resampled from simulated logs of the three-axis arm, and from the nine measured no-load logs of a UR10e where
they are there. A third row breaks the premise on purpose: days differ (a slow autoregression of half the spread between
logs is added to every score).

Delay: simulated logs of the three-axis arm, 40 healthy ones, then a change; ten logs a day. Nothing of this is fitted to
the outcome: the threshold is `armloop.monitoring.ranks.threshold`.

    python benchmarks/watch_promise.py [--hours 3000] [--delays 2]
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from operation import Change, healthy_model, operate  # noqa: E402

from armloop.log import MotionLog, read_log  # noqa: E402
from armloop.model import ReconstructedModel, load_model  # noqa: E402
from armloop.monitoring.alarms import find_alarms  # noqa: E402
from armloop.monitoring.naming import Normal, later_part, name_change  # noqa: E402
from armloop.monitoring.ranks import scan, threshold  # noqa: E402
from armloop.monitoring.sums import LogSums, log_sums  # noqa: E402
from armloop.monitoring.trend import course  # noqa: E402
from armloop.monitoring.units import Units, scores, streams  # noqa: E402

Array = NDArray[np.float64]

UNIT_HOURS, HISTORY = 1 / 6, 200
GAINS = [11.75, 11.98, 9.83, 10.75, 10.55, 10.9]


def units_of(
    parts: list[LogSums], blocks: list[NDArray[np.intp]] | None = None, every_s: float = 8640.0
) -> Units:
    """One unit per log, of all its blocks or of those drawn."""
    drawn = [np.arange(part.blocks) for part in parts] if blocks is None else blocks

    def total(name: str) -> Array:
        return np.array([getattr(part, name)[k].sum(axis=0) for part, k in zip(parts, drawn, strict=True)])

    size = np.array(
        [np.einsum("bpp->bp", part.gram)[k].sum(axis=0) for part, k in zip(parts, drawn, strict=True)]
    )
    n = len(parts)
    return Units(
        parts[0].columns,
        every_s * np.arange(n),
        total("seconds"),
        np.zeros(n, dtype=np.intp),
        np.arange(n),
        total("moment"),
        size,
        total("rows"),
        total("energy"),
        total("torque"),
        np.full_like(total("rows"), np.nan),
        np.full(n, np.nan),
    )


def false_alarms(
    name: str, parts: list[LogSums], hours: float, promised: list[float], days: float, seed: int
) -> None:
    """Print the rate of first alarms in resampled histories beside what is promised."""
    rng = np.random.default_rng(seed)
    histories = int(np.ceil(hours / (HISTORY * UNIT_HOURS)))
    first: list[Array] = []
    S = 0
    for _ in range(histories):
        chosen = [parts[k] for k in rng.integers(len(parts), size=HISTORY)]
        units = units_of(chosen, [rng.integers(part.blocks, size=20) for part in chosen])
        values, tolerance = scores(units)
        if days:
            shift = np.zeros(HISTORY)
            for u in range(1, HISTORY):
                shift[u] = 0.97 * shift[u - 1] + np.sqrt(1 - 0.97**2) * rng.standard_normal()
            values = values + days * np.std(values, axis=0) * shift[:, None]
        S = values.shape[1]
        most = scan(values, units.programme, tolerance).log_evidence.max(axis=(1, 2))
        first.append(most)
    for mean in promised:
        limit = threshold(mean / UNIT_HOURS, 2 * S)
        over = [np.flatnonzero(most > limit) for most in first]
        alarms = sum(len(at) > 0 for at in over)
        watched = UNIT_HOURS * sum(float(at[0] + 1) if len(at) else HISTORY for at in over)
        upper = float(chi2.ppf(0.95, 2 * alarms + 2)) / 2 / watched
        print(f"{name:34s} {mean:9g} {watched:9.0f} {alarms:7d} {1 / upper:14.0f}", flush=True)


def delays(model: ReconstructedModel, seeds: int) -> None:
    """Print how long it takes to find and name changes of different size."""
    print(
        "\nDetection delay, promise 1000 h; logs of 20 s, ten a day; three-axis arm, 40 healthy logs before"
    )
    print(
        f"{'change':28s} {'seed':>4s} {'logs':>5s} {'days':>6s} {'size then':>10s}  how, and as what it is named"
    )
    joint = np.array([0.0, 1.0, 0.0])
    cases: dict[str, list[Change]] = {}
    for part in (0.03, 0.05, 0.1, 0.2):
        cases[f"friction of joint 2 +{100 * part:g} %"] = [Change(friction=part * joint)] * 40
    for mass in (0.1, 0.3, 1.0):
        cases[f"load of {mass:g} kg"] = [Change(mass=mass)] * 30
    cases["friction of joint 2 +1 % a day"] = [Change(friction=0.001 * (k + 1) * joint) for k in range(200)]
    for seed in range(seeds):
        healthy = [log_sums(model, operate(40 + seed, k)) for k in range(40)]
        for name, changes in cases.items():
            found = None
            parts = list(healthy)
            # in portions, so that logs after the alarm need not be simulated
            for first in range(0, len(changes), 10):
                parts += [
                    log_sums(model, operate(40 + seed, 40 + k, changes[k]))
                    for k in range(first, min(first + 10, len(changes)))
                ]
                units = units_of(parts)
                values, tolerance = scores(units)
                listed = streams(units.columns, model.arm.n)
                found = find_alarms(
                    values, units.programme, tolerance, listed, 1000.0 / (units.hours / units.count)
                ).alarms
                if found:
                    break
            if not found:
                print(f"{name:28s} {seed:4d}  not found in {len(changes)} logs", flush=True)
                continue
            alarm = found[0]
            before = normal(parts[: alarm.since])
            window = normal([parts[k] for k in later_part(alarm.since, alarm.unit)])
            named = name_change(model.arm, units.columns, before, window)
            what = named[0].words if named else "not named"
            late = alarm.unit - 39
            size = changes[late - 1].friction.max() if changes[0].mass == 0 else 0.0
            own = [s for s, stream in enumerate(listed) if named and stream.place == named[0].place]
            form = course(units.when, values[:, own[0] if own else alarm.stream]).form
            then = f"{100 * size:.1f} %" if size else ""
            print(f"{name:28s} {seed:4d} {late:5d} {late / 10:6.1f} {then:>10s}  {form}; {what}", flush=True)


def normal(parts: list[LogSums]) -> Normal:
    """The normal equations of logs."""
    return Normal(
        np.array([part.gram.sum(axis=0) for part in parts]),
        np.array([part.moment.sum(axis=0) for part in parts]),
        np.array([part.energy.sum() for part in parts]),
    )


def measured() -> list[LogSums]:
    """Sums of the UR10e's no-load logs against a rigid-body model of them; empty where the data are not there."""
    folder = ROOT.parent / "shared" / "data" / "ur10e"
    paths = sorted(folder.glob("noload_*.csv"))
    if not paths:
        print("(measured logs of a UR10e are not there: left out)")
        return []
    from armloop.cli import main

    with tempfile.TemporaryDirectory() as temporary:
        out = Path(temporary) / "model.json"
        words = ["--arm", str(folder / "ur10e.urdf"), "--library", "rigid-body", "--out", str(out)]
        gains = ["--drive-gains", ",".join(map(str, GAINS))]
        assert main(["reconstruct", *map(str, paths[:5]), *words, *gains]) == 0
        model = load_model(out)
    logs: list[MotionLog] = [read_log(path, tau_unit="A", drive_gains=GAINS) for path in paths]
    return [log_sums(model, log) for log in logs]


def run() -> None:
    """Parse and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=3000.0, help="of healthy operation resampled, per row")
    parser.add_argument("--delays", type=int, default=1, help="seeds of the delays; 0 leaves them out")
    parser.add_argument("--simulated-logs", type=int, default=60)
    options = parser.parse_args()
    model = healthy_model()
    promised = [10.0, 100.0, 1000.0]
    simulated = [log_sums(model, operate(77, k, None, 60.0)) for k in range(options.simulated_logs)]
    logs = measured()
    print("False alarms of a whole arm (first alarms of histories; all joints and effects together)")
    print(
        f"{'healthy operation resampled from':34s} {'promised':>9s} {'hours':>9s} {'alarms':>7s} {'mean h, 95 % ≥':>14s}"
    )
    false_alarms("60 simulated logs, three axes", simulated, options.hours, promised, 0.0, 1)
    if logs:
        false_alarms("9 measured no-load logs, UR10e", logs, options.hours, promised, 0.0, 2)
    false_alarms("simulated, days differ (premise not met)", simulated, options.hours / 3, promised, 0.5, 3)
    if options.delays:
        delays(model, options.delays)


if __name__ == "__main__":
    run()
