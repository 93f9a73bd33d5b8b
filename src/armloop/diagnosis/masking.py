"""Confounding with the model's own errors: effects that are plain in a run, but no larger than what the model may err by.

Friction that differs from log to log is one of these errors. What it would explain is no reason to name a law that comes
near it: such a law must explain something beside it.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import Protocol, TypeVar

from armloop.diagnosis.fit import Fit, deviate
from armloop.diagnosis.judgement import SIGNIFICANCE
from armloop.laws.effects import Effect
from armloop.model import AddedEffect


class _Found(Protocol):
    @property
    def effect(self) -> Effect: ...


F = TypeVar("F", bound=_Found)


def masked(fit: Fit, found: Sequence[F], unclear: Collection[Effect]) -> list[tuple[F, AddedEffect]]:
    """Those of the effects found, with their parameters, that are unclear only as the model itself errs by as much.

    Where all that an effect is of is clear together, a part of it is there that another law is by itself: the model errs by
    less than that.

    Args:
        fit: all that was found.
        unclear: effects of it that are not stated: not clear of their stated errors, or worth nothing.
    """
    every = zip(found, fit.added(), fit.clear, fit.shown, fit.wald, strict=True)
    return [
        (f, added)
        for f, added, clear, shown, wald in every
        if f.effect in unclear and max(clear, deviate(*wald)) < SIGNIFICANCE <= shown
    ]


def stand_in(
    found: Sequence[F], before: Sequence[F], masking: Sequence[F], gained: Callable[[list[F], F], float]
) -> F | None:
    """An effect that is found without the masked ones, was not found before, and gains nothing beside them; None if none.

    Args:
        gained: the log posterior odds of an effect beside others.
    """
    if not masking:
        return None
    known = {f.effect.place for f in before}
    for f in found:
        others = [*masking, *(other for other in found if other is not f)]
        if f.effect.place not in known and gained(others, f) <= 0:
            return f
    return None
