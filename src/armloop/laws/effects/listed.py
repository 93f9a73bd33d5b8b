"""The effects that armloop brings along: every effect that a file of this folder defines."""

from __future__ import annotations

import inspect
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

from armloop.laws.effects.base import Effect

_PACKAGE = __package__ or "armloop.laws.effects"


def _defined(module: str) -> list[type[Effect]]:
    """The named effects of a module, but not those that it imports."""
    members = vars(import_module(f"{_PACKAGE}.{module}")).values()
    return [
        kind
        for kind in members
        if inspect.isclass(kind)
        and issubclass(kind, Effect)
        and kind.__module__ == f"{_PACKAGE}.{module}"
        and hasattr(kind, "name")
    ]


_FOLDER = str(Path(__file__).parent)
_FILES = sorted(
    {module.name for module in iter_modules([_FOLDER])} - {"base", "events", "found", "law", "listed", "own"}
)

#: Every listed effect by its name in ``diagnosis.json``. Of two that do equally well with as many numbers a search names
#: the first: what looks like another comes after it, what leans on the known model after what the motion tells alone, and
#: a fault of the record after what acts on the arm.
EFFECTS: dict[str, type[Effect]] = {
    kind.name: kind
    for kind in sorted(
        (k for file in _FILES for k in _defined(file)),
        key=lambda k: (bool(k.looks_like), k.needs_model, k.sensor, k.name),
    )
}


def listed(effect: Effect) -> bool:
    """Whether an effect is one of these. How often what is named is there, is known of these alone."""
    return EFFECTS.get(effect.name) is type(effect)
