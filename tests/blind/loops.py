"""How often the loop's verdict is right: an effect drawn from a seed is put into the arm, then traced.

Every seed is a whole loop without the tracking: its own data collection, its own reconstructed model, its
own second run. Clean runs have nothing hidden in them. The diagnosis is handed the model's file and the log.

    python tests/blind/loops.py --seeds 20 --clean 5
    python tests/blind/loops.py --keep DIR     keep finished loops, and go on with the rest
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from armloop.data.log import read_log, write_log
from armloop.diagnosis import diagnose
from armloop.drake.experiments.collection import collect, measure_run
from armloop.drake.experiments.scenarios import load_plan, load_plant
from armloop.identification.reconstruction import reconstruct
from armloop.model import load_model
from armloop.reports.tables import table
from armloop.util.checkpoints import Kept
from armloop.workflows.undeclared import draw


@dataclass(frozen=True)
class Case:
    """One seed's outcome; names are "effect at joint"."""

    seed: int
    hidden: str
    found: str
    right: bool
    deviation: str
    before: float
    after: float


def run(arm: str, seed: int, clean: bool) -> Case:
    """One loop: collect, reconstruct, measure with (or without) an undeclared effect, diagnose."""
    threadpool_limits(1)
    plant = load_plant(arm)
    hidden = None if clean else draw(plant.arm, seed)
    with tempfile.TemporaryDirectory() as folder:
        model_file, log_file = Path(folder) / "model.json", Path(folder) / "run.csv"
        logs = collect(plant.arm, plant.config, load_plan("paper"), seed)
        reconstruct(list(logs.values()), plant.arm).model.save(model_file)
        effects = [] if hidden is None else [hidden]
        write_log(log_file, measure_run(plant.arm, plant.config, seed + 500, effects=effects))
        diagnosis = diagnose(load_model(model_file), [read_log(log_file)])
    found = diagnosis.named
    truth = [] if hidden is None else [(hidden.name, hidden.joint)]
    errors = diagnosis.errors()
    ratio = [np.array(errors[key]) / np.array(errors["noise_floor"]) for key in ("before", "after")]
    deviation = ""
    if hidden is not None and found == truth:
        estimates = diagnosis.outcome.added()[0].parameters
        parts = []
        for key, value in hidden.parameters.items():
            off = np.linalg.norm(
                np.asarray(estimates[key].value, dtype=float) - np.asarray(value, dtype=float)
            )
            parts.append(f"{key} {off / max(float(np.linalg.norm(np.asarray(value))), 1e-9):.1%}")
        deviation = ", ".join(parts)
    names = [", ".join(f"{name} {joint or ''}".strip() for name, joint in pairs) for pairs in (truth, found)]
    return Case(
        seed,
        names[0] or "nothing",
        (names[1] or "nothing") + ("" if diagnosis.unlisted is None else " + unlisted"),
        found == truth and diagnosis.unlisted is None,
        deviation,
        float(ratio[0].max()),
        float(ratio[1].max()),
    )


def main() -> int:
    """Run all cases on two processes and print the table; exit status 1 if a verdict was wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--arm", default="three_axis")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--clean", type=int, default=5)
    parser.add_argument("--keep", default=None, metavar="DIR", help="keep what is finished here")
    options = parser.parse_args()
    kept = Kept(Path(options.keep) if options.keep else None, Path(__file__).read_text(encoding="utf-8"))
    jobs = [(options.arm, seed, False) for seed in range(1, options.seeds + 1)]
    jobs += [(options.arm, 100 + seed, True) for seed in range(1, options.clean + 1)]
    cases = []
    found = {job: kept.get(job) for job in jobs}
    with ProcessPoolExecutor(2, get_context("fork")) as workers:
        made = {job: workers.submit(run, *job) for job in jobs if found[job] is None}
        for job in jobs:
            if job in made:
                found[job] = asdict(made[job].result())
                kept.put(job, found[job])
            case = Case(**found[job])
            cases.append(case)
            verdict = "right" if case.right else "WRONG"
            print(
                f"  … {len(cases)}/{len(jobs)} seed {case.seed}: {case.hidden} → {case.found}: {verdict}",
                file=sys.stderr,
            )
    headers = ["seed", "hidden", "verdict", "right", "parameters off by", "before", "after"]
    rows = [
        [
            c.seed,
            c.hidden,
            c.found,
            "yes" if c.right else "NO",
            c.deviation,
            f"{c.before:.1f}",
            f"{c.after:.1f}",
        ]
        for c in cases
    ]
    print(
        table(
            headers,
            rows,
            "Undeclared effects (residual before and after in units of the baseline's, worst joint)",
        )
    )
    right = sum(case.right for case in cases)
    print(f"{right} of {len(cases)} verdicts right")
    return 0 if right == len(cases) else 1


if __name__ == "__main__":
    sys.exit(main())
