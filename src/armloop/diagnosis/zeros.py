"""Best linear unbiased prediction of a log's encoder zeros, robustly, before a run is judged.

Where the zeros differed among a model's training logs (:mod:`armloop.identification.reconstruction.encoder_zeros`), a new
log has zeros of its own, from the same distribution. They are nuisance parameters: nothing that has changed. A joint
whose zero lies outside of that distribution keeps it, and the search finds an encoder offset.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from armloop.data.filters import INDEPENDENT
from armloop.data.log import MotionLog
from armloop.data.signals import ShortRunError, preprocess
from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.judgement import SIGNIFICANCE
from armloop.laws.effects import effect
from armloop.model import ReconstructedModel
from armloop.regression.embedded import ITERATIONS
from armloop.util.arrays import Array

#: Degrees of freedom of Student's t, by which samples that an event or an effect moves weigh less.
_FREEDOM = 4.0


def spread(model: ReconstructedModel) -> Array:
    """(n,) standard deviation of the training logs' encoder zeros, rad (m); zeros where they did not differ."""
    kept = model.history.get("encoder_zeros")
    return np.zeros(model.arm.n) if not kept else np.asarray(kept["spread"], dtype=float)


def settled(model: ReconstructedModel, logs: Sequence[MotionLog]) -> tuple[list[MotionLog], Array]:
    """Logs as encoders with the model's zeros would have recorded them, and (L, n) the zeros taken off, rad (m)."""
    usual = spread(model)
    zeros: Array = np.zeros((len(logs), model.arm.n))
    if usual.any():
        zeros = np.stack([_zeros(model, log, usual) for log in logs])
    pairs = zip(logs, zeros, strict=True)
    return [replace(log, q=log.q - zero) if zero.any() else log for log, zero in pairs], zeros


def sentences(model: ReconstructedModel, logs: Sequence[str], zeros: Array) -> list[str]:
    """What was taken off, a sentence a log."""
    found = []
    for name, zero in zip(logs, zeros, strict=True):
        pairs = zip(zero, model.arm.joints, strict=True)
        words = [f"joint {j} {x:+.3f} {joint.position_unit}" for j, (x, joint) in enumerate(pairs, 1) if x]
        if words:
            found.append(
                f"{name}: the encoder zeros of this log, {', '.join(words)}, were regressed and taken off first; the "
                "training logs' differ by as much"
            )
    return found


def _zeros(model: ReconstructedModel, log: MotionLog, usual: Array) -> Array:
    """(n,) zeros of one log; zero for joints that have none of their own, or another altogether."""
    try:
        samples = preprocess([log], model.conditioning)
    except ShortRunError:
        return np.zeros(model.arm.n)
    evidence = Evidence.of(model, samples, [])
    rows = evidence.rows
    left = (evidence.residual([]) / evidence.scale)[rows]
    slopes = np.stack(
        [
            (effect("encoder_offset", j + 1).columns(evidence.context, 0.0)[:, :, 0] / evidence.scale)[rows]
            for j in range(model.arm.n)
        ],
        axis=1,
    )
    own, zeros = usual > 0, np.zeros(model.arm.n)
    # one that was changed is regressed beside the others, so that they do not stand in for it
    zeros[own] = predicted(slopes[:, own], left, usual[own], INDEPENDENT)
    return np.where(np.abs(zeros) > SIGNIFICANCE * usual, 0.0, zeros)


def predicted(X: Array, y: Array, spreads: Array, memory: float) -> Array:
    """(p,) posterior mode of normal effects in noise of Student's t, of unit scale, by reweighting.

    Args:
        memory: so many rows tell no more than one does: of samples, those that lie in a period of the filter's corner.
    """
    weight: Array = np.ones(len(y))
    x: Array = np.zeros(X.shape[1])
    for _ in range(ITERATIONS):
        G = (X.T * weight) @ X / memory + np.diag(1 / spreads**2)
        x = np.asarray(np.linalg.solve(G, (X.T * weight) @ y / memory))
        weight = np.asarray((_FREEDOM + 1) / (_FREEDOM + (y - X @ x) ** 2))
    return np.asarray(x)
