"""A command's options as a class: its annotated attributes are the parser, the checks and the defaults of the function.

    class Options(Chain, Json):
        model: str = argument("MODEL.json")
        out: str = required("folder for the answer")
        max_order: int = option("largest order tried (%(default)s)", 4, check=within(1, 6, "give an order from 1 to 6"))

``Options.max_order`` is the default, which the function of ``import armloop`` has as its own; ``options.max_order`` is what
was given. The type is the annotation's, text (``from __future__ import annotations``); a flag is a ``bool``. Dataclasses, or
tyro upon them, would do the same, but cost each start at least the 20 ms of ``inspect``, where all of argparse takes 20.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any, ClassVar, NamedTuple

from armloop.util.errors import InputError
from armloop.util.given import require

#: What Python code must give for an option of a type, as a message says it.
_KINDS = {"str": "a word", "int": "a whole number", "float": "a finite number", "bool": "True or False"}


class Check(NamedTuple):
    """What a number must be, and what is said of one that is not."""

    holds: Callable[[Any], bool]
    wrong: str


def within(least: float, most: float, wrong: str) -> Check:
    """A number from ``least`` to ``most``."""
    return Check(lambda x: least <= x <= most, wrong)


def positive(wrong: str) -> Check:
    """A finite number above zero."""
    return Check(lambda x: 0 < x < math.inf, wrong)


def comma_numbers(text: str, option: str) -> list[float]:
    """The numbers of an option with one per joint; raises ``InputError``."""
    try:
        return [float(part) for part in text.split(",")]
    except ValueError as error:
        raise InputError(f"{option} {text!r}: give one number per joint, separated by commas") from error


def whole(least: int, most: int, wrong: str) -> Callable[[str], int]:
    """The type of an option that takes a whole number from ``least`` to ``most``; ``wrong`` is said of any other text."""

    def parse(text: str) -> int:
        if not (text.isascii() and text.isdecimal()) or len(text) > 10 or not least <= int(text) <= most:
            raise argparse.ArgumentTypeError(f"{text!r:.60} is {wrong}")
        return int(text)

    return parse


class Option:
    """One option or argument: of the class it gives the default, of an object what was given (a descriptor).

    Attributes:
        check: of a value that is given; None where any will do.
        but_not: options with the same word here exclude each other.
        more: what ``ArgumentParser.add_argument`` wants to know in addition.
    """

    def __init__(
        self,
        help: str | None,
        default: Any = None,
        check: Check | None = None,
        but_not: str = "",
        **more: Any,
    ) -> None:
        self.default, self.check, self.but_not = default, check, but_not
        self.more = {"help": help, **more}
        self.positional = False

    def __get__(self, instance: object, owner: type) -> Any:
        return self.default

    def declare(self, parser: argparse._ActionsContainer, name: str, kind: str) -> None:
        """Add it to a parser; ``kind`` is its annotation."""
        kind = kind.removesuffix(" | None")
        more: dict[str, Any] = dict(self.more)
        if kind == "bool":
            more["action"] = "store_true"
        elif kind in ("int", "float"):
            more.setdefault("type", {"int": int, "float": float}[kind])
        if self.positional:
            parser.add_argument(name, **more)
            return
        parser.add_argument(f"--{name.replace('_', '-')}", default=self.default, **more)


def option(help: str, default: Any = None, **more: Any) -> Any:
    """An option that may be left out."""
    return Option(help, default, **more)


def required(help: str, **more: Any) -> Any:
    """An option that must be given."""
    return Option(help, required=True, **more)


def flag(help: str, **more: Any) -> Any:
    """An option without a value."""
    return Option(help, False, **more)


def several(help: str, metavar: str, **more: Any) -> Any:
    """An option that may be given several times."""
    return Option(help, [], metavar=metavar, action="append", **more)


def argument(metavar: str | None = None, help: str | None = None, **more: Any) -> Any:
    """An argument without a name."""
    if metavar is not None:
        more["metavar"] = metavar
    found = Option(help, **more)
    found.positional = True
    return found


class Options:
    """The options of a command; what several share are base classes, whose options follow its own.

    Class attributes:
        group: heading in the help for a class's options and those of its bases.
    """

    group: ClassVar[str]
    command: str
    force: bool = flag("replace files that are read, or that this command has not written")

    def __init__(self, given: Mapping[str, Any]) -> None:
        vars(self).update(given)
        for _, name, each in self._all():
            _check_given(each, name, given.get(name))
            _checked(each, f"--{name.replace('_', '-')}", getattr(self, name))

    @classmethod
    def checked(cls, **given: Any) -> None:
        """Check what a function was given by the options' names, the types of all first; raises ``InputError``."""
        named = {name: (part.__annotations__[name], each) for part, name, each in cls._all()}
        for name, value in given.items():
            kind, or_none, _ = named[name][0].partition(" | None")
            require(_KINDS[kind] + or_none.replace("|", "or"), **{name: value})
        for name, value in given.items():
            _checked(named[name][1], name, value)

    @classmethod
    def declare(cls, parser: argparse.ArgumentParser) -> None:
        """Add all of them to a parser."""
        groups: dict[str, Any] = {}
        for part, name, each in sorted(cls._all(), key=lambda one: not one[2].positional):
            kinds = [] if part is Options else [c for c in cls.__mro__ if issubclass(c, part)]
            title = next((vars(c)["group"] for c in kinds if "group" in vars(c)), "")
            if title and title not in groups:
                groups[title] = parser.add_argument_group(title)
            place = groups.get(title, parser)
            if each.but_not:
                if each.but_not not in groups:
                    groups[each.but_not] = place.add_mutually_exclusive_group()
                place = groups[each.but_not]
            each.declare(place, name, part.__annotations__[name])

    @classmethod
    def _all(cls) -> Iterator[tuple[type[Options], str, Option]]:
        """Each option with its name and the class that has it first; one that is stated anew keeps its place."""
        found = [
            (part, name, each)
            for part in cls.__mro__
            for name, each in vars(part).items()
            if isinstance(each, Option)
        ]
        stated = {name: each for _, name, each in reversed(found)}
        first = {name: part for part, name, _ in found}
        for part, name, _ in found:
            if part is first[name]:
                yield part, name, stated[name]


def _check_given(each: Option, name: str, value: Any) -> None:
    """Raise ``InputError`` for text of nothing, as a variable of a shell that is not set leaves it."""
    for text in value if isinstance(value, list) else [value]:
        if isinstance(text, str) and not text.strip():
            label = each.more.get("metavar") or name if each.positional else f"--{name.replace('_', '-')}"
            raise InputError(f"{label} is empty; give a value, or leave it out")


def _checked(each: Option, said: str, value: Any) -> None:
    if each.check is not None and value is not None and not each.check.holds(value):
        shown = f"{value:g}" if isinstance(value, float) else value
        raise InputError(f"{said} {shown}: {each.check.wrong}")
