"""CUSUM monitoring, sample by sample: block sums, a null learned from healthy blocks, cumulative sums beyond it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armloop.data.motion import Motion, Samples
from armloop.model import AddedEffect, ReconstructedModel
from armloop.monitoring.catalogue import Column, catalogue
from armloop.monitoring.naming import Normal, name_change
from armloop.monitoring.sums import joint_sums, residual_scale
from armloop.util.arrays import Array

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
        up, down: (p,) cumulative sums; begun: (2, p) block at which each was last zero.
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
    up: Array | None = None
    down: Array | None = None
    begun: Array | None = None
    window: tuple[BlockSums, ...] = ()
    alarmed: int = 0
    agreed: tuple[object, int] = (None, 0)
    known: Known = Known()
    blocks: int = 0

    @property
    def score(self) -> Array | None:
        """(p,) the larger cumulative sum of each column as a part of the limit; None while learning."""
        if self.up is None or self.down is None:
            return None
        return np.maximum(self.up, self.down) / LIMIT


def block_sums(
    model: ReconstructedModel, motion: Motion, tau: Array, slides: NDArray[np.bool_]
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
    assert (
        watch.limit is not None
        and watch.up is not None
        and watch.down is not None
        and watch.begun is not None
    )
    size = np.diag(block.gram)
    score = _score(block, watch.null) / watch.limit
    up = np.maximum(watch.up + score - ALLOWANCE, 0.0)
    down = np.maximum(watch.down - score - ALLOWANCE, 0.0)
    up, down = (np.where(size > 0, new, old) for new, old in ((up, watch.up), (down, watch.down)))
    begun = np.where(np.stack([up, down]) > 0, watch.begun, watch.blocks)
    watch = replace(watch, up=up, down=down, begun=begun)
    if not watch.alarmed:
        window = (*watch.window, block)[-_BACK:]
        over = np.argwhere(np.stack([up, down]) >= LIMIT)
        if not len(over):
            return replace(watch, window=window)
        side, column = max(over.tolist(), key=lambda at: float(np.stack([up, down])[at[0], at[1]]))
        since = watch.blocks - int(begun[side, column])
        return replace(watch, alarmed=watch.blocks, window=window[-max(since, 1) :])
    return _name(model, columns, replace(watch, window=(*watch.window, block)[-_LONGEST:]))


def _score(block: BlockSums, null: Array) -> Array:
    size = np.diag(block.gram)
    return (block.moment - null * size) / np.sqrt(np.where(size > 0, size, 1.0))


def _learned(watch: Watch, healthy: tuple[BlockSums, ...]) -> Watch:
    gram = np.array([block.gram for block in healthy])
    moment = np.array([block.moment for block in healthy])
    size = np.einsum("bpp->bp", gram)
    whole = size.sum(axis=0)
    null = np.where(whole > 0, moment.sum(axis=0) / np.where(whole > 0, whole, 1.0), 0.0)
    largest = np.max(np.abs([_score(block, null) for block in healthy]), axis=0)
    # what did not show in the healthy blocks has no null: it cannot alarm
    limit = np.where((whole > 0) & (largest > 0), largest, np.inf)
    zero = np.zeros(len(null))
    energy = np.array([block.energy for block in healthy])
    return replace(
        watch,
        healthy=(),
        null=null,
        limit=limit,
        normal=Normal(gram, moment, energy),
        up=zero,
        down=zero,
        begun=np.full((2, len(null)), watch.blocks),
    )


def _name(model: ReconstructedModel, columns: tuple[Column, ...], watch: Watch) -> Watch:
    """Name what the window shows: at first when it agrees with itself, later whenever the window has doubled."""
    length, known = len(watch.window), watch.known
    due = (
        length >= _FEWEST
        if known.revision == 0
        else length in (2 * _FEWEST, 4 * _FEWEST, 8 * _FEWEST, _LONGEST)
    )
    since = watch.blocks - watch.alarmed
    if known.revision and (not due or since > _LONGEST):
        return watch
    if not due:
        return watch
    window = Normal(
        np.array([block.gram for block in watch.window]),
        np.array([block.moment for block in watch.window]),
        np.array([block.energy for block in watch.window]),
    )
    named = name_change(model.arm, columns, watch.normal, window)
    place = named[0].place if named else None
    if known.revision == 0:
        often = watch.agreed[1] + 1 if place is not None and place == watch.agreed[0] else 1
        watch = replace(watch, agreed=(place, often))
        if place is None or often < _AGREE:
            if since > _GIVE_UP and watch.up is not None:
                zero = np.zeros_like(watch.up)
                return replace(watch, alarmed=0, up=zero, down=zero, agreed=(None, 0), window=())
            return watch
    if not named:
        return watch
    effects = tuple(AddedEffect(Column(*one.place, 0).effect, one.parameters) for one in named)
    began = known.since if known.revision else watch.window[0].begin
    return replace(watch, known=Known(known.revision + 1, effects, began))
