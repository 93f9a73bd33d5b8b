"""Checkpoints of a long command: finished items, kept by a digest of all that they depend on, until the command ends.

They lie in the output folder as JSON, each written whole. A command that was ended, however, goes on with the items
that are not there; other input, other options, another version of the program or of what computes give other digests.
"""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from armloop.util.errors import InputError
from armloop.util.files import strict, write_text
from armloop.util.reading import read_json

FOLDER = ".armloop.kept"
_COMPUTING = ("numpy", "scipy", "scikit-learn", "pysindy", "drake", "osqp", "control")


class Kept:
    """Items of one command.

    Args:
        folder: the command's output folder; None keeps nothing.
        depends: what all items depend on, JSON-ready.
    """

    def __init__(self, folder: Path | None, depends: Any) -> None:
        self._folder = None if folder is None else folder / FOLDER
        self._depends = json.dumps([depends, _program()], sort_keys=True)
        self._earlier = frozenset(self._files())

    def get(self, item: Any) -> Any | None:
        """What was kept of an item (JSON-ready); None if nothing can be read of it."""
        if self._folder is None:
            return None
        try:
            return read_json(self._path(item), InputError, "a checkpoint")["value"]
        except (InputError, KeyError, TypeError):
            return None

    def put(self, item: Any, value: Any) -> None:
        """Keep the value of an item, JSON-ready and not None; a place that cannot be written to keeps nothing."""
        if self._folder is not None:
            with suppress(InputError):  # the command goes on without; its outputs will say what is wrong
                write_text(self._path(item), strict({"written_by": "armloop", "value": value}))

    def once(self, item: Any, make: Callable[[], Any]) -> Any:
        """What was kept of an item, or what is made of it now and kept."""
        value = self.get(item)
        if value is None:
            value = make()
            self.put(item, value)
        return value

    def clear(self) -> None:
        """Forget all items: the command has come to its end."""
        self._remove(self._files())

    @contextmanager
    def unless_at_fault(self) -> Iterator[None]:
        """Forget what was kept since this began where the block finds the input at fault: such a call leaves nothing."""
        try:
            yield
        except InputError:
            self._remove(self._files() - self._earlier)
            raise

    def _files(self) -> set[Path]:
        if self._folder is None or not self._folder.is_dir() or self._folder.is_symlink():
            return set()
        return set(self._folder.glob("*.json"))

    def _remove(self, files: set[Path]) -> None:
        for path in files:
            path.unlink(missing_ok=True)
        if self._folder is not None and not self._folder.is_symlink() and not self._files():
            with suppress(OSError):
                (self._folder / ".armloop").unlink(missing_ok=True)
                self._folder.rmdir()

    def _path(self, item: Any) -> Path:
        assert self._folder is not None
        text = f"{self._depends}\n{json.dumps(item, sort_keys=True)}"
        return self._folder / f"{hashlib.sha256(text.encode()).hexdigest()[:32]}.json"


def digest(*arrays: Any) -> str:
    """SHA-256 of arrays' shapes and bytes, for what items depend on."""
    import numpy as np

    found = hashlib.sha256()
    for array in arrays:
        whole = np.ascontiguousarray(array)
        found.update(f"{whole.dtype} {whole.shape}".encode())
        found.update(whole.tobytes())
    return found.hexdigest()


@cache
def _program() -> list[str]:
    """The program's own text and the versions of what computes."""
    package, found = Path(__file__).resolve().parents[1], hashlib.sha256()
    for folder in (package, package.with_name("armloop_paper")):
        for path in sorted(folder.rglob("*.py")):
            found.update(str(path.relative_to(package.parent)).encode() + b"\0" + path.read_bytes())
    versions = []
    for name in _COMPUTING:
        with suppress(PackageNotFoundError):
            versions.append(f"{name} {version(name)}")
    return [found.hexdigest(), platform.machine(), *versions]
