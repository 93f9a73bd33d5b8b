"""A registry: named things of one kind, those that come along and a user's own, registered or installed as entry points.

Nothing of a user's is imported before it is asked for: by its name, that one; all of them only where all are wanted.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Generic, TypeVar

from armloop.util.errors import InputError

T = TypeVar("T")

_NAME = re.compile(r"[a-z][a-z0-9_]*")


def check_class(kind: Any, where: str, base: type, public: str, needed: Sequence[str] = ()) -> None:
    """Raise ``InputError`` unless a class is a subclass of ``base``, that users know as ``public``, with what it needs."""
    if not (isinstance(kind, type) and issubclass(kind, base)):
        raise InputError(f"{where}: is {kind!r}; it must be a subclass of {public}")
    missing = [key for key in needed if getattr(kind, key, None) is getattr(base, key, None)]
    if missing:
        raise InputError(f"{where}: {kind.__name__} lacks {', '.join(missing)}; define them in the class")


class Registry(Generic[T]):
    """Things of one kind by their names; each has an attribute ``name``.

    Attributes:
        group: of the entry points, ``armloop.effects`` for instance.
        noun: what one of them is called.
        listed: those that come along.
        check: raises ``InputError``, which begins with the place handed in, where a user's own is none of the kind.
        session: those registered since Python started.
    """

    def __init__(
        self, group: str, noun: str, listed: Mapping[str, T], check: Callable[[Any, str], None]
    ) -> None:
        self.group, self.noun, self.listed, self._check = group, noun, listed, check
        self.session: dict[str, T] = {}
        self._loaded: dict[str, T] = {}

    def register(self, thing: Any) -> None:
        """Add one for the rest of this session. One of the same module may be registered again, as when a cell runs twice.

        Raises:
            InputError: it is none of the kind, or its name is taken.
        """
        where = f"{self.noun} class {getattr(thing, '__name__', thing)!s}"
        self._checked(thing, where)
        home, other, entry = _home(thing), self.session.get(thing.name), self.installed.get(thing.name)
        if other is not None and _home(other) != home:
            taken = f"{_home(other)}.{getattr(other, '__qualname__', type(other).__qualname__)}"
        elif entry is not None and entry.module != home:
            taken = self.words(entry)
        else:
            self.session[thing.name] = thing
            return
        raise InputError(f"{where}: the name {thing.name!r} is taken by {taken}; choose another")

    def find(self, name: str) -> T | None:
        """The one of this name, None if there is none; raises ``InputError`` for an installed one that is no good."""
        found = self.listed.get(name, self.session.get(name))
        return self._load(self.installed[name]) if found is None and name in self.installed else found

    def own(self) -> dict[str, T]:
        """Every one of the user's by its name, installed ones loaded; raises ``InputError`` for one that is no good.

        It is not passed over: what lacks one without a word would be something else.
        """
        return {name: self._load(entry) for name, entry in self.installed.items()} | self.session

    def own_names(self) -> list[str]:
        """Names of the user's own, without loading any."""
        return list(dict.fromkeys([*self.installed, *self.session]))

    def forget(self) -> None:
        """Take back what was registered, and look for installed ones anew."""
        self.session.clear()
        self._loaded.clear()
        self.__dict__.pop("installed", None)

    @cached_property
    def installed(self) -> dict[str, EntryPoint]:
        """Entry points by name; raises ``InputError`` for a name that is a listed one's, or two packages'."""
        found: dict[str, EntryPoint] = {}
        for entry in entry_points(group=self.group):
            if entry.name in self.listed:
                raise InputError(
                    f"{self.words(entry)}: the name {entry.name!r} is that of a listed {self.noun}; choose another"
                )
            other = found.setdefault(entry.name, entry)
            if other.value != entry.value:
                raise InputError(
                    f"{self.words(entry)}: {self.words(other)} has the same name; uninstall one of the two"
                )
        return found

    def words(self, entry: EntryPoint) -> str:
        """An entry point, and the package it is of."""
        package = entry.dist.name if entry.dist is not None else "an unknown package"
        return f"{self.noun} {entry.name!r} of package {package} ({entry.value})"

    def _load(self, entry: EntryPoint) -> T:
        if entry.name in self._loaded:
            return self._loaded[entry.name]
        try:
            thing = entry.load()
        # Whatever a foreign module does wrong on its way in, the user is to read one line that names it.
        except Exception as error:
            raise InputError(
                f"{self.words(entry)} cannot be loaded: {type(error).__name__}: {error}; repair or uninstall it"
            ) from error
        self._checked(thing, self.words(entry))
        if thing.name != entry.name:
            raise InputError(
                f"{self.words(entry)}: its class calls itself {thing.name!r}; give both one name"
            )
        return self._loaded.setdefault(entry.name, thing)

    def _checked(self, thing: Any, where: str) -> None:
        self._check(thing, where)
        if not isinstance(thing.name, str) or not _NAME.fullmatch(thing.name):
            raise InputError(
                f"{where}: its name is {thing.name!r}; it must be lower-case letters, digits and _, like 'eddy_brake'"
            )
        if thing.name in self.listed:
            raise InputError(
                f"{where}: the name {thing.name!r} is that of a listed {self.noun}; choose another"
            )


def _home(thing: Any) -> str:
    """The module that a class, or the class of an object, is of."""
    return str(getattr(thing, "__module__", type(thing).__module__))
