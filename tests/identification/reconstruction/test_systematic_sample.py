"""Of many logs, and of the runs of each, some are looked at, evenly."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from armloop.data.log import MotionLog
from armloop.identification.reconstruction import systematic_sample


def test_some_of_many_logs_are_looked_at_and_of_each_some_of_its_runs(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(systematic_sample, "_SAMPLES", 60)
    nothing: Any = [SimpleNamespace(samples=0)] * 2
    assert systematic_sample.selected(nothing) == [0, 1]
    for each, picked in (
        (60, [0]),
        (59, [0, 9]),
        (30, [0, 9]),
        (10, [0, 1, 3, 5, 7, 9]),
        (6, list(range(10))),
    ):
        logs: Any = [SimpleNamespace(samples=each)] * 10
        assert systematic_sample.selected(logs) == picked
    q = 0.01 * np.arange(100.0)[:, None]
    time = 0.01 * (np.arange(100.0) + np.where(np.arange(100) >= 30, 50.0, 0.0))
    log = MotionLog(time, q, np.ones_like(q), q)
    assert len(log.runs()) == 2
    first, second = systematic_sample.even_selection([log])
    assert first.q.tolist() == q[:30].tolist() and second.q.tolist() == q[30:90].tolist()
    monkeypatch.setattr(systematic_sample, "_SAMPLES", 40)
    (longest,) = systematic_sample.even_selection([log])
    assert longest.q.tolist() == q[30:70].tolist()
    # what is too short for any filter is no run
    monkeypatch.setattr(systematic_sample, "_SAMPLES", 60)
    time = 0.01 * (np.arange(100.0) + np.where(np.arange(100) >= 81, 50.0, 0.0))
    early = MotionLog(time, q, log.v, q)
    (alone,) = systematic_sample.even_selection([early])
    assert alone.q.tolist() == q[:60].tolist()
    several = systematic_sample.placed_runs([log.select(slice(0, 60)), log.select(slice(0, 30))])
    assert [(k, len(part.q)) for k, part in several] == [(0, 30), (1, 30)]


def unread(samples: int) -> Any:
    """A log of one run that says which of its rows are taken."""
    log = SimpleNamespace(samples=samples, period=0.01, runs=lambda: [slice(0, samples)])
    log.read, log.stretch = lambda: log, lambda rows: rows
    return log


@pytest.mark.parametrize(
    ("count", "samples", "picked"),
    [
        (3, 10, [0, 1, 2]),
        (5, 60_000, [0]),
        (5, 20_000, [0, 2, 4]),
        (1, 90_000, [0]),
        (9, 15_000, [0, 2, 5, 8]),
    ],
)
def test_sixty_thousand_samples_are_read(count: int, samples: int, picked: list[int]) -> None:
    taken = systematic_sample.placed_runs([unread(samples) for _ in range(count)])
    assert taken == [(k, slice(0, min(samples, 60_000 // len(picked)))) for k in picked]


def test_samples_that_a_filter_takes_out_are_not_counted():
    logs = [unread(20_000) for _ in range(5)]
    for log in logs:
        log.period = 0.001
    # recorded at 1 kHz: four times as many are read where 250 Hz are left
    every = systematic_sample.placed_runs(logs, 250.0)
    assert every == [(k, slice(0, 20_000)) for k in range(5)]
    some = systematic_sample.placed_runs(logs, 900.0)
    assert some == [(k, slice(0, 16_666)) for k in (0, 1, 2, 4)]
    # a filter that keeps them all
    assert systematic_sample.placed_runs(logs, 2000.0) == systematic_sample.placed_runs(logs)
