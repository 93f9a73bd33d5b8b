"""Primitive types of the files: numbers, names and lists, with the bounds that all share."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

#: Joints of an arm, candidate functions of a model: more than any arm has, few enough to be computed with.
MOST_JOINTS, MOST_TERMS = 16, 200_000

#: A finite number. In SI units nothing of an arm is as large, and products of what is smaller do not overflow.
#: No link of an arm or a crane is heavier, kg, and no part of it farther away, m.
HEAVIEST, FARTHEST = 1e6, 1e5
Finite = Annotated[float, Meta(ge=-1e12, le=1e12)]
NotNegative = Annotated[float, Meta(ge=0.0, le=1e12)]
Positive = Annotated[float, Meta(gt=0.0, le=1e12)]
#: A length of time, s.
Seconds = Annotated[float, Meta(ge=0.0, le=1e7, description="s")]
Instant = Annotated[float, Meta(ge=-1e12, le=1e12, description="by the clock of its log, s")]
Share = Annotated[float, Meta(ge=-1e3, le=1e3, description="part of an energy; 1 is all of it")]
Count = Annotated[int, Meta(ge=0, le=10**12)]
JointNumber = Annotated[int, Meta(ge=1, le=MOST_JOINTS, description="counted from 1, base to tip")]
Step = Annotated[int, Meta(ge=1, le=3, description="step of the reconstruction")]
Name = Annotated[str, Meta(max_length=400)]
Text = Annotated[str, Meta(max_length=20_000)]
Vector3 = Annotated[list[Finite], Meta(min_length=3, max_length=3)]
Matrix3 = Annotated[list[Vector3], Meta(min_length=3, max_length=3)]
Pose = Annotated[
    list[Annotated[list[Finite], Meta(min_length=4, max_length=4)]],
    Meta(min_length=4, max_length=4, description="homogeneous, m"),
]
PerJoint = Annotated[list[Finite], Meta(min_length=1, max_length=MOST_JOINTS)]
PerJointOrNull = Annotated[list[NotNegative | None], Meta(min_length=1, max_length=MOST_JOINTS)]
