"""Scenarios: plants, collection plans and tracking experiments as YAML data, checked at the door.

Files are read with `pydrake.common.yaml` into the plain dataclasses of `scenario_data`, then
validated and turned into the frozen types of the simulation. Whatever is wrong raises `ScenarioError`, one
line that names the file and the field.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np
from pydrake.common.yaml import yaml_load_file, yaml_load_typed

from armloop.arm import Arm, load_arm
from armloop.drake_systems.collection import CollectionPlan, PlantConfig
from armloop.drake_systems.friction import JointFriction
from armloop.drake_systems.pid import PidGains
from armloop.drake_systems.scenario_data import CONTROLLERS, PlanData, PlantData, TrackingData
from armloop.drake_systems.speed_mode import Instruments
from armloop.errors import ArmError, LogError, ScenarioError
from armloop.excitation import (
    MotionRanges,
    Reference,
    fourier_reference,
    paper_reference,
    read_reference,
)
from armloop.resources import scenario_names, scenario_path

T = TypeVar("T")
_PARTS = ("plants", "collection")  # YAML files that scenarios and collections draw on
_LONGEST = 600.0  # s of a tracking run
_FINEST, _COARSEST = 1e-4, 5e-3  # s of a time step


@dataclass(frozen=True, eq=False)
class Plant:
    """A named simulated arm, ready to be built."""

    name: str
    arm: Arm
    config: PlantConfig


@dataclass(frozen=True, eq=False)
class TrackingScenario:
    """A tracking experiment, validated.

    score : (start, end) s, the interval that is scored; controllers : names among `CONTROLLERS`
    """

    name: str
    plant: Plant
    gains: PidGains
    reference: Reference
    score: tuple[float, float]
    controllers: tuple[str, ...] = CONTROLLERS
    seed: int = 0


def plant_names() -> list[str]:
    """Return the names of the plants in plants.yaml."""
    return sorted(_read(scenario_path("plants")))


def load_plant(name: str) -> Plant:
    """Return a plant of plants.yaml; raises `ScenarioError` when there is none of that name."""
    path = scenario_path("plants")
    return _plant(name, _entry(path, name, PlantData), path, name)


def plant_for(spec: str | Path) -> Plant:
    """Return the plant of an arm by its built-in name, or of any URDF by its path.

    A URDF says nothing of dry friction; its joints get f_s 0.65, f_c 0.5, f_v 1 N*m (5, 6.5 N, 20 N*s/m for
    prismatic ones) and the ranges that its limits allow.
    """
    if str(spec) in plant_names():
        return load_plant(str(spec))
    arm = load_arm(spec)
    turning, sliding = JointFriction(0.65, 0.5, 0.1, 1.0), JointFriction(6.5, 5.0, 0.01, 20.0)
    friction = tuple(turning if turns else sliding for turns in arm.revolute)
    return Plant(arm.name, arm, PlantConfig(friction, MotionRanges.of(arm)))


def load_plan(name: str) -> CollectionPlan:
    """Return a plan of collection.yaml; raises `ScenarioError` when there is none of that name."""
    path = scenario_path("collection")
    data = _entry(path, name, PlanData)
    where = f"{path}: {name}"
    for key, least in (
        ("rate", 10.0),
        ("static_hold", 0.02),
        ("velocity_hold", 0.02),
        ("trajectory_duration", 5.0),
    ):
        if not getattr(data, key) >= least:
            raise ScenarioError(f"{where}: {key} is {getattr(data, key)}; it must be at least {least}")
    for key, value in dataclasses.asdict(data).items():
        if value < 0:
            raise ScenarioError(f"{where}: {key} is {value}; it must not be negative")
    if not _FINEST <= data.segment_time_step <= _COARSEST:
        raise ScenarioError(f"{where}: segment_time_step must be {_FINEST:g} to {_COARSEST:g} s")
    for key in ("static_settle", "velocity_settle"):
        if getattr(data, key) <= 10.0 / data.rate:
            raise ScenarioError(f"{where}: {key} must be above 10 sample periods, {10.0 / data.rate} s")
    return CollectionPlan(**dataclasses.asdict(data))


def load_tracking(spec: str | Path) -> TrackingScenario:
    """Return a tracking scenario by its built-in name or the path of its YAML file.

    Raises `ScenarioError`, one line that names the file and the field, or `ArmError` for its URDF.
    """
    path = scenario_path(str(spec)) if str(spec) in scenario_names() else Path(spec)
    raw = _read(path, kind="scenario")
    data = _typed(path, raw, TrackingData, None)
    if bool(data.plant) == (data.own_plant is not None):
        raise ScenarioError(f"{path}: plant: give either the name of a plant in plants.yaml or own_plant")
    if data.own_plant is not None:
        plant = _plant(path.stem, data.own_plant, path, "own_plant")
    elif data.plant not in plant_names():
        raise ScenarioError(
            f"{path}: plant: {data.plant!r} is unknown; there are: {', '.join(plant_names())}"
        )
    else:
        plant = load_plant(data.plant)
    reference = _reference(data, plant, path)
    gains = [_per_joint(getattr(data, key), plant.arm.n, f"{path}: {key}") for key in ("kp", "ki", "kd")]
    if any(np.any(gain < 0) for gain in gains):
        raise ScenarioError(f"{path}: kp, ki and kd must not be negative")
    unknown = [name for name in data.controllers if name not in CONTROLLERS]
    if unknown or not data.controllers:
        given = ", ".join(unknown) or "empty"
        raise ScenarioError(f"{path}: controllers: {given}; there are: {', '.join(CONTROLLERS)}")
    if len(data.score) != 2 or not 0 <= data.score[0] < data.score[1] <= reference.duration + 1e-9:
        raise ScenarioError(
            f"{path}: score is {data.score}; it must be a start and an end in 0 to {reference.duration:g} s"
        )
    return TrackingScenario(
        path.stem,
        plant,
        PidGains(*gains),
        reference,
        (data.score[0], data.score[1]),
        tuple(dict.fromkeys(data.controllers)),
        data.random_seed,
    )


def _reference(data: TrackingData, plant: Plant, path: Path) -> Reference:
    wanted = data.reference
    if wanted.kind == "paper":
        if plant.arm.n != 3:
            raise ScenarioError(
                f"{path}: reference: the paper's is for 3 joints; {plant.arm.name} has {plant.arm.n}"
            )
        if not 1 <= wanted.periods <= _LONGEST / 20:
            raise ScenarioError(
                f"{path}: reference.periods is {wanted.periods}; it must be 1 to {_LONGEST / 20:g}"
            )
        if not 0 < wanted.unit <= 1:
            raise ScenarioError(
                f"{path}: reference.unit is {wanted.unit}; it must be above 0 and at most 1 rad"
            )
        reference: Reference = paper_reference(wanted.unit, wanted.periods)
    elif wanted.kind == "fourier":
        if not 5 <= wanted.duration <= _LONGEST:
            raise ScenarioError(
                f"{path}: reference.duration is {wanted.duration}; it must be 5 to {_LONGEST:g} s"
            )
        reference = fourier_reference(plant.config.ranges, wanted.duration, data.random_seed)
    elif wanted.kind == "csv":
        reference = _table(wanted.file, plant, path)
    else:
        raise ScenarioError(f"{path}: reference.kind is {wanted.kind!r}; it must be paper, fourier or csv")
    q, _, _ = reference.evaluate(np.arange(0.0, reference.duration, 0.01))
    for j, joint in enumerate(plant.arm.joints):
        if q[:, j].min() < joint.lower or q[:, j].max() > joint.upper:
            raise ScenarioError(
                f"{path}: reference: joint {j + 1} would go from {q[:, j].min():.3g} to {q[:, j].max():.3g}; "
                f"its limits are {joint.lower:.3g} to {joint.upper:.3g}"
            )
    return reference


def _table(file: str, plant: Plant, path: Path) -> Reference:
    if not file:
        raise ScenarioError(f"{path}: reference.file is missing; a csv reference needs the path of its file")
    try:
        reference = read_reference(path.parent / file, plant.arm.n)
    except LogError as error:
        raise ScenarioError(f"{path}: reference.file: {error}") from error
    if not reference.duration <= _LONGEST:
        raise ScenarioError(
            f"{path}: reference.file lasts {reference.duration:g} s; it must be at most {_LONGEST:g} s"
        )
    return reference


def _plant(name: str, data: PlantData, path: Path, where: str) -> Plant:
    if not data.arm:
        raise ScenarioError(f"{path}: {where}: arm is missing; give a built-in name or the path of a URDF")
    beside = path.parent / data.arm
    try:
        arm = load_arm(beside if beside.is_file() else data.arm)
    except ArmError as error:
        raise ScenarioError(f"{path}: {where}: arm: {error}") from error
    if len(data.friction) != arm.n:
        raise ScenarioError(
            f"{path}: {where}: friction has {len(data.friction)} joints; {arm.name} has {arm.n}"
        )
    friction = []
    for j, values in enumerate(data.friction):
        try:
            friction.append(JointFriction(**dataclasses.asdict(values)))
        except ValueError as error:
            raise ScenarioError(f"{path}: {where}: friction of joint {j + 1}: {error}") from error
    ranges = MotionRanges.of(arm)
    if data.ranges is not None:
        stated = {
            key: _per_joint(value, arm.n, f"{path}: {where}: ranges.{key}", spread=False)
            for key, value in dataclasses.asdict(data.ranges).items()
        }
        try:
            ranges = MotionRanges(**stated)
        except ValueError as error:
            raise ScenarioError(f"{path}: {where}: ranges: {error}") from error
    if not _FINEST <= data.time_step <= _COARSEST:
        raise ScenarioError(
            f"{path}: {where}: time_step is {data.time_step}; it must be {_FINEST:g} to {_COARSEST:g} s"
        )
    for key in ("encoder_counts", "torque_noise"):
        if not getattr(data, key) >= 0:
            raise ScenarioError(f"{path}: {where}: {key} is {getattr(data, key)}; it must not be negative")
    if not data.prismatic_lead > 0:
        raise ScenarioError(f"{path}: {where}: prismatic_lead is {data.prismatic_lead}; it must be above 0")
    instruments = Instruments(data.encoder_counts, data.prismatic_lead, data.torque_noise)
    return Plant(name, arm, PlantConfig(tuple(friction), ranges, instruments, data.time_step))


def _per_joint(values: list[float], n: int, where: str, *, spread: bool = True) -> Any:
    array = np.array(values, dtype=float)
    if not np.isfinite(array).all():
        raise ScenarioError(f"{where} is {values}; it must hold finite numbers")
    if spread and len(array) == 1:
        return np.full(n, array[0])
    if len(array) != n:
        one = "one number or " if spread else ""
        raise ScenarioError(f"{where} has {len(array)} numbers; it must have {one}one per joint, {n}")
    return array


def _read(path: Path, kind: str = "scenario") -> Mapping[str, Any]:
    """Return the file as a mapping."""
    if not path.is_file():
        known = ", ".join(name for name in scenario_names() if name not in _PARTS)
        raise ScenarioError(f"{path}: no such {kind}; give the path of a YAML file or one of: {known}")
    try:
        raw = yaml_load_file(str(path))
    except Exception as error:  # the reader passes the YAML parser's own errors through
        raise ScenarioError(f"{path}: unreadable YAML: {error}") from error
    if not isinstance(raw, Mapping):
        raise ScenarioError(f"{path}: a {kind} must be a mapping of fields")
    return raw


def _entry(path: Path, name: str, schema: type[T]) -> T:
    raw = _read(path)
    if name not in raw:
        raise ScenarioError(f"{path}: there is no {name!r}; there are: {', '.join(sorted(raw))}")
    return _typed(path, raw[name], schema, name)


def _typed(path: Path, raw: Any, schema: type[T], name: str | None) -> T:
    """Check fields and types, with messages a person understands; then let Drake's reader do its part."""
    _check(raw, schema, f"{path}: {name}" if name else str(path))
    try:
        return yaml_load_typed(schema=schema, filename=str(path), child_name=name, defaults=schema())
    except Exception as error:
        raise ScenarioError(f"{path}: {name or 'scenario'}: {error}") from error


def _check(raw: Any, schema: Any, where: str) -> None:
    """Raise `ScenarioError` unless `raw` has the fields and types of `schema`."""
    if get_origin(schema) is Union:
        if raw is not None:
            _check(raw, get_args(schema)[0], where)
    elif get_origin(schema) is list:
        if not isinstance(raw, list):
            raise ScenarioError(f"{where} is {raw!r}; it must be a list")
        for index, item in enumerate(raw):
            _check(item, get_args(schema)[0], f"{where}[{index + 1}]")
    elif dataclasses.is_dataclass(schema):
        if not isinstance(raw, Mapping):
            raise ScenarioError(f"{where} is {raw!r}; it must be a mapping of fields")
        hints = get_type_hints(schema)
        for key, value in raw.items():
            if key not in hints:
                raise ScenarioError(f"{where}: field {key!r} is unknown; there are: {', '.join(hints)}")
            _check(value, hints[key], f"{where}: {key}")
    elif schema is float:
        if isinstance(raw, bool) or not isinstance(raw, int | float) or not np.isfinite(raw):
            raise ScenarioError(f"{where} is {raw!r}; it must be a finite number")
    elif schema is int:
        if isinstance(raw, bool) or not isinstance(raw, int):
            raise ScenarioError(f"{where} is {raw!r}; it must be a whole number")
    elif not isinstance(raw, schema):
        raise ScenarioError(f"{where} is {raw!r}; it must be a {schema.__name__}")
