"""What to do about a sensor at fault, in words: the record is to be mended, not the arm, nor the feedforward."""

from __future__ import annotations

from armloop.model import AddedEffect


def remedy(added: AddedEffect) -> str:
    """A sentence or two on what a controller's owner should do; empty for what acts on the arm itself."""
    return added.effect.remedy(added.parameters)
