"""From logs to a model: condition the signals, hold data out, run a method, score what it predicts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armloop.arm import Arm
from armloop.blocks import folds
from armloop.errors import InputError
from armloop.log import MotionLog
from armloop.model import ReconstructedModel
from armloop.motion import Motion, Samples
from armloop.progress import Progress, silent
from armloop.reconstruction.excitation import check_recorded
from armloop.reconstruction.lagrangian import lagrangian
from armloop.reconstruction.options import Options, StepReport
from armloop.reconstruction.rigid_body import rigid_body
from armloop.reconstruction.shared import SHARED_CONDITIONING
from armloop.reconstruction.sindy import sindy
from armloop.reconstruction.stepwise import stepwise
from armloop.scoring import Score, score
from armloop.signals import Conditioning, condition

METHODS = ("stepwise", "sindy")
LIBRARIES = ("double-feature-set", "rigid-body", "lagrangian")


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """A model with the account of how it came about.

    Attributes:
        reports: one per step.
        held_out: score on blocks that no step has seen.
        notes: what the user should know.
    """

    model: ReconstructedModel
    reports: list[StepReport]
    held_out: Score
    notes: list[str]

    def to_dict(self) -> dict[str, Any]:
        """The answer of ``armloop reconstruct --json``, without the model's path."""
        return {
            "steps": [report.to_dict() for report in self.reports],
            "held_out": self.held_out.moving,
            "notes": self.notes,
        }


def default_library(arm: Arm) -> str:
    """The double feature set up to four joints, beyond which it explodes; then rigid-body."""
    return "double-feature-set" if arm.n <= 4 else "rigid-body"


def default_conditioning(library: str) -> Conditioning:
    """Filter that suits a library: friction with memory needs every sample, sparse terms do not."""
    return Conditioning() if library == "double-feature-set" else SHARED_CONDITIONING


def reconstruct(
    logs: Sequence[MotionLog],
    arm: Arm,
    method: str = "stepwise",
    library: str | None = None,
    conditioning: Conditioning | None = None,
    options: Options | None = None,
    progress: Progress = silent,
    recorded: dict[str, Any] | None = None,
) -> Reconstruction:
    """Reconstruct a model of an arm's joint torques from its logs.

    Args:
        logs: runs of the same arm; which sample serves which step is found from the samples.
        method: ``"stepwise"`` or ``"sindy"`` (one regression of everything, the baseline).
        library: one of :data:`LIBRARIES`; by default what suits the number of joints.
        conditioning: filter; by default what suits the library.
        recorded: how the logs recorded the torque, kept in the model for later logs.

    Raises:
        InputError: logs that do not fit the arm, an unknown method, or too little excitation.
    """
    if method not in METHODS:
        raise InputError(f"unknown method {method!r}; there are: {', '.join(METHODS)}")
    library = library or default_library(arm)
    if library not in LIBRARIES:
        raise InputError(f"unknown library {library!r}; there are: {', '.join(LIBRARIES)}")
    if method == "sindy" and library != "double-feature-set":
        raise InputError(f"method 'sindy' works on the library double-feature-set, not on {library!r}")
    options = options or Options()
    conditioning = conditioning or default_conditioning(library)
    for log in logs:
        if log.joints != arm.n:
            raise InputError(f"{log.name}: {log.joints} joints, but {arm.name} has {arm.n}")
    progress(f"conditioning {len(logs)} log(s), low-pass {conditioning.cutoff_hz:g} Hz")
    samples = condition(logs, conditioning)
    check_recorded(arm, samples)
    held_out = held_out_rows(samples, options)
    if library == "rigid-body":
        found = rigid_body(arm, samples, held_out, options, progress)
    elif library == "lagrangian":
        found = lagrangian(arm, samples, held_out, options, progress)
    elif method == "sindy":
        found = sindy(arm, samples, held_out, options, progress)
    else:
        found = stepwise(arm, samples, held_out, options, progress)
    model = ReconstructedModel(
        arm=arm,
        components=tuple(found.components),
        friction=found.law,
        conditioning=conditioning,
        recorded=recorded or {"unit": "N*m", "drive_gains": None},
        history={
            "method": method,
            "library": library,
            "logs": [log.name for log in logs],
            "steps": [report.to_dict() for report in found.reports],
            "notes": found.notes,
            "range": _range(samples.motion),
            **found.history,
        },
    )
    held = score(model, samples, held_out)
    model = replace(model, baseline=_baseline(model, samples, held_out, found.condition))
    return Reconstruction(model, found.reports, held, found.notes)


def _baseline(
    model: ReconstructedModel,
    samples: Samples,
    held_out: NDArray[np.bool_],
    conditions: NDArray[np.int_] | None,
) -> dict[str, Any]:
    """What the model leaves on held-out data, per joint: of the condition that it explains worst.

    A later run is one of motion; easy data (creeping, steady) must not make the model look better than
    it is on those.
    """
    labels = np.zeros(samples.motion.samples, dtype=int) if conditions is None else conditions
    scores = [score(model, samples, held_out & (labels == label)) for label in np.unique(labels[held_out])]
    table = np.array([[np.nan if x is None else x for x in s.moving["rmse"]] for s in scores])
    usable = np.isfinite(table).any(axis=0)
    rmse = [float(np.nanmax(column)) if ok else None for column, ok in zip(table.T, usable, strict=True)]
    rms = score(model, samples, held_out).rms
    nrmse = [e / scale if e is not None and scale else None for e, scale in zip(rmse, rms, strict=True)]
    return {"rmse": rmse, "nrmse": nrmse, "rms": rms, "samples": int(held_out.sum())}


def _range(motion: Motion) -> list[list[float]]:
    """Half ranges of q, v, vdot, then the centre of q: where the model knows the arm."""
    low, high = np.quantile(motion.q, 0.005, axis=0), np.quantile(motion.q, 0.995, axis=0)
    rates = [np.quantile(np.abs(x), 0.995, axis=0).tolist() for x in (motion.v, motion.vdot)]
    return [(0.5 * (high - low)).tolist(), *rates, (0.5 * (high + low)).tolist()]


def held_out_rows(samples: Samples, options: Options) -> NDArray[np.bool_]:
    """(N,) every ``folds``-th block, which no step may fit."""
    return folds(samples.motion, options.folds, options.block_seconds) == 0
