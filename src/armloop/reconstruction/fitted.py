"""Which samples each regression of a reconstruction used: what standard errors have to know."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from armloop.model import ReconstructedModel
from armloop.reconstruction.data import Chunk, Data
from armloop.reconstruction.found import Found
from armloop.reconstruction.shared import sliding_rows
from armloop.reconstruction.sorter import Sorter
from armloop.signals import smooth
from armloop.uncertainty import Fitted, standard_errors


def uncertainty(model: ReconstructedModel, data: Data, found: Found, shared: bool) -> dict[str, Any]:
    """Standard errors of a model's coefficients.

    Of logs that are not kept in memory the even selection stands for all samples, and errors are those of a
    regression of it: too large rather than too small.

    Args:
        found: how the model was found.
        shared: whether its coefficients serve all joints.
    """
    samples = data.reference.samples
    if not data.in_memory:
        # a selection cannot be filtered; its columns are taken as they are
        samples = replace(samples, cutoff_hz=0.0)
    if model.effects:
        # taken as given, like the terms: their own errors stand beside their parameters
        bare = model.predict(samples.motion) - replace(model, effects=()).predict(samples.motion)
        samples = replace(samples, tau=samples.tau - smooth(samples, bare))
    return standard_errors(model, samples, fitted_rows(data, found, shared))


def fitted_rows(data: Data, found: Found, shared: bool) -> list[Fitted]:
    """The regressions in their order, with the samples of the reference that they used."""
    chunk = data.reference
    if shared:
        rows = sliding_rows(chunk.samples)
        return [Fitted((1, 2, 3), rows if found.final is not None else rows & ~chunk.held_out[:, None])]
    return step_rows(chunk, found.regressed_by)


def step_rows(chunk: Chunk, sorter: Sorter | None) -> list[Fitted]:
    """The stepwise method's regressions in their order, with the samples of a chunk that they use."""
    rows = chunk.samples.moving & (chunk.independent & ~chunk.held_out)[:, None]
    if sorter is None:
        return [Fitted((1, 2, 3), rows)]
    condition = sorter(chunk.samples.motion)
    return [Fitted((step,), rows & (condition == step)[:, None]) for step in (1, 2, 3)]
