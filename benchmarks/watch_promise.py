"""Does `armloop watch` keep its promise on false alarms, and how soon does it find and name what has changed?

False alarms: histories of 200 units of ten minutes, each unit's blocks drawn with replacement from one healthy simulated
log of the three-axis arm (so that what belongs to a log stays together, and samples keep their dependence within a
block), the logs drawn with replacement. The bound is that of a Poisson process, 95 %, on what was watched before the
first alarm of each history. A second row breaks the premise on purpose: days differ (a slow autoregression of half the
spread between logs is added to every score). Measured logs: `watch_measured.py`.

Delay: simulated logs of the three-axis arm, 40 healthy ones, then a change; ten logs a day.

Warm-up: friction falls by a fifth with a time constant of 20 minutes after a start, and logs are taken at random times
since start. Nothing of this is fitted to the outcome: the threshold is `armloop.monitoring.ranks.threshold`.

    python benchmarks/watch_promise.py [--hours 1000] [--delays 2] [--warm 1]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from operation import Change, healthy_model, operate  # noqa: E402
from resampled import Blocks  # noqa: E402

from armloop.model import ReconstructedModel  # noqa: E402
from armloop.monitoring.alarms import find_alarms  # noqa: E402
from armloop.monitoring.naming import Normal, later_part, name_change  # noqa: E402
from armloop.monitoring.ranks import HORIZON, scan, threshold  # noqa: E402
from armloop.monitoring.sums import log_sums  # noqa: E402
from armloop.monitoring.trend import course  # noqa: E402
from armloop.monitoring.units import Units, scores, streams  # noqa: E402
from armloop.monitoring.warmth import adjust, without_warmth  # noqa: E402

Array = NDArray[np.float64]

UNIT_SECONDS, HISTORY, EVERY_S = 600.0, 200, 8640.0
#: Healthy units that a change is named against, and units after an alarm with which it is judged anew.
HEALTHY, LATER = 40, 64
PROMISED = (10.0, 100.0, 1000.0)


def false_alarms_header() -> None:
    """Print what the columns of :func:`false_alarms` are."""
    print("False alarms of a whole arm (first alarms of histories; all joints and effects together)")
    print(
        f"{'healthy operation resampled from':40s} {'promised h':>10s} {'hours':>7s} {'alarms':>7s} "
        f"{'mean h between, 95 % bound':>27s}"
    )


def false_alarms(name: str, blocks: Blocks, hours: float, days: float, seed: int) -> None:
    """Print the rate of first alarms in resampled histories beside what is promised."""
    rng = np.random.default_rng(seed)
    first: list[Array] = []
    long: list[float] = []
    S = 0
    while sum(long) * HISTORY < hours:
        units = blocks.units(blocks.drawn(rng, HISTORY, UNIT_SECONDS), EVERY_S)
        values, tolerance = scores(units)
        if days:
            shift = np.zeros(HISTORY)
            for u in range(1, HISTORY):
                shift[u] = 0.97 * shift[u - 1] + np.sqrt(1 - 0.97**2) * rng.standard_normal()
            values = values + days * np.std(values, axis=0) * shift[:, None]
        S = values.shape[1]
        active = np.isfinite(values).any(axis=0)
        found = scan(values[:, active], units.programme, tolerance[:, active])
        first.append(found.log_evidence.max(axis=(1, 2)))
        long.append(units.hours / HISTORY)
    for mean in PROMISED:
        over = [
            np.flatnonzero(most > threshold(mean / each, 2 * S))
            for most, each in zip(first, long, strict=True)
        ]
        alarms = sum(len(at) > 0 for at in over)
        watched = sum(
            each * float(at[0] + 1 if len(at) else HISTORY) for at, each in zip(over, long, strict=True)
        )
        least = watched / (float(chi2.ppf(0.95, 2 * alarms + 2)) / 2)
        print(f"{name:40s} {mean:10g} {watched:7.0f} {alarms:7d} {f'above {least:.0f}':>27s}", flush=True)


def delays_header(per_day: int) -> None:
    """Print what the columns of :func:`delay` are."""
    print(
        f"{'change':38s} {'units':>5s} {'days':>5s} {'size then':>10s} {'how':11s} as what it is named  "
        f"({per_day} units a day)"
    )


def delay(
    label: str,
    model: ReconstructedModel,
    units: Units,
    changed: int,
    sizes: Sequence[str],
    normal: Callable[[Sequence[int]], Normal],
    values: Array | None = None,
) -> bool:
    """Test a history whose units change from ``changed`` on; print the first alarm, and return whether there was one.

    Args:
        sizes: of the change at each unit after that; normal: normal equations of units.
        values: (U, S) scores to test instead of the units' own.
    """
    own, tolerance = scores(units)
    values = own if values is None else values
    listed = streams(units.columns, model.arm.n)
    mean_units = 1000.0 / (units.hours / units.count)
    watched = find_alarms(values, units.programme, tolerance, listed, mean_units)
    found = watched.alarms
    if not found:
        return False
    alarm = found[0]
    late = alarm.unit - changed + 1
    size = sizes[late - 1] if late > 0 else "healthy"
    print(f"{label:38s} {late:5d} {late / 10:5.1f} {size:>10s}", flush=True)
    # as the command does it: named at once, and again with what there is by then
    until = min([alarm.unit + LATER, units.count - 1, *(other.unit for other in found[1:2])])
    before = normal(range(max(alarm.from_unit, alarm.since - HEALTHY), alarm.since))
    for last in sorted({alarm.unit, until, *(alarm.unit + k for k in (8, 16) if alarm.unit + k < until)}):
        named = name_change(model.arm, units.columns, before, normal(later_part(alarm.since, last)))
        here = [s for s, stream in enumerate(listed) if named and stream.place == named[0].place]
        span = slice(max(alarm.from_unit, alarm.since - HORIZON), last + 1)
        shown = max(here or [alarm.stream], key=lambda s: float(watched.evidence[alarm.unit, s]))
        form = course(units.when[span], values[span, shown], units.programme[span]).form
        what = named[0].words if named else "not named"
        others = ", ".join(place[0] for place in named[0].alternatives[:3]) if named else ""
        more = f"with {last - alarm.unit} more" if last > alarm.unit else "at once"
        print(f"{'':38s} {more:>22s} {form:11s} {what}" + (f" (or {others})" if others else ""), flush=True)
    return True


def delays(model: ReconstructedModel, seed: int) -> None:
    """Print how long it takes to find and name changes of different size and joints, and a drift."""
    healthy = [log_sums(model, operate(40 + seed, k)) for k in range(40)]
    cases: dict[str, list[Change]] = {}
    for part in (0.03, 0.05, 0.1, 0.2):
        for joint in range(3) if part == 0.05 else (1,):
            one = part * (np.arange(3) == joint)
            cases[f"friction of joint {joint + 1} +{100 * part:g} %"] = [Change(friction=one)] * 40
    for mass in (0.1, 0.3, 1.0):
        cases[f"load of {mass:g} kg"] = [Change(mass=mass)] * 40
    joint = np.array([0.0, 1.0, 0.0])
    cases["friction of joint 2 +1 % a day"] = [Change(friction=0.001 * (k + 1) * joint) for k in range(200)]
    for name, changes in cases.items():
        parts = list(healthy)
        sizes = [f"{100 * c.friction.max():.1f} %" if c.mass == 0 else f"{c.mass:g} kg" for c in changes]
        # in portions, so that logs after the alarm need not be simulated
        for first in range(0, len(changes), 10):
            more = range(first, min(first + 10, len(changes)))
            parts += [log_sums(model, operate(40 + seed, 40 + k, changes[k])) for k in more]
            blocks = Blocks.of(parts)
            whole = blocks.whole()

            def normal(index: Sequence[int], blocks: Blocks = blocks, whole: Array = whole) -> Normal:
                return blocks.normal(whole[list(index)])

            label = f"{name} (seed {seed})"
            if delay(label, model, blocks.units(whole, EVERY_S), 40, sizes, normal):
                break
        else:
            print(f"{name:38s} not found in {len(changes)} units", flush=True)


def warm_up(model: ReconstructedModel, seed: int) -> None:
    """Print what warming up does to the tests, with and without a column that tells how warm the arm is."""
    print(
        "\nFriction falls by a fifth as joints warm up; 120 healthy logs, then 5 % more friction of joint 2"
    )
    delays_header(10)
    rng = np.random.default_rng([seed, 9])
    since = rng.uniform(0.0, 7200.0, 180)
    fallen = 0.2 * (1.0 - np.exp(-since / 1200.0))
    wear = np.where(np.arange(180) < 120, 1.0, 1.05)[:, None] ** np.array([0.0, 1.0, 0.0])
    parts = [
        log_sums(model, operate(60 + seed, k, Change(friction=(1 - fallen[k]) * wear[k] - 1)))
        for k in range(180)
    ]
    blocks = Blocks.of(parts)
    whole = blocks.whole()
    # a joint's temperature follows what its friction falls with, measured to half a degree
    temperature = 25.0 + 100.0 * fallen + 0.5 * rng.standard_normal(180)
    told: dict[str, tuple[Array | None, Array | None]] = {
        "temperature": (temperature, None),
        "since_start": (None, since),
        "neither": (None, None),
    }
    for name, (warmth, start) in told.items():
        units = blocks.units(whole, EVERY_S, warmth, start)
        values, _ = scores(units)
        adjusted = adjust(units, values, streams(units.columns, 3), 20)
        healthy = blocks.normal(whole[:20])

        def equations(
            index: Sequence[int], w: Array = adjusted.warmth, healthy: Normal = healthy, c: Units = units
        ) -> Normal:
            own = blocks.normal(whole[list(index)])
            return without_warmth(c.columns, healthy, w[:20], own, w[list(index)]) if w.any() else own

        label = f"{name} recorded (seed {seed})"
        found = delay(
            label,
            model,
            units,
            120,
            ["+5 %"] * 60,
            equations,
            adjusted.values,
        )
        if not found:
            print(f"{label:38s} no alarm: neither a false one nor the change, in 60 units")


def run() -> None:
    """Parse and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=1000.0, help="of healthy operation resampled, per row")
    parser.add_argument("--delays", type=int, default=1, help="seeds of the delays; 0 leaves them out")
    parser.add_argument("--warm", type=int, default=1, help="seeds of the warm-up; 0 leaves it out")
    parser.add_argument("--simulated-logs", type=int, default=60)
    options = parser.parse_args()
    model = healthy_model()
    if options.hours:
        logs = [log_sums(model, operate(77, k, None, 60.0)) for k in range(options.simulated_logs)]
        blocks = Blocks.of(logs)
        false_alarms_header()
        false_alarms(f"{len(logs)} simulated logs, three axes", blocks, options.hours, 0.0, 1)
        false_alarms("the same, but days differ (premise not met)", blocks, options.hours / 3, 0.5, 3)
    if options.delays:
        print("\nDetection delay, promise 1000 h; logs of 20 s; three-axis arm, 40 healthy logs before")
        delays_header(10)
    for seed in range(options.delays):
        delays(model, seed)
    for seed in range(options.warm):
        warm_up(model, seed)


if __name__ == "__main__":
    run()
