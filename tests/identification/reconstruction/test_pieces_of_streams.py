"""Logs one by one: how their blocks are numbered, which samples stand for all, and what is read again."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from armloop.data.motion import Motion, Samples
from armloop.data.signals import ShortRunError, Speeds
from armloop.identification.reconstruction import data as module
from armloop.identification.reconstruction.data import Chunk, Data


def samples(length: int, begin: float = 0.0) -> Samples:
    """One run of so many samples a second apart; 0.1 rad more with each."""
    time = begin + np.arange(float(length))
    q = 0.1 * time[:, None]
    moving = np.ones((length, 1), dtype=bool)
    return Samples(Motion(time, q, 0 * q, 0 * q, np.array([0])), q.copy(), moving, 1.0, 0.0)


class Source:
    """A log that says its number when it is read."""

    def __init__(self, number: int, length: int, noise: float = 0.0) -> None:
        self.number, self.samples, self.noise, self.name = number, length, noise, f"log {number}"

    def read(self) -> Source:
        return self


HOW: Any = SimpleNamespace(cutoff_hz=1.0)
OPTIONS: Any = SimpleNamespace(block_seconds=2.0, folds=5)


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The noise that the conditioning was told of; a log of fewer than three samples is too short."""
    noises: list[Any] = []

    def preprocess(logs: Any, how: Any, speeds: Any = None) -> Samples:
        noises.append(None if speeds is None else speeds.noise.tolist())
        if logs[0].samples < 3:
            raise ShortRunError("too short")
        return samples(logs[0].samples, 100.0 * logs[0].number)

    monkeypatch.setattr(module, "preprocess", preprocess)
    monkeypatch.setattr(
        Speeds, "of", lambda log, cutoff_hz: Speeds(np.array([log.noise, 1.0]), np.array([np.inf, 1.0]))
    )
    return noises


def logs(*lengths: int) -> Any:
    return [Source(k, length, noise=float(k % 2)) for k, length in enumerate(lengths)]


@pytest.mark.parametrize("streamed", [False, True])
def test_blocks_are_numbered_on_from_log_to_log_and_short_logs_left_out(
    streamed: bool, asked: list[Any]
) -> None:
    data = (Data.streamed if streamed else Data.kept)(logs(6, 2, 7, 4), HOW, OPTIONS)
    assert data.in_memory == (not streamed) and len(data.parts) == 3
    chunks = list(data.map(lambda chunk: chunk))
    # six seconds and a sample are four pieces, of a second and a half each
    numbers = [*(0, 0, 1, 1, 2, 2), *(3, 3, 4, 5, 5, 6, 6), *(7, 7, 8, 8)]
    assert [int(b) for chunk in chunks for b in chunk.blocks] == data.reference.blocks.tolist() == numbers
    folds = data.reference.blocks % 5
    np.testing.assert_array_equal(data.reference.held_out, folds == 0)
    np.testing.assert_array_equal(data.reference.validation, folds == 1)
    assert data.reference.samples.motion.starts.tolist() == [0, 6, 13]
    # the noisiest log's noise, for all
    assert {tuple(noise) for noise in asked} == {(1.0, 1.0)}
    # a log in memory keeps its name, whatever was left out before it
    named = [(name, int(kept.motion.time[0]), kept.motion.samples) for name, kept in data.by_log]
    assert named == ([] if streamed else [(f"log {k}", 100 * k, N) for k, N in ((0, 6), (2, 7), (3, 4))])


@pytest.mark.parametrize("make", [Data.streamed, Data.kept])
def test_without_a_filter_no_noise_is_asked_for_and_without_a_long_run_it_is_said(
    make: Any, asked: list[Any]
) -> None:
    make(logs(6), SimpleNamespace(cutoff_hz=0.0), OPTIONS)
    assert set(map(str, asked)) == {"None"}
    with pytest.raises(ShortRunError):
        make(logs(2, 1), HOW, OPTIONS)
    with pytest.raises(ShortRunError):
        make(logs(2), HOW, OPTIONS)


@pytest.mark.parametrize(("most", "stride"), [(60, 1), (30, 2), (21, 2), (20, 3), (15, 4), (12, 6), (13, 4)])
def test_the_reference_is_an_even_selection_that_meets_every_fold(
    most: int, stride: int, asked: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not every fifth sample, where samples are dealt into five folds one by one."""
    monkeypatch.setattr(module, "REFERENCE", most)
    data = Data.streamed(logs(40, 20), HOW, OPTIONS)
    expected = [*np.arange(0, 40, stride), *(100 + np.arange(0, 20, stride))]
    assert data.reference.samples.motion.time.tolist() == expected


def test_a_window_is_all_or_stretches_of_all(asked: list[Any]) -> None:
    kept = Data.kept(logs(40, 20), HOW, OPTIONS)
    assert kept.window(60) is kept.reference
    few = kept.window(59)
    # of sixty samples in memory, in one piece, there is no room for 64 stretches but of nothing: all of it
    assert few is not kept.reference and few.samples.motion.samples <= 64
    streamed = Data.streamed(logs(400, 200), HOW, OPTIONS)
    window = streamed.window(10**6)
    assert window is not streamed.reference and window.samples.motion.samples == 600
    # two pieces, 32 stretches of each
    window = streamed.window(128)
    assert window.samples.motion.samples == 128 and len(window.samples.motion.starts) == 64
    assert (np.diff(window.samples.motion.time).reshape(-1)[::2] == 1.0).all()


def test_logs_are_read_again_evenly(asked: list[Any]) -> None:
    data = Data.streamed(logs(10, 10, 10, 10), HOW, OPTIONS)
    for most, numbers in ((40, [0, 1, 2, 3]), (39, [0, 2]), (20, [0, 2]), (19, [0, 3]), (1, [0])):
        read, chunk = data.recorded(most)
        assert [log.number for log in read] == numbers  # type: ignore[attr-defined]
        assert chunk.samples.motion.samples == 10 * len(numbers)


def test_progress_is_told_of_all_passes_but_those_in_memory(
    asked: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[str] = []
    monkeypatch.setattr(module, "paced", lambda progress, seconds: told.append)
    clock = iter([100.0, 110.0, 130.0, 160.0])
    monkeypatch.setattr(module.time, "monotonic", lambda: next(clock))
    data = Data.streamed(logs(10, 10, 10), HOW, OPTIONS)
    assert list(data.map(lambda chunk: len(chunk.blocks), "sums")) == [10, 10, 10]
    # ten seconds for the first of three: twenty left; thirty for two: fifteen
    assert told == [
        "sums: 1 of 3 pieces, 20 s left in this pass",
        "sums: 2 of 3 pieces, 15 s left in this pass",
    ]
    told.clear()
    clock = iter([1.0])
    assert Data.kept(logs(10, 10), HOW, OPTIONS).sum(lambda chunk: len(chunk.blocks)) == 20
    assert told == []


def test_mixed_parts_are_not_all_in_memory(asked: list[Any]) -> None:
    kept, streamed = (make(logs(10), HOW, OPTIONS) for make in (Data.kept, Data.streamed))
    both = Data([*kept.parts, *streamed.parts], kept.reference, kept.workers)
    assert kept.in_memory and not streamed.in_memory and not both.in_memory


def test_parts_of_a_chunk_choose_what_they_chose_in_the_whole() -> None:
    chunk = Chunk.of(samples(20), OPTIONS).nested()
    assert chunk.choosing is not None and chunk.choosing.any()
    for part, rows in ((chunk.cut(3, 9), np.arange(3, 9)), (chunk.take(np.array([0, 5, 9])), [0, 5, 9])):
        assert part.choosing is not None
        for name in ("choosing", "held_out", "validation", "independent", "blocks"):
            np.testing.assert_array_equal(getattr(part, name), getattr(chunk, name)[rows])


def test_a_window_chooses_by_what_chose_in_the_chunks(asked: list[Any]) -> None:
    data = Data.kept(logs(20, 20), HOW, OPTIONS).nested()
    whole, window = data.window(40), data.window(20)
    assert whole.choosing is not None and window.choosing is not None
    rows = np.searchsorted(whole.samples.motion.time, window.samples.motion.time)
    np.testing.assert_array_equal(window.choosing, whole.choosing[rows])
    np.testing.assert_array_equal(window.judging("test"), whole.judging("test")[rows])
