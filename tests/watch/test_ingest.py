"""A log that is too long for memory is read in pieces, and comes to what it would come to as a whole."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.parquet
import pytest
from operation import Change, healthy_model, operate

from armloop.data import pieces
from armloop.data.log import MotionLog, write_log
from armloop.model import ReconstructedModel
from armloop.monitoring.sums import LogSums, RestingError, log_sums
from armloop.util.arrays import Array
from armloop.util.errors import LogError
from armloop.watch import ingest, sources
from armloop.watch.ingest import _sums
from armloop.watch.sources import LogFile


def put(path: Path) -> LogFile:
    """A log of 200 s, with the temperature of its time."""
    log = operate(3, 0, None, 200.0)
    write_log(path, log)
    table = pyarrow.parquet.read_table(path)
    pyarrow.parquet.write_table(table.append_column("temperature", pyarrow.array(20 + log.time / 10)), path)
    return LogFile(path, "arm", "", ("2026-01-01",))


@pytest.fixture
def in_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pieces of 50 s."""
    monkeypatch.setattr(pieces, "PIECE", 3000)
    monkeypatch.setattr(sources, "log_sources", partial(pieces.log_sources, in_memory=3000))


def test_pieces_come_to_what_the_log_does_as_a_whole(
    tmp_path: Path, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    model, file = healthy_model(), put(tmp_path / "log.parquet")
    whole, began = _sums(file, model)
    request.getfixturevalue("in_pieces")
    largest: list[int] = []
    summed = partial(_recording_samples, largest)
    monkeypatch.setattr("armloop.watch.ingest.recordings", summed)
    parts, first = _sums(file, model)
    assert max(largest) == 3000 and len(largest) == 4
    assert (first, parts.columns) == (began, whole.columns)
    assert (np.diff(parts.start) > 0).all()
    assert parts.seconds.sum() == pytest.approx(whole.seconds.sum(), rel=0.02)
    for name in ("rows", "energy", "speed"):
        a, b = getattr(parts, name).sum(axis=0), getattr(whole, name).sum(axis=0)
        np.testing.assert_allclose(a, b, rtol=0.03)
    middle = parts.start + 0.5 * parts.seconds
    np.testing.assert_allclose(parts.temperature[:, 0], 20 + middle / 10, atol=0.2)


def _recording_samples(largest: list[int], *given: object):  # type: ignore[no-untyped-def]
    for recording in sources.recordings(*given):  # type: ignore[arg-type]
        largest.append(recording.log.samples)
        yield recording


@pytest.mark.usefixtures("in_pieces")
def test_a_piece_in_which_the_arm_rests_is_passed_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model, file = healthy_model(), put(tmp_path / "log.parquet")

    def resting_until(until: float) -> None:
        def summed(model: ReconstructedModel, log: MotionLog, extra: dict[str, Array]) -> LogSums:
            if 40.0 < log.time[0] < until:
                raise RestingError(f"{log.name}: no joint slides")
            return log_sums(model, log, extra)

        monkeypatch.setattr("armloop.watch.ingest.log_sums", summed)

    resting_until(90.0)
    sums, _ = _sums(file, model)
    assert (sums.start < 50).any() and (sums.start > 100).any()
    assert not ((sums.start > 52) & (sums.start < 98)).any()
    monkeypatch.setattr(
        "armloop.watch.ingest.recordings",
        lambda *given: (part for part in sources.recordings(*given) if part.log.time[0] > 40.0),
    )
    resting_until(1e3)
    with pytest.raises(RestingError, match="no joint slides"):
        _sums(file, model)


def test_a_log_recorded_in_another_unit_is_set_aside_and_a_changed_arm_is_not_asked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model, good = healthy_model(), operate(3, 0)
    file = LogFile(tmp_path / "log.csv", "arm", "", ("2026-01-01",))
    write_log(file.path, replace(good, tau=1e3 * good.tau))
    with pytest.raises(LogError, match=r"log: all torques are about 1000 times .* as if tau were in mN·m"):
        _sums(file, model)
    write_log(file.path, operate(3, 0, Change(mass=2.0)))
    sums, _ = _sums(file, model)
    assert 0.1 < sums.unexplained.max() < 0.8  # the arm itself is another, by far, and stays in the store
    monkeypatch.setattr(ingest, "misrecorded", lambda *_: pytest.fail("asked of a log the model explains"))
    write_log(file.path, operate(3, 0, Change(friction=np.array([0.0, 0.5, 0.0]))))
    _sums(file, model)
