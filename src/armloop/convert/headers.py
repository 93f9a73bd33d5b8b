"""Column inference from names: which are the time, positions, velocities and torques of which joint.

Nothing here is certain. What comes out is a map to be looked at, with what it is unsure of.
"""

from __future__ import annotations

import re
from collections.abc import Mapping as Mapping_
from collections.abc import Sequence
from dataclasses import dataclass, replace

from armloop.convert.mapping import Mapping, QuantityMap, TimeMap
from armloop.convert.units import canonical, spelt
from armloop.convert.vocabulary import CURRENT, WANTED, WORDS, kind_of, words_of

_BRACKETS = str.maketrans("（）［］【】", "()[][]")
_UNIT = re.compile(r"[\[(]([^\[\]()]*[^\[\]()\d][^\[\]()]*)[\])]\s*$")
_UNIT_WORDS = {"deg", "degrees", "rad", "mm", "nm", "amp", "ms", "us", "ns", "ma"}


@dataclass(frozen=True)
class Group:
    """Columns whose names differ in the joint alone."""

    key: str
    columns: tuple[str, ...]
    joints: tuple[str, ...]
    words: tuple[str, ...]
    unit: str
    by_name: bool = False


@dataclass(frozen=True)
class Suggestion:
    """A map and, by field, what was not clear."""

    mapping: Mapping | None
    unsure: dict[str, str]


def suggest(
    columns: Sequence[str], joints: Sequence[str] = (), units: Mapping_[str, str] | None = None
) -> Suggestion:
    """A map for a table with these columns.

    ``joints`` are the names of the arm's, where one is given, ``units`` those of a row below the header.
    """
    unsure: dict[str, str] = {}
    groups = groups_of(columns, joints, units)
    best: dict[str, list[Group]] = {kind: ranked(kind, groups) for kind in ("q", "v", "tau", "vdot")}
    needed = {"q": "positions", "tau": "torques or currents"}
    missing = [words for kind, words in needed.items() if not best[kind]]
    if missing:
        return Suggestion(None, {"columns": f"no columns of {' and '.join(missing)} were recognised"})
    q = best["q"][0]
    fields: dict[str, QuantityMap] = {}
    for kind, likely in best.items():
        fitting = [ordered for group in likely if (ordered := _in_order(group, q)) is not None]
        if not fitting:
            if kind == "tau":
                return Suggestion(None, {"columns": f"no {len(q.columns)} columns of torque go with {q.key}"})
            continue
        group = fitting[0]
        fields[kind] = QuantityMap(list(group.columns), unit_of(kind, group))
        if len(fitting) > 1:
            unsure[kind] = "also possible: " + ", ".join(other.key for other in fitting[1:4])
    time, doubt = time_of(columns, units)
    if doubt:
        unsure["time"] = doubt
    named = not q.joints[0].isdecimal()
    mapping = Mapping(
        time,
        fields["q"],
        fields["tau"],
        fields.get("v"),
        fields.get("vdot"),
        list(q.joints) if named else None,
    )
    if "v" not in fields:
        unsure["v"] = "no velocities were recognised; they will be differenced from q"
    if not named:
        unsure["joints"] = "the columns are taken base to tip"
    return Suggestion(mapping, unsure)


def _in_order(group: Group, first: Group) -> Group | None:
    """The group with its columns in the order of the joints of another, or None where the joints differ."""
    if first.joints[0].isdecimal() or group.joints[0].isdecimal():
        both = group.joints[0].isdecimal() and first.joints[0].isdecimal()
        return group if both and len(group.columns) == len(first.columns) else None
    if set(group.joints) != set(first.joints):
        return None
    columns = dict(zip(group.joints, group.columns, strict=True))
    return replace(group, columns=tuple(columns[joint] for joint in first.joints), joints=first.joints)


def groups_of(
    columns: Sequence[str], joints: Sequence[str] = (), units: Mapping_[str, str] | None = None
) -> list[Group]:
    """Columns that differ in the joint alone, by its number or its name."""
    return _numbered(columns, units or {}) + _named(columns, joints, units or {})


def _split_unit(name: str, units: Mapping_[str, str]) -> tuple[str, str]:
    """A name without its unit, and the unit as it is written: in a row of its own, in brackets, or as the last word."""
    if units.get(name):
        return name, units[name]
    found = _UNIT.search(name.translate(_BRACKETS))
    if found:
        return name[: found.start()].strip(), found[1]
    last = words_of(name)[-1:]
    if last and last[0] in _UNIT_WORDS and len(words_of(name)) > 1:
        return name, spelt(last[0])
    return name, ""


def _numbered(columns: Sequence[str], units: Mapping_[str, str]) -> list[Group]:
    """Groups like ``q1, q2, …`` or ``state.q[0], state.q[1], …`` with consecutive numbers from 0 or 1."""
    found: dict[tuple[str, str, str], dict[int, str]] = {}
    for column in columns:
        name, unit = _split_unit(column, units)
        for place in re.finditer(r"\d+", name):
            key = (name[: place.start()], name[place.end() :], unit)
            found.setdefault(key, {}).setdefault(int(place[0]), column)
    groups = []
    for (before, after, unit), members in found.items():
        numbers = sorted(members)
        if numbers[0] not in (0, 1) or numbers != list(range(numbers[0], numbers[0] + len(numbers))):
            continue
        words = [word for word in words_of(f"{before} {after}") if not word.isdecimal()]
        label = f"{before}{{{numbers[0]}..{numbers[-1]}}}{after}"
        groups.append(
            Group(
                label, tuple(members[k] for k in numbers), tuple(str(k) for k in numbers), tuple(words), unit
            )
        )
    most = max((len(group.columns) for group in groups), default=0)
    # A lone column with a 1 in its name is a group only where the arm may have one joint.
    return [group for group in groups if len(group.columns) > 1 or most == 1]


def _named(columns: Sequence[str], joints: Sequence[str], units: Mapping_[str, str]) -> list[Group]:
    """Groups like ``elbow.pos, wrist.pos`` that share a beginning or an end, or hold the names of the arm's joints."""
    found: dict[tuple[str, str], dict[str, str]] = {}
    for column in columns:
        name, unit = _split_unit(column, units)
        hits = [joint for joint in joints if joint in name]
        if hits:
            joint = max(hits, key=len)
            found.setdefault((name.replace(joint, " "), unit), {})[joint] = column
            continue
        for separator in ("/", ".", "__", " ", "_"):
            first, _, last = name.rpartition(separator)
            if first and last and not last.isdecimal() and not WANTED & set(words_of(first)):
                found.setdefault((separator + last, unit), {})[first] = column
                break
    groups = []
    for (key, unit), members in found.items():
        if len(members) > 1 or (len(joints) == 1 and members):
            ordered = (
                sorted(members, key=list(joints).index) if set(members) <= set(joints) else list(members)
            )
            words = tuple(word for word in words_of(key) if not word.isdecimal())
            names = tuple(members[joint] for joint in ordered)
            groups.append(
                Group(f"*{key.strip()}", names, tuple(ordered), words, unit, set(members) == set(joints))
            )
    return groups


def ranked(kind: str, groups: Sequence[Group]) -> list[Group]:
    """The groups that may hold a quantity, the likeliest first."""

    def rank(group: Group) -> tuple[int, int, int, int]:
        wanted = sum(word in WANTED for word in group.words)
        place = min(WORDS[kind].index(word) for word in group.words if word in WORDS[kind])
        how = 0 if group.by_name else 1 if group.joints[0].isdecimal() else 2
        return wanted, how, place, -len(group.columns)

    return sorted(
        (group for group in groups if kind_of(group.words) == kind and rank(group)[0] < 2), key=rank
    )


def unit_of(kind: str, group: Group) -> str | None:
    """The unit that the names of a group say, or None."""
    said = canonical(group.unit, kind)
    if said is None and group.unit and kind in ("v", "vdot"):
        said = canonical(f"{group.unit}/s" + ("^2" if kind == "vdot" else ""), kind)
    if said is None and kind == "tau" and CURRENT & set(group.words):
        return None
    return said


def time_of(columns: Sequence[str], units: Mapping_[str, str] | None = None) -> tuple[TimeMap, str]:
    """The column of time by its name, if one is named so, and what is not sure of it."""
    found, units = [], units or {}
    for column in columns:
        name, unit = _split_unit(column, units)
        # a variable inside a struct or a topic: data.time, /joint_states/header/stamp
        words = [word for word in words_of(re.split(r"[./]", name)[-1]) if word not in _UNIT_WORDS]
        if words and all(word in WORDS["time"] for word in words):
            found.append((WORDS["time"].index(words[0]), column, canonical(unit, "time")))
    if not found:
        return TimeMap(), ""
    found.sort(key=lambda entry: entry[0])
    _, column, written = found[0]
    doubt = "" if len(found) == 1 else "also possible: " + ", ".join(entry[1] for entry in found[1:3])
    return TimeMap(column, written), doubt
