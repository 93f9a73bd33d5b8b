"""JSON schemas of all files, for editors and other people's programs; ``python -m`` this module writes them.

They lie in ``docs/schemas``; a test says whether they are those of the descriptions.
"""

from __future__ import annotations

import json
import sys
from inspect import cleandoc
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
            {
                "$schema": "https://json-schema.org/draft/2020-12/schema",
                **_dedented(msgspec.json.schema(kind)),
            },
            indent=1,
            ensure_ascii=False,
        )
        + "\n"
        for name, kind in FILES.items()
    }


def _dedented(part: Any) -> Any:
    """A schema whose descriptions, which are docstrings, are not indented: as Python 3.13 leaves them, older ones do not."""
    if isinstance(part, dict):
        cleaned = {key: _dedented(inner) for key, inner in part.items()}
        said = cleaned.get("description")
        return {**cleaned, "description": cleandoc(said)} if isinstance(said, str) else cleaned
    return [_dedented(inner) for inner in part] if isinstance(part, list) else part


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    for name, text in schemas().items():
        (folder / name).write_text(text, encoding="utf-8")
