"""A blind test of the diagnosis: random arms, random effects; what it names, and how often that is right.

For every arm its own data collection and its own reconstructed model; for every case a run in closed loop with
sticking friction, quantised encoders and a noisy torque, with nothing, one effect, two, or an unlisted law
hidden in it. The logs go into one folder, what is hidden into another: the diagnosis is a process of its own
that is handed the path of the logs alone, and the answers are opened when all verdicts are in.

    python tests/blind/run.py --arms 20 --cases 16
    python tests/blind/run.py --arms 20 --keep DIR     keep logs, models, answers and verdicts, and go on with the rest
    python tests/blind/run.py --outside --arms 6       arms, engine and controllers from outside (MuJoCo)
    python tests/blind/run.py --outside --points   … in runs that pick and place, models from sines and sweeps
    python tests/blind/run.py --outside --loads    … in which a load is carried in parts of the runs
    python tests/blind/run.py --outside --stops    … in which a joint meets a spring on one side of a position
    python tests/blind/run.py --outside --tendons  … in which a spring pulls between two joints, or a cable at a link
    python tests/blind/run.py --measured ../shared/data   effects added to logs of three arms (--first 4, 7, …: others)
    python tests/blind/run.py --again DIR              diagnose kept logs once more
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from generate import generate
from judge import print_verdicts
from measured_generate import SOURCES, generate_measured
from threadpoolctl import threadpool_limits

from armloop.drake.experiments.scenarios import load_plan
from armloop.util.checkpoints import Kept
from armloop.util.errors import InputError

VERDICTS = Path(__file__).with_name("verdicts.py")


def make(
    seed: int, cases: int, place: Path, outside: list[int] | None, how: dict[str, bool], measured: Path | None
) -> str:
    """Generate one arm's cases; the reason where such an arm cannot be had."""
    threadpool_limits(1)
    try:
        if measured is not None:
            generate_measured(seed, cases, measured, place / "logs", place / "answers")
            return ""
        if outside is not None:
            sys.path.insert(0, str(Path(__file__).parents[1]))
            from outside_generate import generate_outside

            generate_outside(seed, cases, place / "logs", place / "answers", outside, **how)
            return ""
        generate(seed, range(cases), load_plan("paper"), place / "logs", place / "answers")
    except InputError as error:
        return str(error)
    return ""


def judge(folder: Path, out: Path) -> dict[str, dict[str, Any]]:
    """Diagnose one arm's runs in a process that knows their folder and nothing else."""
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    done = subprocess.run(
        [sys.executable, str(VERDICTS), str(folder), str(out)],
        env={**os.environ, **threads},
        capture_output=True,
        text=True,
    )
    if done.returncode:
        raise RuntimeError(f"{folder.name}: {done.stderr}")
    answer: dict[str, dict[str, Any]] = json.loads(out.read_text(encoding="utf-8"))
    return answer


def main() -> int:
    """Run the arms side by side, print the verdicts; 1 if a target is missed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--arms", type=int, default=20)
    parser.add_argument("--cases", type=int, default=16, help="runs per arm")
    parser.add_argument("--first", type=int, default=1, help="seed of the first arm")
    parser.add_argument(
        "--outside",
        nargs="*",
        type=int,
        metavar="JOINTS",
        help="arms simulated by MuJoCo instead of our own, with one of these numbers of joints (2 3 3 4)",
    )
    parser.add_argument(
        "--points",
        action="store_true",
        help="with --outside: the runs go from point to point and dwell there",
    )
    parser.add_argument(
        "--loads", action="store_true", help="with --outside: a load is carried in parts of the runs"
    )
    parser.add_argument(
        "--stops",
        action="store_true",
        help="with --outside: a joint meets a spring on one side of a position",
    )
    parser.add_argument(
        "--tendons",
        action="store_true",
        help="with --outside: a spring pulls between two joints, or a cable from a fixed point at a link",
    )
    parser.add_argument(
        "--measured",
        default=None,
        metavar="DATA",
        type=Path,
        help="folder of measured logs to add effects to",
    )
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--keep", default=None, metavar="DIR", help="keep logs, models and answers here")
    parser.add_argument("--again", default=None, metavar="DIR", help="judge the kept logs of DIR once more")
    options = parser.parse_args()
    outside = (options.outside or [2, 3, 3, 4]) if options.outside is not None else None
    with (
        tempfile.TemporaryDirectory() as temporary,
        ProcessPoolExecutor(options.processes, get_context("fork")) as workers,
    ):
        place = Path(options.again or options.keep or temporary)
        # --again is asked for to judge once more
        scripts = {
            path.name: path.read_text(encoding="utf-8") for path in sorted(VERDICTS.parent.glob("*.py"))
        }
        kept = Kept(Path(options.keep) if options.keep and not options.again else None, scripts)
        if not options.again:
            arms = options.arms if options.measured is None else min(options.arms, len(SOURCES))
            seeds = range(options.first, options.first + arms)
            how = {key: getattr(options, key) for key in ("points", "loads", "stops", "tendons")}
            reasons = {seed: kept.get(["made", seed, options.cases]) for seed in seeds}
            made = {
                s: workers.submit(make, s, options.cases, place, outside, how, options.measured)
                for s in seeds
                if reasons[s] is None
            }
            for seed in seeds:
                if seed in made:
                    reasons[seed] = made[seed].result()
                    kept.put(["made", seed, options.cases], reasons[seed])
                if reasons[seed]:
                    _say(f"arm {seed} cannot be used: {reasons[seed]}")
            _say(f"{options.cases} runs of each of {len(seeds)} arms are made")
        folders = sorted((place / "logs").iterdir())
        folders = [folder for folder in folders if list(folder.glob("run_*.csv"))]
        found = {folder.name: kept.get(["judged", folder.name, options.cases]) for folder in folders}
        jobs = {
            folder.name: workers.submit(judge, folder, Path(temporary) / f"{folder.name}.json")
            for folder in folders
            if found[folder.name] is None
        }
        verdicts: dict[str, dict[str, Any]] = {}
        for k, (name, given) in enumerate(found.items()):
            try:
                if given is None:
                    given = jobs[name].result()
                    kept.put(["judged", name, options.cases], given)
                verdicts |= given
            except RuntimeError as error:
                _say(str(error))
            _say(f"{k + 1}/{len(found)} arms judged")
        if options.keep or options.again:
            (place / "verdicts.json").write_text(json.dumps(verdicts, indent=1), encoding="utf-8")
        sealed = {
            name: json.loads((place / "answers" / f"{name}.json").read_text(encoding="utf-8"))
            for name in verdicts
        }
        return print_verdicts({name: (sealed[name], verdict) for name, verdict in verdicts.items()})


def _say(words: str) -> None:
    print(f"  … {words}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
