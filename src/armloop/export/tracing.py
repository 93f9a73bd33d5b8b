"""Symbolic tracing by operator overloading: numbers that remember how they were computed, to be written as C.

The same plain arithmetic that serves floats, arrays and symbols (see :mod:`armloop.util.functions`) runs once on these; what
comes out is a graph of operations in which equal ones are one (hash consing) and what multiplies zero is gone.
Sines and cosines of whole-number combinations of the joints' angles follow from those of single joints by the
addition theorem: an arm has few joints and a model many waves.
"""

from __future__ import annotations

import math
import operator
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any, cast

from armloop.util.functions import Functions

Key = tuple[Any, ...]


def _operators(sign: str) -> tuple[Callable[[Node, Any], Node], Callable[[Node, Any], Node]]:
    """The method for a sign between a node and another number, and the one for another number and a node."""
    return (
        lambda self, other: self.graph.operate(sign, self, other),
        lambda self, other: self.graph.operate(sign, other, self),
    )


class Node:
    """One number: an input, a constant, or an operation on others."""

    __slots__ = ("angle", "graph", "key")

    def __init__(self, graph: Graph, key: Key, angle: tuple[int, ...] | None = None) -> None:
        self.graph, self.key = graph, key
        #: Whole multiples of the angles that this is the sum of, where it is one.
        self.angle = angle

    __add__, __radd__ = _operators("+")
    __sub__, __rsub__ = _operators("-")
    __mul__, __rmul__ = _operators("*")
    __truediv__, __rtruediv__ = _operators("/")

    def __neg__(self) -> Node:
        return -1.0 * self

    def __pos__(self) -> Node:
        return self

    def __abs__(self) -> Node:
        return self.graph.call("fabs", self)

    def __pow__(self, power: int) -> Node:
        if power != int(power) or power < 0:
            raise TypeError(f"only whole powers from 0 can be written, not {power}")
        result: Any = 1.0
        for _ in range(int(power)):
            result = result * self
        return self.graph.node(result)

    def __bool__(self) -> bool:
        return _branches()


def _branches(*_: Any) -> bool:
    raise TypeError("a law that branches on its arguments cannot be written as one formula")


class Graph:
    """The operations of one formula."""

    def __init__(self, angles: int) -> None:
        """Take the number of joint angles that waves are combinations of."""
        self.angles = angles
        self._nodes: dict[Key, Node] = {}
        self._waves: dict[tuple[int, ...], tuple[Node, Node]] = {}

    def input(self, name: str, angle: int | None = None) -> Node:
        """A named input; ``angle`` is the index of the joint whose angle it is."""
        wave = None if angle is None else tuple(int(k == angle) for k in range(self.angles))
        return self._made(("input", name), wave)

    def constant(self, value: float) -> Node:
        """A number."""
        value = float(value)
        if not math.isfinite(value):
            raise ValueError(f"a coefficient is {value}, not a finite number")
        return self._made(("constant", value + 0.0), (0,) * self.angles if value == 0.0 else None)

    def node(self, x: Any) -> Node:
        """A node of any number."""
        return x if isinstance(x, Node) else self.constant(x)

    def functions(self) -> Functions:
        """The elementary functions on nodes."""
        return Functions(
            sin=lambda x: self._wave(x, 0),
            cos=lambda x: self._wave(x, 1),
            exp=lambda x: self.call("exp", x),
            tanh=lambda x: self.call("tanh", x),
            sqrt=lambda x: self.call("sqrt", x),
            sign=lambda x: self.call("sgn", x),
            clip=_branches,
        )

    def operate(self, sign: str, a: Any, b: Any) -> Node:
        """The sum, difference, product or quotient of two numbers."""
        a, b = self.node(a), self.node(b)
        x, y = _value(a), _value(b)
        if x is not None and y is not None:
            return self.constant(_ARITHMETIC[sign](x, y))
        return {"+": self._sum, "-": self._difference, "*": self._product, "/": self._quotient}[sign](
            a, b, x, y
        )

    def _sum(self, a: Node, b: Node, x: float | None, y: float | None) -> Node:
        if x == 0.0:
            return b
        if y == 0.0:
            return a
        if b.key[0] == "-" and b.key[2] is a:  # c + (1 - c) of a rotation about a coordinate axis
            return cast(Node, b.key[1])
        if b.key[0] == "*" and _value(b.key[1]) == -1.0:
            return self._made(("-", a, b.key[2]), _combined(a, b, 1))
        return self._made(("+", a, b), _combined(a, b, 1))

    def _difference(self, a: Node, b: Node, x: float | None, y: float | None) -> Node:
        if y == 0.0:
            return a
        return -b if x == 0.0 else self._made(("-", a, b), _combined(a, b, -1))

    def _product(self, a: Node, b: Node, x: float | None, y: float | None) -> Node:
        if y is not None:
            a, b, x = b, a, y
        if x == 0.0:
            return self.constant(0.0)
        if x == 1.0:
            return b
        angle = None
        if x is not None and b.angle is not None and x == int(x):
            angle = tuple(int(x) * k for k in b.angle)
        return self._made(("*", a, b), angle)

    def _quotient(self, a: Node, b: Node, x: float | None, y: float | None) -> Node:
        return a if x == 0.0 or y == 1.0 else self._made(("/", a, b), None)

    def call(self, name: str, x: Any) -> Node:
        """A function of one number."""
        x = self.node(x)
        value = _value(x)
        if value is not None:
            return self.constant(float(_FUNCTIONS[name](value)))
        return self._made((name, x), None)

    def _made(self, key: Key, angle: tuple[int, ...] | None) -> Node:
        found = self._nodes.get(key)
        if found is None:
            found = self._nodes[key] = Node(self, key, angle)
        return found

    def _wave(self, x: Any, which: int) -> Node:
        x = self.node(x)
        if x.angle is None or max(map(abs, x.angle), default=0) > _HIGHEST:
            return self.call(("sin", "cos")[which], x)
        return self._sine_cosine(x.angle)[which]

    def _sine_cosine(self, wave: tuple[int, ...]) -> tuple[Node, Node]:
        """Sine and cosine of a whole-number combination of the angles."""
        if wave in self._waves:
            return self._waves[wave]
        order = sum(map(abs, wave))
        first = next((k for k, m in enumerate(wave) if m), None)
        if first is None:
            found = self.constant(0.0), self.constant(1.0)
        elif wave[first] < 0:
            s, c = self._sine_cosine(tuple(-m for m in wave))
            found = -s, c
        elif order == 1:
            angle = next(n for n in self._nodes.values() if n.key[0] == "input" and n.angle == wave)
            found = self.call("sin", angle), self.call("cos", angle)
        else:
            last = max(k for k, m in enumerate(wave) if m)
            step = 1 if wave[last] > 0 else -1
            unit = tuple(int(k == last) for k in range(len(wave)))
            rest = tuple(m - step * u for m, u in zip(wave, unit, strict=True))
            (s1, c1), (s2, c2) = self._sine_cosine(rest), self._sine_cosine(unit)
            found = (
                (s1 * c2 + c1 * s2, c1 * c2 - s1 * s2) if step > 0 else (s1 * c2 - c1 * s2, c1 * c2 + s1 * s2)
            )
        self._waves[wave] = found
        return found


#: Multiples of an angle that are still built from single ones; a motor's ripple of order 101 is not.
_HIGHEST = 8
_ARITHMETIC = {"+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv}
_FUNCTIONS: dict[str, Callable[[float], float]] = {
    "sin": math.sin,
    "cos": math.cos,
    "exp": math.exp,
    "tanh": math.tanh,
    "sqrt": math.sqrt,
    "fabs": abs,
    "sgn": lambda x: (x > 0) - (x < 0),
}


def _value(x: Node) -> float | None:
    return float(x.key[1]) if x.key[0] == "constant" else None


def _combined(a: Node, b: Node, sign: int) -> tuple[int, ...] | None:
    if a.angle is None or b.angle is None:
        return None
    return tuple(x + sign * y for x, y in zip(a.angle, b.angle, strict=True))


def statements(outputs: Sequence[Node]) -> tuple[list[str], list[str]]:
    """C statements that compute what several outputs need, each once, and the outputs' expressions.

    An operation that is used once is written where it is used; a sum of products stays a line to read.
    """
    order = _ordered(outputs)
    uses = Counter(id(x) for node in order for x in _operands(node))
    text: dict[int, str] = {}
    lines: list[str] = []
    for node in order:
        kind = node.key[0]
        if kind == "input":
            text[id(node)] = node.key[1]
            continue
        if kind == "constant":
            text[id(node)] = literal(node.key[1])
            continue
        operands = [text[id(x)] for x in _operands(node)]
        if kind in "+-*/":
            written = f"({operands[0]} {kind} {operands[1]})"
        else:
            written = f"{kind}({operands[0]})"
        if uses[id(node)] > 1 or len(written) > _LONGEST:
            name = f"t{len(lines)}"
            lines.append(f"const double {name} = {_bare(written)};")
            written = name
        text[id(node)] = written
    return lines, [_bare(text[id(node)]) for node in outputs]


#: Characters of an expression before it gets a line of its own.
_LONGEST = 300


def literal(value: float) -> str:
    """A C literal that reads back as exactly this number."""
    text = repr(float(value))
    text = text if any(mark in text for mark in ".en") else text + ".0"
    return f"({text})" if value < 0 else text


def inputs_used(outputs: Sequence[Node]) -> set[str]:
    """Names of the inputs that the outputs depend on."""
    return {node.key[1] for node in _ordered(outputs) if node.key[0] == "input"}


def _ordered(outputs: Sequence[Node]) -> list[Node]:
    """All nodes that the outputs depend on, each once, behind its operands (depth first)."""
    found: dict[int, Node] = {}
    stack = [(node, False) for node in reversed(outputs)]
    while stack:
        node, done = stack.pop()
        if done:
            found[id(node)] = node
        elif id(node) not in found:
            stack.append((node, True))
            stack += [(x, False) for x in reversed(_operands(node))]
    return list(found.values())


def _operands(node: Node) -> list[Node]:
    return [x for x in node.key[1:] if isinstance(x, Node)]


def _bare(text: str) -> str:
    """Without the outermost brackets, where they belong together."""
    if not (text.startswith("(") and text.endswith(")")):
        return text
    depth = 0
    for k, mark in enumerate(text):
        depth += (mark == "(") - (mark == ")")
        if depth == 0 and k < len(text) - 1:
            return text
    return text[1:-1]
