"""Column inference from names: which are the time, positions, velocities and torques of which joint.

Nothing here is certain. What comes out is a map to be looked at, with what it is unsure of.
"""

from __future__ import annotations

import re
from collections.abc import Mapping as Mapping_
from collections.abc import Sequence
from dataclasses import dataclass, replace

from armloop.convert.mapping import UNSAID, Mapping, QuantityMap, TimeMap
from armloop.convert.units import FACTORS, canonical, spelt
from armloop.convert.vocabulary import WANTED, WORDS, kind_of, wanted, words_of

_BRACKETS = str.maketrans("（）［］【】", "()[][]")
_UNIT = re.compile(r"[\[(]([^\[\]()]*[^\[\]()\d][^\[\]()]*)[\])]\s*$")
_UNIT_WORDS = {"deg", "degrees", "rad", "mm", "nm", "amp", "ma"}
# Units that end a name, behind the joint's number or before it, and their rates: q1_deg, q_deg_1, v1_deg_s, posDeg.
_ENDS = r"(?:[\W_]+|(?<=\d)|(?<=[a-z])(?=[A-Z]))((?i:{}))([\W_]*(?:per|p)?[\W_]*(?:s|sec))?(?=[\W_\d]*$)"
_WORDED = re.compile(_ENDS.format("|".join(sorted(_UNIT_WORDS, key=len, reverse=True))))
# A letter is one only beside other joints' units: q1_m is what was measured, but in metres beside q2_deg.
_LETTERED = re.compile(_ENDS.format("m|n|a"))

# By joint, the columns that may be its, and the unit of each as it is written.
_Members = dict[str, list[tuple[str, str]]]


@dataclass(frozen=True)
class Group:
    """Columns whose names differ in the joint alone."""

    key: str
    columns: tuple[str, ...]
    joints: tuple[str, ...]
    words: tuple[str, ...]
    units: tuple[str, ...]  # of each column as it is written, empty where it is not
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
        if (doubt := not_measured(group)) is not None:
            if kind in needed:
                return Suggestion(None, {"columns": doubt})
            unsure[kind] = doubt
            continue
        fields[kind] = QuantityMap(list(group.columns), unit_of(kind, group.units))
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
        unsure.setdefault("v", "no velocities were recognised; they will be differenced from q")
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
    at = [group.joints.index(joint) for joint in first.joints]
    columns, units = (tuple(each[k] for k in at) for each in (group.columns, group.units))
    return replace(group, columns=columns, joints=first.joints, units=units)


def groups_of(
    columns: Sequence[str], joints: Sequence[str] = (), units: Mapping_[str, str] | None = None
) -> list[Group]:
    """Columns that differ in the joint, by its number or its name, and those that differ in its unit, too."""
    return _numbered(columns, units or {}) + _named(columns, joints, units or {})


def split_unit(name: str, units: Mapping_[str, str]) -> tuple[str, str]:
    """A name without its unit, and the unit as it is written: in a row of its own, in brackets, or as the last word."""
    if units.get(name):
        return name, units[name]
    found = _UNIT.search(name.translate(_BRACKETS))
    if found:
        return name[: found.start()].strip(), found[1]
    return name, _without_last(name, _WORDED)[1]


def _without_last(name: str, ends: re.Pattern[str]) -> tuple[str, str]:
    """A name without the unit that is its last word, and the unit; nothing where no word of it is left then."""
    found = ends.search(name)
    if found is None or not words_of(name[: found.start()]):
        return name, ""
    return name[: found.start()] + name[found.end() :], spelt(found[1]) + ("/s" if found[2] else "")


def _bare(name: str, unit: str) -> tuple[str, str]:
    """A name without any unit at its end, and the unit: what is left is the same for joints of different units."""
    for ends in (_WORDED, _LETTERED):
        short, last = _without_last(name, ends)
        if last:
            return short, unit or last
    return name, unit


def _differing(members: _Members) -> dict[str, tuple[str, str]]:
    """One column per joint and its unit where the joints' units differ, and may be those of one quantity; else none."""
    each = {joint: columns[0] for joint, columns in members.items() if len(columns) == 1}
    units = {unit for _, unit in each.values()}
    known = [unit for unit in units if any(canonical(unit, kind) for kind in FACTORS)]
    alike = any(all(canonical(unit, kind) for unit in known) for kind in FACTORS)
    return each if len(units) > 1 and len(each) == len(members) and alike else {}


def _numbered(columns: Sequence[str], units: Mapping_[str, str]) -> list[Group]:
    """Groups like ``q1, q2, …`` or ``state.q[0], state.q[1], …`` with consecutive numbers from 0 or 1."""
    found: dict[tuple[str, str, str], dict[str, tuple[str, str]]] = {}
    stems: dict[tuple[int, str], _Members] = {}
    for column in columns:
        name, unit = split_unit(column, units)
        for k, place in enumerate(re.finditer(r"\d+", name)):
            before, after, joint = name[: place.start()], name[place.end() :], str(int(place[0]))
            found.setdefault((before, after, unit), {}).setdefault(joint, (column, unit))
            stem, last = _bare(f"{before}0{after}", unit)
            stems.setdefault((k, stem), {}).setdefault(joint, []).append((column, last))
    fragments = [(before, after, members) for (before, after, _), members in found.items()]
    for (k, stem), each in stems.items():
        place = [*re.finditer(r"\d+", stem)][k]
        fragments.append((stem[: place.start()], stem[place.end() :], _differing(each)))
    groups = []
    for before, after, members in fragments:
        numbers = sorted(map(int, members))
        if not numbers or numbers[0] > 1 or numbers != list(range(numbers[0], numbers[0] + len(numbers))):
            continue
        words = [word for word in words_of(f"{before} {after}") if not word.isdecimal()]
        label = f"{before}{{{numbers[0]}..{numbers[-1]}}}{after}"
        names = tuple(map(str, numbers))
        groups.append(_group(label, names, members, tuple(words)))
    most = max((len(group.columns) for group in groups), default=0)
    # A lone column with a 1 in its name is a group only where the arm may have one joint.
    return [group for group in groups if len(group.columns) > 1 or most == 1]


def _named(columns: Sequence[str], joints: Sequence[str], units: Mapping_[str, str]) -> list[Group]:
    """Groups like ``elbow.pos, wrist.pos`` that share a beginning or an end, or hold the names of the arm's joints."""
    found: dict[tuple[str, str], dict[str, tuple[str, str]]] = {}
    stems: dict[str, _Members] = {}
    for column in columns:
        name, unit = split_unit(column, units)
        if (placed := _by_name(_without_last(name, _WORDED)[0], joints)) is not None:
            found.setdefault((placed[0], unit), {})[placed[1]] = (column, unit)
        bare, last = _bare(name, unit)
        if (placed := _by_name(bare, joints)) is not None:
            stems.setdefault(placed[0], {}).setdefault(placed[1], []).append((column, last))
    fragments = [(key, members) for (key, _), members in found.items()]
    groups = []
    for key, members in fragments + [(key, _differing(each)) for key, each in stems.items()]:
        if len(members) > 1 or (len(joints) == 1 and members):
            ordered = (
                sorted(members, key=list(joints).index) if set(members) <= set(joints) else list(members)
            )
            words = tuple(word for word in words_of(key) if not word.isdecimal())
            by_name = set(members) == set(joints)
            groups.append(_group(f"*{key.strip()}", tuple(ordered), members, words, by_name))
    return groups


def _by_name(name: str, joints: Sequence[str]) -> tuple[str, str] | None:
    """What a column holds and the joint, by the names of the arm's joints or by what stands apart in its own."""
    hits = [joint for joint in joints if joint in name]
    if hits:
        joint = max(hits, key=len)
        return name.replace(joint, " "), joint
    for separator in ("/", ".", "__", " ", "_"):
        first, _, last = name.rpartition(separator)
        if first and last and not last.isdecimal() and not wanted(first):
            return separator + last, first
    return None


def _group(
    key: str,
    joints: tuple[str, ...],
    members: Mapping_[str, tuple[str, str]],
    words: tuple[str, ...],
    by_name: bool = False,
) -> Group:
    columns, units = zip(*(members[joint] for joint in joints), strict=True)
    return Group(key, columns, joints, words, units, by_name)


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


def not_measured(group: Group) -> str | None:
    """What to say of columns that by their names are what was asked for, or a bound; a motor's are measured."""
    # a letter is one only at the end: q_d, not drive d
    said = [
        word for word in group.words if word in WANTED - {"motor"} and (len(word) > 1 or not word.isascii())
    ]
    said = said or [word for word in group.words[-1:] if word in WANTED - {"motor"}]
    return f"{group.key} is not what was measured by its name ({said[0]})" if said else None


def unit_of(kind: str, said: Sequence[str]) -> str | list[str] | None:
    """The unit of a quantity's columns by what is written of each, one per column where they differ, or None."""
    rate = {"v": "/s", "vdot": "/s^2"}.get(kind)
    each = [
        canonical(unit, kind) or (canonical(unit + rate, kind) if unit and rate else None) for unit in said
    ]
    return each[0] if len(set(each)) == 1 else [unit or UNSAID for unit in each]


def time_of(columns: Sequence[str], units: Mapping_[str, str] | None = None) -> tuple[TimeMap, str]:
    """The column of time by its name, if one is named so, and what is not sure of it."""
    found, units = [], units or {}
    for column in columns:
        name, unit = split_unit(column, units)
        # a variable inside a struct or a topic: data.time, /joint_states/header/stamp
        words = words_of(re.split(r"[./]", name)[-1])
        if len(words) > 1 and canonical(words[-1], "time") is not None:
            *words, last = words
            unit = unit or last
        if words and all(word in WORDS["time"] for word in words):
            found.append((WORDS["time"].index(words[0]), column, canonical(unit, "time")))
    if not found:
        return TimeMap(), ""
    found.sort(key=lambda entry: entry[0])
    _, column, written = found[0]
    doubt = "" if len(found) == 1 else "also possible: " + ", ".join(entry[1] for entry in found[1:3])
    return TimeMap(column, written), doubt
