"""The description of a model file's baseline: what the model leaves on left-out blocks of its training runs."""

from __future__ import annotations

from typing import Annotated

from msgspec import UNSET, Meta, Struct, UnsetType

from armloop.schemas.types import (
    MOST_JOINTS,
    Count,
    JointNumber,
    NotNegative,
    PerJoint,
    PerJointOrNull,
    Share,
    Text,
)


class EnergyPartsData(Struct, forbid_unknown_fields=True):
    """Parts of one joint's torque energy on left-out data; null where there are too few."""

    joint: JointNumber
    explained: Share | None = None
    predictable_left: Share | None = None
    noise: Share | None = None
    std_error: NotNegative | None = None
    correlation_time: NotNegative | None = None
    separated: bool = True


class NullData(Struct):
    """What a law removes of the residual on left-out stretches of the training runs, per joint, N²·m² (N²) a sample."""

    effect: Text
    joint: JointNumber | None
    removed: PerJoint
    stretches: Count
    other_joint: JointNumber | None = None


class BaselineData(Struct):
    """What the model leaves on left-out data of its own training runs, per joint; a field that is not known is left away."""

    rmse: PerJointOrNull | UnsetType = UNSET
    rms: PerJointOrNull | UnsetType = UNSET
    nrmse: PerJointOrNull | UnsetType = UNSET
    worst: PerJointOrNull | UnsetType = UNSET
    reversals: PerJointOrNull | UnsetType = UNSET
    creeping: PerJointOrNull | UnsetType = UNSET
    logs: Annotated[list[NotNegative | None], Meta(max_length=MOST_JOINTS)] = []
    samples: Count | UnsetType = UNSET
    joints: Annotated[list[EnergyPartsData], Meta(max_length=MOST_JOINTS)] | UnsetType = UNSET
    null: Annotated[list[NullData], Meta(max_length=100_000)] | UnsetType = UNSET
