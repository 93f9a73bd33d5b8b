"""The samples of a reconstruction, chunk by chunk: in memory, or conditioned anew on every pass over the logs.

Whatever a method needs of them is a sum over chunks, computed by workers, or a look at the reference: all samples of
small logs, an even selection from large ones.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import partial, reduce
from itertools import chain
from math import gcd
from operator import add
from typing import Any, TypeVar

import numpy as np

from armloop.data.blocks import block_numbers, stretch
from armloop.data.log import MotionLog
from armloop.data.motion import Motion, Samples
from armloop.data.pieces import LogSource
from armloop.data.signals import Conditioning, ShortRunError, Speeds, independent_rows, preprocess
from armloop.identification.reconstruction.options import Options
from armloop.util.arrays import Index, Mask
from armloop.util.progress import Progress, paced, silent
from armloop.util.workers import Serial, Workers

Answer = TypeVar("Answer")
#: Samples as something sees them.
View = Callable[[Samples], Samples]

#: Samples of the reference: enough for clusters and quantiles.
REFERENCE = 50_000
#: Seconds between two lines that tell how far a pass is.
_PACE = 10.0
#: Consecutive samples that stand for all, where these are not in memory: to tell laws apart, and for their errors; and
#: the stretches that they are in.
WINDOW, _STRETCHES = 150_000, 64
#: Fold that chooses the library where the held-out blocks are too few to be halved; 0 judges, 1 chooses orders.
_CHOOSING = 2


@dataclass(frozen=True, eq=False)
class Chunk:
    """Conditioned samples of whole runs, with the parts they play.

    Attributes:
        samples: N of them.
        blocks: (N,) number of the block each lies in, rising over the chunks.
        held_out: (N,) those that no step may fit.
        validation: (N,) those that choose orders; they are used for the final fit, too.
        independent: (N,) so many of them that four are left per period of the filter's corner.
        folds: number of folds that the blocks are dealt into.
        choosing: (N,) held-out samples that choose the library; those of every other held-out block by default.
    """

    samples: Samples
    blocks: Index
    held_out: Mask
    validation: Mask
    independent: Mask
    folds: int = 5
    choosing: Mask | None = None

    def judging(self, part: str, margin: float = 0.0) -> Mask:
        """(N,) held-out samples that judge: ``"all"``, ``"selection"`` (they choose the library) or ``"test"``.

        Those that do not choose the library choose nothing.

        Args:
            margin: seconds from a sample in a block of another part within which none judges.
        """
        own = self.held_out.copy()
        if part != "all":
            choosing = self.blocks // self.folds % 2 == 0 if self.choosing is None else self.choosing
            own &= choosing if part == "selection" else ~choosing
        if margin > 0:
            own &= ~_near(~own, self.samples.motion, margin)
        return own

    def chunk(self) -> Chunk:
        """The chunk itself: in memory it need not be made."""
        return self

    def through(self, view: View) -> Chunk:
        """The same with its samples as something else sees them."""
        return replace(self, samples=view(self.samples))

    def nested(self) -> Chunk:
        """The same with one more fold held out, which alone chooses the library."""
        choosing = self.blocks % self.folds == _CHOOSING
        return replace(self, held_out=self.held_out | choosing, choosing=choosing)

    @staticmethod
    def of(samples: Samples, options: Options, first: int = 0, held_out: Mask | None = None) -> Chunk:
        """Deal samples into folds by blocks, the first of them numbered ``first``."""
        blocks = first + block_numbers(samples.motion, options.block_seconds, samples.spans)
        fold = blocks % options.folds
        held_out = fold == 0 if held_out is None else held_out
        return Chunk(samples, blocks, held_out, fold == 1, independent_rows(samples), options.folds)

    def cut(self, low: int, high: int) -> Chunk:
        """Consecutive samples."""
        return self._of(stretch(self.samples, low, high), slice(low, high))

    def take(self, rows: Index) -> Chunk:
        """Some samples, in order; each run keeps at least one."""
        old, motion = self.samples, self.samples.motion
        taken = motion.take(rows, np.searchsorted(rows, motion.starts).astype(np.intp))
        samples = replace(old, motion=taken, tau=old.tau[rows], moving=old.moving[rows], unknown=None)
        return self._of(samples, rows)

    def _of(self, samples: Samples, rows: slice | Index) -> Chunk:
        """Samples, which are some of these, with the parts they play."""
        return replace(self, samples=samples, **{k: x[rows] for k, x in self.roles().items()})

    def roles(self) -> dict[str, Any]:
        """What is said of each sample, (N,) each, by name."""
        names = ("blocks", "held_out", "validation", "independent", "choosing")
        return {name: x for name in names if (x := getattr(self, name)) is not None}


@dataclass(frozen=True, eq=False)
class _Conditioned:
    """A chunk that is made when it is needed."""

    source: LogSource
    how: Conditioning
    speeds: Speeds | None
    options: Options
    first: int = 0
    view: View | None = None

    def chunk(self) -> Chunk | None:
        """None where no run is long enough for the filter."""
        try:
            samples = preprocess([self.source.read()], self.how, self.speeds)
        except ShortRunError:
            return None
        return Chunk.of(samples if self.view is None else self.view(samples), self.options, self.first)

    def through(self, view: View) -> _Conditioned:
        """The same with its samples as something else sees them."""
        return replace(self, view=view)


@dataclass(frozen=True, eq=False)
class Data:
    """All samples of a reconstruction.

    Attributes:
        parts: what the chunks are made from.
        reference: samples for global statistics: all of them, or an even selection.
        workers: who computes sums over the chunks.
        progress: who is told how far a pass over logs that are not in memory is.
        names: of the logs that the parts are made from, where they are kept in memory.
    """

    parts: Sequence[_Conditioned | Chunk]
    reference: Chunk
    workers: Workers
    progress: Progress = silent
    names: Sequence[str] = ()

    @staticmethod
    def of(samples: Samples, options: Options, held_out: Mask | None = None) -> Data:
        """Samples in memory; ``held_out`` (N,) by default is every ``folds``-th block."""
        chunk = Chunk.of(samples, options, held_out=held_out)
        return Data([chunk], chunk, Serial())

    @staticmethod
    def kept(logs: Sequence[MotionLog], how: Conditioning, options: Options) -> Data:
        """Samples in memory, a chunk for each log: so sums are added up in the order in which streamed ones are.

        Raises:
            ShortRunError: no log has a run long enough for the filter.
        """
        speeds = Speeds.of_all(logs, how.cutoff_hz) if how.cutoff_hz > 0 else None
        chunks, names, first = [], [], 0
        for log in logs:
            chunk = _Conditioned(log, how, speeds, options, first).chunk()
            if chunk is not None:
                chunks.append(chunk)
                names.append(log.name)
                first = int(chunk.blocks[-1]) + 1
        if not chunks:
            preprocess(logs, how, speeds)  # says how long a run must be
        return Data(chunks, _joined(chunks), Serial(), names=names)

    def through(self, view: View) -> Data:
        """The same samples as something else sees them: which of them count as moving."""
        parts = [part.through(view) for part in self.parts]
        # a selection of samples is none of neighbours, which a view may ask for
        reference = self.reference.through(view) if self.in_memory else self.reference
        return replace(self, parts=parts, reference=reference)

    def nested(self) -> Data:
        """The same, in memory, with one more fold held out, which alone chooses the library."""
        chunks = [part.nested() for part in self.parts if isinstance(part, Chunk)]
        return replace(self, parts=chunks, reference=self.reference.nested())

    @property
    def by_log(self) -> list[tuple[str, Samples]]:
        """Every log's name and samples; none of logs that are read when needed."""
        chunks = [part for part in self.parts if isinstance(part, Chunk)]
        return [(name, chunk.samples) for name, chunk in zip(self.names, chunks, strict=False)]

    @property
    def in_memory(self) -> bool:
        """Whether the reference is all there is."""
        return all(isinstance(part, Chunk) for part in self.parts)

    @staticmethod
    def streamed(
        logs: Sequence[LogSource],
        how: Conditioning,
        options: Options,
        workers: Workers | None = None,
        progress: Progress = silent,
    ) -> Data:
        """Samples that are read and conditioned anew on every pass, each log apart from the others.

        The dead zones of the velocities come from the noisiest log, as they do in memory.

        Raises:
            ShortRunError: no log has a run long enough for the filter.
        """
        workers = workers or Serial()
        speeds = None
        if how.cutoff_hz > 0:
            speeds = Speeds.joined(workers.map(partial(_speeds, how.cutoff_hz), logs))
        stride = max(1, sum(log.samples for log in logs) // REFERENCE)
        # Samples that are no time series are dealt into folds one by one: every fold must be met.
        while gcd(stride, options.folds) > 1:
            stride += 1
        parts, reference, first = [], [], 0
        surveyed = workers.map(
            partial(_survey, stride), [_Conditioned(log, how, speeds, options) for log in logs]
        )
        for log, survey in zip(logs, surveyed, strict=True):
            if survey is not None:
                parts.append(_Conditioned(log, how, speeds, options, first))
                thinned, blocks = survey
                fold = (first + thinned.blocks) % options.folds
                reference.append(
                    replace(thinned, blocks=first + thinned.blocks, held_out=fold == 0, validation=fold == 1)
                )
                first += blocks
        if not parts:
            preprocess([logs[0].read()], how, speeds)  # says which run is too short
        return Data(parts, _joined(reference), workers, progress)

    def sampled(self, count: int) -> Data:
        """At most so many chunks, evenly; all samples in one where they are in memory."""
        if self.in_memory:
            return replace(self, parts=[self.reference])
        return replace(self, parts=self.parts[:: max(1, -(-len(self.parts) // count))])

    def window(self, most: int) -> Chunk:
        """All samples where there are no more, else stretches of consecutive ones, evenly, about so many together."""
        if self.in_memory and self.reference.samples.motion.samples <= most:
            return self.reference
        some = self.sampled(_STRETCHES).parts
        each = -(-_STRETCHES // len(some))
        length = max(1, most // (each * len(some)))
        cut = partial(_on_chunk, partial(_stretches, count=each, length=length))
        return _joined(list(chain.from_iterable(self.workers.map(cut, some))))

    def map(self, function: Callable[[Chunk], Answer], what: str = "") -> Iterator[Answer]:
        """The function's answers for all chunks, in order; of a long pass over logs it is told how far it is.

        Args:
            what: the pass is for.
        """
        tell, count, began = paced(self.progress, _PACE), len(self.parts), time.monotonic()
        answers = self.workers.map(partial(_on_chunk, function), self.parts)
        for number, answer in enumerate(answers, 1):
            if number < count and not self.in_memory:
                left = (time.monotonic() - began) / number * (count - number)
                tell(
                    f"{what or 'reading the logs'}: {number} of {count} pieces, {left:.0f} s left in this pass"
                )
            yield answer

    def sum(self, function: Callable[[Chunk], Answer], what: str = "") -> Answer:
        """Sum of the function's answers over all chunks."""
        answers: Iterator[Any] = self.map(function, what)
        return reduce(add, answers)

    def recorded(self, most: int) -> tuple[list[MotionLog], Chunk]:
        """Logs as they were recorded, about so many samples of them, evenly, and the same conditioned."""
        streamed = [part for part in self.parts if isinstance(part, _Conditioned)]
        whole = sum(part.source.samples for part in streamed)
        some = streamed[:: max(1, -(-whole // most))]
        chunks = [chunk for chunk in (part.chunk() for part in some) if chunk is not None]
        return [part.source.read() for part in some], _joined(chunks)


def _near(rows: Mask, motion: Motion, seconds: float) -> Mask:
    """(N,) samples of the same run within so many seconds of one in ``rows`` (N,)."""
    near = np.zeros(len(rows), dtype=bool)
    for run in motion.runs():
        time, others = motion.time[run], np.flatnonzero(rows[run])
        if len(others) == 0:
            continue
        place = np.searchsorted(others, np.arange(len(time)))
        after = time[others[np.minimum(place, len(others) - 1)]] - time
        before = time - time[others[np.maximum(place - 1, 0)]]
        near[run] = (np.abs(after) <= seconds) | (np.abs(before) <= seconds)
    return near


def _on_chunk(function: Callable[[Chunk], Answer], part: _Conditioned | Chunk) -> Answer:
    chunk = part.chunk()
    assert chunk is not None, "a log changed between two passes"
    return function(chunk)


def _stretches(chunk: Chunk, count: int, length: int) -> list[Chunk]:
    """So many stretches of a chunk, evenly; all of it in one where it is no longer."""
    N = chunk.samples.motion.samples
    if N <= count * length:
        return [chunk]
    middles = (np.arange(count) + 0.5) * N / count
    starts = np.clip(middles - length / 2, 0, N - length).astype(int)
    # Copied: a view would keep the whole chunk, of every piece of a log that does not fit into memory.
    return [deepcopy(chunk.cut(low, low + length)) for low in starts.tolist()]


def _speeds(cutoff_hz: float, log: LogSource) -> Speeds:
    return Speeds.of(log.read(), cutoff_hz)


def _survey(stride: int, part: _Conditioned) -> tuple[Chunk, int] | None:
    """An even selection of a chunk's samples, and its number of blocks."""
    chunk = part.chunk()
    if chunk is None:
        return None
    runs = chunk.samples.motion.runs()
    rows = np.concatenate([np.arange(run.start, run.stop, stride) for run in runs]).astype(np.intp)
    return chunk.take(rows), int(chunk.blocks[-1]) + 1


def _joined(chunks: Sequence[Chunk]) -> Chunk:
    """One chunk of several."""
    samples = [chunk.samples for chunk in chunks]
    tau, moving = (np.concatenate([getattr(s, key) for s in samples]) for key in ("tau", "moving"))
    first = samples[0]
    # Of logs of several rates it tells how long so many samples are together; a filter asks each run for its own.
    periods, counts = [s.period for s in samples], [s.motion.samples for s in samples]
    spans = [s.spans for s in samples if s.spans is not None]
    whole = replace(
        first,
        motion=Motion.joined([s.motion for s in samples]),
        tau=tau,
        moving=moving,
        period=float(np.average(periods, weights=counts)) if len(set(periods)) > 1 else first.period,
        spans=np.concatenate(spans) if len(spans) == len(samples) else None,
        unknown=None,
    )
    roles = [chunk.roles() for chunk in chunks]
    joined: dict[str, Any] = {k: np.concatenate([own[k] for own in roles]) for k in roles[0]}
    return replace(chunks[0], samples=whole, **joined)
