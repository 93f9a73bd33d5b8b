"""ROS bags (ROS 2 db3 and MCAP, with or without their folder; ROS 1 .bag), read without ROS.

A ``sensor_msgs/JointState`` names its joints in every message; positions are in rad (m) and velocities in rad/s
(m/s) by its definition. What ``effort`` holds it does not say: many drivers publish motor current in A.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

import numpy as np

from armloop.convert.joints import match
from armloop.convert.mapping import Mapping, QuantityMap, TimeMap
from armloop.convert.recording import Recording
from armloop.util.arrays import Array, Index
from armloop.util.errors import LogError

JOINT_STATE = "JointState"
# Messages of a topic that are looked at: for the arm's joints, as a gripper's driver may share it, and beside a jump.
_FIRST = 100


def read_rosbag(path: Path, topic: str | None, wanted: Sequence[str] | None) -> Recording:
    """Read the joint states of one bag, of ``topic`` where it has several; raises ``LogError`` where there are none.

    Messages without the joints ``wanted`` (of a gripper's driver) are left out; None takes all, which name the same joints.
    """
    import msgspec
    from rosbags.highlevel import AnyReader, AnyReaderError
    from rosbags.typesys import Stores, get_typestore

    stamps: list[int] = []
    received: list[int] = []
    rows: list[tuple[Array, Array, Array]] = []
    names: tuple[str, ...] = ()
    others: dict[str, None] = {}
    without = 0
    fault: LogError | None = None
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as reader:
            connections = [c for c in reader.connections if c.msgtype.rpartition("/")[2] == JOINT_STATE]
            chosen = _topic(path, {c.topic for c in connections}, topic, reader, wanted)
            left = sorted({c.topic for c in reader.connections} - {chosen})
            order: dict[tuple[str, ...], list[int] | None] = {}
            for connection, at, raw in reader.messages([c for c in connections if c.topic == chosen]):
                message: Any = reader.deserialize(raw, connection.msgtype)
                found = tuple(message.name)
                if found not in order:
                    try:
                        order[found] = match(found, wanted or names or found, f"{path}: {chosen}")
                    except LogError as error:
                        order[found], fault = None, error
                    if wanted is None and names and {*found} != {*names}:
                        raise LogError(
                            f"{path}: {chosen}: some messages name the joints {', '.join(names)}, others "
                            f"{', '.join(found) or 'none'}; give --arm with its URDF, which says whose are the arm's"
                        )
                index = order[found]
                if index is None:
                    without += 1
                    others |= dict.fromkeys(found)
                    continue
                names = names or tuple(found[k] for k in index)
                others |= dict.fromkeys(name for k, name in enumerate(found) if k not in index)
                # Velocities may be missing, from the first message on: they are then the rates of the positions.
                has_velocities = len(message.velocity) > 0 if not rows else len(rows[0][1]) > 0
                sizes = len(message.position), len(message.velocity), len(message.effort)
                if sizes != (len(found), len(found) * has_velocities, len(found)):
                    raise LogError(
                        f"{path}: {chosen}, message {len(rows) + 1}: {sizes[0]} positions, {sizes[1]} velocities, "
                        f"{sizes[2]} efforts for {len(found)} joints; a log needs every joint's position and effort in each "
                        "message, and its velocity in each or in none, so record a driver that publishes them"
                    )
                stamp = message.header.stamp
                stamps.append(int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec))
                received.append(at)
                velocity = message.velocity[index] if has_velocities else message.velocity
                rows.append((message.position[index], velocity, message.effort[index]))
    except (
        AnyReaderError,
        msgspec.DecodeError,
        KeyError,
        EOFError,
        AssertionError,
        UnicodeDecodeError,
    ) as error:
        remedy = "give the bag's folder, a .db3, .mcap or .bag"
        if "end magic" in str(error):  # what a recorder that was killed leaves
            remedy = (
                "its end is missing, as where a recorder was killed: `mcap recover` writes what there is anew"
            )
        raise LogError(f"{path}: no readable bag ({error}); {remedy}") from error
    if not rows:
        raise fault or LogError(f"{path}: {chosen} has no messages; record the joint states of a moving arm")
    notes = [f"{len(rows)} messages of {chosen}"]
    if left:
        notes.append(f"topics not read: {', '.join(left)}")
    if without:
        notes.append(f"messages without all joints of the arm, left out: {without}")
    if strange := sorted(others.keys() - {*names}):
        notes.append(f"joints that are not the arm's, left out: {', '.join(strange)}")
    clock, recorded = np.array(stamps, dtype=np.int64), np.array(received, dtype=np.int64)
    if not (clock > 0).any() or (np.diff(clock) == 0).all():
        clock = recorded
        notes.append("time is when a message was recorded: the headers hold no stamps")
    stamped = np.flatnonzero(clock > 0)
    if len(stamped) < len(clock):
        notes.append(f"messages without a stamp, left out: {len(clock) - len(stamped)}")
    turn, starts = _in_turn(clock[stamped], recorded[stamped], notes)
    kept = stamped[turn]
    return _recording(path, clock[kept], [rows[int(k)] for k in kept], names, starts, notes)


def _in_turn(clock: Any, received: Any, notes: list[str]) -> tuple[Index, list[int]]:
    """Messages in the order of their stamps, and where a clock that was set back begins anew among them.

    One that is late comes later than its stamp says; behind a clock that was set back all do.
    """
    delay = received - clock
    late = np.flatnonzero(np.diff(clock) < 0) + 1
    back = [
        int(k)
        for k in late
        if np.median(delay[k : k + _FIRST]) - np.median(delay[max(0, k - _FIRST) : k])
        > (clock[k - 1] - clock[k]) / 2
    ]
    starts = [0, *back]
    for k in back:
        notes.append(
            f"message {k + 1}: the clock of the stamps was set back by {(clock[k - 1] - clock[k]) * 1e-9:.3g} s; "
            "a run begins there"
        )
    if len(late) > len(back):
        notes.append(
            f"{len(late) - len(back)} messages were recorded out of turn; they are sorted by their stamps"
        )
    parts = pairwise([*starts, len(clock)])
    return np.concatenate(
        [first + np.argsort(clock[first:last], kind="stable") for first, last in parts]
    ), starts


def _recording(
    path: Path,
    clock: Any,
    rows: list[tuple[Array, Array, Array]],
    names: tuple[str, ...],
    starts: list[int],
    notes: list[str],
) -> Recording:
    columns = {"stamp": (clock - clock[0]) * 1e-9}
    fields = {}
    for k, (field, kind) in enumerate((("position", "q"), ("velocity", "v"), ("effort", "tau"))):
        values = np.array([row[k] for row in rows], dtype=np.float64)
        if not values.size:
            continue
        fields[kind] = [f"{name}/{field}" for name in names]
        columns |= {column: values[:, j] for j, column in enumerate(fields[kind])}
    mapping = Mapping(
        TimeMap("stamp", "s"),
        # rad or m, rad/s or m/s: the joint's kind says which, and both are SI
        QuantityMap(fields["q"], "rad"),
        QuantityMap(fields["tau"], None),
        QuantityMap(fields["v"], "rad/s") if "v" in fields else None,
        joints=list(names),
    )
    return Recording(
        path,
        "ROS bag",
        columns,
        mapping,
        named=True,
        starts=starts,
        epoch=float(clock[0]) * 1e-9,
        rows="message",
        notes=notes,
    )


def _topic(path: Path, found: set[str], topic: str | None, reader: Any, wanted: Sequence[str] | None) -> str:
    if topic is not None and topic not in found:
        listed = ", ".join(sorted(found)) or "none"
        raise LogError(f"{path}: no joint states under the topic {topic}; there are: {listed}")
    if topic is not None:
        return topic
    if not found:
        kinds = ", ".join(sorted({f"{c.topic} ({c.msgtype})" for c in reader.connections})) or "no topics"
        raise LogError(f"{path}: holds no sensor_msgs/JointState, but {kinds}; record the joint states")
    if len(found) > 1 and wanted is not None:
        found = {name for name in found if _has_joints(reader, name, wanted)} or found
    if len(found) > 1:
        raise LogError(
            f"{path}: joint states under several topics; say --topic with one of: {', '.join(sorted(found))}"
        )
    return next(iter(found))


def _has_joints(reader: Any, topic: str, wanted: Sequence[str]) -> bool:
    """Whether one of the first messages of a topic holds the joints."""
    messages = reader.messages([c for c in reader.connections if c.topic == topic])
    for connection, _, raw in islice(messages, _FIRST):
        with suppress(LogError):
            match(reader.deserialize(raw, connection.msgtype).name, wanted, topic)
            return True
    return False
