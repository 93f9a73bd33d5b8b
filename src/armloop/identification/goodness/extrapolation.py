"""Extrapolation: the part of a motion beyond what a model was fitted on, where nothing has tested its terms."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from armloop.data.motion import Motion
from armloop.model import ReconstructedModel
from armloop.robot.arm import Arm
from armloop.util.arrays import Array, Mask

#: How far beyond its range, in parts of it, a quantity still counts as inside: ranges leave out the rarest samples.
_MARGIN = 0.05
#: Torques that change by less than this part do not depend on what was changed, but for rounding and a base that is level to
#: a ten-thousandth.
_NOTHING = 1e-4
#: Part of a motion that is worth a word.
WORTH_A_WORD = 0.02


def trained_range(model: ReconstructedModel) -> Array | None:
    """(4, n) half ranges of q, v and vdot and the centre of q of what a model was fitted on; None where it keeps none.

    Where nothing of the arm depends on the angle of its first joint, as about a vertical axis, or on the place of its first
    slide, the range of that is infinite: as good as trained everywhere.
    """
    kept = model.history.get("range")
    if kept is None:
        return None
    ranges = np.array(kept, dtype=float)
    half, speed, rate, centre = ranges
    rng, N = np.random.default_rng(0), 64
    q, v, vdot = rng.uniform(-1, 1, (3, N, len(half))) * np.stack([half, speed, rate])[:, None]
    motion = Motion(np.arange(float(N)), centre + q, v, vdot, np.arange(N))
    turned = motion.q.copy()
    turned[:, 0] += rng.uniform(-1, 1, N) * np.maximum(half[0], 1.0)
    here, there = (model.predict(replace(motion, q=q)) for q in (motion.q, turned))
    if np.abs(here - there).max() <= _NOTHING * np.abs(here).max():
        ranges[0, 0] = np.inf
    return ranges


def outside_trained_range(motion: Motion, ranges: Any) -> Array:
    """(n,) part of the samples in which a joint's q, v or vdot lies beyond what the model was fitted on.

    Args:
        ranges: half ranges of q, v and vdot, then the centre of q, (4, n), as the model's history keeps them;
            None where it keeps none, which counts as inside.
    """
    if ranges is None:
        return np.zeros(motion.joints)
    return np.asarray(_outside(motion, np.asarray(ranges, dtype=float)).any(axis=0).mean(axis=0))


def _outside(motion: Motion, ranges: Array) -> Mask:
    """(3, N, n) where q, v and vdot lie beyond their ranges."""
    return np.asarray(np.abs(_of_middle(motion, ranges)) > (1 + _MARGIN) * ranges[:3, None])


def _of_middle(motion: Motion, ranges: Array) -> Array:
    """(3, N, n) q from its middle, v and vdot."""
    return np.stack([motion.q - ranges[3], motion.v, motion.vdot])


def extrapolated(arm: Arm, motion: Motion, ranges: Any) -> list[str]:
    """A sentence for each joint of which so much lies beyond the range a model was fitted on that it is worth a word.

    Args:
        ranges: as in :func:`outside_trained_range`.
    """
    if ranges is None:
        return []
    ranges = np.asarray(ranges, dtype=float)
    shares = outside_trained_range(motion, ranges)
    outside = _outside(motion, ranges).mean(axis=1)
    sizes = np.abs(_of_middle(motion, ranges)).max(axis=1)
    words = []
    for j in np.flatnonzero(shares > WORTH_A_WORD):
        unit = arm.joints[j].position_unit
        most = int(np.argmax(outside[:, j]))
        what, per = (("position", ""), ("speed", "/s"), ("acceleration", "/s²"))[most]
        from_middle = " from the middle of its range" if most == 0 else ""
        words.append(
            f"joint {j + 1}: {shares[j]:.0%} of the motion lies outside the range the model was trained on (its {what} up "
            f"to {sizes[most, j]:.3g} {unit}{per}{from_middle}, trained up to {ranges[most, j]:.3g})"
        )
    return words
