"""How long one diagnosis takes: a run of 60 s at 500 Hz, of three joints and of six, with its split.

Arms, motions and torques are drawn here in plain arrays: an arm of boxes, Stribeck friction, sensors with noise, and
on the run that is diagnosed a load on the last link, or a load and drag in the second joint. The model is the arm
without them.

The rival is what one would write at first: every hypothesis with every value of its nonlinear parameter, through
the same filter, refitted by `numpy.linalg.lstsq` on the one half of the blocks and judged on the other, with all
samples of its joints. It is timed for a single pass over the hypotheses, without any of the judging: a search makes
one pass for each effect it finds, and one more. The split is profiled in a run of its own; its parts are shares.

    python benchmarks/diagnosis.py [--seconds 60] [--rate 500] [--joints 3 6] [--no-rival]
"""

from __future__ import annotations

import argparse
import cProfile
import os
import pstats
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from armloop.data.blocks import block_numbers
from armloop.data.log import MotionLog
from armloop.data.signals import preprocess, smooth
from armloop.diagnosis import Diagnosis, diagnose
from armloop.identification.scoring import score
from armloop.laws.effects import hypotheses
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import ReconstructedModel
from armloop.model.components import RigidBody
from armloop.reports.tables import table
from armloop.robot.arm import Arm, load_arm
from armloop.robot.kinematics import nominal_parameters
from armloop.robot.newton_euler import inverse_dynamics
from armloop.util.functions import NUMPY

Array = NDArray[np.float64]

#: Seconds that one diagnosis may take on two cores, by the number of joints.
TARGET = {3: 10.0, 6: 20.0}
CORES = 2
NOISE, STRIBECK = 0.01, 0.1
#: Functions whose time is shown: label, module, name; those with a dash are parts of the search.
PARTS = (
    ("preprocessing", "signals", "preprocess"),
    ("contacts", "contacts", "find_contacts"),
    ("search", "search", "search"),
    ("- nonlinear parameters", "trials", "_best_shape"),
    ("- fits", "fit", "fit"),
    ("unlisted law", "unlisted", "find_law"),
)


def random_urdf(n: int, seed: int) -> str:
    """An arm of boxes whose axes turn across each other."""
    rng = np.random.default_rng(seed)
    axes = ["0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0", "0 1 0"]
    parts = ['<link name="base"/>']
    reach = 0.0
    for j in range(n):
        mass, length = 4.0 * 0.6**j, rng.uniform(0.2, 0.45) * 0.85**j
        square = mass / 12 * (length**2 + 0.05**2)
        parts.append(
            f'<link name="l{j}"><inertial><origin xyz="{length / 2} 0.01 0.01"/><mass value="{mass}"/>'
            f'<inertia ixx="{mass / 12 * 0.005}" iyy="{square}" izz="{square}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
            f'<joint name="j{j}" type="revolute"><parent link="{f"l{j - 1}" if j else "base"}"/><child link="l{j}"/>'
            f'<origin xyz="{reach} 0 0"/><axis xyz="{axes[j]}"/>'
            '<limit lower="-3" upper="3" velocity="4" effort="300"/></joint>'
        )
        reach = length
    return f'<robot name="boxes_{n}">{"".join(parts)}</robot>'


def friction(size: Array) -> FrictionLaw:
    """Stribeck and viscous friction, levels a part of each joint's torque RMS (n,)."""
    return FrictionLaw(
        tuple(
            (
                FrictionTerm("sign", 0.13 * x),
                FrictionTerm("stribeck", -0.03 * x, STRIBECK),
                FrictionTerm("viscous", 0.15 * x),
            )
            for x in size.tolist()
        )
    )


def motion(n: int, seconds: float, rate: float, seed: int) -> tuple[Array, Array, Array, Array]:
    """Time, and a Fourier series of six harmonics of 20 s per joint with its derivatives, (N, n)."""
    rng, w = np.random.default_rng(seed), 2 * np.pi / 20 * np.arange(1, 7)
    t = np.arange(0, seconds, 1 / rate)
    size = rng.uniform(0.15, 0.35, (n, 6)) / np.sqrt(np.arange(1, 7))
    phase = np.multiply.outer(t, w)[:, None, :] + rng.uniform(0, 2 * np.pi, (n, 6))
    q = (size * np.sin(phase)).sum(axis=2)
    v = (size * w * np.cos(phase)).sum(axis=2)
    return t, q, v, -(size * w**2 * np.sin(phase)).sum(axis=2)


def torque(arm: Arm, links: Array, q: Array, v: Array, vdot: Array) -> Array:
    """(N, n) torque of links (10 n,)."""
    columns = inverse_dynamics(arm, links, functions=NUMPY)(
        *([x[:, j] for j in range(arm.n)] for x in (q, v, vdot))
    )
    return np.stack(columns, axis=1)


def run(
    arm: Arm, law: FrictionLaw, links: Array, drag: float, seconds: float, rate: float, seed: int
) -> MotionLog:
    """What the sensors record of one run: torque noise of 1 %, a little on q and v."""
    rng = np.random.default_rng(seed)
    t, q, v, vdot = motion(arm.n, seconds, rate, seed)
    tau = torque(arm, links, q, v, vdot)
    for j, terms in enumerate(law.terms):
        dry, dip, viscous = (term.coefficient for term in terms)
        level = dry + dip * (1 - np.exp(-((v[:, j] / STRIBECK) ** 2)))
        tau[:, j] += level * np.sign(v[:, j]) + (viscous + drag * (j == 1)) * v[:, j]
    tau += NOISE * np.sqrt(np.mean(tau**2, axis=0)) * rng.normal(size=tau.shape)
    return MotionLog(
        t, q + 1e-5 * rng.normal(size=q.shape), v + 1e-3 * rng.normal(size=v.shape), tau, name="run"
    )


def problem(n: int, seconds: float, rate: float) -> tuple[ReconstructedModel, dict[str, MotionLog]]:
    """The model of an arm of n joints, and runs of the arm with one effect and with two."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "arm.urdf"
        path.write_text(random_urdf(n, seed=n))
        arm = load_arm(path)
    links = nominal_parameters(arm)
    size = np.sqrt(np.mean(torque(arm, links, *motion(n, 20.0, 50.0, 1)[1:]) ** 2, axis=0))
    law = friction(np.maximum(size, 0.2 * size.max()))
    bare = ReconstructedModel(arm, (RigidBody(links, (), np.zeros(0)),), law)
    clean = preprocess([run(arm, law, links, 0.0, seconds, rate, 2)], bare.conditioning)
    model = replace(bare, baseline=score(bare, clean).moving)
    loaded = np.array(links)
    mass, centre = 0.15 * links[::10].sum(), np.array([0.05, 0.02, 0.0])
    inertia = mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    loaded[-10:] += [
        mass,
        *(mass * centre),
        *(inertia[i] for i in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))),
    ]
    drag = 0.3 * float(size[1])
    return model, {
        "load": run(arm, law, loaded, 0.0, seconds, rate, 3),
        "load and drag": run(arm, law, loaded, drag, seconds, rate, 3),
    }


def timed(model: ReconstructedModel, log: MotionLog) -> tuple[float, float, Diagnosis]:
    """Seconds that one diagnosis takes by the clock and of the processors, and its answer."""
    start, used = time.perf_counter(), _used()
    answer = diagnose(model, [log], jobs=CORES)
    return time.perf_counter() - start, _used() - used, answer


def _used() -> float:
    """Seconds of the processors of this process and of those it has waited for."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


def split(model: ReconstructedModel, log: MotionLog) -> list[tuple[str, float]]:
    """Share of each part in one process, by a profile; what none of them holds last."""
    profile = cProfile.Profile()
    profile.runcall(diagnose, model, [log], jobs=1)
    stats = pstats.Stats(profile).stats  # type: ignore[attr-defined]
    spent = {(Path(file).stem, name): row[3] for (file, _, name), row in stats.items()}
    whole = spent["diagnose", "diagnose"]
    shares = [(label, spent.get((module, name), 0.0) / whole) for label, module, name in PARTS]
    rest = 1 - sum(share for label, share in shares if not label.startswith("-"))
    return [*shares, ("rest", rest)]


def rival(model: ReconstructedModel, log: MotionLog) -> tuple[float, int]:
    """Seconds of one pass of refits by `numpy.linalg.lstsq`, and how many there were."""
    start = time.perf_counter()
    samples = preprocess([log], model.conditioning)
    listed = hypotheses(model.arm)
    context = model.context(samples.motion, listed)
    left = samples.tau - smooth(samples, model.predict(samples.motion))
    fold = block_numbers(samples.motion, 1.5) % 2
    refits = 0
    for effect in listed:
        own = [effect.joint - 1] if effect.joint and not effect.other_joint else range(model.arm.n)
        for shape in effect.shapes(context):
            columns = effect.columns(context, shape)
            columns = smooth(samples, columns[:, None] if columns.ndim == 2 else columns[:, list(own)])
            rows = samples.moving[:, list(own)]
            X, y = columns[rows], left[:, list(own)][rows]
            mine = np.broadcast_to(fold[:, None], rows.shape)[rows]
            for k in (0, 1):
                beta = np.linalg.lstsq(X[mine != k], y[mine != k], rcond=None)[0]
                np.mean((y[mine == k] - X[mine == k] @ beta) ** 2)
            refits += 2
    return time.perf_counter() - start, refits


def main() -> None:
    """Time both and print the tables."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--rate", type=float, default=500.0)
    parser.add_argument("--joints", type=int, nargs="+", default=[3, 6])
    parser.add_argument("--no-rival", action="store_true")
    options = parser.parse_args()
    rows: list[list[object]] = []
    parts: list[list[object]] = [[label] for label, _, _ in PARTS] + [["rest"]]
    headers, words = ["part of the time"], []
    with threadpool_limits(CORES):
        for n in options.joints:
            model, logs = problem(n, options.seconds, options.rate)
            for name, log in logs.items():
                seconds, used, answer = timed(model, log)
                found = ", ".join(f.effect.label() for f in answer.outcome.found) or answer.verdict
                target = f"{TARGET[n]:g} s" if n in TARGET else None
                rows.append(
                    [n, name, len(hypotheses(model.arm)), found, f"{seconds:.1f} s", f"{used:.1f} s", target]
                )
                headers.append(f"{n} joints, {name}")
                for row, (_, share) in zip(parts, split(model, log), strict=True):
                    row.append(f"{share:.0%}")
                if not options.no_rival and name == "load":
                    theirs, refits = rival(model, log)
                    words.append(
                        f"{n} joints: one pass of {refits} refits by numpy.linalg.lstsq takes {theirs:.1f} s, "
                        f"{theirs / seconds:.1f} times the whole diagnosis"
                    )
    title = f"One diagnosis of {options.seconds:g} s at {options.rate:g} Hz, {CORES} cores"
    headings = ["joints", "put into the run", "hypotheses", "found", "time", "CPU", "target"]
    print(table(headings, rows, title))
    print(table(headers, parts, "Where it goes"))
    print("\n".join(words))


if __name__ == "__main__":
    main()
