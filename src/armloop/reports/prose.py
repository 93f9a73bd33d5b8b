"""Prose of the reports: named blocks of text templates, in which a run's values are filled in."""

from __future__ import annotations

import re
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from armloop.reports.words import counted, listed, number, numbers, percent, place, unit

_TEMPLATES = Environment(
    loader=PackageLoader("armloop.reports"), undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
)
_TEMPLATES.filters |= {f.__name__: f for f in (counted, listed, number, numbers, percent, place, unit)}


class Prose:
    """The blocks of ``templates/NAME.txt`` with these values; a blank line ends a paragraph, a line end is a blank."""

    def __init__(self, name: str, /, **values: object) -> None:
        self._template = _TEMPLATES.get_template(f"{name}.txt")
        self._values: dict[str, Any] = values

    def __getitem__(self, block: str) -> str:
        """A block as one paragraph."""
        return " ".join(self.paragraphs(block))

    def paragraphs(self, block: str) -> list[str]:
        """A block's paragraphs; none where its conditions leave nothing to say."""
        text = "".join(self._template.blocks[block](self._template.new_context(self._values)))
        # not \s: the narrow blanks within large numbers stay
        return [re.sub("[ \n]+", " ", part) for part in re.split("\n[ \n]*\n", text.strip(" \n")) if part]
