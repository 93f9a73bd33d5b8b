"""JSON schemas of all files, for editors and other people's programs; ``python -m`` this module writes them.

They lie in ``docs/schemas``; a test says whether they are those of the descriptions.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import msgspec

from armloop.schemas.answers import DiagnosisData, LoopData
from armloop.schemas.answers import TrackingData as TrackingAnswer
from armloop.schemas.model import ModelData
from armloop.schemas.scenarios import PlanData, PlantData, TrackingData
from armloop.schemas.scores import CrossValidationData, EvaluationData, MeasuredData, ReconstructionData
from armloop.schemas.tools import (
    ClusterData,
    ConversionData,
    ExcitationData,
    ExportData,
    ReproductionData,
    SuggestionData,
    TuningData,
    WatchData,
)

FILES: dict[str, Any] = {
    "model": ModelData,
    "diagnosis": DiagnosisData,
    "tracking": TrackingAnswer,
    "loop": LoopData,
    "measured": MeasuredData,
    "evaluation": EvaluationData,
    "reconstruction": ReconstructionData,
    "crossvalidation": CrossValidationData,
    "cluster": ClusterData,
    "conversion": ConversionData,
    "suggestion": SuggestionData,
    "excitation": ExcitationData,
    "export": ExportData,
    "reproduction": ReproductionData,
    "tune": TuningData,
    "watch": WatchData,
    "scenario": TrackingData,
    "plant": PlantData,
    "collection_plan": PlanData,
}


def schemas() -> dict[str, str]:
    """The text of each schema by the name of its file."""
    return {
        f"{name}.schema.json": json.dumps(
            {"$schema": "https://json-schema.org/draft/2020-12/schema", **msgspec.json.schema(kind)},
            indent=1,
            ensure_ascii=False,
        )
        + "\n"
        for name, kind in FILES.items()
    }


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    for name, text in schemas().items():
        (folder / name).write_text(text, encoding="utf-8")
