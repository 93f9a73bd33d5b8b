"""The effects that armloop brings along: every effect that a file of this folder defines."""

from __future__ import annotations

import inspect
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

from armloop.laws.effects.base import Effect

_PACKAGE = __package__ or "armloop.laws.effects"


_FILES = {module.name for module in iter_modules([str(Path(__file__).parent)])}
_MODULES = [
    import_module(f"{_PACKAGE}.{name}")
    for name in sorted(_FILES - {"base", "events", "found", "law", "listed", "own"})
]
#: The named effects of each file, but not those that it imports.
_DEFINED = [
    kind
    for module in _MODULES
    for kind in vars(module).values()
    if inspect.isclass(kind)
    and issubclass(kind, Effect)
    and kind.__module__ == module.__name__
    and hasattr(kind, "name")
]

#: Every listed effect by its name in ``diagnosis.json``. Of two that do equally well with as many numbers a search names
#: the first: what looks like another comes after it, what leans on the known model after what the motion tells alone, and
#: a fault of the record after what acts on the arm.
EFFECTS: dict[str, type[Effect]] = {
    kind.name: kind
    for kind in sorted(
        _DEFINED, key=lambda kind: (bool(kind.looks_like), kind.needs_model, kind.sensor, kind.name)
    )
}


def listed(effect: Effect) -> bool:
    """Whether an effect is one of these. How often what is named is there, is known of these alone."""
    return EFFECTS.get(effect.name) is type(effect)
