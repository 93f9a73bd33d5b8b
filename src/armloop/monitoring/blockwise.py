"""CUSUM monitoring, sample by sample: block sums, a null learned from healthy blocks, cumulative sums beyond it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from armloop.data.motion import Motion, Samples
from armloop.model import AddedEffect, ReconstructedModel
from armloop.monitoring.catalogue import Column, catalogue
from armloop.monitoring.naming import Normal, name_change
from armloop.monitoring.sums import joint_sums, residual_scale
from armloop.util.arrays import Array, Mask

#: What a cumulative sum lets pass per block, and where it alarms, in units of the largest healthy score: a lasting
#: score half as large again as everything healthy alarms after a dozen blocks, one four times as large after one.
ALLOWANCE, LIMIT = 1.25, 2.75
#: Blocks of a change before it is named, how often in a row the same effect has to be named, and when one that cannot be
#: named is given up; later, what was named is estimated again whenever the window has doubled, up to the longest.
_FEWEST, _AGREE, _GIVE_UP, _LONGEST = 6, 3, 60, 96
#: Blocks before the alarm that the change may have begun in.
_BACK = 16


@dataclass(frozen=True, eq=False)
class BlockSums:
    """Sums of one block: gram (p, p), moment (p,), energy of the residual; and when the block begins, s."""

    gram: Array
    moment: Array
    energy: float
    begin: float


@dataclass(frozen=True, eq=False)
class Known:
    """What was named: revision 0 is nothing; each further one replaces the one before.

    Attributes:
        revision: number.
        effects: with parameters, as a model takes them.
        since: begin of the block in which the change began, s.
    """

    revision: int = 0
    effects: tuple[AddedEffect, ...] = ()
    since: float = float("nan")


@dataclass(frozen=True, eq=False)
class Watch:
    """State of a watch after some blocks; :func:`advance` gives the next one.

    Attributes:
        healthy: blocks learned from, until there are enough; then empty.
        null: (p,) healthy coefficients; limit: (p,) largest healthy score; normal: healthy normal equations.
        sums: (2, p) cumulative sums, upward and downward; begun: (2, p) block at which each was last zero.
        window: blocks since the change, or the last few.
        alarmed: number of blocks seen at the alarm; 0 before it.
        agreed: (place, how often in a row).
        known: what was named.
        blocks: number of blocks seen.
    """

    healthy: tuple[BlockSums, ...] = ()
    null: Array | None = None
    limit: Array | None = None
    normal: Normal | None = None
    sums: Array | None = None
    begun: Array | None = None
    window: tuple[BlockSums, ...] = ()
    alarmed: int = 0
    agreed: tuple[object, int] = (None, 0)
    known: Known = Known()
    blocks: int = 0

    @property
    def score(self) -> Array | None:
        """(p,) the larger cumulative sum of each column as a part of the limit; None while learning."""
        return None if self.sums is None else self.sums.max(axis=0) / LIMIT


def block_sums(
    model: ReconstructedModel, motion: Motion, tau: Array, slides: Mask
) -> tuple[tuple[Column, ...], BlockSums]:
    """Sums of one block of samples.

    Args:
        tau: (N, n) measured torque; slides: (N, n) samples of each joint that count.
    """
    period = float(np.median(np.diff(motion.time)))
    samples = Samples(motion, tau, slides, period)
    known = catalogue(model, samples, np.arange(motion.samples))
    scale = residual_scale(model)
    predicted = known.predicted if not model.effects else model.predict(motion)
    u = (tau - predicted) / scale * slides
    gram, moment = joint_sums(known.values / scale[:, None], u, slides)
    return known.columns, BlockSums(gram, moment, float((u**2).sum()), float(motion.time[0]))


def advance(
    model: ReconstructedModel, columns: tuple[Column, ...], watch: Watch, block: BlockSums, learn: int
) -> Watch:
    """Take one more block; the first ``learn`` ones are known to be healthy."""
    watch = replace(watch, blocks=watch.blocks + 1)
    if watch.null is None:
        healthy = (*watch.healthy, block)
        return replace(watch, healthy=healthy) if len(healthy) < learn else _learned(watch, healthy)
    assert watch.limit is not None and watch.sums is not None and watch.begun is not None
    score = _score(block, watch.null) / watch.limit
    sums = np.maximum(watch.sums + np.stack([score, -score]) - ALLOWANCE, 0.0)
    sums = np.where(np.diag(block.gram) > 0, sums, watch.sums)
    begun = np.where(sums > 0, watch.begun, watch.blocks)
    watch = replace(watch, sums=sums, begun=begun)
    if not watch.alarmed:
        window = (*watch.window, block)[-_BACK:]
        if sums.max(initial=0.0) < LIMIT:
            return replace(watch, window=window)
        since = watch.blocks - int(begun.flat[np.argmax(sums)])
        return replace(watch, alarmed=watch.blocks, window=window[-max(since, 1) :])
    return _name(model, columns, replace(watch, window=(*watch.window, block)[-_LONGEST:]))


def _score(block: BlockSums, null: Array) -> Array:
    size = np.diag(block.gram)
    return (block.moment - null * size) / np.sqrt(np.where(size > 0, size, 1.0))


def _learned(watch: Watch, healthy: tuple[BlockSums, ...]) -> Watch:
    normal = _normal(healthy)
    whole = np.einsum("bpp->p", normal.gram)
    null = np.where(whole > 0, normal.moment.sum(axis=0) / np.where(whole > 0, whole, 1.0), 0.0)
    largest = np.max(np.abs([_score(block, null) for block in healthy]), axis=0)
    # what did not show in the healthy blocks has no null: it cannot alarm
    limit = np.where((whole > 0) & (largest > 0), largest, np.inf)
    return replace(
        watch,
        healthy=(),
        null=null,
        limit=limit,
        normal=normal,
        sums=np.zeros((2, len(null))),
        begun=np.full((2, len(null)), watch.blocks),
    )


def _normal(blocks: Sequence[BlockSums]) -> Normal:
    gram, moment, energy = zip(*((b.gram, b.moment, b.energy) for b in blocks), strict=True)
    return Normal(np.array(gram), np.array(moment), np.array(energy))


def _name(model: ReconstructedModel, columns: tuple[Column, ...], watch: Watch) -> Watch:
    """Name what the window shows: at first when it agrees with itself, later whenever the window has doubled."""
    length, known = len(watch.window), watch.known
    since = watch.blocks - watch.alarmed
    if known.revision == 0:
        due = length >= _FEWEST
    else:
        due = since <= _LONGEST and length in (2 * _FEWEST, 4 * _FEWEST, 8 * _FEWEST, _LONGEST)
    if not due:
        return watch
    named = name_change(model.arm, columns, watch.normal, _normal(watch.window))
    place = named[0].place if named else None
    if known.revision == 0:
        often = watch.agreed[1] + 1 if place is not None and place == watch.agreed[0] else 1
        watch = replace(watch, agreed=(place, often))
        if place is None or often < _AGREE:
            if since > _GIVE_UP:
                return replace(
                    watch, alarmed=0, sums=np.zeros((2, len(columns))), agreed=(None, 0), window=()
                )
            return watch
    if not named:
        return watch
    effects = tuple(AddedEffect(Column(*one.place, 0).effect, one.parameters) for one in named)
    began = known.since if known.revision else watch.window[0].begin
    return replace(watch, known=Known(known.revision + 1, effects, began))
