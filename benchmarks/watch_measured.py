"""Does `armloop watch` keep its promise on every healthy measured log, and would it have seen a change there?

Four measured arms, each with a model of some of its own logs (../shared/data; a folder that is not there is left out):

- in the order of the files, as the command takes them (a unit is a log), and cut into short blocks, each a unit, which is
  harder, for neighbours resemble each other. So few hours can only show that nothing is grossly wrong;
- healthy operation resampled from them: units of ten minutes, each from one log, of its blocks with replacement. A half
  of the logs that the model was made of are among them, as in life: a model is made of an arm's first logs;
- the same with something added to the measured torque from the fortieth unit on, what the motion of that log asks for: 5 %
  more of the model's friction at each joint in turn, a load of 0.3 kg, a friction that grows by 1 % a day, ten units a day.
  An arm on which a change of that size stays below the tolerance, or is not told from the spread of its logs, says so.

    python benchmarks/watch_measured.py [--hours 1000] [--arms ur10e,ur5,panda,double_pendulum]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from resampled import Blocks, Changing  # noqa: E402
from watch_promise import (  # noqa: E402  # noqa: E402
    EVERY_S,
    HEALTHY,
    UNIT_SECONDS,
    delay,
    delays_header,
    false_alarms,
    false_alarms_header,
)

from armloop.data.log import MotionLog, read_log  # noqa: E402
from armloop.data.motion import Motion  # noqa: E402
from armloop.data.signals import preprocess  # noqa: E402
from armloop.identification.reconstruction import reconstruct  # noqa: E402
from armloop.model import ReconstructedModel  # noqa: E402
from armloop.monitoring.alarms import find_alarms  # noqa: E402
from armloop.monitoring.naming import Normal  # noqa: E402
from armloop.monitoring.sums import log_sums  # noqa: E402
from armloop.monitoring.units import Units, scores, streams  # noqa: E402
from armloop.robot.arm import load_arm  # noqa: E402
from armloop.robot.kinematics import regressor  # noqa: E402
from armloop.util.errors import InputError  # noqa: E402

Array = NDArray[np.float64]

Law = Callable[[ReconstructedModel, Motion], Array]

DATA = ROOT.parent / "shared" / "data"


@dataclass(frozen=True)
class Measured:
    """Logs of an arm that are healthy.

    training : files that the model is made of; watched : programmes, each with its files, in the order of the names
    gains : N*m/A; None where torque was recorded; block : s
    """

    urdf: str
    training: tuple[str, ...]
    watched: dict[str, tuple[str, ...]]
    gains: tuple[float, ...] | None
    block: float


ARMS = {
    "ur10e": Measured(
        "ur10e.urdf",
        ("noload_20_01*", "noload_20_02_05*", "noload_20_02_06*"),
        {"exciting": ("noload_*",), "one joint at a time": ("jointwise_*",)},
        (11.75, 11.98, 9.83, 10.75, 10.55, 10.9),
        5.0,
    ),
    "ur5": Measured(
        "ur5.urdf",
        ("no1.csv", "no2.csv", "no8_*"),
        {
            "free": ("no1.csv", "no2.csv"),
            "slow": ("no5_acc_slow_no*", "no6_*", "no7_acc_slow_verify_model_short.csv"),
            "no singularity": ("no8_*", "no9_*_nodist*"),
        },
        (12.5, 12.5, 12.5, 9.2, 9.2, 9.2),
        5.0,
    ),
    "panda": Measured("panda.urdf", ("exciting_1a.csv",), {"exciting": ("exciting_1a.csv",)}, None, 1.0),
    "double_pendulum": Measured(
        "double_pendulum.urdf",
        ("sysid_1433*", "sysid_1435*", "sysid_1436*", "sysid_1437*"),
        {
            "exciting": ("sysid_*",),
            "swing up": ("acrobot_clean_*",),
            "swing up, other law": ("acrobot_pilco_*",),
        },
        None,
        2.0,
    ),
}


def read(folder: Path, patterns: tuple[str, ...], gains: tuple[float, ...] | None) -> list[MotionLog]:
    """Logs by patterns of their names."""
    paths = sorted({path for pattern in patterns for path in folder.glob(pattern)})
    if not paths:
        raise SystemExit(f"{folder}: no {', '.join(patterns)}")
    unit = {} if gains is None else {"tau_unit": "A", "drive_gains": list(gains)}
    return [read_log(path, quiet=True, **unit) for path in paths]


def with_torque(model: ReconstructedModel, log: MotionLog, law: Law, level: float) -> MotionLog:
    """A log as it would be with a further torque along the same motion."""
    motion = preprocess([log], model.conditioning).motion
    more = level * law(model, motion)
    return replace(
        log, tau=log.tau + np.column_stack([np.interp(log.time, motion.time, column) for column in more.T])
    )


def friction_of(joint: int) -> Law:
    """The model's own friction at a joint, numbered from 0, once more."""

    def law(model: ReconstructedModel, motion: Motion) -> Array:
        return (model.predict(motion) - model.rigid_body(motion)) * (np.arange(model.arm.n) == joint)

    return law


def payload(model: ReconstructedModel, motion: Motion) -> Array:
    """A load of 1 kg, 0.05 m out along z of the last link's frame."""
    body = np.array([1, 0, 0, 0.05, 0.05**2, 0.05**2, 0, 0, 0, 0])  # m, mc, Ixx, Iyy, Izz, Ixy, Ixz, Iyz
    return regressor(model.arm, motion.q, motion.v, motion.vdot, links=[model.arm.n - 1]) @ body


def in_order(name: str, units: Units, joints: int, label: str) -> None:
    """Print what the tests make of healthy units in the order of their files."""
    values, tolerance = scores(units)
    listed = streams(units.columns, joints)
    mean_units = 1000.0 / (units.hours / units.count)
    found = find_alarms(values, units.programme, tolerance, listed, mean_units)
    most = float(found.evidence.max(initial=-np.inf))
    share = f"{max(most, 0.0) / float(found.limits[-1]):5.2f}"
    print(
        f"{name:16s} {label:22s} {units.hours:7.3f} {units.count:6d} {len(found.alarms):7d} {share:>18s}",
        flush=True,
    )
    for alarm in found.alarms:
        stream = listed[alarm.stream]
        print(f"    unit {alarm.unit}: {stream.name} at joint {stream.joint}", flush=True)


def run() -> None:
    """Parse and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=1000.0, help="of healthy operation resampled, per arm")
    parser.add_argument("--arms", default=",".join(ARMS))
    parser.add_argument("--joints", default="all", help="whose friction changes, such as 1,2")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    known: dict[str, tuple[ReconstructedModel, list[MotionLog], Blocks]] = {}
    print("Healthy measured logs in the order of their files; promised: 1000 h between false alarms")
    print(
        f"{'arm':16s} {'a unit is':22s} {'hours':>7s} {'units':>6s} {'alarms':>7s} {'evidence/threshold':>18s}"
    )
    for name in options.arms.split(","):
        about, folder = ARMS[name], DATA / name
        if not folder.is_dir():
            print(f"{name:16s} (its logs are not there: left out)")
            continue
        arm = load_arm(folder / about.urdf)
        gains = None if about.gains is None else list(about.gains)
        recorded = {"unit": "N*m" if gains is None else "A", "drive_gains": gains}
        training = read(folder, about.training, about.gains)
        model = reconstruct(training, arm, library="rigid-body", recorded=recorded).model
        logs, numbers, sums = [], [], []
        for number, patterns in enumerate(about.watched.values()):
            for log in read(folder, patterns, about.gains):
                try:
                    sums.append(log_sums(model, log, block_seconds=about.block))
                except InputError as error:
                    print(f"    set aside: {error}")
                    continue
                logs.append(log)
                numbers.append(number)
        blocks = Blocks.of(sums, numbers)
        known[name] = model, logs, blocks
        in_order(name, blocks.units(blocks.whole(), 600.0), arm.n, "a log")
        short = blocks.units(np.eye(len(blocks.log)), 600.0)
        in_order(name, short, arm.n, f"a block of {about.block:g} s")
    print()
    false_alarms_header()
    for name, (_, logs, blocks) in known.items():
        false_alarms(f"{len(logs)} measured logs, {name}", blocks, options.hours, 0.0, 2)
    print(
        f"\nThe same operation with a change from unit {HEALTHY} on; promised: 1000 h; units of ten minutes"
    )
    delays_header(10)
    for name, (model, logs, blocks) in known.items():
        for law, histories in changes(model.arm.n, options.joints):
            changing = with_levels(model, logs, blocks, law, ARMS[name].block)
            for what, level, sizes in histories:
                found_after(f"{name}: {what}", model, changing, level, sizes, options.seed)


def with_levels(
    model: ReconstructedModel, logs: Sequence[MotionLog], blocks: Blocks, law: Law, block: float
) -> Changing:
    """The blocks at level 0, 1 and 2 of a change."""
    sums = [[log_sums(model, with_torque(model, log, law, w), None, block) for log in logs] for w in (1, 2)]
    return Changing(blocks, *(Blocks.of(parts) for parts in sums))


def found_after(
    label: str, model: ReconstructedModel, changing: Changing, level: Array, sizes: list[str], seed: int
) -> None:
    """Print how soon a change that comes after healthy units is found, or how it compares with what is no change."""
    counts = changing.zero.drawn(np.random.default_rng(seed), HEALTHY + len(level), UNIT_SECONDS)
    levels = np.concatenate([np.zeros(HEALTHY), level])

    def normal(index: Sequence[int]) -> Normal:
        return changing.normal(counts[list(index)], levels[list(index)])

    units = changing.units(counts, levels, EVERY_S)
    if delay(label, model, units, HEALTHY, sizes, normal):
        return
    values, tolerance = scores(changing.units(counts, 0.0 * levels, EVERY_S))
    later, _ = scores(units)
    moved = np.abs(later[-1] - values[-1])
    # the spread of the units of one programme, which alone are compared
    programme = units.programme
    spread = np.array([np.nanstd(values[programme == one], axis=0) for one in np.unique(programme)]).mean(
        axis=0
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        parts = np.nanmax(np.where(tolerance[-1] > 0, moved / tolerance[-1], np.nan))
        beyond = np.nanmax(np.where(spread > 0, (moved - tolerance[-1]) / spread, np.nan))
    print(
        f"{label:38s} not found in {len(level)} units; at most {parts:.1f} of the tolerance; beyond it, "
        f"{max(beyond, 0.0):.1f} of the spread of healthy units",
        flush=True,
    )


def changes(joints: int, which: str) -> list[tuple[Law, list[tuple[str, Array, list[str]]]]]:
    """What is added to the measured torque: a law at level 1; the level of each unit, with its name and sizes in words."""
    chosen = range(joints) if which == "all" else [int(j) - 1 for j in which.split(",") if int(j) <= joints]
    drift = 0.001 * np.arange(1, 301)
    sizes = [f"{100 * w:.1f} %" for w in drift]
    found: list[tuple[Law, list[tuple[str, Array, list[str]]]]] = [
        (payload, [("load of 0.3 kg", np.full(100, 0.3), ["0.3 kg"] * 100)])
    ]
    for j in chosen:
        step = (f"friction of joint {j + 1} +5 %", np.full(100, 0.05), ["5 %"] * 100)
        found.append((friction_of(j), [step, (f"friction of joint {j + 1} +1 % a day", drift, sizes)]))
    return found


if __name__ == "__main__":
    run()
