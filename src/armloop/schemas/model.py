"""The description of a model file, ``armloop/model/2``: its fields, each with its unit and range."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from msgspec import UNSET, Meta, Struct, UnsetType

from armloop.schemas.baseline import BaselineData
from armloop.schemas.types import (
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

SCHEMA = "armloop/model/2"
_SUM = Annotated[float, Meta(ge=-1e12, le=1e12, description="SI units")]
_Joints = Meta(min_length=1, max_length=MOST_JOINTS)
_Terms = Meta(max_length=MOST_TERMS)
_TWO = Meta(min_length=2, max_length=2)
_Pair = Annotated[list[Finite], _TWO]
_Ranges = Annotated[list[Annotated[list[Finite], _Joints]], Meta(min_length=4, max_length=4)]
_Numbers = Annotated[str, Meta(pattern=r"^(-?[0-9]+([.][0-9]+)?(e[+-]?[0-9]+)?( |$))+$", max_length=100_000)]


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
    speeds: Annotated[list[Annotated[int, Meta(ge=0, le=MOST_JOINTS)]], _TWO]


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


class SpellsOfLogsData(Struct):
    """The intervals in which an effect is there; ``posture`` at the start of each tells which log."""

    start: Annotated[list[Instant], Meta(min_length=1, max_length=100_000)]
    end: Annotated[list[Instant], Meta(min_length=1, max_length=100_000)]
    std_error: Seconds
    posture: Annotated[list[PerJoint], Meta(min_length=1, max_length=100_000)]
    unit: Literal["s"] = "s"
    log: list[Name] = []


class EffectData(Struct):
    """An effect that was added, on a joint, a pair, or none.

    ``since`` or ``until`` an instant, or ``during`` intervals, if it is not always there.
    """

    effect: Name
    joint: JointNumber | None
    parameters: Annotated[dict[Name, EstimateData], Meta(max_length=64)]
    other_joint: JointNumber | None = None
    since: OnsetOfLogData | UnsetType = UNSET
    until: OnsetOfLogData | UnsetType = UNSET
    during: SpellsOfLogsData | UnsetType = UNSET


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
    range: _Ranges | UnsetType = UNSET
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
        list[_Numbers],
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
    heterogeneity: Annotated[
        float, Meta(ge=0.0, description="variance between logs of a usual coefficient, by that by blocks")
    ] = 0.0
    between_logs: Annotated[
        list[Annotated[list[_Pair], _TWO] | None],
        Meta(
            max_length=MOST_JOINTS,
            description="per joint the covariance of dry level and viscous coefficient",
        ),
    ] = []
    sensor_drift: Annotated[
        list[Annotated[list[NotNegative], _TWO]],
        Meta(
            max_length=MOST_JOINTS,
            description="per joint, between logs: sd of its torque's constant and rate",
        ),
    ] = []
    sensor_drift_freedom: Positive | None = None
    between_logs_known: Literal["assumed", "alike", "different"] = "different"
    between_logs_freedom: Positive | None = None


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
