"""Innovations: what of a residual a model's noise, its dry friction and its timing cannot account for.

Two kinds of ignorance are kept apart. Noise, and errors that grow with the motion, have a variance: the innovation is
measured in it. Dry friction has a bound: at rest it may hold anything within its level, and near rest its level is
known only in part; what lies within that is none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from armloop.data.creep import CREEPING, STICKING
from armloop.data.motion import Motion, Samples
from armloop.data.signals import smooth
from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.judgement import NEARLY, SIGNIFICANCE
from armloop.dynamics import Dynamics, ModelEquations
from armloop.identification.scoring import too_slow
from armloop.identification.standstill import at_rest, fastest, sticking
from armloop.laws.friction import Direction
from armloop.model import AddedEffect, ReconstructedModel
from armloop.util.arrays import PER_MEDIAN, Array, Mask
from armloop.util.errors import ModelError
from armloop.util.functions import NUMPY

#: Seconds over which a residual is averaged before its size is taken: what oscillates faster is no event.
WINDOW = 0.2
#: Dry friction of a joint that creeps is known but for what may, by chance, be left there as on the model's training
#: logs, at most, and where nobody knows that, or slower than it slid in them, but for this part …
_UNSURE = 0.8
#: … and at rest it can hold this many times its sliding level.
_STICTION = 1.2


def innovations(evidence: Evidence, residual: Array, known: Sequence[AddedEffect] = ()) -> tuple[Array, Mask]:
    """(N, n) signed innovations in standard deviations, and (N, n) whether a joint rests.

    Args:
        residual: (N, n) what the model, with the effects found so far, leaves; N·m (N).
        known: the effects found so far; what they rub, a joint at rest may hold, too.
    """
    samples, model = evidence.samples, evidence.model
    motion = samples.motion
    rest = at_rest(samples, model)
    # Where sliding takes more than the model says, so does sticking.
    sliding_more = [
        float(np.median((np.sign(motion.v[:, j]) * residual[:, j])[evidence.rows[:, j]]))
        if evidence.rows[:, j].any()
        else 0.0
        for j in range(motion.joints)
    ]
    more = np.abs(sliding_more)
    dry = dry_level(evidence, known) + more
    speeds = fastest(model)
    slow = np.where(np.isfinite(speeds), CREEPING * speeds, STICKING)
    left = [np.inf if x is None else x for x in model.baseline.get("creeping") or [None]]
    creeping = np.minimum(SIGNIFICANCE * np.array(left) + more, _UNSURE * dry)
    creeping = creeping * np.exp(-((motion.v / np.maximum(slow, 1e-9)) ** 2))
    creeping = np.where(too_slow(model, samples), _UNSURE * dry, creeping)
    creeping = creeping + shared_dry(evidence, known, slow)
    # The filter averages what friction may hold with what it may not: a joint that turns round fast rests but a moment.
    unsure = np.maximum(smooth(samples, np.where(rest, dry, creeping)), 0.0)
    # Of a joint at rest the model's friction follows the noise of its speed: what is left without it counts, too.
    friction = model.friction.torque(motion, load=evidence.context.load)
    for added in (a for a in known if a.effect.rubs):
        friction = friction + added.torque(evidence.context)
    bare = residual + smooth(samples, friction)
    size = np.abs(residual) - unsure
    size = np.maximum(np.where(rest, np.minimum(size, np.abs(bare) - stiction(model) * unsure), size), 0.0)
    if evidence.unknown is not None:
        size = np.where(evidence.unknown, 0.0, size)
    sign = np.sign(np.where(rest, bare, residual))
    return sign * size / deviations(evidence, residual), rest


def stiction(model: ReconstructedModel) -> Array:
    """(n,) how many times its sliding level a joint at rest can hold: more, where it never crept in its training."""
    slowest = np.asarray(model.history.get("slowest") or 0.0)
    return np.where(slowest > CREEPING * fastest(model), 1 + _UNSURE, _STICTION)


def averaged(samples: Samples, values: Array) -> Array:
    """(N, ...) running means over :data:`WINDOW`, run by run: what a push adds stays, what oscillates goes."""
    width = max(1, round(WINDOW / samples.period))
    return np.concatenate([uniform_filter1d(values[run], width, axis=0) for run in samples.motion.runs()])


def deviations(evidence: Evidence, residual: Array) -> Array:
    """(N, n) standard deviation of the averaged residual, N·m (N).

    The baseline's, at least what the run's own noise leaves in an average: the sensor may have become a noisier one.
    Where a model contradicts itself, it is unsure by as much, and of what effects found since supply by a part of it: no
    law is met exactly.
    """
    model, motion = evidence.model, evidence.samples.motion
    predicted = evidence.context.predicted
    own = np.broadcast_to(evidence.scale, motion.q.shape)
    rough = np.abs(residual - averaged(evidence.samples, residual))
    noise = [
        PER_MEDIAN * float(np.median(rough[rows, j])) if (rows := evidence.rows[:, j]).any() else 0.0
        for j in range(motion.joints)
    ]
    if evidence.samples.cutoff_hz > 0:
        # An average holds so many independent values.
        own = np.maximum(own, np.array(noise) / np.sqrt(max(WINDOW / evidence.samples.reach, 1.0)))
    tau = smooth(evidence.samples, model.predict(motion) if predicted is None else predicted)
    rate = np.zeros_like(tau)
    for run in motion.runs():
        if run.stop - run.start > 2:
            rate[run] = np.gradient(tau[run], motion.time[run], axis=0)
    late = 0.5 * evidence.samples.period * rate  # torque and motion of a sample may be half a period apart
    supplied = NEARLY * (evidence.residual([]) - residual) ** 2
    return np.asarray(
        np.sqrt(np.maximum(own, 1e-12) ** 2 + late**2 + contradiction(model, motion) ** 2 + supplied)
    )


def contradiction(model: ReconstructedModel, motion: Motion) -> Array:
    """(N, n) skew part of M(q) times vdot, N·m (N): what sparse terms, found joint by joint, are surely wrong by.

    Zero for rigid bodies and energies, whose M(q) is symmetric, and where terms are not linear in the acceleration.
    """
    try:
        M = Dynamics(model).mass_matrix(motion.q)
    except ModelError:
        return np.zeros_like(motion.q)
    return np.einsum("kij,kj->ki", (M - M.transpose(0, 2, 1)) / 2, motion.vdot)


def dry_level(evidence: Evidence, known: Sequence[AddedEffect] = ()) -> Array:
    """(N, n) dry friction of the model and of known effects at creeping speed, along all directions that a joint is part of.

    Of a direction that fades in with the speed, all: what a joint at rest may hold is the level that it fades in to.
    """
    each = [_on_joints(along, level, evidence) for along, level in _dry(evidence, known)]
    return np.asarray(np.sum(each, axis=0))


def _dry(evidence: Evidence, known: Sequence[AddedEffect]) -> list[tuple[Direction, Array]]:
    """(N,) level of dry friction at creeping speed along each direction."""
    motion, model = evidence.samples.motion, evidence.model
    try:
        rubbing = ModelEquations(model.with_effects(known), NUMPY, sharp=True)
    except ModelError:  # an effect of one's own that is no law of the state
        rubbing = ModelEquations(replace(model, effects=()), NUMPY, sharp=True)
    creep = list(np.broadcast_to(sticking(model), motion.v.shape).T)
    load = np.zeros_like(motion.v) if evidence.context.load is None else evidence.context.load
    found = rubbing.dry_and_smooth(list(motion.q.T), creep, list(load.T), motion.elapsed)
    return [(along, np.abs(level) + np.zeros(len(motion.v))) for along, level, _ in found]


def _on_joints(along: Direction, level: Array, evidence: Evidence) -> Array:
    """(N, n) what the joints of a direction feel at most of dry friction (N,) along it."""
    each = [np.zeros_like(level) for _ in range(evidence.samples.motion.joints)]
    along.add(each, level)
    return np.abs(np.stack(each, axis=1))


def shared_dry(evidence: Evidence, known: Sequence[AddedEffect], slow: Array) -> Array:
    """(N, n) what joints that slide may hold of dry friction along a direction that two share and in which neither slides.

    Args:
        slow: (n,) speed of each joint below which it creeps, rad/s (m/s).
    """
    v, held = evidence.samples.motion.v, np.zeros_like(evidence.samples.motion.v)
    for along, level in _dry(evidence, known):
        if along.ratio:
            creep = max(slow[along.joint] + abs(along.ratio) * slow[along.other], 1e-9)
            held += _on_joints(along, level * np.exp(-((along.of(v.T) / creep) ** 2)), evidence)
    return held
