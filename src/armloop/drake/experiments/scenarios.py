"""Scenarios: plants, collection plans and tracking experiments as YAML data, checked at the door.

Files are read into the descriptions of `armloop.schemas.scenarios`, checked against each other and the arm, and turned
into the frozen types of the simulation. What is wrong raises `ScenarioError`, one line that names the file and the field.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
from msgspec.structs import asdict, replace

from armloop.drake.control.controllers import LISTED, REGISTRY
from armloop.drake.control.pid import PidGains
from armloop.drake.control.reference import ReferenceLike
from armloop.drake.control.scenario_types import Pickup, Plant, TrackingScenario, Wear
from armloop.drake.experiments.collection import CollectionPlan
from armloop.drake.experiments.scenario_files import beside, entry, per_joint, read, scenario_entry
from armloop.drake.experiments.scenario_references import (
    reference_from,
    reference_of,
    require_own_fields,
)
from armloop.drake.plant.config import Instruments, PlantConfig
from armloop.drake.plant.fault_injection import UndeclaredEffect, realise
from armloop.drake.plant.friction import JointFriction
from armloop.drake.plant.usual_friction import usual_friction
from armloop.experiment.excitation import MotionRanges, Reference
from armloop.robot.arm import Arm, load_arm
from armloop.robot.urdf import urdf_tree
from armloop.schemas.scenarios import (
    LimitsData,
    PickupData,
    PlantData,
    PlantEffectData,
    TrackingData,
)
from armloop.util.doubts import warn
from armloop.util.errors import ArmError, ModelError, ScenarioError
from armloop.util.given import path_of
from armloop.util.resources import scenario_path, urdf_names, urdf_path

__all__ = [
    "Pickup",
    "Plant",
    "TrackingScenario",
    "Wear",
    "load_plan",
    "load_plant",
    "load_tracking",
    "plan_names",
    "plant_for",
    "plant_names",
]

_LEAST_LOG = 14.0  # s, what a diagnosis needs and a little more
_FEWEST_STEPS = 10  # of the plant, that are scored


def plant_names() -> list[str]:
    """Return the names of the plants in plants.yaml."""
    return sorted(read(scenario_path("plants")))


def load_plant(name: str) -> Plant:
    """Return a plant of plants.yaml; raises `ScenarioError` when there is none of that name."""
    path = scenario_path("plants")
    return _plant(name, entry(path, name, PlantData), f"{path}: {name}")


def built_in(spec: str | Path | Arm) -> bool:
    """Tell whether an arm is one of those in plants.yaml: by its name, or loaded by it and left as it was."""
    if not isinstance(spec, Arm):
        return str(spec) in plant_names()
    return spec.name in {*plant_names()} & {*urdf_names()} and spec.urdf == urdf_path(spec.name).read_text(
        encoding="utf-8"
    )


def plant_for(spec: str | Path | Arm, friction: tuple[JointFriction, ...] | None = None) -> Plant:
    """Return the plant of an arm by its built-in name, of any URDF by its path, or of an arm that is loaded.

    The joints of a URDF get the friction given, else that of `usual_friction`, which is said, and the ranges that its
    limits allow. Damping and friction of its `<dynamics>` are not used, which is said where they are above zero: most
    URDFs have dummies there, and none has what sticks.
    """
    if built_in(spec):
        return load_plant(spec.name if isinstance(spec, Arm) else str(spec))
    arm = spec if isinstance(spec, Arm) else load_arm(spec)
    return Plant(
        arm.name,
        arm,
        PlantConfig(_unstated_friction(arm) if friction is None else friction, MotionRanges.of(arm)),
    )


def _unstated_friction(arm: Arm) -> tuple[JointFriction, ...]:
    """Friction of a usual size for joints of which none is stated; says so, and where a URDF's is not used."""
    joints = urdf_tree(arm.urdf).iter("joint") if arm.urdf else ()
    stated = {
        joint.get("name")
        for joint in joints
        for dynamics in joint.findall("dynamics")
        if any(float(dynamics.get(key) or 0.0) > 0 for key in ("damping", "friction"))
    }
    unused = [name for name in arm.joint_names if name in stated]
    instead = (
        f", for damping and friction in the URDF's <dynamics> of {', '.join(unused)} are not used"
        if unused
        else ""
    )
    friction = usual_friction(arm)
    levels = ", ".join(f"{f.coulomb:.3g}" for f in friction)
    warn(
        f"{arm.name}: the simulated joints have friction of a usual size, Coulomb {levels} "
        f"{' / '.join(dict.fromkeys(arm.torque_units)).replace('*', '·')}{instead}; state theirs as `friction` of a "
        "scenario's own_plant"
    )
    return friction


def plan_names() -> list[str]:
    """Return the names of the plans in collection.yaml."""
    return sorted(read(scenario_path("collection")))


def load_plan(name: str) -> CollectionPlan:
    """Return a plan of collection.yaml; raises `ScenarioError` when there is none of that name."""
    path = scenario_path("collection")
    plan = entry(path, name, CollectionPlan)
    where = f"{path}: {name}"
    for key in ("static_settle", "velocity_settle"):
        if getattr(plan, key) <= 10.0 / plan.rate:
            raise ScenarioError(f"{where}: {key} must be above 10 sample periods, {10.0 / plan.rate} s")
    return plan


def load_tracking(
    spec: str | Path,
    arm: str | Path | Arm | None = None,
    motion: str | Path | ReferenceLike | None = None,
) -> TrackingScenario:
    """Return a tracking scenario by its built-in name or the path of its YAML file.

    spec : of a file with several scenarios, FILE:NAME, or FILE for the first or the one named as the file
    arm : in place of the arm of the scenario's own plant: a built-in name or the path of a URDF, with the scenario's
        `lock` and `tip`; or an arm that is loaded, as it is
    motion : in place of the scenario's reference, all of it is scored: one, the path of one that `write_reference` wrote,
        or a Drake trajectory

    Raises `ScenarioError`, one line that names the file and the field, or `ArmError` for its URDF.
    """
    path, name, where, data = scenario_entry(spec, TrackingData)
    plant, rate, used = _limited(data.limits, _plant_of(data, name, path, where, arm), where)
    n, period = plant.arm.n, plant.config.time_step
    if motion is None:
        require_own_fields(data.reference, where)
        reference = reference_of(
            data.reference, plant.arm, plant.config.ranges, data.random_seed, path, where
        )
    else:
        reference, data = reference_from(motion, plant.arm), replace(data, score=[])
    gains = [per_joint(getattr(data, key), n, f"{where}: {key}") for key in ("kp", "ki", "kd")]
    if any(np.any(gain < 0) for gain in gains):
        raise ScenarioError(f"{where}: kp, ki and kd must not be negative")
    unknown = [name for name in data.controllers if REGISTRY.find(name) is None]
    if unknown or not data.controllers:
        given = ", ".join(unknown) or "empty"
        raise ScenarioError(
            f"{where}: controllers: {given}; there are: {', '.join([*LISTED, *REGISTRY.own_names()])}; "
            "one of your own is known once its package is installed (entry points armloop.controllers)"
        )
    twice = {name for name in data.controllers if data.controllers.count(name) > 1}
    if twice:
        raise ScenarioError(
            f"{where}: controllers: {', '.join(sorted(twice))} stands there twice; name each once"
        )
    if data.pickup and data.wear:
        raise ScenarioError(f"{where}: pickup and wear are two kinds of run; give one of them")
    if data.pickup and data.controllers not in (["pid_step3"], TrackingData().controllers):
        raise ScenarioError(f"{where}: controllers: a pickup is run by pid_step3 alone; leave them out")
    default = [reference.duration / 2, reference.duration]
    score = default if data.score is None else data.score or [0.0, reference.duration]
    least = _FEWEST_STEPS * period
    if len(score) != 2 or not 0 <= score[0] <= score[1] - least < score[1] <= reference.duration + 1e-9:
        raise ScenarioError(
            f"{where}: score is {score}; it must be a start and an end in 0 to {reference.duration:g} s, "
            f"{least:g} s or more apart"
        )
    if data.bandwidth is not None and not 0 < data.bandwidth <= 1 / period:
        raise ScenarioError(
            f"{where}: bandwidth is {data.bandwidth}; it must be above 0 and at most {1 / period:g} rad/s"
        )
    return TrackingScenario(
        name,
        plant,
        PidGains(*gains),
        reference,
        (score[0], score[1]),
        tuple(data.controllers),
        data.random_seed,
        data.bandwidth,
        _pickup(data.pickup, reference, where),
        data.wear,
        rate,
        used,
        _effects(data.effects, plant.arm, where),
    )


def _limited(data: LimitsData | None, plant: Plant, where: str) -> tuple[Plant, np.ndarray | None, float]:
    """Return the plant with the drives' limits of torque, those of its rate, and what of both may be planned with."""
    arm = plant.arm
    if data is None:
        return plant, None, LimitsData().used
    if not data.effort and not data.rate:
        raise ScenarioError(f"{where}: limits needs an effort or a rate")
    if data.effort:
        effort = per_joint(data.effort, arm.n, f"{where}: limits.effort")
        joints = tuple(
            dataclasses.replace(joint, effort=float(e)) for joint, e in zip(arm.joints, effort, strict=True)
        )
        plant = dataclasses.replace(plant, arm=dataclasses.replace(arm, joints=joints))
    rate = per_joint(data.rate, arm.n, f"{where}: limits.rate") if data.rate else None
    return plant, rate, data.used


def _effects(data: list[PlantEffectData], arm: Arm, where: str) -> tuple[UndeclaredEffect, ...]:
    try:
        effects = tuple(UndeclaredEffect(e.effect, e.joint, e.parameters, e.other_joint) for e in data)
        realise(arm, effects)
    except (ModelError, ScenarioError) as error:
        raise ScenarioError(f"{where}: effects: {error}") from error
    return effects


def _pickup(data: PickupData | None, reference: Reference, where: str) -> Pickup | None:
    if data is None:
        return None
    if not 0 < data.at <= data.diagnose_at - _LEAST_LOG or not data.diagnose_at < reference.duration:
        raise ScenarioError(
            f"{where}: pickup: at {data.at} and diagnose_at {data.diagnose_at} must lie within 0 and "
            f"{reference.duration:g} s, {_LEAST_LOG:g} s or more between them"
        )
    payload = UndeclaredEffect("payload", None, {"mass": data.mass, "com": list(data.com)})
    return Pickup(data.at, data.diagnose_at, payload)


def _plant_of(data: TrackingData, name: str, path: Path, where: str, arm: str | Path | Arm | None) -> Plant:
    if bool(data.plant) == (data.own_plant is not None):
        raise ScenarioError(f"{where}: plant: give either the name of a plant in plants.yaml or own_plant")
    if data.own_plant is None:
        if arm is not None:
            raise ScenarioError(f"{where}: plant: it is {data.plant}; --arm is for scenarios with own_plant")
        if data.plant not in plant_names():
            raise ScenarioError(
                f"{where}: plant: {data.plant!r} is unknown; there are: {', '.join(plant_names())}"
            )
        return load_plant(data.plant)
    own = data.own_plant
    if arm is None and own.arm and own.arm not in urdf_names():
        own = replace(own, arm=str(beside(path, own.arm, f"{where}: own_plant: arm")))
    if arm is not None and not isinstance(arm, Arm):
        # a path from where the user stands, not from the scenario's folder
        given = path_of(arm, "the arm", ArmError)
        own = replace(own, arm=str(given.resolve() if given.exists() else arm))
    return _plant(name, own, f"{where}: own_plant", arm if isinstance(arm, Arm) else None)


def _plant(name: str, data: PlantData, where: str, loaded: Arm | None = None) -> Plant:
    if loaded is None and not data.arm:
        raise ScenarioError(
            f"{where}: arm is missing; give a built-in name or the path of a URDF here, or by --arm"
        )
    try:
        arm = loaded or load_arm(data.arm, data.lock, data.tip or None)
    except ArmError as error:
        raise ScenarioError(f"{where}: arm: {error}") from error
    if len(data.friction) not in (0, arm.n):
        raise ScenarioError(f"{where}: friction has {len(data.friction)} joints; {arm.name} has {arm.n}")
    friction = [] if data.friction else list(_unstated_friction(arm))
    for j, values in enumerate(data.friction):
        try:
            friction.append(JointFriction(**asdict(values)))
        except ValueError as error:
            raise ScenarioError(f"{where}: friction of joint {j + 1}: {error}") from error
    ranges = MotionRanges.of(arm)
    if data.ranges is not None:
        stated = {
            key: per_joint(value, arm.n, f"{where}: ranges.{key}", spread=False)
            for key, value in asdict(data.ranges).items()
        }
        try:
            ranges = MotionRanges(**stated)
        except ValueError as error:
            raise ScenarioError(f"{where}: ranges: {error}") from error
    instruments = Instruments(data.encoder_counts, data.prismatic_lead, data.torque_noise)
    rotors = data.rotor_inertia and per_joint(
        data.rotor_inertia, arm.n, f"{where}: rotor_inertia", spread=False
    )
    return Plant(
        name,
        arm,
        PlantConfig(tuple(friction), ranges, instruments, data.time_step, tuple(map(float, rotors))),
    )
