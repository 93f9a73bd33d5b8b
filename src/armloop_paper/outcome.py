"""What an item of the reproduction comes to: the paper's figures, ours, and a section that says what agrees."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from armloop.reports.html import Section


@dataclass(frozen=True)
class Outcome:
    """One item, figures JSON-ready; raises ``ValueError`` when the paper's side and ours have different keys."""

    paper: dict[str, Any]  # None where the paper prints no number
    ours: dict[str, Any]
    verdict: str  # agrees, partly or differs; beyond where the paper has nothing to compare with
    headline: str  # ours against the paper's in one short line
    section: Section  # of the report; its text says what agrees, what does not and why
    details: dict[str, Any] = field(default_factory=dict)  # without a counterpart: spread, readings, errors

    def __post_init__(self) -> None:
        if _keys(self.paper) != _keys(self.ours):
            raise ValueError(f"{self.section.title}: the paper's side and ours have different keys")

    def to_dict(self) -> dict[str, Any]:
        """The item's object in ``reproduction.json``."""
        return {
            "paper": self.paper,
            "ours": self.ours,
            "verdict": self.verdict,
            "details": self.details,
        }


def beyond(ours: dict[str, Any], headline: str, section: Section) -> Outcome:
    """A study beyond the paper, whose side has the same keys and no numbers."""
    return Outcome(_keys(ours), ours, "beyond", headline, section)


def _keys(value: Any) -> Any:
    return {key: _keys(part) for key, part in value.items()} if isinstance(value, dict) else None
