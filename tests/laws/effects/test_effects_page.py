"""The page of the effects has a row for each, with the parameters as a scenario and a model's file name them."""

from __future__ import annotations

from pathlib import Path

import pytest

from armloop.laws.effects import EFFECTS, effect_kind
from armloop.laws.effects.base import Effect, Parameter

_UNITS = {"TAU": "N·m", "POS": "rad", "INERTIA": "kg·m²", "kg*m^2": "kg·m²", "^2": "²", "*": "·"}
_OF = {"arm": "the arm", "joint": "a joint", "pair": "two joints"}


def unit(of: Parameter) -> str:
    """As a reader writes it, of a joint that turns."""
    text = of.unit
    for name, written in _UNITS.items():
        text = text.replace(name, written)
    return "" if text == "1" else f" {text}"


def row(kind: type[Effect] | Effect) -> str:
    numbers = ", ".join(f"`{p.name}`{unit(p)}{' (3)' if p.size == 3 else ''}" for p in kind.parameters)
    law = getattr(kind, "law", None)
    written = "`" + law.replace("|", "\\|") + "`" if law else ""
    return f"| `{kind.name}` | {_OF[kind.scope]} | {written} | {numbers} |"


@pytest.mark.parametrize("name", EFFECTS)
def test_an_effect_has_its_row(name: str, repository: Path) -> None:
    page = (repository / "docs" / "effects.md").read_text(encoding="utf-8").splitlines()
    assert row(effect_kind(name)) in page
