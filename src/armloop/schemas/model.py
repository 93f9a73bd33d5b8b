"""The description of a model file, ``armloop/model/2``, and what ``armloop/model/1`` lacks of it."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from msgspec import UNSET, Meta, Struct, UnsetType

from armloop.schemas.baseline import BaselineData
from armloop.schemas.checking import Misfit, checked
from armloop.schemas.types import (
    FARTHEST,
    HEAVIEST,
    MOST_JOINTS,
    MOST_TERMS,
    Finite,
    Instant,
    JointNumber,
    Matrix3,
    Name,
    NotNegative,
    PerJoint,
    Pose,
    Positive,
    Seconds,
    Step,
    Text,
    Vector3,
)
from armloop.util.errors import ModelError

SCHEMA = "armloop/model/2"
_SUM = Annotated[float, Meta(ge=-1e12, le=1e12, description="SI units")]
#: Relative error of what a file of decimal numbers may have lost.
_ROUNDED = 1e-6
_Joints = Meta(min_length=1, max_length=MOST_JOINTS)
_Terms = Meta(max_length=MOST_TERMS)


class JointData(Struct, forbid_unknown_fields=True):
    """A moving joint; a limit that is not there is none."""

    name: Name
    kind: Literal["revolute", "prismatic"]
    lower: Finite | UnsetType = UNSET  # rad (m)
    upper: Finite | UnsetType = UNSET
    velocity: NotNegative | UnsetType = UNSET  # rad/s (m/s)
    effort: NotNegative | UnsetType = UNSET  # N·m (N)


class ArmData(Struct):
    """An arm's kinematics and nominal links, base to tip."""

    name: Name
    joints: Annotated[list[JointData], _Joints]
    X_PF: Annotated[list[Pose], _Joints]
    axis: Annotated[list[Vector3], _Joints]
    mass: PerJoint
    com: Annotated[list[Vector3], _Joints]
    inertia: Annotated[list[Matrix3], _Joints]
    X_tool: Pose
    gravity: Vector3
    zeros: PerJoint | UnsetType = UNSET
    fingerprint: Name = ""


class TermsData(Struct, tag_field="kind", tag="terms"):
    """Products of the joints' functions with a coefficient each, per joint, found in one step."""

    step: Step
    joints: Annotated[list[Annotated[dict[Name, _SUM], _Terms]], _Joints]


class RigidBodyData(Struct, tag_field="kind", tag="rigid_body"):
    """Base parameters, and full parameters that have them."""

    base_parameters: Annotated[dict[Text, _SUM], _Terms]
    parameters: Annotated[list[_SUM], Meta(max_length=11 * MOST_JOINTS)]


class EnergyTermData(Struct):
    """One term of the energies."""

    term: Name
    coefficient: _SUM
    degrees: Annotated[list[Annotated[int, Meta(ge=-9, le=9)]], Meta(max_length=MOST_JOINTS)]
    sine: bool
    speeds: Annotated[list[Annotated[int, Meta(ge=0, le=MOST_JOINTS)]], Meta(min_length=2, max_length=2)]


class LagrangianData(Struct, tag_field="kind", tag="lagrangian"):
    """Kinetic and potential energy."""

    terms: Annotated[list[EnergyTermData], _Terms]


class FrictionTermData(Struct):
    """One term of a joint's friction; ``parameter`` is a speed or a width, 0 where there is none."""

    kind: Name
    coefficient: Finite
    parameter: NotNegative = 0.0
    name: Name = ""


class EstimateData(Struct):
    """A physical parameter; vectors are lists; a standard error that nobody knows is null."""

    value: Finite | Annotated[list[Finite], Meta(min_length=1, max_length=100_000)]
    std_error: (
        NotNegative | Annotated[list[NotNegative | None], Meta(min_length=1, max_length=100_000)] | None
    )
    unit: Name


class OnsetOfLogData(Struct):
    """The instant of one log at which an effect begins to be there, or ceases to be; ``posture`` tells which log."""

    value: Instant
    std_error: Seconds
    posture: PerJoint
    unit: Literal["s"] = "s"
    log: Name = ""
    elsewhere: bool = False


class EffectData(Struct):
    """An effect that was added, on a joint, a pair, or none; ``since`` or ``until`` an instant if it is not always there."""

    effect: Name
    joint: JointNumber | None
    parameters: Annotated[dict[Name, EstimateData], Meta(max_length=64)]
    other_joint: JointNumber | None = None
    since: OnsetOfLogData | UnsetType = UNSET
    until: OnsetOfLogData | UnsetType = UNSET


class ConditioningData(Struct, forbid_unknown_fields=True):
    """How logs are filtered; see ``armloop.data.signals.Conditioning``."""

    cutoff_hz: Annotated[float, Meta(ge=0.0, le=1e4, description="Hz; 0 is no filter")]
    oversampling: Annotated[float, Meta(gt=1.0, le=1e4)] = 25.0
    dead_zone: Annotated[float, Meta(ge=0.0, le=1e3)] = 4.0
    smear: Annotated[float, Meta(ge=0.0, le=1e3)] = 0.5
    torque_lag: Annotated[
        float, Meta(ge=-1.0, le=1.0, description="s by which torque is later than motion")
    ] = 0.0


class RecordedData(Struct):
    """What the torque columns of the training logs held."""

    unit: Literal["N*m", "A"]
    drive_gains: Annotated[list[Positive], _Joints] | None


class LogZerosData(Struct):
    """What one log's encoders read too much."""

    log: Text
    zeros: PerJoint


class EncoderZerosData(Struct):
    """Encoder zeros that differed from log to log, rad (m)."""

    spread: Annotated[
        list[NotNegative], Meta(min_length=1, max_length=MOST_JOINTS, description="standard deviation")
    ]
    logs: Annotated[list[LogZerosData], Meta(max_length=100_000)] = []
    errors: dict[Text, NotNegative] = {}


class LeaningData(Struct):
    """How the base was found to lean: the direction of gravity in its frame, the angle and its standard error, rad."""

    gravity: Vector3
    angle: NotNegative
    std_error: NotNegative


class ZeroData(Struct):
    """By what angle a joint (from 1) was found to be further than its position says, and its standard error, rad."""

    joint: Annotated[int, Meta(ge=1, le=MOST_JOINTS)]
    angle: Finite
    std_error: NotNegative


class HistoryData(Struct):
    """How the model came about; what else stands there is kept as it is."""

    method: Name | None = None
    library: Name | None = None
    logs: Annotated[list[Text], Meta(max_length=100_000)] = []
    notes: Annotated[list[Text], Meta(max_length=10_000)] = []
    range: Annotated[list[Annotated[list[Finite], _Joints]], Meta(min_length=4, max_length=4)] | UnsetType = (
        UNSET
    )
    slowest: Annotated[list[NotNegative], _Joints] | UnsetType = UNSET
    velocity_noise: Annotated[list[NotNegative], _Joints] | UnsetType = UNSET
    inertial: Annotated[list[_SUM], Meta(max_length=10 * MOST_JOINTS)] | UnsetType = UNSET
    encoder_zeros: EncoderZerosData | UnsetType = UNSET
    leaning: LeaningData | UnsetType = UNSET
    zeros: Annotated[list[ZeroData], Meta(max_length=MOST_JOINTS)] | UnsetType = UNSET


class ErrorData(Struct):
    """A coefficient's standard error."""

    std_error: NotNegative | None
    degrees_of_freedom: NotNegative | None


class TorqueErrorsData(Struct):
    """Independent errors of coefficients that were regressed together, one standard deviation each, by the coefficient."""

    unknowns: Annotated[list[Text], _Terms]
    directions: Annotated[
        list[
            Annotated[str, Meta(pattern=r"^(-?[0-9]+([.][0-9]+)?(e[+-]?[0-9]+)?( |$))+$", max_length=100_000)]
        ],
        Meta(
            max_length=MOST_TERMS,
            description="per unknown its part of each, up to the diagonal; numbers and blanks",
        ),
    ]


class UncertaintyData(Struct):
    """Standard errors of the coefficients, by their terms' names."""

    method: Text = ""
    block_seconds: Seconds | None = None
    correlation_seconds: Seconds | None = None
    joints: Annotated[list[Annotated[dict[Text, ErrorData], _Terms]], Meta(max_length=MOST_JOINTS)] = []
    friction: Annotated[list[Annotated[dict[Text, ErrorData], _Terms]], Meta(max_length=MOST_JOINTS)] = []
    shared: Annotated[dict[Text, ErrorData], _Terms] = {}
    stribeck: Annotated[list[dict[Name, Any]], Meta(max_length=MOST_JOINTS)] = []
    torque: Annotated[list[TorqueErrorsData], Meta(max_length=MOST_JOINTS)] = []
    torque_lag: Finite = 0.0
    between_logs: Annotated[
        list[
            Annotated[
                list[Annotated[list[Finite], Meta(min_length=2, max_length=2)]],
                Meta(min_length=2, max_length=2),
            ]
            | None
        ],
        Meta(
            max_length=MOST_JOINTS,
            description="per joint the covariance of dry level and viscous coefficient",
        ),
    ] = []


class ModelData(Struct):
    """A reconstructed model of an arm's joint torques; SI units, joints base to tip."""

    schema: Literal["armloop/model/2"]
    arm: ArmData
    components: Annotated[list[TermsData | RigidBodyData | LagrangianData], Meta(max_length=100)]
    friction: Annotated[list[Annotated[list[FrictionTermData], Meta(max_length=1000)]], _Joints]
    effects: Annotated[list[EffectData], Meta(max_length=1000)]
    conditioning: ConditioningData
    recorded: RecordedData
    baseline: BaselineData
    history: HistoryData
    uncertainty: UncertaintyData
    written_by: Name = ""
    formulas: Annotated[list[str], Meta(max_length=MOST_JOINTS)] = []


def _from_1(data: dict[str, Any]) -> dict[str, Any]:
    """``armloop/model/1`` knew models without standard errors."""
    return {"uncertainty": {}, **data, "schema": "armloop/model/2"}


#: Schema: what makes the next one of it.
_MIGRATIONS = {"armloop/model/1": _from_1}


def _other(schema: Any) -> str:
    """What is wrong with a schema that is not this one."""
    kind, _, number = schema.rpartition("/") if isinstance(schema, str) else ("", "", "")
    here, _, mine = SCHEMA.rpartition("/")
    if kind == "armloop/diagnosis":
        return f"it must be {SCHEMA!r}; the model of a diagnosis lies beside it, in model.json"
    if kind == here and number.isdecimal() and int(number) > int(mine):
        return f"of a newer armloop; this one reads up to {SCHEMA!r}"
    return f"it must be {SCHEMA!r}"


def model_data(data: Any) -> dict[str, Any]:
    """What was read from a model file, checked, as one of this schema; raises ``ModelError``, which names the field."""
    found = data.get("schema") if isinstance(data, dict) else None
    while isinstance(found, str) and found in _MIGRATIONS:
        data = _MIGRATIONS[found](data)
        found = data["schema"]
    if found != SCHEMA:
        raise ModelError(f"schema is {found!r:.60}, {_other(found)}")
    try:
        model = checked(data, ModelData)
    except Misfit as misfit:
        raise ModelError(str(misfit)) from None
    _agree(model)
    whole: dict[str, Any] = data
    return whole


def _agree(model: ModelData) -> None:
    """Raise ``ModelError`` where lengths do not go with the number of joints."""
    arm, n = model.arm, len(model.arm.joints)
    history, zeros = model.history, model.history.encoder_zeros
    ranges = [] if history.range is UNSET else history.range
    lengths: list[tuple[str, Any]] = [
        *((f"arm.{key}", getattr(arm, key)) for key in ("X_PF", "axis", "mass", "com", "inertia")),
        ("friction", model.friction),
        ("recorded.drive_gains", model.recorded.drive_gains),
        *(
            (f"baseline.{key}", getattr(model.baseline, key))
            for key in ("rmse", "rms", "nrmse", "worst", "reversals", "creeping")
        ),
        ("baseline.joints", model.baseline.joints or UNSET),  # without parts there are none
        *(
            (f"baseline.null: removed of {law.effect!r:.60}", law.removed)
            for law in model.baseline.null or ()
        ),
        *((f"history.range[{k + 1}]", row) for k, row in enumerate(ranges)),
        ("history.slowest", history.slowest),
        ("history.velocity_noise", history.velocity_noise),
        ("history.encoder_zeros.spread", UNSET if zeros is UNSET else zeros.spread),
        *(
            (f"uncertainty.{key}", getattr(model.uncertainty, key) or None)
            for key in ("joints", "friction", "stribeck", "between_logs")
        ),
    ]
    for part in model.components:
        if isinstance(part, TermsData):
            lengths.append((f"terms of step {part.step}", part.joints))
        elif isinstance(part, LagrangianData):
            lengths += [(f"lagrangian: degrees of {term.term!r:.60}", term.degrees) for term in part.terms]
        else:
            if len(part.parameters) not in (10 * n, 11 * n):
                raise ModelError(
                    f"rigid_body: {len(part.parameters)} parameters, {n} links need {10 * n} or {11 * n}"
                )
            for k, mass in enumerate(part.parameters[: 10 * n : 10]):
                if abs(mass) > HEAVIEST:
                    raise ModelError(
                        f"rigid_body: the mass of link {k + 1} is {mass:g} kg; no link has more than {HEAVIEST:g}"
                    )
    for place, values in lengths:
        if values is not None and values is not UNSET and len(values) != n:
            raise ModelError(f"{place}: {len(values)} joints, the arm has {n}")
    if any(x < 0 for row in ranges[:3] for x in row):
        raise ModelError("history.range: half ranges, velocities and accelerations must not be negative")
    if history.inertial is not UNSET and len(history.inertial) != 10 * n:
        raise ModelError(f"history.inertial: {len(history.inertial)} parameters, {n} links have {10 * n}")
    _check_arm(arm)
    _check_sums(model)
    for kept_errors in model.uncertainty.torque:
        numbers = [len(row.split()) for row in kept_errors.directions]
        if numbers != [min(k + 1, max(numbers, default=0)) for k in range(len(kept_errors.unknowns))]:
            raise ModelError(
                "uncertainty.torque: directions must be one row for each of the unknowns, each a number longer than the "
                "one before, up to the same length"
            )
    for k, effect in enumerate(model.effects):
        for word, onset in (("since", effect.since), ("until", effect.until)):
            if onset is not UNSET and len(onset.posture) != n:
                raise ModelError(
                    f"effects[{k + 1}].{word}.posture: {len(onset.posture)} joints, the arm has {n}"
                )
        for joint_number in (effect.joint, effect.other_joint):
            if joint_number is not None and joint_number > n:
                raise ModelError(
                    f"effects[{k + 1}]: effect {effect.effect!r:.60} is on joint {joint_number}; the arm has "
                    f"joints 1 to {n}"
                )
        for name, each in effect.parameters.items():
            sizes = {
                len(x) if isinstance(x, list) else 0 for x in (each.value, each.std_error) if x is not None
            }
            if len(sizes) > 1:
                raise ModelError(f"effects[{k + 1}]: {name}: value and std_error are not of one length")


def _check_arm(arm: ArmData) -> None:
    """Raise ``ModelError`` where numbers of an arm, each right in itself, are no arm's together."""
    poses = {f"arm.X_PF[{k + 1}]": np.array(pose) for k, pose in enumerate(arm.X_PF)}
    poses["arm.X_tool"] = np.array(arm.X_tool)
    for place, X in poses.items():
        x, y, z = X[:3, :3]
        turned = np.concatenate([[x @ x - 1, y @ y - 1, x @ y], np.cross(x, y) - z])
        if np.abs(turned).max() > _ROUNDED or X[3].tolist() != [0.0, 0.0, 0.0, 1.0]:
            raise ModelError(f"{place} is no pose: a rotation and a place (m) above a row 0, 0, 0, 1")
    for k, axis in enumerate(arm.axis):
        if abs(np.dot(axis, axis) - 1.0) > _ROUNDED:
            raise ModelError(f"arm.axis[{k + 1}] is {axis}; an axis must have the length 1")
    for k, inertia in enumerate(map(np.array, arm.inertia)):
        rounded = _ROUNDED * np.abs(inertia).max()
        if np.abs(inertia - inertia.T).max() > rounded or (np.diag(inertia) < -rounded).any():
            raise ModelError(
                f"arm.inertia[{k + 1}] is no inertia: it must be symmetric, and no moment negative"
            )
    for k, mass in enumerate(arm.mass):
        if not 0 <= mass <= HEAVIEST:
            raise ModelError(f"arm.mass[{k + 1}] is {mass:g}; a mass must be from 0 to {HEAVIEST:g} kg")
    places = {f"arm.com[{k + 1}]": np.array(com) for k, com in enumerate(arm.com)}
    for name, xyz in (places | {name: X[:3, 3] for name, X in poses.items()}).items():
        farthest = np.abs(xyz).max()
        if farthest > FARTHEST:
            raise ModelError(f"{name} lies {farthest:g} m away, as no part of an arm does; give m")
    if not arm.name.isprintable():
        raise ModelError(f"arm.name is {arm.name!r:.60}, which cannot be shown; give it a name of its own")
    names = [joint.name for joint in arm.joints]
    for k, name in enumerate(names):
        if not name.strip() or name in names[:k] or not name.isprintable():
            fault = (
                "is used twice"
                if name in names[:k]
                else "is empty"
                if not name.strip()
                else "cannot be shown"
            )
            raise ModelError(
                f"arm.joints[{k + 1}].name is {name!r:.60}, which {fault}; give each joint a name of its own"
            )
    for joint in arm.joints:
        low = float("-inf") if joint.lower is UNSET else joint.lower
        high = float("inf") if joint.upper is UNSET else joint.upper
        if not low < high:
            raise ModelError(
                f"arm: joint {joint.name!r:.60} goes from {low:g} to {high:g}; give lower below upper"
            )


def _check_sums(model: ModelData) -> None:
    """Raise ``ModelError`` where a sum has the same part twice: it would count twice."""
    bodies = [part for part in model.components if not isinstance(part, TermsData)]
    steps = [part.step for part in model.components if isinstance(part, TermsData)]
    if len(bodies) > 1 or len(set(steps)) < len(steps):
        raise ModelError(
            "components: one of them stands twice; a sum has one rigid_body or lagrangian, and terms of a step once"
        )
    for k, terms in enumerate(model.friction):
        given = [(term.kind, term.parameter) for term in terms]
        for i, (kind, parameter) in enumerate(given):
            if (kind, parameter) in given[:i]:
                raise ModelError(f"friction[{k + 1}]: {kind!r:.60} of parameter {parameter:g} stands twice")
