"""How long work tells where it stands: a function that takes one line, silent unless one is handed in."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[str], None]


def silent(message: str) -> None:
    """Say nothing."""
    del message
