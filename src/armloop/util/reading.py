"""Bounded reading of JSON and YAML: nothing that stands in a file makes a reader work or remember without end.

Both are stricter than their libraries: a key stands once, numbers are finite and of no more digits than a number of
physics has, and a file is a regular file of a size that such a file may have.
"""

from __future__ import annotations

import json
import math
import os
import re
import stat
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from armloop.util import outputs
from armloop.util.errors import InputError
from armloop.util.given import path_of

#: Bytes of a file of settings, and of a file of results.
SETTINGS, RESULTS = 1 << 20, 1 << 26
#: Digits of a number, levels of lists within lists, values of a YAML file with its aliases written out.
_DIGITS, _LEVELS, _VALUES = 64, 64, 50_000


def read_bytes(path: str | Path, most: int, error: type[InputError], what: str = "a file") -> bytes:
    """The content of a regular file of at most so many bytes; raises the ``InputError`` given for any other."""
    path = path_of(path, f"the path of {what}", error)
    try:
        # Without blocking: a pipe that nobody writes to would be waited for.
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            found = os.fstat(descriptor)
            if stat.S_ISDIR(found.st_mode):
                raise error(f"{path}: cannot be read (is a folder); give {what}")
            if not stat.S_ISREG(found.st_mode):
                raise error(f"{path}: is a device or a pipe; give {what}")
            if found.st_size > most:
                raise error(f"{path}: has {found.st_size} bytes; {what} has at most {most}")
            with os.fdopen(descriptor, "rb", closefd=False) as file:
                content = file.read(most)
        finally:
            os.close(descriptor)
    except FileNotFoundError as fault:
        raise error(f"{path}: no such file; give {what}") from fault
    except (OSError, ValueError) as fault:
        if isinstance(fault, InputError):
            raise
        reason = getattr(fault, "strerror", None) or str(fault)
        raise error(f"{str(path)[:200]}: cannot be read ({reason}); give {what}") from fault
    outputs.reading(path)
    return content


def read_text(path: str | Path, most: int, error: type[InputError], what: str = "a file") -> str:
    """The text of a UTF-8 file; see :func:`read_bytes`."""
    try:
        return read_bytes(path, most, error, what).decode("utf-8-sig")
    except UnicodeDecodeError as fault:
        raise error(f"{path}: cannot be read (byte {fault.start} is no UTF-8); give {what}") from fault


def read_json(path: str | Path, error: type[InputError], what: str) -> Any:
    """The value in a JSON file of the kind described above; raises the ``InputError`` given for any other."""
    text = read_text(path, RESULTS, error, what)
    with _refusing(path, error, what):
        try:
            return json.loads(
                text,
                object_pairs_hook=_once,
                parse_constant=_no_constant,
                parse_int=_whole,
                parse_float=_number,
            )
        except json.JSONDecodeError as fault:
            raise error(f"{path}: not JSON (line {fault.lineno}: {fault.msg}); give {what}") from fault


class _Doubt(Exception):
    """What is wrong with a value."""


@contextmanager
def _refusing(path: str | Path, error: type[InputError], what: str) -> Iterator[None]:
    """Say of which file a doubt is, and refuse one that nests without end."""
    try:
        yield
    except _Doubt as fault:
        raise error(f"{path}: {fault}") from None
    except RecursionError as fault:
        raise error(f"{path}: lists within lists, too deep; give {what}") from fault


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in keys if keys.count(key) > 1)
        raise _Doubt(f"field {twice[:60]!r} stands twice in one object; leave one out")
    return found


def _no_constant(text: str) -> Any:
    raise _Doubt(f"{text} is not a finite number; strict JSON has null where there is none")


def _whole(text: str) -> int:
    if len(text) > _DIGITS:
        raise _Doubt(f"{text[:20]}… is a number of {len(text)} digits; give one of at most {_DIGITS}")
    return int(text)


def _number(text: str) -> float:
    value = float(text) if len(text) <= 4 * _DIGITS else math.inf
    if not math.isfinite(value):
        raise _Doubt(f"{text[:20]} is not a finite number; strict JSON has null where there is none")
    return value


def read_yaml(path: str | Path, error: type[InputError], what: str) -> Any:
    """The value in a YAML file by the safe subset: no tags that make objects, few aliases; raises as :func:`read_json`."""
    import yaml

    text = read_text(path, SETTINGS, error, what)
    with _refusing(path, error, what):
        try:
            loader = _loader()(text)
            node = loader.get_single_node()
            if node is None:
                return None
            _size(node, {}, 0)
            return loader.construct_document(node)
        except yaml.YAMLError as fault:
            mark = getattr(fault, "problem_mark", None)
            line = f"line {mark.line + 1}: " if mark else ""
            raise error(
                f"{path}: unreadable YAML: {line}{getattr(fault, 'problem', None) or fault}"
            ) from fault
        except ValueError as fault:
            raise error(f"{path}: unreadable YAML: {fault}") from fault


def _size(node: Any, known: dict[int, int], level: int) -> int:
    """Values that a node stands for, with its aliases written out."""
    import yaml

    if level > _LEVELS:
        raise _Doubt(f"more than {_LEVELS} lists within lists, or an alias of what it is in")
    if id(node) not in known:
        total = 1
        if isinstance(node, yaml.SequenceNode):
            total += sum(_size(each, known, level + 1) for each in node.value)
        elif isinstance(node, yaml.MappingNode):
            for key, _ in node.value:
                if key.tag not in ("tag:yaml.org,2002:str", "tag:yaml.org,2002:merge"):
                    line = key.start_mark.line + 1
                    raise _Doubt(f"line {line}: a field's name must be text; put it between quotes")
            keys = [key.value for key, _ in node.value]
            twice = [key for key, times in Counter(keys).items() if times > 1 and key != "<<"]
            if twice:
                raise _Doubt(f"field {min(twice)[:60]!r} stands twice in one mapping; leave one out")
            total += sum(_size(each, known, level + 1) for pair in node.value for each in pair)
        if total > _VALUES:
            raise _Doubt(f"stands for more than {_VALUES} values; settings are fewer")
        known[id(node)] = total
    return known[id(node)]


def _loader() -> Any:
    import yaml

    class Loader(yaml.SafeLoader):
        """The safe loader, which takes 1e3 for the number that it is and refuses what is no finite number."""

    def integer(loader: Any, node: Any) -> int:
        if len(node.value) > _DIGITS:
            raise _Doubt(f"{node.value[:20]}… is a number of {len(node.value)} digits; give a shorter one")
        digits = node.value.lstrip("+-")
        if ":" in digits or (digits[:1] == "0" and digits.isdigit() and len(digits) > 1):
            # YAML 1.1 takes 1:30 for 90 and 010 for 8, which nobody means
            raise _Doubt(
                f"line {node.start_mark.line + 1}: {node.value[:20]} is no plain number; write it like 90 or 0.5"
            )
        return int(yaml.SafeLoader.construct_yaml_int(loader, node))

    def number(loader: Any, node: Any) -> float:
        value = math.inf if ":" in node.value else float(yaml.SafeLoader.construct_yaml_float(loader, node))
        if not math.isfinite(value):
            raise _Doubt(f"line {node.start_mark.line + 1}: {node.value[:20]} must be a finite number")
        return value

    Loader.add_constructor("tag:yaml.org,2002:int", integer)
    Loader.add_constructor("tag:yaml.org,2002:float", number)
    # YAML 1.1 wants a point and a sign in the exponent; people write 1e-3.
    Loader.add_implicit_resolver(
        "tag:yaml.org,2002:float", re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)[eE][-+]?\d+$"), list("-+0123456789.")
    )
    return Loader
