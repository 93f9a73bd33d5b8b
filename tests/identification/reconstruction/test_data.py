"""Reading and conditioning a log anew on every pass gives the model that it gives in memory."""

import re
import sys
import weakref
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from synthetic import LOWER, UPPER, fourier_motion, friction, measured, rigid_torque, three_axis

from armloop.data.log import MotionLog, write_log
from armloop.data.pieces import log_sources
from armloop.data.regimes.indicators import size
from armloop.data.signals import Conditioning, ShortRunError, as_torque, preprocess, smooth
from armloop.experiment.excitation import MotionRanges
from armloop.experiment.sampling import inverse_dynamics_samples
from armloop.identification.reconstruction import Options, Reconstruction, reconstruct
from armloop.identification.reconstruction import data as data_module
from armloop.identification.reconstruction.data import Chunk, Data
from armloop.identification.reconstruction.nearest_regime import Sorter
from armloop.identification.reconstruction.sums import Usable
from armloop.regression.sparse import Sparse
from armloop.util.workers import Processes, Serial, Workers

#: Terms chosen by least squares, as by default, but faster: what is asked is where the samples come from. Standard errors
#: are compared to the bit below, and the parts in `tests/identification/goodness`.
OPTIONS = Options(max_order=1, sparse=Sparse("thresholded"), parts=False, standard_errors=False)


def a_run(seed: int, seconds: float = 10.0, rate: float = 125.0) -> MotionLog:
    motion = fourier_motion(seconds, rate, seed)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)
    return measured(motion, tau, seed, name=f"run{seed}")


def same(one: Reconstruction, other: Reconstruction, rel: float = 1e-6) -> None:
    """Assert that two reconstructions are the same up to round-off."""
    assert [r.terms for r in one.reports] == [r.terms for r in other.reports]
    assert [r.samples for r in one.reports] == [r.samples for r in other.reports]
    assert one.notes == other.notes
    for a, b in zip(one.model.components, other.model.components, strict=True):
        for mine, theirs in zip(a.to_dict()["joints"], b.to_dict()["joints"], strict=True):
            assert mine == pytest.approx(theirs, rel=rel)
    for key in ("rmse", "nrmse", "rms"):
        assert one.model.baseline[key] == pytest.approx(other.model.baseline[key], rel=rel)


@pytest.fixture(scope="module")
def logs() -> list[MotionLog]:
    return [a_run(seed) for seed in range(3)]


@pytest.fixture(scope="module")
def in_memory(logs: list[MotionLog]) -> Reconstruction:
    return reconstruct(logs, three_axis(), options=OPTIONS)


@pytest.mark.parametrize("workers", [None, Processes(2)], ids=["serial", "processes"])
def test_streamed_logs_give_the_same_model(
    logs: list[MotionLog], in_memory: Reconstruction, workers: Workers | None
) -> None:
    same(reconstruct(logs, three_axis(), options=OPTIONS, workers=workers, in_memory=0), in_memory)


@pytest.mark.parametrize("library", ["rigid-body", "lagrangian"])
def test_shared_coefficients_are_the_same_to_the_bit_wherever_logs_are_kept(
    logs: list[MotionLog], library: str
) -> None:
    """The same sums in the same order: models, laws, ripples and standard errors are equal, not alike."""
    options = Options(friction=("coulomb", "viscous", "presliding"), parts=False)
    kept, streamed = (
        reconstruct(logs[:2], three_axis(), library=library, options=options, workers=workers, in_memory=most)
        for workers, most in ((None, 10**6), (Processes(2), 0))
    )
    assert streamed.model.to_dict() == kept.model.to_dict()
    assert streamed.to_dict() == kept.to_dict()


def test_a_csv_in_pieces_gives_the_model_of_its_pieces_to_the_bit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each piece is a run of its own: the model is that of logs in memory that end where the pieces do."""
    log = a_run(1, 12.0)
    monkeypatch.setattr("armloop.data.pieces.PIECE", log.samples // 2)
    write_log(tmp_path / "run.csv", log)
    pieces = log_sources([tmp_path / "run.csv"], 3, {"unit": "N*m", "drive_gains": None}, in_memory=0)
    edges = np.cumsum([0, *(piece.samples for piece in pieces)]).tolist()
    parts = [replace(log.select(slice(a, b)), name="run") for a, b in pairwise(edges)]
    assert len(parts) == 2 and edges[-1] == log.samples
    options = Options(parts=False, standard_errors=False)
    kept = reconstruct(parts, three_axis(), library="rigid-body", options=options)
    streamed = reconstruct(pieces, three_axis(), library="rigid-body", options=options, in_memory=0)
    assert streamed.model.to_dict() == kept.model.to_dict()


def test_of_streamed_logs_one_piece_lies_in_memory_at_a_time(
    logs: list[MotionLog], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever is kept of a pass over the logs is copied out of them: memory does not grow with their number."""
    made: list[weakref.ref[np.ndarray]] = []
    most = 0
    room = "armloop.identification.reconstruction"
    conditioned = data_module._Conditioned
    chunk = conditioned.chunk

    def counted(self: object) -> Chunk | None:
        nonlocal most
        found = chunk(self)
        made.extend([weakref.ref(found.samples.tau), weakref.ref(found.samples.motion.q)])
        most = max(most, *(sum(one() is not None for one in made[k::2]) for k in (0, 1)))
        return found

    monkeypatch.setattr(conditioned, "chunk", counted)
    # Not by their names alone, one of which is a function's, too.
    for user in ("fitted", "training"):
        monkeypatch.setattr(sys.modules[f"{room}.{user}"], "WINDOW", 600)
    monkeypatch.setattr(sys.modules[f"{room}.reconstruct"], "_RIPPLE", 600)
    half = logs[0].samples // 2
    pieces = [log.select(rows) for log in logs[:2] for rows in (slice(None, half), slice(half, None))]
    result = reconstruct(pieces, three_axis(), library="rigid-body", in_memory=0)
    assert len(made) >= 2 * 5 * len(pieces) and most == 1
    assert result.model.uncertainty and result.parts


def test_a_long_pass_tells_how_much_time_is_left(
    logs: list[MotionLog], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("armloop.identification.reconstruction.data.paced", lambda progress, _: progress)
    said: list[str] = []
    data = Data.streamed(logs, Conditioning(), Options(), progress=said.append)
    assert data.sum(lambda chunk: len(chunk.blocks), "counting") > 0
    assert re.fullmatch(r"counting: 2 of 3 pieces, \d+ s left in this pass", said[1]) and len(said) == 2


def test_a_window_is_of_consecutive_samples_of_all_parts(logs: list[MotionLog]) -> None:
    data = Data.streamed(logs, Conditioning(), Options())
    for most in (500, 10**6):
        window = data.window(most)
        samples, whole = window.samples, data.reference.samples
        assert min(most / 2, whole.motion.samples) <= samples.motion.samples <= most
        for run in samples.motion.runs():
            np.testing.assert_allclose(np.diff(samples.motion.time[run]), samples.period)
    kept = Data.kept(logs, Conditioning(), Options())
    np.testing.assert_array_equal(data.window(10**6).samples.tau, kept.window(10**6).samples.tau)
    assert data.window(10**6).samples.spans is not None and kept.window(500).samples.motion.samples <= 500


def test_a_window_of_many_pieces_keeps_none_of_them(logs: list[MotionLog]) -> None:
    class Watched(Serial):
        def map(self, function, chunks):  # type: ignore[no-untyped-def]
            for answer in super().map(function, chunks):
                for part in answer:
                    motion = part.samples.motion
                    arrays = [motion.time, motion.q, motion.v, motion.vdot, part.samples.tau, part.blocks]
                    assert len(part.blocks) < 100 and all(x.base is None for x in arrays), "views of a piece"
                yield answer

    data = replace(Data.streamed(logs, Conditioning(), Options()), workers=Watched())
    assert data.window(500).samples.motion.samples <= 500


def test_files_on_a_dask_cluster_give_the_same_model(
    logs: list[MotionLog], in_memory: Reconstruction, tmp_path: Path
) -> None:
    from distributed import LocalCluster

    from armloop.util.workers import Cluster

    paths = [tmp_path / f"{log.name}.parquet" for log in logs]
    for path, log in zip(paths, logs, strict=True):
        write_log(path, log)
    sources = log_sources(paths, 3, {"unit": "N*m", "drive_gains": None})
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as processes:
        workers = Cluster(processes.scheduler_address)
        streamed = reconstruct(sources, three_axis(), options=OPTIONS, workers=workers, in_memory=0)
        workers.close()
    same(streamed, in_memory)


def test_chunks_play_the_parts_of_the_whole(logs: list[MotionLog]) -> None:
    whole = Chunk.of(preprocess(logs, Conditioning()), Options())
    data = Data.streamed(logs, Conditioning(), Options())
    chunks = list(data.map(lambda chunk: chunk))
    assert len(chunks) == 3
    for key in ("blocks", "held_out", "validation", "independent"):
        expected = getattr(whole, key)
        np.testing.assert_array_equal(np.concatenate([getattr(c, key) for c in chunks]), expected)
        np.testing.assert_array_equal(getattr(data.reference, key), expected)
    for key in ("q", "v", "vdot"):
        expected = getattr(whole.samples.motion, key)
        np.testing.assert_array_equal(getattr(data.reference.samples.motion, key), expected)
    np.testing.assert_array_equal(data.reference.samples.moving, whole.samples.moving)
    np.testing.assert_array_equal(data.reference.samples.motion.starts, whole.samples.motion.starts)


def test_the_reference_does_not_grow_with_the_data(
    logs: list[MotionLog], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("armloop.identification.reconstruction.data.REFERENCE", 1000)
    data = Data.streamed(logs, Conditioning(), Options())
    reference = data.reference
    assert 1000 <= len(reference.blocks) < 2000
    assert len(reference.samples.motion.starts) == 3
    assert 0.15 < reference.held_out.mean() < 0.25
    total = data.sum(lambda chunk: len(chunk.blocks))
    assert total >= 3 * len(reference.blocks)


def test_the_reference_meets_every_fold_and_a_chunk_may_lack_a_condition(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # one file per condition, no time series, five times as many samples as the reference takes
    monkeypatch.setattr("armloop.identification.reconstruction.data.REFERENCE", 720)
    ranges = MotionRanges(LOWER, UPPER, np.full(3, 1.5), np.full(3, 3.0))
    logs = list(inverse_dynamics_samples(three_axis(), ranges, (600, 1500, 1500), seed=2).values())
    data = Data.streamed(logs, Conditioning(cutoff_hz=0), OPTIONS)
    assert 0.15 < data.reference.held_out.mean() < 0.25
    assert 0.15 < data.reference.validation.mean() < 0.25
    options = Options(max_order=2, parts=False, standard_errors=False)
    how = Conditioning(cutoff_hz=0)
    streamed = reconstruct(logs, three_axis(), conditioning=how, options=options, in_memory=0)
    assert streamed.reports[0].orders == [2, 0] and streamed.reports[0].terms == [0, 2, 1]
    assert [report.samples[0] for report in streamed.reports] == [480, 1200, 1200]


def test_a_log_too_short_for_the_filter_is_left_out_unless_all_are(logs: list[MotionLog]) -> None:
    short = replace(a_run(9).select(slice(0, 25)), name="short")
    with_it, without = (Data.streamed(some, Conditioning(), Options()) for some in ([short, *logs], logs))
    np.testing.assert_array_equal(
        with_it.reference.samples.motion.q.shape, without.reference.samples.motion.q.shape
    )
    with pytest.raises(ShortRunError, match="short: the longest run"):
        Data.streamed([short], Conditioning(), Options())


def test_unsorted_samples_take_the_condition_of_their_neighbours(logs: list[MotionLog]) -> None:
    samples = preprocess(logs, Conditioning())
    speed = size(as_torque(samples).motion.v)
    labels = np.digitize(speed, np.quantile(speed, [0.3, 0.6]))
    sorter = Sorter(samples, labels)
    assert sorter(samples) is labels
    other = as_torque(samples)
    half = Chunk.of(other, Options()).take(np.arange(0, len(labels), 2))
    learnt = Sorter(half.samples, labels[::2])
    assert (learnt(samples)[::2] == labels[::2]).all()
    assert (learnt(samples) == labels).mean() > 0.97  # all but those near a border


def test_logs_of_several_rates_are_filtered_each_at_its_own_and_count_alike_in_any_order() -> None:
    logs = [a_run(1, rate=60.0), a_run(2, 8.0, rate=400.0)]
    seconds, how = [], Conditioning()
    for order in (logs, logs[::-1]):
        data = Data.kept(order, how, OPTIONS)
        whole = data.reference.samples
        seconds.append(whole.motion.samples * whole.period)
        each = [part.samples for part in data.parts if isinstance(part, Chunk)]
        apart = [smooth(own, np.sign(own.motion.v)) for own in each]
        assert smooth(whole, np.sign(whole.motion.v)) == pytest.approx(np.concatenate(apart), abs=1e-9)
        every, still = np.arange(whole.motion.samples), np.zeros(whole.motion.samples, dtype=bool)
        fitted = Usable(whole, every, whole.motion, whole.tau, whole.tau, whole.moving, still, 0 * every)
        assert fitted.filtered(np.sign(whole.motion.v)) == pytest.approx(np.concatenate(apart), abs=1e-9)
    recorded = sum(float(np.ptp(log.time)) for log in logs)
    assert seconds[0] == pytest.approx(seconds[1], rel=1e-12)
    assert seconds[0] == pytest.approx(recorded, rel=0.05)
