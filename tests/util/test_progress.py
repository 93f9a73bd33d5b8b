"""Progress that counts says how long is left."""

from collections.abc import Iterator

import pytest

from armloop.util import progress


@pytest.fixture
def said(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    """The lines that come out of counts that are 10 s apart."""
    clock = iter(range(0, 1000, 10))
    monkeypatch.setattr(progress.time, "monotonic", lambda: next(clock))
    lines: list[str] = []
    tell = progress.with_time_left(lines.append)
    for message in ("reading", *(f"{k} of 4 logs" for k in (0, 1, 2, 4)), "1 of 4 logs", "0 of 3 arms"):
        tell(message)
    yield lines


def test_the_time_left_follows_from_the_pace_of_the_count(said: list[str]) -> None:
    assert said == [
        "reading",
        "0 of 4 logs",
        "1 of 4 logs (about 30 s left)",
        "2 of 4 logs (about 20 s left)",
        "4 of 4 logs",
        "1 of 4 logs",  # from the start: nothing is known of its pace
        "0 of 3 arms",
    ]
