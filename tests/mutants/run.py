"""Mutation testing: change the numerics in one place at random, and see whether the tests of the room fail.

    python tests/mutants/run.py --rooms regression laws --mutants 40 --seed 1

A mutant is one comparison, operator, number, sign or choice put otherwise, in a copy of the package. It is tried first on
those of its room's quick tests that execute its statement, then on slow ones and those of rooms that guard it too, in a fork
of a process that has numpy and Drake at hand; it is dead if one fails or takes three times as long as without it. What no
test executes survives. Results are kept in ``out/mutants/`` by the content of the file that
was changed and of the tests that decided, so that a run that was ended goes on where it was; what is done until then is
a random sample too.
"""

from __future__ import annotations

import argparse
import bisect
import compileall
import hashlib
import itertools
import json
import math
import os
import re
import resource
import shutil
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

os.environ |= {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"}
sys.dont_write_bytecode = True

import pytest  # noqa: E402
from places import PACKAGE, ROOT, Mutant, mutants  # noqa: E402
from trace_lines import ARGUMENTS, KEPT, Traced, ended, ends_with_parent, traced  # noqa: E402

#: Rooms whose numerics are changed; the tests that must see it lie in the folder of the same name.
ROOMS = (
    "regression",
    "identification/uncertainty",
    "laws",
    "drake",
    "identification/reconstruction",
    "diagnosis",
)
#: Tests of other rooms that guard a room's numerics too.
GUARDS = {
    "drake": ("faults",),
    "laws": ("dynamics", "model"),
    "identification/reconstruction": ("identification/goodness", "identification/validation"),
}
#: What a trial's process has imported already.
AT_HAND = (
    "numpy scipy.optimize scipy.signal scipy.stats scipy.linalg sklearn.linear_model sklearn.cluster matplotlib.pyplot "
    "pydrake.all control osqp pysindy pyarrow.csv pyarrow.parquet msgspec hypothesis yaml jinja2 coverage"
)
#: Times what its tests take that a mutant may take, and seconds that everything else may.
PATIENCE, MARGIN = 3.0, 15.0
#: Seconds of its room's quick tests that a mutant is tried on, and of those that are left, marked slow or not, and of the
#: rooms that guard it: the quickest that execute its statement. One that they do not see counts as survived, though a
#: longer test may see it.
QUICK, SLOW = 20.0, 90.0


@cache
def _of(folder: str) -> list[Traced]:
    return [test for file in sorted((ROOT / "tests" / folder).rglob("test_*.py")) for test in traced(file)]


def stages(mutant: Mutant, room: str) -> Iterator[tuple[str, list[Traced]]]:
    """The tests that a mutant is tried on: the room's quick ones, then those that are left."""
    own = concerned(mutant, _of(room))
    quick = _within(QUICK, [test for test in own if not test.slow])
    yield "quick", quick
    others = [test for name in GUARDS.get(room, ()) for test in concerned(mutant, _of(name))]
    yield "slow", _within(SLOW, [test for test in own + others if test not in quick])


def _within(seconds: float, tests: list[Traced]) -> list[Traced]:
    tests = sorted(tests, key=lambda test: test.seconds)
    return tests[: bisect.bisect_right(list(itertools.accumulate(test.seconds for test in tests)), seconds)]


def concerned(mutant: Mutant, tests: list[Traced]) -> list[Traced]:
    """The tests that execute the mutant's statement."""
    wanted: dict[str, set[int]] = defaultdict(set)
    if mutant.names is None:
        wanted[str(mutant.path)] = set(range(mutant.first, mutant.last + 1))
    else:  # executed by the import: seen by those that execute a line with what it defines
        name = re.compile(r"\b(" + "|".join(mutant.names or (".",)) + r")\b")
        for file in (ROOT / PACKAGE).rglob("*.py") if mutant.names else [ROOT / mutant.path]:
            for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), 1):
                if name.search(line):
                    wanted[str(file.relative_to(ROOT))].add(number)
        wanted[str(mutant.path)] -= set(range(mutant.first, mutant.last + 1))
    return [
        test
        for test in tests
        if any(lines & test.lines.get(path, frozenset()) for path, lines in wanted.items())
    ]


def in_order(mutant: Mutant, tests: list[Traced]) -> list[Traced]:
    """Those of the file named for the mutant's module first, then the quickest file first."""
    # a file's tests share its fixtures
    takes: dict[str, float] = defaultdict(float)
    for test in tests:
        takes[test.name.split("::")[0]] += test.seconds

    def order(test: Traced) -> tuple[bool, float, str, float]:
        file = test.name.split("::")[0]
        return mutant.path.stem not in Path(file).stem, takes[file], file, test.seconds

    return sorted(tests, key=order)


class _Only:
    """A plugin of pytest: these tests in this order; the first that fails goes into the pipe."""

    def __init__(self, names: list[str], pipe: int) -> None:
        self.place, self.pipe = {name: k for k, name in enumerate(names)}, pipe

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        items[:] = sorted(
            (i for i in items if i.nodeid in self.place), key=lambda item: self.place[item.nodeid]
        )

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            os.write(self.pipe, report.nodeid.encode())
            self.pytest_runtest_logreport = lambda report: None  # type: ignore[method-assign]


def _try(tests: list[Traced], source: Path, pipe: int) -> None:
    """In the fork: end with pytest's status."""
    os.setsid()
    ends_with_parent()
    seconds = math.ceil(PATIENCE * sum(test.seconds for test in tests) + MARGIN)
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 5))
    nowhere = os.open(os.devnull, os.O_RDWR)
    for each in (0, 1, 2):
        os.dup2(nowhere, each)
    os.environ["PYTHONPATH"] = str(source)
    sys.path.insert(0, str(source))
    files = list(dict.fromkeys(str(ROOT / test.name.split("::")[0]) for test in tests))
    os._exit(pytest.main([*ARGUMENTS, *files], plugins=[_Only([test.name for test in tests], pipe)]))


def killer(tests: list[Traced], source: Path) -> str | None:
    """The first of the tests that fails with the package there, or what else ended them; None if all pass."""
    read, write = os.pipe()
    child = os.fork()
    if not child:
        try:
            _try(tests, source, write)
        finally:
            os._exit(99)
    os.close(write)
    # the limit is on the processor's time, which others do not take; beside it none may only wait
    status = ended(child)
    name = os.read(read, 10_000).decode()
    os.close(read)
    if status == pytest.ExitCode.OK:
        return None
    if status == 99:
        raise RuntimeError("a trial could not begin")
    return name or ("time" if status < 0 else "import")


def digest(paths: list[Path]) -> str:
    """What files contain."""
    parts = hashlib.sha256()
    for path in paths:
        parts.update(path.read_bytes())
    return parts.hexdigest()[:24]


class Results:
    """Trials that were made, by what they depend on."""

    def __init__(self, file: Path) -> None:
        self.file, self.known = file, dict[str, dict[str, Any]]()
        if file.exists():
            for line in file.read_text(encoding="utf-8").splitlines():
                if line.endswith("}"):
                    each = json.loads(line)
                    self.known[each["key"]] = each

    def get(self, key: str, room: str) -> dict[str, Any] | None:
        """The trial of this key, if the tests that decided it are what they were."""
        each = self.known.get(key)
        return each if each and each["tests"] == self.tests(each["killer"], room) else None

    def tests(self, by: str | None, room: str) -> str:
        """The content of the test file that killed, or of all tests of the room."""
        file = ROOT / (by or "").split("::")[0]
        if by and file.is_file():
            return digest([file])
        folders = () if by else (room, *GUARDS.get(room, ()))
        return digest([path for name in folders for path in sorted((ROOT / "tests" / name).rglob("*.py"))])

    def add(
        self, key: str, room: str, mutant: Mutant, by: str | None, stage: str, seconds: float
    ) -> dict[str, Any]:
        """Keep one more."""
        each = {
            **{"key": key, "room": room, "path": str(mutant.path), "line": mutant.line},
            **{
                "old": mutant.old,
                "new": mutant.new,
                "killer": by,
                "stage": stage,
                "seconds": round(seconds, 1),
            },
            "tests": self.tests(by, room),
        }
        self.known[key] = each
        with self.file.open("a", encoding="utf-8") as file:
            file.write(json.dumps(each) + "\n")
        return each


def wilson(hits: int, of: int) -> tuple[float, float]:
    """The 95 % interval of a share (Wilson's score interval)."""
    z = 1.96
    middle, spread = hits + z * z / 2, z * math.sqrt(hits * (of - hits) / of + z * z / 4)
    return (middle - spread) / (of + z * z), (middle + spread) / (of + z * z)


def main() -> None:
    """Draw, change, test, count."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rooms", nargs="+", choices=ROOMS, default=list(ROOMS))
    parser.add_argument("--mutants", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--minutes", type=float, default=math.inf, help="end after so long; a new run goes on"
    )
    options = parser.parse_args()
    begin = time.monotonic()
    drawn = mutants(options.rooms, options.mutants, options.seed)
    KEPT.mkdir(parents=True, exist_ok=True)
    results = Results(KEPT / "trials.jsonl")
    # on one core there are no worker processes, whose lines would not be seen
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    for name in AT_HAND.split():
        __import__(name)
    answers: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as scratch:
        source = Path(scratch) / "src"
        shutil.copytree(ROOT / "src", source)
        compileall.compile_dir(source, quiet=2)  # else every trial compiles the whole package anew
        for name in ("urdf", "scenarios"):
            (Path(scratch) / name).symlink_to(ROOT / name)
        for room, mutant in drawn:
            file = Path(scratch) / mutant.path
            text = file.read_text(encoding="utf-8")
            key = digest([ROOT / mutant.path]) + f":{mutant.start}:{mutant.end}:{mutant.new}"
            each = results.get(key, room)
            if each is None:
                if time.monotonic() - begin > 60 * options.minutes:
                    print(f"ended after {options.minutes:g} minutes, with {len(answers)} of {len(drawn)}")
                    break
                started, by = time.monotonic(), None
                kept, tried = file.stat(), 0
                file.write_text(mutant.mutated(text), encoding="utf-8")
                try:
                    for stage, chosen in stages(mutant, room):  # noqa: B007
                        tried += len(chosen)
                        if chosen and (by := killer(in_order(mutant, chosen), source)):
                            break
                finally:
                    file.write_text(text, encoding="utf-8")
                    os.utime(file, ns=(kept.st_atime_ns, kept.st_mtime_ns))
                each = results.add(key, room, mutant, by, stage, time.monotonic() - started)
                print(_line(each), f"({each['seconds']:.1f} s, {tried} tests)", flush=True)
            answers.append(each)
    report(answers, options.seed)


def _line(each: dict[str, Any]) -> str:
    fate = "survived" if not each["killer"] else "timed out" if each["killer"] == "time" else each["stage"]
    return f"{fate:11}{each['path']}:{each['line']}  {each['old']!r} -> {each['new']!r}"


def report(answers: list[dict[str, Any]], seed: int) -> None:
    """The score, by room and of all, and who survived."""
    print(
        f"\n{len(answers)} mutants, seed {seed}; killed quick: by the room's quick tests; slow: by what is left"
    )
    print(
        f"{'room':30}{'mutants':>8}{'quick':>8}{'slow':>8}{'timed out':>11}{'survived':>10}  score (95 % interval)"
    )
    for room in (*ROOMS, ""):
        of = [each for each in answers if each["room"].startswith(room)]
        if of:
            dead = [each for each in of if each["killer"]]
            quick = sum(each["stage"] == "quick" for each in dead)
            late = sum(each["killer"] == "time" for each in dead)
            low, high = wilson(len(dead), len(of))
            print(
                f"{room or 'all':30}{len(of):8}{quick:8}{len(dead) - quick:8}{late:11}{len(of) - len(dead):10}"
                f"  {quick / len(of):.0%} quick, {len(dead) / len(of):.0%} ({low:.0%} to {high:.0%})"
            )
    print("\n".join(_line(each) for each in answers if not each["killer"]))


if __name__ == "__main__":
    main()
