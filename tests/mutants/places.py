"""The places of the package where a mutant can be made, and which lines a test must execute to see it."""

from __future__ import annotations

import ast
import random
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = Path("src/armloop")
#: What stands for an operator, and what is put in its stead.
_COMPARE = {
    ast.Lt: ("<", "<="),
    ast.LtE: ("<=", "<"),
    ast.Gt: (">", ">="),
    ast.GtE: (">=", ">"),
    ast.Eq: ("==", "!="),
    ast.NotEq: ("!=", "=="),
    ast.In: ("in", "not in"),
    ast.NotIn: ("not in", "in"),
    ast.Is: ("is", "is not"),
    ast.IsNot: ("is not", "is"),
}
_BINARY = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Div: ("/", "*"),
    ast.Pow: ("**", "*"),
    ast.MatMult: ("@", "*"),
    ast.BitAnd: ("&", "|"),
    ast.BitOr: ("|", "&"),
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
#: Keyword arguments that change no result: whether zip, which only a programmer's mistake makes unequal, and scipy's
#: factorizations look at what they are given; whether a solver tells how it goes on; whether a field
#: is shown by ``repr``.
_NO_NUMERICS = ("strict", "check_finite", "verbose", "repr")


@dataclass(frozen=True)
class Mutant:
    """One change of one file: characters start … end are replaced.

    ``first`` … ``last`` are the lines of its statement, in a default value's stead those of the function. ``names`` are
    those that a statement executed by the import defines: a test sees them where they are used.
    """

    path: Path
    line: int
    start: int
    end: int
    old: str
    new: str
    first: int
    last: int
    names: tuple[str, ...] | None = None

    def mutated(self, text: str) -> str:
        """The file's text with the change."""
        return text[: self.start] + self.new + text[self.end :]


class _Finder(ast.NodeVisitor):
    """Every place of a file where its meaning can be changed; not its texts, types and messages."""

    def __init__(self, path: Path) -> None:
        self.path, self.text, self.found = path, (ROOT / path).read_text(encoding="utf-8"), list[Mutant]()
        self._first, self._last, self._names, self._inside = 0, 0, None, False
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
        self.found.append(
            Mutant(
                *(self.path, node.lineno, start, end, self.text[start:end], new),  # type: ignore[attr-defined]
                *(self._first, self._last, self._names),
            )
        )

    def visit(self, node: ast.AST) -> None:
        """Keep the lines of the statement that is gone through: of one with a body, those of its head."""
        if not isinstance(node, ast.stmt):
            return super().visit(node)
        before = self._first, self._last, self._names
        body = getattr(node, "body", None)
        self._first = node.lineno
        self._last = max(node.lineno, body[0].lineno - 1) if body else node.end_lineno
        if not self._inside:
            targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
            self._names = tuple(t.id for t in targets if isinstance(t, ast.Name))
        super().visit(node)
        self._first, self._last, self._names = before

    def _between(self, node: ast.AST, left: ast.AST, right: ast.AST, old: str, new: str) -> None:
        start, end = self._span(left)[1], self._span(right)[0]
        at = self.text.find(old, start, end)
        if at >= 0:
            self._add(node, at, at + len(old), new)

    def visit_Compare(self, node: ast.Compare) -> None:
        sides = [node.left, *node.comparators]
        for operator, left, right in zip(node.ops, sides, sides[1:], strict=False):
            self._between(node, left, right, *_COMPARE[type(operator)])
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        if type(node.op) in _BINARY and not isinstance(node.left, ast.Constant | ast.JoinedStr):
            self._between(node, node.left, node.right, *_BINARY[type(node.op)])
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        old, new = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
        self._between(node, node.values[0], node.values[1], old, new)
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        """The operator alone goes: what stands between it and its operand may open a parenthesis."""
        if isinstance(node.op, ast.Not | ast.USub | ast.Invert):
            start = self._span(node)[0]
            self._add(node, start, start + (3 if isinstance(node.op, ast.Not) else 1), "")
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
        inside, self._inside, self._names = self._inside, True, None
        self._first, self._last = node.body[0].lineno, node.end_lineno
        for each in (*node.args.defaults, *(d for d in node.args.kw_defaults if d is not None), *node.body):
            self.visit(each)
        self._inside = inside

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        """Decorators say how a class is kept, not what it computes."""
        for each in node.body:
            self.visit(each)

    def visit_keyword(self, node: ast.keyword) -> None:
        """Nor do arguments that no result depends on (:data:`_NO_NUMERICS`)."""
        if node.arg not in _NO_NUMERICS:
            self.visit(node.value)


def mutants(rooms: list[str], count: int, seed: int) -> list[tuple[str, Mutant]]:
    """So many, drawn evenly from all places of the rooms."""
    places: list[tuple[str, Mutant]] = []
    for room in rooms:
        for file in sorted((ROOT / PACKAGE / room).rglob("*.py")):
            finder = _Finder(file.relative_to(ROOT))
            finder.visit(ast.parse(finder.text))
            places += [(room, mutant) for mutant in finder.found]
    return random.Random(seed).sample(places, min(count, len(places)))
