"""Atomic writes: a file is replaced whole, in one step, or not at all."""

from __future__ import annotations

import fcntl
import json
import os
import secrets
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from armloop.util import outputs
from armloop.util.errors import InputError
from armloop.util.finite import finite

#: Bytes of a file's name that its draft keeps; with the rest of the draft's name they fit wherever the file does.
_KEPT = 120


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Yield a draft's path beside `path`; when the block ends well, rename it to `path`, else remove it.

    Links are followed. The draft is new, its name cannot be guessed, and it has the permissions that `path` has or a
    new file gets. Missing parent folders are made; drafts that a killed process has left of `path` are removed.
    Raises `InputError` when the place cannot be written to, or by the rules of `armloop.util.outputs`.
    """
    final = outputs.target(path)
    draft: Path | None = None
    descriptor = -1
    try:
        final.parent.mkdir(parents=True, exist_ok=True)
        label = os.fsdecode(os.fsencode(final.name)[:_KEPT])
        _remove_abandoned(final.parent, label)
        draft = final.with_name(f".{label}.{secrets.token_hex(8)}.part")
        descriptor = os.open(draft, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, 0o666)
        with suppress(OSError):  # a file system without locks: its abandoned drafts stay
            fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
        with suppress(FileNotFoundError):
            os.chmod(draft, stat.S_IMODE(final.stat().st_mode))
        yield draft
        outputs.target(path)  # nobody else's file has come there meanwhile
        outputs.record(draft, final)
        os.replace(draft, final)
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(f"{path}: cannot be written ({reason}); choose a folder you may write to") from error
    finally:
        if descriptor >= 0:
            os.close(descriptor)
        if draft is not None:
            # gone when all went well; when it did not, the first error is the one to tell
            with suppress(OSError):
                draft.unlink()


def write_text(path: str | Path, text: str) -> None:
    """Write `text` to `path` as UTF-8, whole or not at all; see `replacing`. A web page gets the command's mark."""
    mark = outputs.stamp()
    head, found, rest = text.partition("<head>")
    if mark is not None and found and head.lstrip().lower().startswith(("<!doctype html", "<html")):
        text = f'{head}{found}\n<meta name="generator" content="{mark}">{rest}'
    with replacing(path) as draft:
        # A name that is no UTF-8 can be part of a text.
        draft.write_bytes(text.encode("utf-8", errors="backslashreplace"))


def write_json(path: str | Path, value: dict[str, Any]) -> None:
    """Write an object as strict JSON with the command's mark, whole or not at all; see `strict`."""
    mark = outputs.stamp()
    if mark is not None:
        first = {key: value[key] for key in ("schema",) if key in value}
        value = {**first, "written_by": mark, **{k: v for k, v in value.items() if k not in first}}
    write_text(path, strict(value, indent=1) + "\n")


def strict(value: Any, indent: int | None = None) -> str:
    """JSON as RFC 8259 has it: a number that is not finite becomes null."""
    try:
        return json.dumps(value, indent=indent, allow_nan=False)
    except ValueError:  # looked at item by item only where there is one to find
        return json.dumps(finite(value), indent=indent, allow_nan=False)


def write_figure(path: str | Path, figure: Any, **how: Any) -> None:
    """Write a matplotlib figure as PNG with the command's mark, whole or not at all; see `replacing`."""
    mark = outputs.stamp()
    with replacing(path) as draft:
        figure.savefig(
            draft, format="png", dpi=110, metadata={} if mark is None else {"Software": mark}, **how
        )


def _remove_abandoned(folder: Path, label: str) -> None:
    """Remove drafts that nobody holds any more."""
    for path in folder.iterdir():
        if path.name.startswith(f".{label}.") and path.name.endswith(".part"):
            with suppress(OSError):
                descriptor = os.open(path, os.O_RDWR | os.O_NOFOLLOW | os.O_CLOEXEC)
                try:
                    fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    path.unlink()
                finally:
                    os.close(descriptor)
