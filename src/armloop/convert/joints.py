"""The order of an arm's joints among those of a source, by name."""

from __future__ import annotations

import re
from collections.abc import Sequence

from armloop.util.errors import LogError


def match(names: Sequence[str], joints: Sequence[str], where: str) -> list[int]:
    """The index in ``names`` of each joint of the arm.

    A name is that of the joint, or ends in it, or begins with it, apart from upper case and separators
    (``ur10_elbow_joint`` for ``elbow_joint``), if no other name does so as well.

    Raises:
        LogError: a joint is not found, or more than once: one line with both lists.
    """
    listed = f"the source has {', '.join(names)}; the arm has {', '.join(joints)}"
    if len(set(names)) < len(names):
        raise LogError(f"{where}: a joint's name stands twice; {listed}")
    found = []
    for joint in joints:
        hits = (
            [k for k, name in enumerate(names) if name == joint]
            or [k for k, name in enumerate(names) if _plain(name) == _plain(joint)]
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


def may_be_unordered(names: Sequence[str]) -> bool:
    """Whether the order of names may be the alphabet's, as drivers publish them, and not the arm's.

    Names that count their joints (``joint1``, ``joint2``) are in both orders at once.
    """
    counted = [re.sub(r"\d+", "", name) for name in names]
    return len(names) > 2 and list(names) == sorted(names) and len(set(counted)) > 1


def _plain(name: str) -> str:
    return re.sub(r"[\s\-./]+", "_", name.strip().lower())
