"""Schema of a motion log: columns `time,q1..,v1..,tau1..`, `vdot1..` if they are there, and how many joints they are of."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from armloop.data.tables import read_header
from armloop.util.errors import LogError

#: A column of a joint: what it holds, and the number.
JOINT_COLUMN = re.compile(r"(q|v|tau|vdot)(\d{1,3})")


def check_header(path: Path, joints: int | None = None) -> dict[str, list[str]]:
    """The columns of a file's header, as of :func:`columns_of`; raises `LogError` when the file is missing, too."""
    return columns_of(path, read_header(path), joints)


def columns_of(path: Path, header: Sequence[str], joints: int | None = None) -> dict[str, list[str]]:
    """Return the names of the columns of each kind that is there, ``q`` and ``tau`` at least, joint by joint.

    path : where they stand, for the message
    joints : how many joints the arm has; None takes what the header has

    Raises `LogError` when they are not those of a log, or of another number of joints.
    """
    if header and header[0].startswith(("#", "%", "//")):
        raise LogError(
            f"{path}: line 1 is a comment, {header[0][:40]!r}; the first line must name the columns: take it out, or let "
            "`armloop convert` read the file"
        )
    if len(header) == 1 and re.search(r"[;\t ]", header[0]):
        raise LogError(
            f"{path}: the header is one column, {header[0][:40]!r}; put commas between the names, or let `armloop convert` "
            "read the file"
        )
    found: dict[str, set[int]] = {"q": set(), "v": set(), "tau": set(), "vdot": set()}
    for name in header:
        match = JOINT_COLUMN.fullmatch(name)
        if match is None and name != "time":
            continue
        if header.count(name) > 1:
            raise LogError(f"{path}: column {name} stands {header.count(name)} times; each must stand once")
        if match is not None:
            kind, number = match[1], int(match[2])
            if name != f"{kind}{number}" or number == 0:
                raise LogError(
                    f"{path}: column {name}: joints are numbered {kind}1, {kind}2, ... from the base"
                )
            found[kind].add(number)
    n = max((number for numbers in found.values() for number in numbers), default=1)
    # A header without any q is none: v may be missing only where it can be differentiated.
    kinds = [
        kind for kind in found if found[kind] or kind in ("q", "tau") or (kind == "v" and not found["q"])
    ]
    missing = [] if "time" in header else ["time"]
    missing += [f"{kind}{j}" for kind in kinds for j in range(1, n + 1) if j not in found[kind]]
    if missing:
        raise LogError(
            f"{path}: the header lacks {_listed(missing)}; "
            "it must be time,q1..qn,v1..vn,tau1..taun (optionally vdot1..vdotn; v may be left out) with one n; "
            "`armloop convert` reads other names and units"
        )
    if joints is not None and n != joints:
        raise LogError(f"{path}: the columns are those of {n} joints; the arm has {joints}")
    return {kind: [f"{kind}{j}" for j in range(1, n + 1)] for kind, numbers in found.items() if numbers}


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names[:6]) + (f" and {len(names) - 6} more" if len(names) > 6 else "")
