"""The order of an arm's joints among those of a source, by name."""

from __future__ import annotations

import re
from collections.abc import Sequence

from armloop.util.errors import LogError


def match(names: Sequence[str], joints: Sequence[str], where: str) -> list[int]:
    """The index in ``names`` of each joint of the arm; raises ``LogError`` with both lists for none, or more than one.

    A name is that of the joint, or ends in it, or begins with it, apart from upper case and separators
    (``ur10_elbow_joint`` for ``elbow_joint``), if no other name does so as well, or if it is the one that has the prefix
    which all joints of the arm have (``panda_joint1`` beside ``panda_finger_joint1`` for ``joint1``).
    """
    listed = f"the source has {', '.join(names)}; the arm has {', '.join(joints)}"
    if len(set(names)) < len(names):
        raise LogError(f"{where}: a joint's name stands twice; {listed}")
    found = []
    prefix = _common_prefix(names, joints)
    for joint in joints:
        hits = (
            [k for k, name in enumerate(names) if name == joint]
            or [k for k, name in enumerate(names) if _plain(name) == _plain(joint)]
            or [k for k, name in enumerate(names) if prefix and _plain(name) == f"{prefix}_{_plain(joint)}"]
            or [k for k, name in enumerate(names) if _plain(name).endswith("_" + _plain(joint))]
            or [k for k, name in enumerate(names) if _plain(joint).endswith("_" + _plain(name))]
        )
        if len(hits) != 1:
            wrong = "no joint" if not hits else "more than one joint"
            raise LogError(
                f"{where}: {wrong} matches {joint}; {listed}; give their names as joints in a --map"
            )
        found.append(hits[0])
    if len(set(found)) < len(found):
        raise LogError(f"{where}: two joints of the arm match one of the source; {listed}")
    return found


def doubtful_order(names: Sequence[str]) -> str | None:
    """Why the order of names need not be the arm's: the alphabet's, as drivers publish them, or a count that jumps.

    Names that count their joints (``joint1``, ``joint2``) are in the alphabet's order and the arm's at once.
    """
    counted = [re.sub(r"\d+", "", name) for name in names]
    if len(names) > 2 and list(names) == sorted(names) and len(set(counted)) > 1:
        return "in the order of the alphabet"
    counts: dict[str, list[list[int]]] = {}
    for stem, name in zip(counted, names, strict=True):
        counts.setdefault(stem, []).append([int(digits) for digits in re.findall(r"\d+", name)])
    if any(count != sorted(count) for count in counts.values()):
        return "in an order other than that of their numbers"
    return None


def _common_prefix(names: Sequence[str], joints: Sequence[str]) -> str | None:
    """What stands before every joint's name in a source of one arm; None where nothing or more than one thing does."""
    plain = {_plain(name) for name in names}
    first = "_" + _plain(joints[0]) if joints else "_"
    heads = {name.removesuffix(first) for name in plain if name.endswith(first)}
    whole = [head for head in heads if all(f"{head}_{_plain(joint)}" in plain for joint in joints)]
    return whole[0] if len(whole) == 1 else None


def _plain(name: str) -> str:
    return re.sub(r"[\s\-./]+", "_", name.strip().lower())
