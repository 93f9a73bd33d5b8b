"""Warnings of doubtful input: said once each, after the work, on standard error and in the answer of ``--json``.

Python users get them as `armloop.util.errors.InputWarning` through the standard module `warnings`.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

from armloop.util.errors import InputWarning

#: So many files of which the same is said are named each.
_NAMED = 3

_SAID: ContextVar[list[str] | None] = ContextVar("said", default=None)


def warn(message: str) -> None:
    """Say something that is doubtful, in one line."""
    warnings.warn(InputWarning(message), stacklevel=4)


def said() -> list[str]:
    """What has been said since `listening` began, each line once."""
    return list(_SAID.get() or [])


@contextmanager
def listening() -> Iterator[list[str]]:
    """Collect what is said instead of showing it; warnings of others go their usual way."""
    collected: list[str] = []
    token = _SAID.set(collected)
    with warnings.catch_warnings():
        warnings.simplefilter("always", InputWarning)
        usual = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *where: Any, **more: Any) -> None:
            if not issubclass(category, InputWarning):
                usual(message, category, *where, **more)
            elif str(message) not in collected:
                collected.append(str(message))

        warnings.showwarning = show
        try:
            yield collected
        finally:
            _SAID.reset(token)


def gathered(lines: Sequence[str]) -> list[str]:
    """The lines; of many that say the same of several files, but for numbers, the first and how many more there are."""
    alike: dict[str, list[str]] = {}
    for line in lines:
        _, _, rest = line.partition(": ")
        alike.setdefault(re.sub(r"[0-9.]+", "#", rest) or line, []).append(line)
    said: list[str] = []
    for each in alike.values():
        few = len(each) <= _NAMED
        said += each if few else [f"{each[0]} (the same, but for its numbers, of {len(each) - 1} more)"]
    return said
