"""Confounding: why two effects can look alike on one motion, and which motion would tell them apart."""

from __future__ import annotations

from armloop.laws.effects import Effect
from armloop.laws.effects.listed import EFFECTS


def why_alike(found: Effect, rival: Effect) -> str:
    """A sentence for the ``alternatives`` of a diagnosis: what one says of the other, at the same joint."""
    listed = _said(found, rival)
    if listed and _meet(found, rival):
        return listed
    return (
        f"on this motion {rival.label()} explains held-out data nearly as well as {found.label()}; a run over other "
        "postures and speeds may tell them apart: armloop diagnose --next-run designs one"
    )


def _said(found: Effect, rival: Effect) -> str | None:
    """What either says of the other, or else of what that looks like."""
    own = found.alike.get(rival.name) or rival.alike.get(found.name)
    if own:
        return own
    stand_ins = [EFFECTS.get(effect.looks_like, type(effect)) for effect in (found, rival)]
    return stand_ins[0].alike.get(stand_ins[1].name) or stand_ins[1].alike.get(stand_ins[0].name)


def _meet(found: Effect, rival: Effect) -> bool:
    """Whether the sentence is about one joint, or about effects of the whole arm."""
    return found.joint is None or rival.joint is None or found.joint == rival.joint
