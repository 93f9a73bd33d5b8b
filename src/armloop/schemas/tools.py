"""The descriptions of what cluster, convert, excite, export, reproduce, tune and watch answer."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from msgspec import UNSET, Meta, Struct, UnsetType

from armloop.schemas.types import (
    MOST_JOINTS,
    Count,
    Finite,
    JointNumber,
    Name,
    NotNegative,
    PerJoint,
    Seconds,
    Text,
)

_Hours = Annotated[float, Meta(ge=0, le=1e9, description="h of operation")]
_Time = Annotated[float, Meta(ge=-1e12, le=1e12, description="s since 1970, or as the logs count")]
_NotNegatives = Annotated[list[NotNegative], Meta(min_length=1, max_length=MOST_JOINTS)]


class CountsData(Struct):
    """Samples of each condition."""

    static: Count
    constant_velocity: Count
    varying_velocity: Count


class ClusterData(Struct):
    """`armloop cluster --json`."""

    counts: CountsData
    elbow: Annotated[int, Meta(ge=1, le=100, description="clusters that the elbow suggests")]
    wcss: Annotated[list[NotNegative], Meta(description="within-cluster sum of squares of 1, 2, … clusters")]
    iterations: Count
    samples: Count


class ConversionData(Struct):
    """`armloop convert --json`."""

    log: Name
    kinds: Annotated[list[Name], Meta(description="what each source is")]
    samples: Count
    period: Seconds
    runs: Annotated[list[tuple[Count, Count]], Meta(description="first sample and end of each run")]
    joints: Annotated[list[Name], Meta(description="the source's name of each joint, base to tip")]
    tau_unit: Literal["N*m", "A"]
    kept: Annotated[list[Name], Meta(description="further columns")]
    notes: list[Text]


class SuggestionData(Struct):
    """`armloop convert --suggest --json`: the map, where it was written, and the fields that it is unsure of."""

    map: Name | None
    kind: Name
    samples: Count
    joints: Count
    unsure: dict[Name, Text]
    text: Annotated[str, Meta(max_length=10**6, description="the map's YAML")]


class SpreadData(Struct):
    """Quantiles (0.1, 0.5, 0.9) of a measure over random references; null where it is infinite."""

    low: Finite | None
    median: Finite | None
    high: Finite | None
    count: Count


class ExcitationSpreadsData(Struct):
    """The measures of random references."""

    condition: SpreadData
    logdet: SpreadData
    error: SpreadData


class UseData(Struct):
    """Largest part of each joint's range that the reference uses; 1 is all of it."""

    position: _NotNegatives
    velocity: _NotNegatives
    acceleration: _NotNegatives
    torque: _NotNegatives


class RatioErrorData(Struct):
    """RMS error of the coefficients with 1, 2, … repetitions."""

    optimised: list[NotNegative | None]
    random: list[NotNegative | None]


class RatioData(Struct):
    """How much more data random references need for the same error; null: more than ``most``."""

    median: NotNegative | None
    low: NotNegative | None
    high: NotNegative | None
    most: Count
    error: RatioErrorData


class ExcitationData(Struct):
    """`armloop excite --json`."""

    reference: Name
    rows: Count
    library: Name
    criterion: Name
    coefficients: Count
    duration: Seconds
    period: Seconds
    harmonics: Count
    condition: NotNegative | None
    logdet: Finite | None
    error: NotNegative | None
    random: ExcitationSpreadsData
    use: UseData
    notes: list[Text]
    data_ratio: RatioData | UnsetType = UNSET


class ExportData(Struct):
    """`armloop export --json`: torques in N·m (N), or A, per joint; null where nothing can read the target back."""

    target: Literal["urdf", "sdf", "mjcf", "drake", "c"]
    files: list[Name]
    read_back_by: Name | None
    rms: _NotNegatives
    difference: Annotated[_NotNegatives | None, Meta(description="largest, of what the target can say")]
    difference_from_model: Annotated[_NotNegatives | None, Meta(description="largest, of the whole model")]
    cannot_say: list[Text]
    notes: list[Text]


class ItemData(Struct):
    """One table or figure of the paper; both sides have the same keys."""

    paper: dict[str, Any]
    ours: dict[str, Any]
    verdict: Text
    details: dict[str, Any]


#: `armloop reproduce --json`, and reproduction.json, where ``written_by`` stands beside the items.
ReproductionData = dict[str, ItemData | str]


class GainsData(Struct):
    """N·m/rad, N·m/(rad·s) and N·m·s/rad per joint; prismatic: N/m, N/(m·s), N·s/m."""

    kp: PerJoint
    ki: PerJoint
    kd: PerJoint


class MarginsData(Struct):
    """One joint's loop, the others closed; null is infinite, or of a loop that is not stable."""

    gain_margin: NotNegative | None
    gain_reduction: NotNegative | None
    phase_margin: Annotated[float, Meta(ge=-360, le=360, description="deg")] | None
    bandwidth: Annotated[float, Meta(ge=0, le=1e6, description="rad/s")] | None
    sensitivity_peak: NotNegative | None


class AlongData(Struct):
    """The least comfortable posture along the reference, per joint."""

    phase_margin: list[Annotated[float, Meta(ge=-360, le=360, description="deg")] | None]
    sensitivity_peak: list[NotNegative | None]


class TunedData(Struct):
    """One set of gains looked at from all sides."""

    gains: GainsData
    stable: bool
    loop: Annotated[list[MarginsData], Meta(min_length=1, max_length=MOST_JOINTS)]
    along_reference: AlongData
    step_deviation: Annotated[list[NotNegative | None], Meta(min_length=1, max_length=MOST_JOINTS)]
    eta_deg: Annotated[dict[str, _NotNegatives], Meta(description="by controller; deg (mm)")]


class WantedData(Struct):
    """What the gains were asked for."""

    bandwidth_hz: NotNegative
    margin_deg: NotNegative


class TuningData(Struct):
    """`armloop tune --json`, and tune.json."""

    schema: Literal["armloop/tune/1"]
    scenario: Name
    arm: Name
    posture: PerJoint
    wanted: WantedData
    present: TunedData
    proposed: TunedData
    written_by: Name = ""


class LogCountsData(Struct):
    """Logs that were read, that the store knew, and that were set aside."""

    read: Count
    known: Count
    set_aside: Count


class ShownByData(Struct):
    """The coefficient whose test raised the alarm."""

    effect: Name
    joint: JointNumber | None
    other_joint: JointNumber | None
    direction: Literal["rose", "fell"]


class DelayData(Struct):
    """From the change, as far as it can be dated, to the alarm."""

    units: Count
    operation_hours: _Hours


class CourseData(Struct):
    """Whether the change came at once or crept."""

    form: Name
    size: Finite
    per_day: Finite | None
    margin: Finite
    of: Name


class AlarmData(Struct):
    """A change of an arm, and what it is."""

    id: Name
    arm: Name
    when: _Time
    since: _Time
    log: Name
    since_log: Name
    delay: DelayData
    log_evidence: Finite
    limit: Finite
    false_alarm_hours: _Hours
    shown_by: ShownByData
    effects: list[dict[str, Any]]
    course: CourseData
    alternatives: list[dict[str, Any]]
    continues: Name | None
    notes: list[Text]
    model: Annotated[Name, Meta(description="digest of the model that it was found with")] | UnsetType = UNSET
    healthy: Count | UnsetType = UNSET
    window: (
        Annotated[list[Name], Meta(description="digests of the logs that it was named from")] | UnsetType
    ) = UNSET
    into_log: Annotated[Finite, Meta(description="s of the last of these up to the alarm")] | UnsetType = (
        UNSET
    )
    diagnosis: dict[str, Any] | UnsetType = UNSET


class WatchedArmData(Struct):
    """One arm of the store."""

    arm: Name
    logs: Count
    units: Count
    units_since_alarm: Count
    units_for_alarm: (
        Annotated[Count, Meta(description="fewest units since the last alarm after which there can be one")]
        | None
    )
    hours: _Hours
    limit: Finite
    warmth: Name | None
    alarms: list[Name]
    notes: list[Text]


class PromiseData(Struct):
    """The mean time between false alarms that is promised."""

    false_alarm_hours: _Hours
    of: Text


class AsideData(Struct):
    """A log that could not be used."""

    arm: Name
    log: Name
    reason: Text


class WatchData(Struct):
    """`armloop watch --json`; ``new`` are alarms that were not told before, ``alarms`` all there are, by their id.

    ``diagnosed`` are alarms that were told before, and whose logs were diagnosed in this call.
    """

    schema: Literal["armloop/watch/1"]
    logs: LogCountsData
    arms: list[WatchedArmData]
    operation_hours: _Hours
    promise: PromiseData
    new: list[AlarmData]
    diagnosed: list[AlarmData]
    alarms: list[Name]
    set_aside: list[AsideData]
