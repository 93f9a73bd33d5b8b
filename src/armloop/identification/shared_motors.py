"""Standstill of a motor that two joints share: they slide, but not along the direction in which their motor turns.

What its dry friction then holds no motion determines, as of a joint at rest: of a parallel linkage that keeps its forearm
level, or of a wrist whose two joints turn against each other.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from armloop.data.creep import TRAVEL, may_stick
from armloop.data.motion import Samples
from armloop.laws.friction import Direction
from armloop.model import ReconstructedModel
from armloop.util.arrays import Array, Mask, stretches
from armloop.util.errors import ModelError
from armloop.util.functions import MATH

#: rad (m): half a joint's range, where nobody knows it.
_HALF = 1.0


def without_shared_standstill(
    samples: Samples, model: ReconstructedModel, least: Array | None = None
) -> Samples:
    """The samples, of which those do not count as moving in which a joint slides while a motor that it shares stands still.

    Args:
        least: (n,) dry friction, N·m (N), of such a motor on each joint that is worth it; any by default.
    """
    shared = _shared(model)
    if not shared:
        return samples
    moving = samples.moving
    for along, level in shared:
        on_joints = [0.0] * model.arm.n
        along.add(on_joints, level)
        held = np.abs(on_joints) > (0.0 if least is None else least)
        moving = moving & ~(_stands_still(along, model, samples)[:, None] & held)
    return replace(samples, moving=moving)


def sharing(model: ReconstructedModel, joint: int) -> list[int]:
    """Joints (0-based) that share a motor that rubs with a joint."""
    pairs = [(along.joint, along.other) for along, level in _shared(model) if level > 0]
    return [a + b - joint for a, b in pairs if joint in (a, b)]


def _shared(model: ReconstructedModel) -> list[tuple[Direction, float]]:
    """Directions that two joints share, with the level of dry friction along each; none of a model that is no law."""
    if not any(added.effect.other_joint for added in model.effects):
        return []
    # what refuses a command for want of a file comes by here, and has no need of it
    from armloop.dynamics import ModelEquations

    try:
        equations = ModelEquations(model, MATH, sharp=True)
    except ModelError:  # an effect of one's own that is no law of the state
        return []
    creep = [float(x) for x in may_stick(np.full(model.arm.n, np.inf))]
    found = equations.dry_and_smooth([0.0] * model.arm.n, creep)
    return [(along, abs(float(level))) for along, level, _ in found if along.ratio]


def _stands_still(along: Direction, model: ReconstructedModel, samples: Samples) -> Mask:
    """(N,) samples in which next to nothing turns along a direction, or within the filter's reach of such."""
    from armloop.data.blocks import widened

    motion, how, n = samples.motion, model.conditioning, model.arm.n
    half, fastest = np.asarray(
        model.history.get("range") or [np.full(n, _HALF), np.full(n, np.inf)], dtype=float
    )[:2]
    noise = np.resize(np.asarray(model.history.get("velocity_noise") or 0.0, dtype=float), n)
    shares = np.zeros(n)
    shares[along.joint], shares[along.other] = 1.0, abs(along.ratio)
    least = max(shares @ may_stick(fastest), how.dead_zone * float(np.hypot.reduce(shares * noise)))
    position, speed = along.of(motion.q.T), along.of(motion.v.T)
    still = np.abs(speed) <= least
    turned = speed[1:] * speed[:-1] < 0  # between two samples, however fast
    still[1:] |= turned
    still[:-1] |= turned
    for run in motion.runs():
        for first, end in (stretches(~still[run]) + run.start).tolist():
            still[first:end] |= np.ptp(position[first:end]) < TRAVEL * (shares @ half)
    reach = round(samples.reach / samples.period)
    return widened(still[:, None], motion, reach)[:, 0]
