"""The store: a Parquet dataset partitioned by arm and day, one file per log, named by content and renamed into place.

    STORE/store.json                         what this folder is
    STORE/sums/arm=A/day=D/LOG-MODEL.parquet  sums of one log against one model, one row per block
    STORE/aside/LOG-MODEL.json               a log that could not be used, and why
    STORE/running/arm=A.parquet              what the tests need of the past, so that they go on where they were
    STORE/tested/arm=A.json                  what the tests have come to
    STORE/alarms/arm=A/ID.json               what was found
    STORE/announced.json                     which of these have been told

LOG and MODEL are digests of the contents. Every file is written beside its place and renamed (atomic write), and its
bytes depend on what went in alone: a call that was killed at any moment is made good by the next one, to the byte.
"""

from __future__ import annotations

import fcntl
import json
import os
import secrets
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

import numpy as np
from numpy.typing import NDArray

from armloop.monitoring.sums import LogSums
from armloop.util.arrays import Array
from armloop.util.errors import InputError

SCHEMA = "armloop/watch/1"
PER_JOINT = ("rows", "mean", "energy", "lagged", "torque", "speed", "load", "temperature")
PER_BLOCK = ("start", "seconds", "since_start")
#: A draft older than this belongs to nobody, s.
_STALE = 900.0


class Store:
    """The folder of a store.

    Raises:
        InputError: the folder is something else, or another process is at work in it.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder)
        self._new = False
        mark = self.folder / "store.json"
        if self.folder.exists() and not self.folder.is_dir():
            raise InputError(f"{self.folder}: is a file; --store must name a folder")
        if not self.folder.as_posix().isprintable():  # pyarrow takes paths that are UTF-8 alone
            raise InputError(f"{self.folder}: the name is no text; --store must name a folder in plain UTF-8")
        if mark.exists():
            found = _read_json(mark).get("schema")
            if found != SCHEMA:
                raise InputError(f"{mark}: schema is {found!r}, it must be {SCHEMA!r}")
        elif any(self.folder.glob("sums/*/day=*/*.parquet")):
            _write(mark, {"schema": SCHEMA})  # it was moved away, as a mark that cannot be read should be
        elif self.folder.exists() and any(
            p.name != ".lock" and not p.name.endswith(".part") for p in self.folder.iterdir()
        ):
            raise InputError(
                f"{self.folder}: is neither empty nor a store of armloop watch; name another folder"
            )
        else:
            _write(mark, {"schema": SCHEMA})
            self._new = True

    def give_up(self) -> None:
        """Remove what this call has made of a store whose input is at fault; sums and reasons once stored stay."""
        if self._new and not any(path.is_dir() for path in self.folder.iterdir()):
            for path in self.folder.iterdir():
                path.unlink(missing_ok=True)
            with suppress(OSError):
                self.folder.rmdir()

    @contextmanager
    def locked(self, shared_drafts: bool = False) -> Iterator[None]:
        """Hold the store for one coordinator; the lock goes with the process, however it ends.

        Args:
            shared_drafts: workers of a cluster may still be writing: leave their recent drafts alone.
        """
        with (self.folder / ".lock").open("w") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                raise InputError(
                    f"{self.folder}: another armloop watch is at work here; wait for it to end"
                ) from error
            limit = time.time() - (_STALE if shared_drafts else 0.0)
            for draft in self.folder.rglob(".*.part"):
                if draft.stat().st_mtime <= limit:
                    draft.unlink(missing_ok=True)
            yield

    # -- logs -------------------------------------------------------------------------------------------------------

    def known(self) -> set[tuple[str, str]]:
        """(log, model) digests of all logs that are stored."""
        return {digests(path) for path in self.folder.glob("sums/*/*/*.parquet")}

    def known_aside(self) -> set[tuple[str, str]]:
        """(log, model) digests of all logs that are set aside."""
        return {digests(path) for path in self.folder.glob("aside/*.json")}

    def add(self, arm: str, day: str, log: str, model: str, sums: LogSums, about: dict[str, Any]) -> None:
        """Append the sums of one log.

        Args:
            log, model: digests.
            about: ``name`` of the log, ``programme``, and ``when`` it began, s since 1970.
        """
        upper = np.triu_indices(len(sums.columns))
        table = {name: getattr(sums, name) for name in (*PER_BLOCK, *PER_JOINT, "moment")}
        table["size"] = np.einsum("bpp->bp", sums.gram)
        table["gram"] = sums.gram[:, upper[0], upper[1]]
        about = {**about, "columns": [column.key for column in sums.columns]}
        write_table(self.file(arm, day, log, model), table, about)
        for aside in self.folder.glob(f"aside/{log}-*.json"):
            aside.unlink(missing_ok=True)

    def set_aside(self, log: str, model: str, about: dict[str, Any]) -> None:
        """Remember why a log was not used, in place of what was said of it with other models or none."""
        path = self.folder / "aside" / f"{log}-{model}.json"
        _write(path, about)
        for former in self.folder.glob(f"aside/{log}-*.json"):
            if former != path:
                former.unlink(missing_ok=True)

    def aside(self) -> list[dict[str, Any]]:
        """What was set aside, in the order of the names."""
        found = [_read_json(path) for path in sorted(self.folder.glob("aside/*.json"))]
        return sorted(found, key=lambda item: (item["arm"], item["log"]))

    def prune_aside(self, present: Mapping[str, str]) -> None:
        """Forget the logs set aside whose file holds something else by now (it was still being written) or is gone.

        Args:
            present: digests of the logs that there are, by their paths.
        """
        here = set(present.values())
        for path in self.folder.glob("aside/*.json"):
            log, place = digests(path)[0], Path(_read_json(path)["log"])
            # a folder that is not there may be mounted again
            gone = not place.exists() and place.parent.is_dir()
            if log not in here and (gone or str(place) in present):
                path.unlink(missing_ok=True)

    # -- arms -------------------------------------------------------------------------------------------------------

    def arms(self) -> list[str]:
        """The arms that have logs, sorted."""
        return arms_in(self.folder)

    def running(self, arm: str) -> Path:
        """Where the running state of an arm's tests lies."""
        return self.folder / "running" / f"{_partition(arm)}.parquet"

    def files(self, arm: str, model: str) -> list[Path]:
        """The files of an arm's logs against one model."""
        return sorted((self.folder / "sums" / _partition(arm)).glob(f"day=*/*-{model}.parquet"))

    def file(self, arm: str, day: str, log: str, model: str) -> Path:
        """The file of one log against one model."""
        return self.folder / "sums" / _partition(arm) / f"day={day}" / f"{log}-{model}.parquet"

    def tested(self, arm: str) -> dict[str, Any] | None:
        """What the tests of an arm came to when they were last made."""
        path = self.folder / "tested" / f"{_partition(arm)}.json"
        return _read_json(path) if path.exists() else None

    def set_tested(self, arm: str, answer: dict[str, Any]) -> None:
        """Keep what the tests of an arm came to."""
        _write(self.folder / "tested" / f"{_partition(arm)}.json", answer)

    def alarm(self, arm: str, name: str) -> dict[str, Any] | None:
        """An alarm by its identifier."""
        path = self.folder / "alarms" / _partition(arm) / f"{name}.json"
        return _read_json(path) if path.exists() else None

    def add_alarm(self, arm: str, name: str, alarm: dict[str, Any]) -> None:
        """Keep an alarm."""
        _write(self.folder / "alarms" / _partition(arm) / f"{name}.json", alarm)

    def alarms(self) -> list[dict[str, Any]]:
        """All alarms, by time and arm."""
        found = [_read_json(path) for path in self.folder.glob("alarms/*/*.json")]
        return sorted(found, key=lambda alarm: (alarm["when"], alarm["arm"], alarm["id"]))

    def announced(self) -> set[str]:
        """Identifiers of the alarms that were told."""
        path = self.folder / "announced.json"
        told = _read_json(path).get("alarms") if path.exists() else []
        if not isinstance(told, list) or not all(isinstance(name, str) for name in told):
            raise InputError(f"{path}: holds no list of alarms; move it away, and they are told again")
        return set(told)

    def announce(self, names: Sequence[str]) -> None:
        """Remember that alarms were told, after they were: a call killed before tells them again."""
        _write(self.folder / "announced.json", {"alarms": sorted(self.announced() | set(names))})


@contextmanager
def placing(path: Path) -> Iterator[Path]:
    """A draft that takes its place when the block ends well.

    All below a store is the store's own, and its bytes must not depend on the order of writing: the marks and records
    by which :mod:`armloop.util.outputs` knows a command's outputs have no place here.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(f".{path.name}.{secrets.token_hex(8)}.part")
    try:
        yield draft
        os.replace(draft, path)
    finally:
        draft.unlink(missing_ok=True)


def _write(path: Path, value: dict[str, Any]) -> None:
    with placing(path) as draft:
        draft.write_text(json.dumps(value, sort_keys=True) + "\n", encoding="utf-8")


def arms_in(folder: Path) -> list[str]:
    """The arms that have logs in the folder of a store, if it is one, sorted."""
    return sorted(unquote(path.name.removeprefix("arm=")) for path in folder.glob("sums/arm=*"))


def _partition(arm: str) -> str:
    return f"arm={quote(arm, safe=' ')}"


def digests(path: Path) -> tuple[str, str]:
    """Digests of the log and of the model that a file's sums are of."""
    log, _, model = path.stem.partition("-")
    return log, model


def write_table(path: Path, columns: dict[str, NDArray[Any]], about: dict[str, Any]) -> None:
    """Write columns, (N,) or (N, k) as lists of k, with what is to be known of them, as a Parquet file of a store."""
    import pyarrow
    import pyarrow.parquet

    def column(values: NDArray[Any]) -> Any:
        if values.ndim == 1:
            return pyarrow.array(values)
        flat = pyarrow.array(np.ascontiguousarray(values, dtype=float).ravel())
        return pyarrow.FixedSizeListArray.from_arrays(flat, values.shape[1])

    table = pyarrow.table({name: column(values) for name, values in columns.items()})
    written = table.replace_schema_metadata({"armloop": json.dumps(about, sort_keys=True)})
    with placing(path) as draft:
        pyarrow.parquet.write_table(written, draft, compression="zstd", use_dictionary=False)


def read_table(path: Path, columns: Sequence[str] | None = None) -> Any:
    """Read columns of a Parquet file of a store; its folder's name is no column."""
    import pyarrow.parquet

    return pyarrow.parquet.read_table(path, columns=columns, use_threads=False, partitioning=None)


def matrix(column: Any) -> Array:
    """(N, k) of a column of lists of k."""
    whole = column.combine_chunks()
    width = whole.type.list_size
    return np.asarray(whole.flatten().to_numpy(zero_copy_only=False), dtype=float).reshape(-1, width)


def _read_json(path: Path) -> dict[str, Any]:
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"{path}: cannot be read ({error}); move it away, and it is made anew") from error
    if not isinstance(value, dict):
        raise InputError(f"{path}: holds no JSON object; move it away, and it is made anew")
    return value
