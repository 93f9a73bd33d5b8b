"""Progress reporting: a function that takes one line, silent unless one is handed in."""

from __future__ import annotations

import re
import time
from collections.abc import Callable

Progress = Callable[[str], None]
_COUNT = re.compile(r"\b(\d+) of (\d+)\b")
# s; less than this is not worth saying
_LEAST = 5.0


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


def with_time_left(progress: Progress) -> Progress:
    """The same, with the time left where lines count (``3 of 7 …``): what is to do at the pace since the first count."""
    key: tuple[str, int] | None = None
    first, last, begun = 0, 0, 0.0

    def tell(message: str) -> None:
        nonlocal key, first, last, begun
        found = _COUNT.search(message)
        if found is None:
            progress(message)
            return
        done, total = int(found[1]), int(found[2])
        now, this = time.monotonic(), (message[: found.start()], total)
        if this != key or done <= last:  # another count, or the same from the start
            key, first, last, begun = this, done, done, now
            progress(message)
            return
        last = done
        left = (total - done) * (now - begun) / (done - first)
        progress(f"{message} (about {left:.0f} s left)" if left >= _LEAST else message)

    return tell
