"""A blind test of the diagnosis: random arms, random effects; what it names, and how often that is right.

For every arm its own data collection and its own reconstructed model; for every case a run in closed loop with
sticking friction, quantised encoders and a noisy torque, with nothing, one effect, two, or an unlisted law
hidden in it. The logs go into one folder, what is hidden into another: the diagnosis is handed paths of the
first alone, and the answers are opened when all verdicts are in.

    python tests/blind/run.py --arms 20 --cases 16
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from arms import random_arm
from hidden import Run, draw
from judge import print_verdicts
from threadpoolctl import threadpool_limits

from armloop.arm import load_arm
from armloop.diagnosis import diagnose
from armloop.drake_systems.collection import PlantConfig, collect, measure_run
from armloop.drake_systems.friction import JointFriction
from armloop.drake_systems.scenarios import load_plan
from armloop.errors import InputError
from armloop.excitation import MotionRanges, fourier_reference
from armloop.log import read_log, write_log
from armloop.model import load_model
from armloop.reconstruction import reconstruct

DURATION = 50.0


def generate(seed: int, cases: int, logs: Path, answers: Path) -> None:
    """Write the arm, its baseline logs and its runs into one folder, what is hidden in them into another."""
    drawn = random_arm(seed)
    folder = logs / f"arm_{seed}"
    folder.mkdir(parents=True)
    (folder / "arm.urdf").write_text(drawn.urdf, encoding="utf-8")
    arm = load_arm(folder / "arm.urdf")
    friction = [JointFriction(**f) for f in drawn.friction]
    ranges = MotionRanges(**drawn.ranges)
    config = PlantConfig(tuple(friction), ranges)
    for name, log in collect(arm, config, load_plan("paper"), seed).items():
        write_log(folder / f"baseline_{name}.csv", log)
    for case in range(cases):
        number = 1000 * seed + case
        reference = fourier_reference(ranges, DURATION, number, harmonics=5)
        hidden = draw(Run.of(arm, friction, reference), number)
        log = measure_run(
            arm, config, number, effects=hidden.effects, reference=reference, law=_law(arm.n, hidden.extra)
        )
        write_log(folder / f"run_{case}.csv", log)
        answer = {**asdict(hidden), "effects": [_plain(asdict(e)) for e in hidden.effects]}
        (answers / f"arm_{seed}_run_{case}.json").write_text(json.dumps(answer), encoding="utf-8")


def _plain(effect: dict[str, Any]) -> dict[str, Any]:
    parameters = {
        key: [float(x) for x in value] if hasattr(value, "__len__") else float(value)
        for key, value in effect["parameters"].items()
    }
    return {**effect, "parameters": parameters}


def _law(n: int, extra: dict[str, Any]) -> Any:
    if not extra:
        return None
    from math import cos

    joint, a, wave, of, speed, power = (extra[k] for k in ("joint", "a", "wave", "of", "speed", "power"))

    def law(q: list[float], v: list[float]) -> list[float]:
        tau = [0.0] * n
        tau[joint] = a * cos(wave * q[of]) * v[speed] ** power
        return tau

    return law


def judge_blindly(folder: Path) -> dict[str, dict[str, Any]]:
    """The verdict on every run of a folder, from its logs alone."""
    arm = load_arm(folder / "arm.urdf")
    baseline = [read_log(path) for path in sorted(folder.glob("baseline_*.csv"))]
    reconstruct(baseline, arm).model.save(folder / "model.json")
    model = load_model(folder / "model.json")
    verdicts = {}
    for path in sorted(folder.glob("run_*.csv")):
        try:
            verdicts[f"{folder.name}_{path.stem}"] = diagnose(model, [read_log(path)]).to_dict()
        except InputError as error:
            verdicts[f"{folder.name}_{path.stem}"] = {"verdict": f"refused: {error}", "effects": []}
    return verdicts


def one_arm(seed: int, cases: int, logs: str, answers: str) -> dict[str, dict[str, Any]]:
    """Generate and judge one arm's runs."""
    threadpool_limits(1)
    generate(seed, cases, Path(logs), Path(answers))
    return judge_blindly(Path(logs) / f"arm_{seed}")


def main() -> int:
    """Run the arms side by side, print the verdicts; 1 if a target is missed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--arms", type=int, default=20)
    parser.add_argument("--cases", type=int, default=16, help="runs per arm")
    parser.add_argument("--first", type=int, default=1, help="seed of the first arm")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--keep", default=None, metavar="DIR", help="keep logs, models and answers here")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        place = Path(options.keep or temporary)
        logs, answers = place / "logs", place / "answers"
        answers.mkdir(parents=True, exist_ok=True)
        verdicts: dict[str, dict[str, Any]] = {}
        with ProcessPoolExecutor(options.processes, get_context("fork")) as workers:
            jobs = [
                workers.submit(one_arm, options.first + k, options.cases, str(logs), str(answers))
                for k in range(options.arms)
            ]
            for k, job in enumerate(jobs):
                try:
                    verdicts |= job.result()
                except InputError as error:
                    print(f"  … arm {options.first + k} cannot be used: {error}", file=sys.stderr)
                print(f"  … {k + 1}/{len(jobs)} arms", file=sys.stderr, flush=True)
        sealed = {path.stem: json.loads(path.read_text(encoding="utf-8")) for path in answers.glob("*.json")}
        return print_verdicts({name: (sealed[name], verdict) for name, verdict in verdicts.items()})


if __name__ == "__main__":
    sys.exit(main())
