"""Progress reporting: a function that takes one line, silent unless one is handed in."""

from __future__ import annotations

import time
from collections.abc import Callable

Progress = Callable[[str], None]


def silent(message: str) -> None:
    """Say nothing."""
    del message


def paced(progress: Progress, seconds: float = 2.0) -> Progress:
    """The same, passing on at most one line in so many seconds, the first not before they have passed."""
    last = time.monotonic()

    def tell(message: str) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= seconds:
            last = now
            progress(message)

    return tell
