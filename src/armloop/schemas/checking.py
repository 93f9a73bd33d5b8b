"""Check a value that was read against a description; whatever is wrong is one line with the field's place."""

from __future__ import annotations

import re
from typing import Any, TypeVar

import msgspec
from msgspec import inspect as info

T = TypeVar("T")

_PLACE = re.compile(r"\.([^.\[`]+)|\[(\d+|\.\.\.)\]")
_WORDS = {
    "float": "a finite number",
    "int": "a whole number",
    "str": "text",
    "bool": "true or false",
    "null": "null",
    "array": "a list",
    "object": "a mapping of fields",
}
_MANY = 80


class Misfit(ValueError):
    """A value is not as described: ``place`` of the field, empty for the whole, and what is wrong in one line."""

    def __init__(self, place: str, wrong: str) -> None:
        super().__init__(
            f"{place}{': ' if place and wrong.startswith('field ') else ' ' if place else ''}{wrong}"
        )
        self.place = place


def checked(value: Any, schema: type[T]) -> T:
    """The value as an object of a description; raises :class:`Misfit`."""
    try:
        return msgspec.convert(value, schema)
    except msgspec.ValidationError as fault:
        raise _misfit(str(fault), value, schema) from None
    except (RecursionError, OverflowError) as fault:
        raise Misfit("", f"is nothing that can be checked ({fault})") from None


def _misfit(message: str, value: Any, schema: Any) -> Misfit:
    wrong, _, path = message.partition(" - at `$")
    steps: list[str | int] = []
    for name, index in _PLACE.findall(path):
        if index == "...":  # the library does not say which of a mapping's values it is
            steps.append(_key(message, value, schema, steps))
        else:
            steps.append(name or int(index))
    found, kinds = value, _plain(info.type_info(schema))
    for step in steps:
        found, kinds = found[step], [kind for each in kinds for kind in _inner(each, step)]
    place = "".join(f"[{step + 1}]" if isinstance(step, int) else f".{step[:_MANY]}" for step in steps)
    place = place.removeprefix(".")
    missing = re.search(r"missing required field `(.+?)`", wrong)
    if missing:
        return Misfit(place, f"field {missing[1]!r} is missing")
    unknown = re.search(r"contains unknown field `(.+?)`", wrong)
    if unknown:
        there = [field.name for kind in kinds if isinstance(kind, info.StructType) for field in kind.fields]
        return Misfit(place, f"field {unknown[1][:_MANY]!r} is unknown; there are: {', '.join(there)}")
    told = repr(found)
    told = told if len(told) <= _MANY else f"{told[:_MANY]}…"
    if wrong.startswith("Invalid"):
        names = [repr(each) for kind in kinds for each in getattr(kind, "values", ())]
        return Misfit(
            place, f"is {told}; there are: {', '.join(names)}" if names else f"{told} is unknown here"
        )
    return Misfit(place or "the file", f"is {told}; it must be {_expected(wrong)}")


def _key(message: str, value: Any, schema: Any, steps: list[str | int]) -> str:
    """The first key of the mapping at a place whose value raises the message, found by halving."""
    mapping = value
    for step in steps:
        mapping = mapping[step]
    keys = list(mapping)
    while len(keys) > 1:
        half = keys[: len(keys) // 2]
        try:
            msgspec.convert(_with(value, steps, {key: mapping[key] for key in half}), schema)
        except msgspec.ValidationError as fault:
            if str(fault) == message:
                keys = half
                continue
        keys = keys[len(keys) // 2 :]
    return str(keys[0])


def _with(value: Any, steps: list[str | int], end: Any) -> Any:
    """A copy of the value with another one at a place."""
    if not steps:
        return end
    copy = value.copy()
    copy[steps[0]] = _with(value[steps[0]], steps[1:], end)
    return copy


def _inner(kind: Any, step: str | int) -> list[Any]:
    """Kinds of what is at a step within a kind of value, as of :func:`_plain`."""
    if isinstance(kind, info.ListType):
        return _plain(kind.item_type)
    if isinstance(kind, info.DictType):
        return _plain(kind.value_type)
    if isinstance(kind, info.StructType):
        if kind.tag_field == step:
            return [info.LiteralType((kind.tag,))]
        return [inner for field in kind.fields if field.name == step for inner in _plain(field.type)]
    return []


def _plain(kind: Any) -> list[Any]:
    """A kind without its remarks, each of its alternatives."""
    if isinstance(kind, info.Metadata):
        return _plain(kind.type)
    return (
        [each for inner in kind.types for each in _plain(inner)]
        if isinstance(kind, info.UnionType)
        else [kind]
    )


def _expected(message: str) -> str:
    """The library's words in ours: Expected `float` >= 0.0, Expected `array` of length <= 3, Invalid value ..."""
    message = re.sub(r", got .*$", "", message.removeprefix("Expected "))
    message = re.sub(
        r"`([^`]+)`", lambda m: " or ".join(_WORDS.get(each, each) for each in m[1].split(" | ")), message
    )
    message = message.replace(">=", "of at least").replace("<=", "of at most")
    message = re.sub(r"(?<= )> ?", "above ", re.sub(r"(?<= )< ?", "below ", message))
    message = message.replace("of length of at", "with a length of at")
    return re.sub(r"(?<=\d)\.0(?!\d)", "", message)  # 5.0 is 5, 0.005 is itself
