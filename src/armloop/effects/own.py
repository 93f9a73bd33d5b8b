"""Effects of a user's own, beside the listed ones: installed as entry points, or registered in a session.

A package installs effects under the entry points ``armloop.effects``, each by its name (see ``docs/own_effect.md``):

    [project.entry-points."armloop.effects"]
    eddy_brake = "my_effects:EddyBrake"

Nothing is imported before an effect is asked for: by its name, that one; for a diagnosis, all.
"""

from __future__ import annotations

import inspect
import re
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any, TypeVar

from armloop.effects.base import Effect
from armloop.effects.law import Law
from armloop.effects.listed import EFFECTS
from armloop.errors import InputError

GROUP = "armloop.effects"

_NAME = re.compile(r"[a-z][a-z0-9_]*")
_registered: dict[str, type[Effect]] = {}

Kind = TypeVar("Kind", bound=type[Effect])


def register(kind: Kind) -> Kind:
    """Add an effect for the rest of this session, as in a notebook; usable as a decorator.

    A class of the same module may be registered again under its name, as when a cell runs twice.

    Raises:
        InputError: it is no effect, is not complete, or its name is taken.
    """
    where = f"effect class {getattr(kind, '__name__', kind)!s}"
    _check(kind, where)
    other = _registered.get(kind.name)
    if other is not None and other.__module__ != kind.__module__:
        raise InputError(f"{where}: the name {kind.name!r} is taken by {_full_name(other)}; choose another")
    entry = _installed().get(kind.name)
    if entry is not None and entry.module != kind.__module__:
        raise InputError(f"{where}: the name {kind.name!r} is taken by {_words(entry)}; choose another")
    _registered[kind.name] = kind
    return kind


def find(name: str) -> type[Effect] | None:
    """A user's effect by its name, None if there is none.

    Raises:
        InputError: an installed one of that name cannot be loaded or is none.
    """
    if name in _registered:
        return _registered[name]
    entry = _installed().get(name)
    return None if entry is None else _loaded(entry)


def own_effects() -> dict[str, type[Effect]]:
    """Every effect of the user's by its name, installed ones loaded.

    Raises:
        InputError: an installed one cannot be loaded or is none. It is not passed over: a diagnosis that lacks a
            hypothesis without a word would be another diagnosis.
    """
    return {name: _loaded(entry) for name, entry in _installed().items()} | _registered


def own_names() -> list[str]:
    """Their names, without loading any."""
    return list(dict.fromkeys([*_installed(), *_registered]))


@cache
def _installed() -> dict[str, EntryPoint]:
    found: dict[str, EntryPoint] = {}
    for entry in entry_points(group=GROUP):
        if entry.name in EFFECTS:
            raise InputError(
                f"{_words(entry)}: the name {entry.name!r} is that of a listed effect; choose another"
            )
        other = found.setdefault(entry.name, entry)
        if other.value != entry.value:
            raise InputError(f"{_words(entry)}: {_words(other)} has the same name; uninstall one of the two")
    return found


@cache
def _loaded(entry: EntryPoint) -> type[Effect]:
    try:
        kind = entry.load()
    # Whatever a foreign module does wrong on its way in, the user is to read one line that names it.
    except Exception as error:
        raise InputError(
            f"{_words(entry)} cannot be loaded: {type(error).__name__}: {error}; repair or uninstall it"
        ) from error
    _check(kind, _words(entry))
    if kind.name != entry.name:
        raise InputError(f"{_words(entry)}: its class calls itself {kind.name!r}; give both one name")
    return kind


def _check(kind: Any, where: str) -> None:
    """Raise ``InputError`` unless ``kind`` is a complete effect with a name of its own."""
    if not (isinstance(kind, type) and issubclass(kind, Effect)):
        raise InputError(f"{where}: is {kind!r}; it must be a subclass of armloop.effects.Effect")
    missing = [*_undefined(kind), *sorted(kind.__abstractmethods__)]
    if not missing and not kind.parameters and kind.estimates is Effect.estimates:
        missing = ["parameters"]
    if not missing and issubclass(kind, Law) and not kind.elements and kind.values is Law.values:
        missing = ["elements"]
    if missing:
        raise InputError(f"{where}: {kind.__name__} lacks {', '.join(missing)}; define them in the class")
    if not isinstance(kind.name, str) or not _NAME.fullmatch(kind.name):
        raise InputError(
            f"{where}: its name is {kind.name!r}; it must be lower-case letters, digits and _, like 'eddy_brake'"
        )
    if kind.name in EFFECTS or kind.name == "unlisted":
        raise InputError(f"{where}: the name {kind.name!r} is that of a listed effect; choose another")
    if kind.pair_wise and not kind.joint_wise:
        raise InputError(f"{where}: an effect of a pair of joints has one at its first: set joint_wise")


def _undefined(kind: type[Effect]) -> list[str]:
    """Class attributes that a base class asks for and nobody has given."""
    return [
        key
        for base in kind.__mro__
        for key, hint in inspect.get_annotations(base).items()
        if "ClassVar" in str(hint) and not hasattr(kind, key)
    ]


def _words(entry: EntryPoint) -> str:
    package = entry.dist.name if entry.dist is not None else "an unknown package"
    return f"effect {entry.name!r} of package {package} ({entry.value})"


def _full_name(kind: type[Effect]) -> str:
    return f"{kind.__module__}.{kind.__qualname__}"
