"""Hold what a command answered against its published schema."""

import json
from typing import Any

from armloop.drake_systems.scenario_schema import FILES
from armloop.schemas.checking import checked


def answered(text: str, name: str) -> dict[str, Any]:
    """The one JSON object that a command printed, which must be as its schema says."""
    answer = json.loads(text)
    checked(answer, FILES[name])
    return answer
