"""Mutation testing: change the numerics in one place at random, and see whether the quick tests of the room fail.

    python tests/mutants/run.py --rooms regression laws --mutants 40 --seed 1

A mutant is one comparison, operator, number, sign or choice put otherwise, in a copy of the package. It is dead if the
room's quick tests fail or take too long. Results are kept in ``out/mutants.jsonl`` by the content of the file that was
changed and of its tests, so that a run that was ended goes on where it was.
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = Path("src/armloop")
#: Rooms whose numerics are changed, and the tests that must see it.
ROOMS = {
    "regression": ["tests/regression"],
    "identification/uncertainty": ["tests/identification/uncertainty"],
    "laws": ["tests/laws"],
    "identification/reconstruction": ["tests/identification/reconstruction"],
    "diagnosis": ["tests/diagnosis"],
    "drake": ["tests/drake"],
}
_COMPARE = {
    ast.Lt: "<=",
    ast.LtE: "<",
    ast.Gt: ">=",
    ast.GtE: ">",
    ast.Eq: "!=",
    ast.NotEq: "==",
    ast.In: "not in",
    ast.NotIn: "in",
    ast.Is: "is not",
    ast.IsNot: "is",
}
_BINARY = {
    ast.Add: "-",
    ast.Sub: "+",
    ast.Mult: "/",
    ast.Div: "*",
    ast.Pow: "*",
    ast.MatMult: "*",
    ast.BitAnd: "|",
    ast.BitOr: "&",
}
_SIGNS = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.Pow: "**",
    ast.MatMult: "@",
    ast.BitAnd: "&",
    ast.BitOr: "|",
}
_NAMES = {
    "min": "max",
    "max": "min",
    "all": "any",
    "any": "all",
    "sin": "cos",
    "cos": "sin",
    "minimum": "maximum",
    "maximum": "minimum",
}


@dataclass(frozen=True)
class Mutant:
    """One change of one file: characters start … end are replaced."""

    path: Path
    line: int
    start: int
    end: int
    old: str
    new: str


class _Finder(ast.NodeVisitor):
    """Every place of a file where its meaning can be changed; not its texts, types and messages."""

    def __init__(self, path: Path) -> None:
        self.path, self.text, self.found = path, (ROOT / path).read_text(encoding="utf-8"), list[Mutant]()
        self._lines = [0]
        for line in self.text.splitlines(keepends=True):
            self._lines.append(self._lines[-1] + len(line))

    def _at(self, line: int, column: int) -> int:
        begin = self._lines[line - 1]
        raw = self.text[begin : self._lines[line]].encode()
        return begin + len(raw[:column].decode())

    def _span(self, node: ast.AST) -> tuple[int, int]:
        return self._at(node.lineno, node.col_offset), self._at(node.end_lineno, node.end_col_offset)  # type: ignore[attr-defined]

    def _add(self, node: ast.AST, start: int, end: int, new: str) -> None:
        self.found.append(Mutant(self.path, node.lineno, start, end, self.text[start:end], new))  # type: ignore[attr-defined]

    def _between(self, node: ast.AST, left: ast.AST, right: ast.AST, old: str, new: str) -> None:
        start, end = self._span(left)[1], self._span(right)[0]
        at = self.text.find(old, start, end)
        if at >= 0:
            self._add(node, at, at + len(old), new)

    def visit_Compare(self, node: ast.Compare) -> None:
        sides = [node.left, *node.comparators]
        for k, operator in enumerate(node.ops):
            new = _COMPARE[type(operator)]
            old = {v: t for t, v in ((ast.LtE, "<="), (ast.Lt, "<"), (ast.GtE, ">="), (ast.Gt, ">"))}
            sign = next((text for text, kind in old.items() if kind is type(operator)), None)
            sign = (
                sign
                or {
                    ast.Eq: "==",
                    ast.NotEq: "!=",
                    ast.In: "in",
                    ast.NotIn: "not in",
                    ast.Is: "is",
                    ast.IsNot: "is not",
                }[type(operator)]
            )
            self._between(node, sides[k], sides[k + 1], sign, new)
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        kind = type(node.op)
        if kind in _BINARY and not isinstance(node.left, ast.Constant | ast.JoinedStr):
            self._between(node, node.left, node.right, _SIGNS[kind], _BINARY[kind])
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        old, new = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
        self._between(node, node.values[0], node.values[1], old, new)
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        if isinstance(node.op, ast.Not | ast.USub | ast.Invert):
            start = self._span(node)[0]
            self._add(node, start, self._span(node.operand)[0], " " if isinstance(node.op, ast.Not) else "")
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        start, end = self._span(node)
        if isinstance(node.value, bool):
            self._add(node, start, end, str(not node.value))
        elif isinstance(node.value, int):
            self._add(node, start, end, str(node.value + 1))
        elif isinstance(node.value, float):
            self._add(node, start, end, repr(2 * node.value if node.value else 1.0))

    def visit_Name(self, node: ast.Name) -> None:
        if node.id in _NAMES:
            self._add(node, *self._span(node), _NAMES[node.id])

    def visit_Attribute(self, node: ast.Attribute) -> None:
        if node.attr in _NAMES:
            end = self._span(node)[1]
            self._add(node, end - len(node.attr), end, _NAMES[node.attr])
        self.generic_visit(node)

    def visit_Raise(self, node: ast.Raise) -> None:
        """What a message says is no numerics."""

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        """Nor is text."""

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.visit(node.value)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        if node.name in ("sentence", "label", "to_dict", "words", "__repr__"):
            return
        for each in (*node.args.defaults, *(d for d in node.args.kw_defaults if d is not None), *node.body):
            self.visit(each)


def mutants(rooms: list[str], count: int, seed: int) -> list[tuple[str, Mutant]]:
    """So many, drawn evenly from all places of the rooms."""
    places: list[tuple[str, Mutant]] = []
    for room in rooms:
        for file in sorted((ROOT / PACKAGE / room).rglob("*.py")):
            finder = _Finder(file.relative_to(ROOT))
            finder.visit(ast.parse(finder.text))
            places += [(room, mutant) for mutant in finder.found]
    return random.Random(seed).sample(places, min(count, len(places)))


def digest(room: str, mutant: Mutant) -> str:
    """What a result depends on: the file, the change, and the room's tests."""
    parts = hashlib.sha256()
    for path in [
        ROOT / mutant.path,
        *(p for tests in ROOMS[room] for p in sorted((ROOT / tests).rglob("*.py"))),
    ]:
        parts.update(path.read_bytes())
    parts.update(repr((mutant.start, mutant.end, mutant.new)).encode())
    return parts.hexdigest()[:24]


def run(tests: list[str], package: Path, seconds: float) -> tuple[bool, float]:
    """Whether the tests pass with the package, and how long they took."""
    environment = {**os.environ, "PYTHONPATH": str(package), "PYTHONDONTWRITEBYTECODE": "1"}
    environment |= {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-x",
        "-q",
        "-n",
        "0",
        "-m",
        "not slow",
        "-p",
        "no:cacheprovider",
    ]
    begin = time.monotonic()
    try:
        done = subprocess.run(
            [*command, *tests], cwd=ROOT, env=environment, capture_output=True, timeout=seconds, check=False
        )
    except subprocess.TimeoutExpired:
        return False, time.monotonic() - begin
    return done.returncode == 0, time.monotonic() - begin


def survivors(answers: list[dict[str, object]]) -> Iterator[str]:
    """One line per mutant that no test saw."""
    for each in answers:
        if each["survived"]:
            yield f"  {each['path']}:{each['line']}  {each['old']!r} -> {each['new']!r}"


def main() -> None:
    """Draw, change, test, count."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rooms", nargs="+", choices=ROOMS, default=list(ROOMS))
    parser.add_argument("--mutants", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    kept = ROOT / "out" / "mutants.jsonl"
    kept.parent.mkdir(exist_ok=True)
    known = {}
    if kept.exists():
        for line in kept.read_text(encoding="utf-8").splitlines():
            if line.endswith("}"):
                each = json.loads(line)
                known[each["digest"]] = each
    patience: dict[str, float] = {}
    answers: list[dict[str, object]] = []
    with tempfile.TemporaryDirectory() as scratch:
        copy = Path(scratch) / "src"
        shutil.copytree(ROOT / "src", copy)
        for name in ("urdf", "scenarios"):
            (Path(scratch) / name).symlink_to(ROOT / name)
        for room, mutant in mutants(options.rooms, options.mutants, options.seed):
            key = digest(room, mutant)
            if key not in known:
                if room not in patience:
                    passed, took = run(ROOMS[room], copy, 1800)
                    if not passed:
                        sys.exit(f"the quick tests of {room} fail without any change")
                    patience[room] = 3 * took + 30
                file = Path(scratch) / mutant.path
                text = file.read_text(encoding="utf-8")
                file.write_text(text[: mutant.start] + mutant.new + text[mutant.end :], encoding="utf-8")
                try:
                    survived, took = run(ROOMS[room], copy, patience[room])
                finally:
                    file.write_text(text, encoding="utf-8")
                known[key] = {
                    "digest": key,
                    "room": room,
                    "path": str(mutant.path),
                    "line": mutant.line,
                    "old": mutant.old,
                    "new": mutant.new,
                    "survived": survived,
                    "seconds": round(took, 1),
                }
                with kept.open("a", encoding="utf-8") as file_of_all:
                    file_of_all.write(json.dumps(known[key]) + "\n")
            answers.append(known[key])
            each = known[key]
            print(
                f"{'SURVIVED' if each['survived'] else 'dead':9}{each['path']}:{each['line']}  "
                f"{each['old']!r} -> {each['new']!r}  ({each['seconds']:.0f} s)",
                flush=True,
            )
    dead = sum(not each["survived"] for each in answers)
    print(f"\n{dead} of {len(answers)} mutants died ({dead / max(len(answers), 1):.0%})")
    print("\n".join(survivors(answers)))


if __name__ == "__main__":
    main()
