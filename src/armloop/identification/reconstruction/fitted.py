"""Provenance of a regression: which samples it used, and what standard errors have to know."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from armloop.data.motion import Samples
from armloop.data.signals import smooth
from armloop.identification.goodness.null import empirical_null
from armloop.identification.reconstruction.data import WINDOW, Chunk, Data
from armloop.identification.reconstruction.found import Found
from armloop.identification.reconstruction.left_out_logs import errors_of_left_out_logs
from armloop.identification.reconstruction.nearest_regime import Sorter
from armloop.identification.reconstruction.shared import sliding_rows
from armloop.identification.scoring import residual
from armloop.identification.uncertainty import Fitted, between_logs, standard_errors
from armloop.identification.uncertainty.between_logs import log_numbers
from armloop.identification.uncertainty.blocking import independent_blocks
from armloop.identification.uncertainty.cross_fitting import cross_fitted, training_parts
from armloop.identification.uncertainty.sensor_drift import sensor_drift
from armloop.identification.uncertainty.standard_errors import MOST_UNKNOWNS
from armloop.identification.uncertainty.unknowns import problems
from armloop.model import ReconstructedModel


def uncertainty(model: ReconstructedModel, data: Data, found: Found, shared: bool) -> dict[str, Any]:
    """Standard errors of a model's coefficients.

    Of logs that are not kept in memory a selection stands for all samples, and errors are those of a regression of it: too
    large rather than too small.

    Args:
        found: how the model was found.
        shared: whether its coefficients serve all joints; then the selection is of stretches of consecutive samples, for
            friction with memory, which only such coefficients stand beside, has none of the past between others.
    """
    samples, rows = _regressed(model, data, found, shared)
    errors = standard_errors(model, samples, rows)
    if samples.cutoff_hz <= 0 or not errors.get("block_seconds"):
        return errors
    motion, slides = samples.motion, sliding_rows(samples)
    left = residual(replace(model, effects=()), samples)
    blocks = independent_blocks(motion, errors["block_seconds"])
    friction = model.friction.torque(motion, load=model.joint_load(motion)) * slides
    level = np.sqrt((friction**2).sum(axis=0) / np.maximum(slides.sum(axis=0), 1))
    between = between_logs(left, slides, motion, blocks, level)
    drift = sensor_drift(left, slides, motion, float(np.median(np.diff(motion.time))))
    zeros = (
        {}
        if drift is None
        else {"sensor_drift": drift.deviations.tolist(), "sensor_drift_freedom": drift.freedom}
    )
    return {
        **errors,
        **zeros,
        "between_logs": between.covariances,
        "between_logs_known": between.known,
        "between_logs_freedom": between.freedom,
    }


def left_out(model: ReconstructedModel, data: Data, found: Found, shared: bool) -> dict[str, Any]:
    """What parts of the training data show that the coefficients were not regressed on.

    Returns:
        ``null``: what laws of the catalogue remove of the residual on left-out parts; nothing of models with too many
        coefficients; ``logs``: :func:`armloop.identification.reconstruction.left_out_logs.errors_of_left_out_logs`.
    """
    samples, rows = _regressed(model, data, found, shared)
    if samples.cutoff_hz <= 0 or max(len(one.unknowns) for one in problems(model)) > MOST_UNKNOWNS:
        return {"null": []}
    bare, parts, logs = (
        replace(model, effects=()),
        training_parts(samples.motion),
        log_numbers(samples.motion),
    )
    left = cross_fitted(bare, samples, rows, parts)
    whole = left if np.array_equal(parts, logs) else cross_fitted(bare, samples, rows, logs)
    return {
        "null": empirical_null(model, samples, left, parts),
        "logs": errors_of_left_out_logs(samples, whole, logs),
    }


def _regressed(
    model: ReconstructedModel, data: Data, found: Found, shared: bool
) -> tuple[Samples, list[Fitted]]:
    """Samples that a model's coefficients are regressed on, without the torque of its effects, and the regressions' rows."""
    chunk = data.reference
    if shared and not data.in_memory:
        chunk = data.window(WINDOW)
    samples = chunk.samples
    if not (shared or data.in_memory):
        # an even selection cannot be filtered; its columns are taken as they are
        samples = replace(samples, cutoff_hz=0.0)
    if model.effects:
        # taken as given, like the terms: their own errors stand beside their parameters
        bare = model.predict(samples.motion) - replace(model, effects=()).predict(samples.motion)
        samples = replace(samples, tau=samples.tau - smooth(samples, bare))
    return samples, fitted_rows(chunk, found, shared)


def fitted_rows(chunk: Chunk, found: Found, shared: bool) -> list[Fitted]:
    """The regressions in their order, with the samples of a chunk that they used."""
    if shared:
        rows = sliding_rows(chunk.samples)
        return [Fitted((1, 2, 3), rows if found.final is not None else rows & ~chunk.held_out[:, None])]
    return step_rows(chunk, found.regressed_by)


def step_rows(chunk: Chunk, sorter: Sorter | None) -> list[Fitted]:
    """The stepwise method's regressions in their order, with the samples of a chunk that they use."""
    rows = chunk.samples.moving & (chunk.independent & ~chunk.held_out)[:, None]
    if sorter is None:
        return [Fitted((1, 2, 3), rows)]
    condition = sorter(chunk.samples)
    return [Fitted((step,), rows & (condition == step)[:, None]) for step in (1, 2, 3)]
