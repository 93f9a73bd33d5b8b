"""References of scenario files: the paper's, Fourier series, places with rests between them, tables."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from armloop.drake.control.reference import ReferenceLike, as_reference
from armloop.drake.experiments.scenario_files import beside
from armloop.experiment.excitation import (
    MotionRanges,
    Reference,
    fourier_reference,
    paper_reference,
    places_reference,
    read_reference,
)
from armloop.robot.arm import Arm
from armloop.schemas.scenarios import ReferenceData
from armloop.util.errors import LogError, ScenarioError

LONGEST = 600.0  # s of a tracking run

#: What a reference of each kind looks at.
_FIELDS = {
    "paper": ("unit", "periods"),
    "fourier": ("duration",),
    "csv": ("file",),
    "places": ("places", "dwell", "pace"),
}


def reference_of(
    data: ReferenceData, arm: Arm, ranges: MotionRanges, seed: int, path: Path, where: str
) -> Reference:
    """Return the reference that a scenario asks for, checked against the arm's limits.

    path : of the file, from whose folder a table is looked up; where : placed before what is said of a fault
    """
    if data.kind == "paper":
        if arm.n != 3:
            raise ScenarioError(
                f"{where}: reference: the paper's is for 3 joints; {arm.name} has {arm.n}: give kind: fourier, places or csv"
            )
        reference: Reference = paper_reference(data.unit, data.periods)
    elif data.kind == "fourier":
        reference = fourier_reference(ranges, data.duration, seed)
    elif data.kind == "csv":
        reference = _table(data.file, arm, path, where)
    elif data.kind == "places":
        reference = _places(data, arm.n, ranges, where)
    else:
        raise ScenarioError(
            f"{where}: reference.kind is {data.kind!r}; it must be paper, fourier, places or csv"
        )
    given = {"csv": ".file", "places": ".places"}.get(data.kind, "")
    return _possible(reference, arm, f"{where}: reference{given}")


def require_own_fields(data: ReferenceData, where: str) -> None:
    """Raise `ScenarioError` for a field that no reference of this kind looks at."""
    plain, own = ReferenceData(), _FIELDS.get(data.kind)
    for kind, fields in _FIELDS.items():
        for field in fields:
            if own is not None and field not in own and getattr(data, field) != getattr(plain, field):
                raise ScenarioError(
                    f"{where}: reference.{field} belongs to kind: {kind}; this reference is of kind {data.kind}"
                )


def reference_from(given: str | Path | ReferenceLike, arm: Arm) -> Reference:
    """Return the reference of a table, or one that is given as it is, checked against the arm and its limits."""
    if isinstance(given, str | Path):
        return _possible(read_reference(given, arm.n), arm, f"{given}: the reference")
    reference = as_reference(given)
    joints = reference.evaluate([0.0])[0].shape[1]
    if joints != arm.n:
        raise ScenarioError(f"the reference has {joints} joints; {arm.name} has {arm.n}")
    return _possible(reference, arm, "the reference")


def _possible(reference: Reference, arm: Arm, what: str) -> Reference:
    if not reference.duration <= LONGEST:
        raise ScenarioError(f"{what} lasts {reference.duration:g} s; it must be at most {LONGEST:g} s")
    q, _, _ = reference.evaluate(np.arange(0.0, reference.duration, 0.01))
    for j, joint in enumerate(arm.joints):
        if q[:, j].min() < joint.lower or q[:, j].max() > joint.upper:
            raise ScenarioError(
                f"{what}: joint {j + 1} would go from {q[:, j].min():.3g} to {q[:, j].max():.3g}; its limits are "
                f"{joint.lower:.3g} to {joint.upper:.3g}"
            )
    return reference


def _table(file: str, arm: Arm, path: Path, where: str) -> Reference:
    if not file:
        raise ScenarioError(f"{where}: reference.file is missing; a csv reference needs the path of its file")
    try:
        return read_reference(beside(path, file, f"{where}: reference.file"), arm.n)
    except LogError as error:
        raise ScenarioError(f"{where}: reference.file: {error}") from error


def _places(data: ReferenceData, n: int, ranges: MotionRanges, where: str) -> Reference:
    if len(data.places) < 2 or any(len(place) != n for place in data.places):
        raise ScenarioError(f"{where}: reference.places must be two or more places of {n} numbers each")
    try:
        return places_reference(data.places, ranges, dwell=data.dwell, pace=data.pace)
    except ValueError as error:
        raise ScenarioError(f"{where}: reference.places: {error}") from error
