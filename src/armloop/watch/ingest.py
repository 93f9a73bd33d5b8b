"""From logs to the store: each log's sums, whoever computes them; a broken log is set aside and stops nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from armloop.data.log import MotionLog
from armloop.data.signals import ShortRunError, preprocess
from armloop.identification.validation.misrecorded import POOR, misrecorded
from armloop.model import ReconstructedModel
from armloop.monitoring.sums import LogSums, RestingError, log_sums
from armloop.regression.moments import Sums
from armloop.util.errors import InputError, LogError
from armloop.util.progress import Progress, paced, silent
from armloop.util.workers import Workers
from armloop.watch.fleet import model_and_digest, model_for
from armloop.watch.sources import LogFile, arm_in, day_of, recordings
from armloop.watch.store import Store

#: Logs of one arm that a worker takes at a time, in order.
_AT_ONCE = 16
#: Sums are of fewer samples than what was recorded wrongly is judged by: from this part of its bound on it is asked.
_ASKED = 0.8
#: Stands for the model of a log whose arm has none.
_NO_MODEL = "none"


@dataclass(frozen=True)
class Piece:
    """Logs of one arm, in order, with their digests."""

    store: Path
    arm: str
    model: Path
    files: tuple[tuple[LogFile, str], ...]


@dataclass(frozen=True)
class Counts(Sums):
    """How many logs were read, were known before, and were set aside."""

    read: int = 0
    known: int = 0
    aside: int = 0


def ingest(
    store: Store,
    models: dict[str, Path],
    files: Sequence[LogFile],
    workers: Workers,
    progress: Progress = silent,
) -> tuple[Counts, dict[str, Path], list[dict[str, str]]]:
    """Bring new logs into the store.

    Returns:
        Counts, where each log that there is lies, by its digest, and those that cannot be opened, as they are said to be
        set aside; the store knows logs by what they hold.
    """
    known, aside = store.known(), store.known_aside()
    counts, places, closed = Counts(), {}, []
    todo: dict[tuple[str, Path], list[tuple[LogFile, str]]] = {}
    tell = paced(progress)
    for index, file in enumerate(files):
        tell(f"looking at logs: {index} of {len(files)}")
        try:
            digest = file.digest()
        except InputError as error:
            counts += Counts(aside=1)
            closed.append({"arm": file.arm, "log": str(file.path), "reason": str(error)})
            continue
        if digest in places:
            counts += Counts(known=1)
            continue
        places[digest] = file.path
        try:
            arm, programme = _whose(file, models)
        except InputError as error:
            counts += _put_aside(store, aside, digest, file, file.arm, str(error))
            continue
        path = model_for(models, arm) if arm else None
        if path is None:
            reason = (
                f"{file.path}: there is no model of arm {arm!r}; give --models a file {arm}.json"
                if arm
                else f"{file.path}: which arm it is of is not known; put it into a folder named after the arm"
            )
            counts += _put_aside(store, aside, digest, file, arm, reason)
            continue
        model = model_and_digest(path)[1]
        if (digest, model) in known:
            counts += Counts(known=1)
        elif (digest, model) in aside:
            counts += Counts(aside=1)
        else:
            todo.setdefault((arm, path), []).append((replace(file, arm=arm, programme=programme), digest))
    pieces = _side_by_side(store.folder, todo)
    total, done = sum(len(piece.files) for piece in pieces), 0
    for answer in workers.map(read_piece, pieces) if pieces else ():
        counts += answer
        done += answer.read + answer.aside
        tell(f"read {done} of {total} new logs")
    store.prune_aside({str(path): digest for digest, path in places.items()})
    return counts, places, closed


def _put_aside(
    store: Store, aside: set[tuple[str, str]], digest: str, file: LogFile, arm: str, reason: str
) -> Counts:
    if (digest, _NO_MODEL) not in aside:
        store.set_aside(digest, _NO_MODEL, {"arm": arm, "log": str(file.path), "reason": reason})
    return Counts(aside=1)


def _whose(file: LogFile, models: dict[str, Path]) -> tuple[str, str]:
    """Arm and programme of a log: its folder's below DIR, else its columns', else the only model's, else DIR's name."""
    arm, programme = file.arm, file.programme
    if not arm or model_for(models, arm) is None:
        by_column, in_column = arm_in(file.path)
        arm, programme = by_column or arm, programme or in_column
    elif not programme:
        programme = arm_in(file.path)[1]
    if not arm and len(models) == 1:
        arm = next(iter(models)) or "arm"
    folder = file.path.absolute().parent.name
    return arm or (folder if folder in models else ""), programme


def _side_by_side(folder: Path, todo: dict[tuple[str, Path], list[tuple[LogFile, str]]]) -> list[Piece]:
    """Pieces of the arms in turn, those of one arm in its order."""
    queues = [
        [
            Piece(folder, arm, model, tuple(files[first : first + _AT_ONCE]))
            for first in range(0, len(files), _AT_ONCE)
        ]
        for (arm, model), files in sorted(todo.items())
    ]
    longest = max((len(queue) for queue in queues), default=0)
    return [queue[k] for k in range(longest) for queue in queues if k < len(queue)]


def read_piece(piece: Piece) -> Counts:
    """Read the logs of a piece one by one, and write each one's sums; nothing of them is kept in memory."""
    store, counts = Store(piece.store), Counts()
    model, digest = model_and_digest(piece.model)
    for file, log in piece.files:
        try:
            sums, when = _sums(file, model)
        except InputError as error:
            store.set_aside(log, digest, {"arm": piece.arm, "log": str(file.path), "reason": str(error)})
            counts += Counts(aside=1)
            continue
        about = {"name": file.path.stem, "programme": file.programme, "when": when}
        store.add(piece.arm, day_of(when), log, digest, sums, about)
        counts += Counts(read=1)
    return counts


def _sums(file: LogFile, model: ReconstructedModel) -> tuple[LogSums, float]:
    """The sums of a log, and when it began; a long one is read in pieces, of which some may be of an arm at rest.

    Raises:
        LogError: it cannot be used, or was recorded otherwise than the model's own (torques in another unit, say).
    """
    parts: list[LogSums] = []
    began: list[float] = []
    resting: LogError | None = None
    for recording in recordings(file, model):
        began.append(recording.when)
        try:
            parts.append(log_sums(model, recording.log, recording.extra))
        except (RestingError, ShortRunError) as error:
            resting = resting or error
            continue
        _refuse_misrecorded(model, recording.log, parts[-1])
    if not parts and resting is not None:
        raise resting
    return LogSums.joined(parts), began[0]


def _refuse_misrecorded(model: ReconstructedModel, log: MotionLog, sums: LogSums) -> None:
    """Set a log aside that was recorded otherwise than the model's: as a change of the arm it would outshine all others.

    Only of one that the model explains badly is it asked, for it takes as long as the sums.

    Raises:
        LogError: what is wrong with it, and what would be right.
    """
    if (sums.unexplained >= _ASKED * POOR).any() and (
        wrong := misrecorded(model, preprocess([log], model.conditioning))
    ):
        raise LogError(f"{log.name}: {wrong}")
