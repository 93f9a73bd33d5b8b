"""Closed-form expression of a model: a readable sum per joint, of its terms, its friction and the laws found beside them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from armloop.laws.effects.base import number
from armloop.laws.effects.found import RANGE, FoundLaw
from armloop.laws.friction import Direction, FrictionLaw
from armloop.model.added_effect import AddedEffect
from armloop.model.components import Component
from armloop.robot.arm import Arm

_STOP = (
    "stop(q,w) is friction with memory, from -1 to 1: the stretch since the last reversal, in parts of the w, rad or m,\n"
    "  at which the joint slides"
)
#: A term: the step that found it, its coefficient, and its name.
Term = tuple[int, float, str]


class _Model(Protocol):
    @property
    def arm(self) -> Arm: ...
    @property
    def components(self) -> Sequence[Component]: ...
    @property
    def friction(self) -> FrictionLaw: ...
    @property
    def effects(self) -> Sequence[AddedEffect]: ...


def formulas(model: _Model) -> list[str]:
    """One readable formula of the torque per joint; what is of a sensor, or of one run, is in none."""
    lines, kept = [], [a for a in model.effects if not a.effect.sensor and not a.effect.event]
    for j in range(model.arm.n):
        terms: list[Term] = []
        for component in model.components:
            terms += component.terms(model.arm, j)
        terms += [(t.step, t.coefficient, t.name(j + 1)) for t in model.friction.terms[j]]
        terms.sort(key=lambda term: term[0])
        terms += [(3, c, name) for added in kept for c, name in _terms(added, j)]
        body = " ".join(
            f"{'-' if c < 0 else '+'} {abs(c):.4g}{'' if name == '1' else '*' + name}" for _, c, name in terms
        )
        lines.append(f"tau{j + 1} = {body.removeprefix('+ ') or '0'}")
    return lines


def legend(model: _Model) -> list[str]:
    """What symbols in the formulas stand for, an entry each; empty where they speak for themselves."""
    remembers = any(model.friction.remembers(j) for j in range(len(model.friction.terms)))
    found = [line for component in model.components for line in component.legend()] + [_STOP] * remembers
    named = [
        a
        for a in model.effects
        if any(_name(a) == name for j in range(model.arm.n) for _, name in _terms(a, j))
    ]
    return [*found, *(f"{_name(added)}: {added.sentence()}" for added in named)]


def _name(added: AddedEffect) -> str:
    """What an effect is called that has no formula of the state along one direction."""
    return f"{added.effect.name}(q,v,vdot)"


def _terms(added: AddedEffect, j: int) -> list[tuple[float, str]]:
    """Coefficients and names of an effect's terms on a joint (0-based)."""
    if isinstance(added.effect, FoundLaw):
        own = added.effect.index == j
        return [(number(e.value), name) for name, e in added.parameters.items() if own and name not in RANGE]
    placed = added.placed()
    if placed is None:
        acts = not added.effect.indices or j in added.effect.indices
        return [(1.0, _name(added))] if acts else []
    along, acting = placed
    share = {along.other: along.ratio, along.joint: 1.0}.get(j, 0.0)
    terms = []
    for coefficient, element, parameter in acting if share else ():
        name = (
            _along(element.pattern, along)
            .format(j=along.joint + 1, p=parameter)
            .replace("((", "(")
            .replace("))", ")")
        )
        c = share * coefficient
        if c:
            terms.append((-c, "1") if name == "-1" else (c, name))
    return terms


def _along(pattern: str, along: Direction) -> str:
    """An element's pattern for the component of the motion along a direction."""
    if not along.ratio:
        return pattern
    ratio, by = abs(along.ratio), "" if along.ratio > 0 else "-"
    sign, factor = by or "+", "" if ratio == 1 else f"{ratio:.4g}*"
    for symbol in ("vdot", "load", "q", "v"):
        pattern = pattern.replace(
            symbol + "{j}", f"({symbol}{along.joint + 1}{sign}{factor}{symbol}{along.other + 1})"
        )
    return pattern
