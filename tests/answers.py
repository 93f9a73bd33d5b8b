"""Hold what a command answered against its published schema."""

import json
from typing import Any

from armloop.schemas.checking import checked
from armloop.schemas.published import FILES


def answered(text: str, name: str) -> dict[str, Any]:
    """The one JSON object that a command printed, which must be as its schema says."""
    answer = json.loads(text)
    checked(answer, FILES[name])
    return answer
