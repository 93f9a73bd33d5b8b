"""The descriptions of errors as commands tell them: evaluate, reconstruct, crossvalidate, the measured loop."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from msgspec import UNSET, Meta, Struct, UnsetType

from armloop.schemas.answers import DiagnosisData
from armloop.schemas.types import MOST_JOINTS, Count, Name, NotNegative, PerJointOrNull, Seconds, Step, Text

_Terms = Annotated[list[Count], Meta(min_length=1, max_length=MOST_JOINTS, description="per joint")]


class ErrorsData(Struct):
    """RMSE in N·m (N), and nRMSE: RMSE over the RMS of the measured signal; null where there are no such samples."""

    rmse: PerJointOrNull
    nrmse: PerJointOrNull


class ScoreData(Struct):
    """Errors of a model's torques, over all samples, those that move, and those at rest."""

    rmse: PerJointOrNull
    nrmse: PerJointOrNull
    moving: ErrorsData
    standstill: ErrorsData
    samples: Count


class LogScoreData(ScoreData):
    """Those of one log of several."""

    log: Text


class EvaluationData(ScoreData):
    """`armloop evaluate --json`: errors of a model's torques on all logs, and of several on each."""

    logs: list[LogScoreData] | UnsetType = UNSET


class StepData(Struct):
    """One step: truncation orders, columns offered, terms kept per joint."""

    step: Step
    orders: list[Count] | None
    candidates: Count
    terms: _Terms


class ReconstructionData(Struct):
    """`armloop reconstruct --json`."""

    steps: list[StepData]
    held_out: ErrorsData
    model: Name | UnsetType = UNSET
    library: Name | UnsetType = UNSET
    warnings: list[Text] = []
    notes: list[Text] = []


class LeftOutData(Struct):
    """Errors on what was left out of one log."""

    file: Name
    samples: Count
    moving: ErrorsData
    standstill: ErrorsData


class MeanData(Struct):
    """Means over the logs; null where nothing moves."""

    nrmse: NotNegative | None
    nrmse_per_joint: PerJointOrNull


class CrossValidationData(Struct):
    """`armloop crossvalidate --json`, and crossvalidation.json."""

    leave_out: Literal["file", "blocks"]
    block_seconds: Seconds | None
    library: Name
    files: list[LeftOutData]
    mean: MeanData
    notes: dict[str, list[Text]]
    schema: Literal["armloop/crossvalidation/1"] | UnsetType = UNSET
    physical_consistency: dict[str, Any] | UnsetType = UNSET
    written_by: Name = ""


class PushedData(Struct):
    """RMSE while the arm was pushed, with the model before and after, N·m."""

    before: PerJointOrNull
    after: PerJointOrNull


class MeasuredData(Struct):
    """measured.json of `armloop loop --measured`."""

    schema: Literal["armloop/measured/1"]
    data: Text
    free_run: EvaluationData
    diagnosis: DiagnosisData
    rmse_while_pushed: PushedData
    written_by: Name = ""
