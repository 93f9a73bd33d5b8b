"""Conversion of sources in other people's formats to one motion log."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from armloop.convert.assemble import Answers, Part, joined, part
from armloop.convert.detect import read_source
from armloop.convert.mapping import Mapping
from armloop.convert.recording import Array, Recording
from armloop.data.log import MotionLog, check_log
from armloop.data.repeats import same_measurement
from armloop.robot.arm import Arm
from armloop.robot.plausibility import beyond_limits
from armloop.util.doubts import warn
from armloop.util.errors import LogError


@dataclass(eq=False)
class Converted:
    """What a conversion gave."""

    log: MotionLog  # in SI units, base to tip; tau_unit says whether tau is a torque or a current
    extra: dict[str, Array]  # further columns that are kept, by name, each (N,)
    joints: list[str]  # the name that the source gives each joint, base to tip
    kinds: list[str]  # what each source is
    notes: list[str]  # what was read, left and decided, one line each

    def columns(self) -> dict[str, Array]:
        """The columns of the log's file, in its order."""
        return self.log.columns() | self.extra


def read_sources(paths: Sequence[str | Path], arm: Arm | None, topic: str | None = None) -> list[Recording]:
    """Read each source by its format; raises ``LogError``."""
    wanted = None if arm is None else arm.joint_names
    return [read_source(Path(path), topic, wanted) for path in paths]


def convert(
    paths: Sequence[str | Path],
    *,
    arm: Arm | None = None,
    mapping: Mapping | None = None,
    answers: Answers | None = None,
    topic: str | None = None,
) -> Converted:
    """Read sources of one arm into one log; each source and each part of one becomes a run of its own.

    Args:
        paths: files or folders, in the order in which they are to stand in the log.
        arm: its joints are found by name where the source names them.
        mapping: what the columns are; what the format itself says otherwise.
        answers: what the source does not say.
        topic: of a bag that has several joint states.

    Raises:
        LogError: one line that names the source, what is wrong or not said, and what would be right.
    """
    parts: list[Part] = []
    recordings = read_sources(paths, arm, topic)
    for recording in recordings:
        chosen = mapping or recording.mapping
        if chosen is None:
            why = recording.unsure.get("columns", "the columns are not recognised")
            raise LogError(
                f"{recording.path}: {why}{recording.left_out()}; write a map (--suggest starts one) and give it with --map"
            )
        if mapping is None and recording.kind == "table" and recording.unsure:
            first = next(iter(f"{field}: {text}" for field, text in recording.unsure.items()))
            recording.notes.append(f"columns recognised by their names ({first})")
        parts.append(part(recording, chosen, arm, answers or Answers()))
    for path, one in zip(paths[1:], parts[1:], strict=True):
        _require_like(path, one, paths[0], parts[0], arm)
    for k, one in enumerate(parts):
        for j, other in enumerate(parts[:k]):
            if same_measurement(one.log, other.log):
                warn(f"{paths[k]}: holds the measurement of {paths[j]} once more; give each measurement once")
    log, extra = joined(parts)
    check_log(Path(paths[0]), log)
    for sentence in [] if arm is None else beyond_limits(arm, log):
        warn(f"{paths[0]}: {sentence}")
    notes = []
    for path, one in zip(paths, parts, strict=True):
        head = f"{Path(path).name}: " if len(parts) > 1 else ""
        notes += [head + note for note in one.notes]
    extra = {name: cells for name, cells in extra.items() if not np.isnan(cells).all()}
    return Converted(log, extra, parts[0].joints, [r.kind for r in recordings], notes)


def _require_like(path: str | Path, one: Part, first_path: str | Path, first: Part, arm: Arm | None) -> None:
    """Raise ``LogError`` unless a source goes below the first: the same joints in the same order, tau in one unit."""
    if one.log.joints != first.log.joints:
        raise LogError(
            f"{path}: has {one.log.joints} joints, {first_path} {first.log.joints}; give logs of one arm"
        )
    if arm is None and one.joints != first.joints:
        raise LogError(
            f"{path}: its joints are {', '.join(one.joints)}, those of {first_path} {', '.join(first.joints)}; give --arm, "
            "with whose joints both are matched"
        )
    if one.log.tau_unit != first.log.tau_unit:
        raise LogError(
            f"{path}: tau is in {one.log.tau_unit}, that of {first_path} in {first.log.tau_unit}; say --drive-gains, or "
            "convert them one by one"
        )
