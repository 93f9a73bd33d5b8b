"""User-defined effects, beside the listed ones: installed as entry points, or registered in a session.

A package installs effects under the entry points ``armloop.effects``, each by its name (see ``docs/own_effect.md``):

    [project.entry-points."armloop.effects"]
    eddy_brake = "my_effects:EddyBrake"
"""

from __future__ import annotations

import inspect
from typing import Any, TypeVar

from armloop.laws.effects.base import Effect
from armloop.laws.effects.law import Law
from armloop.laws.effects.listed import EFFECTS
from armloop.util.errors import InputError
from armloop.util.registry import Registry, check_class

Kind = TypeVar("Kind", bound=type[Effect])


def _check(kind: Any, where: str) -> None:
    """Raise ``InputError`` unless ``kind`` is a complete effect."""
    check_class(kind, where, Effect, "armloop.laws.effects.Effect")
    # class attributes that a base class asks for and nobody has given
    asked = [pair for base in kind.__mro__ for pair in inspect.get_annotations(base).items()]
    missing = [key for key, hint in asked if "ClassVar" in str(hint) and not hasattr(kind, key)]
    missing += sorted(kind.__abstractmethods__)
    if not missing and not kind.parameters and kind.estimates is Effect.estimates:
        missing = ["parameters"]
    if not missing and issubclass(kind, Law) and not kind.elements and kind.values is Law.values:
        missing = ["elements"]
    if missing:
        raise InputError(f"{where}: {kind.__name__} lacks {', '.join(missing)}; define them in the class")
    if kind.name == "unlisted":
        raise InputError(f"{where}: the name {kind.name!r} is that of a listed effect; choose another")
    if kind.pair_wise and not kind.joint_wise:
        raise InputError(f"{where}: an effect of a pair of joints has one at its first: set joint_wise")


#: All effects by name.
REGISTRY: Registry[type[Effect]] = Registry("armloop.effects", "effect", EFFECTS, _check)


def register(kind: Kind) -> Kind:
    """Add an effect for the rest of this session, as in a notebook; usable as a decorator.

    Raises:
        InputError: it is no effect, is not complete, or its name is taken.
    """
    REGISTRY.register(kind)
    return kind
