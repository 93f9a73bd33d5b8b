"""The descriptions of what commands answer: diagnosis.json, tracking.json, loop.json."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from msgspec import UNSET, Meta, Struct, UnsetType

from armloop.schemas.types import (
    Count,
    Finite,
    Instant,
    JointNumber,
    Name,
    NotNegative,
    PerJoint,
    PerJointOrNull,
    Seconds,
    Share,
    Text,
)


class AlternativeData(Struct):
    """What this motion cannot tell from what was found."""

    effect: Name
    joint: JointNumber | None
    why: Text = ""


class OnsetData(Struct):
    """The instant at which an effect begins to be there, or ceases to be, by the clock of its log."""

    value: Instant
    std_error: Seconds
    unit: Literal["s"]
    log: Name = ""


class SpellsData(Struct):
    """The intervals in which an effect is there, by the clocks of their logs."""

    start: Annotated[list[Instant], Meta(min_length=1, max_length=100_000)]
    end: Annotated[list[Instant], Meta(min_length=1, max_length=100_000)]
    std_error: Seconds
    unit: Literal["s"]
    log: list[Name] = []


class GrowthData(Struct):
    """What all friction of a joint has grown by, in parts of what the model has."""

    value: Finite
    std_error: NotNegative
    unit: Literal["1"]


class FoundData(Struct):
    """An effect that was found, or the law of a residual that no listed effect explains.

    One that is not there all the while has ``since``, from which instant on it is there, or ``until``, or ``during``. A part
    of a joint's friction that has grown as a whole has ``growth``, and its share is that of all parts.
    """

    effect: Name
    joint: JointNumber | None
    other_joint: JointNumber | None = None
    share: Share | None = None
    alternatives: list[AlternativeData] = []
    parameters: dict[str, Any] = {}
    words: Annotated[Text | UnsetType, Meta(description="a sentence on it")] = UNSET
    form: Text | UnsetType = UNSET
    adopted: bool | UnsetType = UNSET
    when: Name | UnsetType = UNSET
    probability: Annotated[float, Meta(ge=0, le=1)] | UnsetType | None = UNSET
    since: OnsetData | UnsetType = UNSET
    until: OnsetData | UnsetType = UNSET
    during: SpellsData | UnsetType = UNSET
    growth: GrowthData | UnsetType = UNSET


class RemainsData(Struct):
    """Error on data left out, before and after what was found, per joint, in ``unit``."""

    metric: Name
    held_out: bool
    unit: list[Name]
    before: PerJointOrNull
    after: PerJointOrNull
    noise_floor: PerJointOrNull | None = None


class JointShareData(Struct):
    """Parts of one joint's torque on data left out."""

    joint: JointNumber
    explained: Share | None = None
    predictable_left: Share | None = None
    noise: Share | None = None
    outside_trained_range: Share | None = None


class DiagnosisData(Struct):
    """What a model lacks on a measured run, and which effects account for it, strongest first."""

    schema: Literal["armloop/diagnosis/1", "armloop/diagnosis/2"]
    verdict: Literal["no_effect", "effects_found", "unlisted_effect", "cannot_tell"]
    effects: list[FoundData]
    error: RemainsData
    reasons: list[Text] = []
    joints: list[JointShareData] = []
    encoder_zeros: list[PerJoint] | UnsetType = UNSET
    logs: Annotated[list[Name], Meta(description="what this is said of")] = []
    apart: Annotated[list[DiagnosisData], Meta(description="of logs in which the arm was not the same")] = []
    written_by: Name = ""


class ControllerData(Struct):
    """One controller's tracking errors per joint: deg, or mm for a prismatic joint."""

    eta_deg: Annotated[list[NotNegative], Meta(description="mean absolute error; deg (mm)")]
    rms: PerJoint | UnsetType = UNSET
    max: PerJoint | UnsetType = UNSET


class TrackingData(Struct):
    """A closed-loop comparison of controllers."""

    schema: Literal["armloop/tracking/1"]
    controllers: dict[str, ControllerData]
    scenario: Name = ""
    arm: Name = ""
    scored_s: list[Seconds] = []
    unit: list[Name] = []
    stable: Annotated[bool, Meta(description="the loop at rest where the reference begins")] = True
    unstable_at_s: Annotated[
        list[Seconds],
        Meta(description="times of the reference, of ten, at whose postures the loop at rest is not stable"),
    ] = []
    not_run: Annotated[list[Name], Meta(description="controllers without a model")] = []
    written_by: Name = ""


class UndeclaredData(Struct):
    """The effect that was put into the simulated arm, told after the verdict."""

    effect: Name
    joint: JointNumber | None
    parameters: dict[str, Any]


class EtaData(Struct):
    """Mean absolute tracking error per joint, deg (mm)."""

    eta_deg: list[NotNegative]


class BeforeAfterData(Struct):
    """Tracking of the arm with the effect, with the model as collected and with the augmented one."""

    before: EtaData
    after: EtaData


class LoopData(Struct):
    """The main job's results."""

    schema: Literal["armloop/loop/1"]
    seed: Count
    reconstruct: dict[str, Any]
    sindy: dict[str, Any] | None
    tracking: TrackingData
    diagnosis: DiagnosisData
    undeclared: UndeclaredData
    right: bool
    tracking_with_effect: BeforeAfterData
    seconds: dict[str, Finite]
    written_by: Name = ""
