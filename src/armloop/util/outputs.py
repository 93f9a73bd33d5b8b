"""Overwrite protection: a command replaces neither what it reads, nor a device, nor a file that it did not write itself.

A file tells who wrote it: JSON, HTML and PNG by a mark near their beginning (:func:`stamp`), every other by a line
``SHA-256  command  name`` of the file ``.armloop`` beside it. The rules hold while a command runs (:func:`guarding`);
Python programs write where they say.
"""

from __future__ import annotations

import fcntl
import os
import stat
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from itertools import takewhile
from pathlib import Path

from armloop.util.errors import InputError
from armloop.util.given import path_of

#: Beside outputs that have no room for a mark: what was written, by which command.
RECORD = ".armloop"
#: Bytes at the beginning of a file among which its mark is.
_HEAD = 4096
_LONGEST_RECORD = 1 << 22


class _Guard:
    """A command that runs: its name, what it reads by device and inode, and what it has taken for itself."""

    def __init__(self, command: str, force: bool, around: _Guard | None) -> None:
        self.command, self.force, self.around = command, force, around
        self.inputs: set[tuple[int, int]] = set()
        self.locks: list[int] = []
        self.made: list[Path] = []
        #: What each output file was asked for by.
        self.taken: dict[Path, str] = {}


_guard: _Guard | None = None


def _let_go() -> None:
    """A fork inherits a lock's open file, and would hold the lock a while after its command was killed."""
    guard = _guard
    while guard is not None:
        while guard.locks:
            os.close(guard.locks.pop())
        guard = guard.around


os.register_at_fork(after_in_child=_let_go)


@contextmanager
def guarding(command: str, inputs: Iterable[str | Path] = (), force: bool = False) -> Iterator[None]:
    """Hold outputs to the rules while the block runs; ``force`` leaves out all but the one on devices.

    inputs : files that may be read; those that do not exist are passed over
    """
    global _guard
    before, _guard = _guard, _Guard(command, force, _guard)
    try:
        for path in inputs:
            reading(path)
        yield
    finally:
        for lock in _guard.locks:
            os.close(lock)
        for folder in reversed(_guard.made):
            with suppress(OSError):  # what has been written keeps its folder
                folder.rmdir()
        _guard = before


def reading(path: str | Path) -> None:
    """Remember a file as an input of the command that runs."""
    if _guard is not None:
        found = _status(Path(path))
        if found is not None:
            _guard.inputs.add((found.st_dev, found.st_ino))


def stamp() -> str | None:
    """The mark of the command that runs, such as ``armloop reconstruct``; None outside of commands."""
    return None if _guard is None else f"armloop {_guard.command}"


def target(path: str | Path, option: str = "") -> Path:
    """The file of an output, links followed; raises ``InputError`` for a folder, a device, an input or a file of others."""
    where, name = str(path_of(path, option or "the path of an output")), option or "the output"
    _check_name(where, name)
    try:
        real = Path(path).resolve()
        found = _status(real)
    except (OSError, RuntimeError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"{where}: cannot be written ({reason}); choose another name for {name}") from error
    if found is None:
        return real
    if stat.S_ISDIR(found.st_mode):
        raise InputError(f"{where}: is a folder; {name} must name a file")
    if not stat.S_ISREG(found.st_mode):
        raise InputError(f"{where}: is a device or a pipe; {name} must name a file")
    if _guard is not None and not _guard.force:
        if (found.st_dev, found.st_ino) in _guard.inputs:
            raise InputError(
                f"{where}: is read by this command and would be replaced; choose another name for {name}"
            )
        try:
            own = _own(real, _guard.command)
        except OSError as error:
            raise InputError(
                f"{where}: cannot be read ({error.strerror}); choose another name for {name}"
            ) from error
        if not own:
            raise InputError(
                f"{where}: exists, and `armloop {_guard.command}` has not written it; choose another name, or add "
                "--force"
            )
    return real


def record(draft: Path, final: Path) -> None:
    """Note in :data:`RECORD` that ``draft`` will become ``final``, if the draft has no mark of its own."""
    if _guard is None or _marked(draft, _guard.command):
        return
    line = _line(draft, _guard.command, final.name)
    known = final.with_name(RECORD)
    if line not in _lines(known):
        # One short write at the end of a file is whole, whoever else writes.
        descriptor = os.open(
            known, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o666
        )
        try:
            os.write(descriptor, f"{line}\n".encode(errors="surrogateescape"))
        finally:
            os.close(descriptor)


def take_folder(path: str | Path, names: Iterable[str] = (), option: str = "--out") -> Path:
    """The output folder for this command alone, checked before any work is done, with the files that will go into it.

    The folder is made, and taken away again if nothing is written. Nothing but a lock of the system holds it: it ends with
    the command, however that ends. Raises ``InputError`` where it cannot be had, or a file in it is not to be replaced.
    """
    folder = path_of(path, option)
    _check_name(str(path), option)
    try:
        _existing(folder, option, "name")
        for name in names:
            target(folder / name)
            if Path(name).parent != Path():
                _existing((folder / name).parent, option, "name")
        if _guard is not None:
            _lock(folder, option, _guard)
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(f"{option} {path}: no such folder can be made ({reason})") from error
    return folder


def take_file(path: str | Path | None, option: str) -> None:
    """Check the place of an output file (None is none) before any work is done; raises as :func:`target`."""
    if path is None:
        return
    real = target(path, option)
    if _guard is not None and _guard.taken.setdefault(real, option) != option:
        raise InputError(
            f"{path}: is given to {_guard.taken[real]} and to {option}; give each a name of its own"
        )
    try:
        longest = os.pathconf(_existing(real.parent, option, "lie in"), "PC_NAME_MAX")
    except OSError as error:
        raise InputError(f"{option} {path}: cannot be written ({error.strerror or error})") from error
    if len(os.fsencode(real.name)) > longest:
        raise InputError(
            f"{real.name[:40]}…: longer than {longest} bytes; shorten the name that {option} gives"
        )


def _existing(folder: Path, option: str, must: str) -> Path:
    """The folder, or the nearest one above it that is there; raises `InputError` where nothing can be made in it."""
    while _status(folder) is None:
        folder = folder.parent
    if not folder.is_dir():
        raise InputError(f"{folder}: is a file; {option} must {must} a folder")
    try:
        # Tried, not asked for: /proc grants its superuser all rights, and yet nothing can be made in it.
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        raise InputError(f"{folder}: cannot be written to; choose another folder for {option}") from error
    return folder


def _check_name(where: str, option: str) -> None:
    """Raise ``InputError`` for a name that means something else: a ~ that no shell has replaced, or standard output."""
    if where == "-":
        raise InputError(
            f"-: {option} cannot be standard output; give a file's name (./- for a file of this name)"
        )
    if where.startswith("~"):
        raise InputError(
            f"{where}: ~ stands for no folder here; write {option} and a blank before it, or the whole path"
        )


def _lock(folder: Path, option: str, guard: _Guard) -> None:
    missing = list(takewhile(lambda each: not each.exists(), (folder, *folder.parents)))
    for each in reversed(missing):
        each.mkdir(exist_ok=True)
        guard.made.append(each)
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        os.close(descriptor)
        raise InputError(
            f"{option} {folder}: another run writes into this folder; wait for its end, or choose another"
        ) from error
    except OSError:  # a file system without locks: outputs are whole all the same, if of two runs
        os.close(descriptor)
        return
    guard.locks.append(descriptor)


def _status(path: Path) -> os.stat_result | None:
    try:
        return path.stat()
    except (FileNotFoundError, NotADirectoryError):
        return None


def _own(path: Path, command: str) -> bool:
    """Whether a file was written by a command of this name, and not changed since where no mark can tell."""
    return _marked(path, command) or _line(path, command, path.name) in _lines(path.with_name(RECORD))


def _marked(path: Path, command: str) -> bool:
    with path.open("rb") as file:
        head = file.read(_HEAD)
    name = f"armloop {command}".encode()
    if head.startswith(b"\x89PNG"):
        return b"Software\x00" + name in head
    return head.lstrip()[:1] in (b"{", b"<") and any(
        before + name + b'"' in head for before in (b'"written_by": "', b'name="generator" content="')
    )


def _line(path: Path, command: str, name: str) -> str:
    import hashlib

    with path.open("rb") as file:
        return f"{hashlib.file_digest(file, 'sha256').hexdigest()}  {command}  {name}"


def _lines(path: Path) -> set[str]:
    try:
        with path.open("rb") as file:
            return set(file.read(_LONGEST_RECORD).decode(errors="surrogateescape").splitlines())
    except OSError:
        return set()
