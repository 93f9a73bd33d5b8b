"""Held-out blocks in the time of the logs, known before anything is filtered, chosen or fitted.

What chooses the filter must not see them either, and which samples a filter leaves depends on the filter: what lies in a
held-out block under any of those that may be chosen is left aside.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armloop.data.blocks import block_numbers
from armloop.data.motion import Motion
from armloop.data.pieces import LogSource
from armloop.data.signals import Conditioning, kept_instants
from armloop.identification.reconstruction.options import Options
from armloop.util.arrays import Array, Mask


def held_out_intervals(
    logs: Sequence[LogSource], filters: Sequence[Conditioning], options: Options
) -> list[Array]:
    """Per log, (B, 2) first and last instant, s, of the blocks that are held out under any of the filters.

    The blocks are those of :meth:`Chunk.of` on the logs conditioned one after the other.
    """
    found: list[Array] = []
    first = [0] * len(filters)
    for source in logs:
        log, own = source.read(), [np.zeros((0, 2))]
        for k, how in enumerate(filters):
            kept, spans = kept_instants(log, how)
            if not kept:
                continue
            time = np.concatenate(kept)
            starts = np.cumsum([0, *(len(part) for part in kept[:-1])])
            nothing = np.zeros((len(time), 0))
            motion = Motion(time, nothing, nothing, nothing, starts)
            blocks = first[k] + block_numbers(motion, options.block_seconds, spans)
            first[k] = int(blocks[-1]) + 1
            edges = np.flatnonzero(np.diff(blocks)) + 1
            begin, end = np.concatenate([[0], edges]), np.concatenate([edges - 1, [len(time) - 1]])
            held = blocks[begin] % options.folds == 0
            own.append(np.column_stack([time[begin[held]], time[end[held]]]))
        found.append(np.concatenate(own))
    return found


def within(time: Array, intervals: Array, margin: float) -> Mask:
    """(N,) instants that lie in one of the intervals (B, 2), or within ``margin`` seconds of it."""
    covered = np.zeros(len(time) + 1, dtype=np.intp)
    np.add.at(covered, np.searchsorted(time, intervals[:, 0] - margin), 1)
    np.add.at(covered, np.searchsorted(time, intervals[:, 1] + margin, side="right"), -1)
    return np.asarray(np.cumsum(covered)[:-1] > 0)
