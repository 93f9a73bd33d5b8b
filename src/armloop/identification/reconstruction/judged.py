"""Goodness of fit of a reconstruction: the parts of the torque on held-out blocks, of logs in memory or streamed."""

from __future__ import annotations

from functools import partial

import numpy as np

from armloop.identification.goodness import Parts, parts_of, witness
from armloop.identification.goodness.features import Scales
from armloop.identification.goodness.witness import MOST, Witness
from armloop.identification.reconstruction.data import Chunk, Data
from armloop.identification.reconstruction.tally import Part
from armloop.identification.scoring import residual
from armloop.model import ReconstructedModel
from armloop.util.progress import Progress, paced, silent

#: Of streamed logs, so many chunks stand for all.
_CHUNKS = 16


def held_out_parts(
    model: ReconstructedModel, data: Data, part: Part = "all", progress: Progress = silent
) -> list[Parts]:
    """Parts of each joint's torque that a model explains, could explain, and cannot, on the held-out blocks.

    Args:
        model: one that has not been fitted on them.
        part: which of the held-out blocks.
    """
    data = data.sampled(_CHUNKS)
    scales = Scales.of(data.reference.samples.motion)
    most = max(1, MOST // len(data.parts))
    rows = data.sum(partial(_witness, model=model, part=part, scales=scales, most=most))
    return parts_of(rows, paced(progress))


def _witness(chunk: Chunk, model: ReconstructedModel, part: Part, scales: Scales, most: int) -> Witness:
    samples = chunk.samples
    load = model.joint_load(samples.motion)
    return witness(residual(model, samples), samples, load, np.asarray(chunk.judging(part)), scales, most)
