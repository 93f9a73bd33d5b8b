"""Random effects of a run's friction, marginalised by generalised least squares: what is there beside friction of the day.

Where a model's training logs differ in friction, as where drives warm up, a run's residual is weighed by that, and effects
below it are not seen. Friction of the day has a shape, though: a dry level and a viscous coefficient of each joint, of a
covariance that the logs tell. Here every hypothesis is asked beside it: rows are whitened by the covariance of a mixed
model, 1 + Z Z' (Aitken's generalised least squares), and weighed by what the model leaves of a log that it knows. Whitened
rows are uncorrelated, so that a fold judges as before; of what it holds the others have these two numbers a joint alone. Of
whatever looks at the residual itself the friction is taken off first, by its best linear unbiased prediction (Henderson,
Biometrics 31, 1975), beside what was found.

Friction that changed is found in the direction in which it does not differ: dry friction where drives that warm up differ by
viscous friction. In the other direction only the first weighing tells whether it is more than what differs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from armloop.diagnosis.evidence import Evidence, Whitening
from armloop.diagnosis.verdict import Diagnosis
from armloop.diagnosis.zeros import predicted
from armloop.identification.uncertainty import friction_directions
from armloop.laws.effects import Effect, effect
from armloop.laws.effects.base import Estimate
from armloop.model import AddedEffect, ReconstructedModel

#: Friction of the day is asked for where it is this part of a joint's baseline or more.
_FELT = 0.5
#: What it is of, as the columns of what friction differs by.
_KINDS = ("coulomb_friction", "viscous_friction")
#: What is said of a verdict beside it.
_SAID = (
    "Friction that differs from log to log is much of the baseline and would hide some of this: it was judged beside the "
    "run's own dry and viscous friction, as far as that is within what differs, without which residuals are stated, and by "
    "what the model leaves of logs that it knows"
)


def of_the_day(
    whole: Evidence, known: Sequence[AddedEffect] = ()
) -> tuple[Evidence, list[AddedEffect]] | None:
    """The run beside its own friction, and that; None where friction does not differ between the training logs by much.

    Args:
        whole: the run, weighed by what friction differs by.
        known: what was found beside it.
    """
    model = whole.model
    if model.uncertainty.get("between_logs_known") != "different":
        return None
    alone = replace(model, uncertainty={**model.uncertainty, "between_logs": None})
    bare = Evidence.of(alone, whole.samples, list(whole.asked))
    between = np.sqrt(np.maximum(whole.scale**2 - bare.scale**2, 0.0))
    if not (between > _FELT * whole.scale).any():
        return None
    directions, roots = friction_directions(model, whole.samples)
    residual, added = bare.left_by(alone.with_effects(known)), list[AddedEffect]()
    columns = np.einsum("njk,jkl->njl", directions, roots)
    taken, memories = np.zeros_like(residual), np.ones(model.arm.n)
    for j in range(model.arm.n):
        rows = np.flatnonzero(bare.rows[:, j])
        if not roots[j].any() or not len(rows):
            continue
        memories[j] = _memory(bare, j)
        Z, y = (x[rows, j] / bare.scale[j] for x in (columns, residual))
        own = predicted(Z, y, np.ones(2), memories[j])
        taken[:, j] = columns[:, j] @ own
        pairs = zip(_KINDS, (roots[j] @ own).tolist(), strict=True)
        added += [_friction(name, j + 1, value) for name, value in pairs]
    day = Evidence.of(alone.with_effects(added), whole.samples, list(whole.asked))
    return replace(day, whitening=Whitening(columns, memories, taken, added)), added


def of_that_day(model: ReconstructedModel, found: Diagnosis, friction: Sequence[AddedEffect]) -> Diagnosis:
    """A verdict beside the friction of the day, with a sentence on that, and of the model without it.

    Args:
        model: as it was made.
        friction: what :func:`of_the_day` took off.
    """
    effects = tuple(added for added in found.model.effects if not any(added is one for one in friction))
    standing = replace(found.standing, reasons=[_SAID, *found.standing.reasons])
    return replace(found, model=replace(model, effects=effects), standing=standing)


def of_no_other_day(found: Diagnosis, whole: Evidence, day: Evidence) -> Diagnosis:
    """A verdict beside which friction of the day tells no more, with a sentence on what its baseline is made of.

    Args:
        whole, day: the run, weighed with what friction differs by and without.
    """
    parts = ", ".join(f"{100 * part:.0f}" for part in day.scale / whole.scale)
    said = (
        "The baseline holds by how much friction differs between the training logs; without that it would be, joint by "
        f"joint, {parts} % of it. Beside the run's own dry and viscous friction nothing more was found"
    )
    return replace(found, standing=replace(found.standing, reasons=[*found.standing.reasons, said]))


def says_more(found: Diagnosis, other: Diagnosis) -> bool:
    """Whether a verdict beside the friction of the day is taken in the place of the other.

    It must name something, and no more than what is listed. What friction hid is then told, or told better; but friction
    that is more than what differs is named by the other alone, and an event that is seen without is told as it was.
    """
    if found.verdict != "effects_found" or found.laws:
        return False
    mine, others = ({_cause(one.effect) for one in each.outcome.found} for each in (found, other))
    if mine != others:
        return bool(mine - others)
    same = {one.effect.place for one in found.outcome.found} == {
        one.effect.place for one in other.outcome.found
    }
    return same and not other.contacts and bool(found.contacts or mine)


def _cause(one: Effect) -> tuple[object, ...]:
    """What an effect is of: a body is one whether it is there all the while or comes and goes."""
    return ("a body",) if one.name in ("payload", "carried_load") else one.place


def _friction(name: str, joint: int, value: float) -> AddedEffect:
    kind = effect(name, joint)
    return AddedEffect(kind, {parameter.name: Estimate(value, 0.0, "") for parameter in kind.parameters})


def _memory(evidence: Evidence, j: int) -> float:
    """How many of a joint's rows that count say as much as one: its residual remembers so many."""
    joints = evidence.model.baseline.get("joints") or []
    seconds = (joints[j].get("correlation_time") if j < len(joints) else None) or 0.0
    time = evidence.samples.motion.time[evidence.rows[:, j]]
    period = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    return max(1.0, seconds / period) if period > 0 else 1.0
