"""From logs to a model: condition the signals, hold data out, run a method, score what it predicts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armloop.arm import Arm
from armloop.blocks import folds
from armloop.errors import InputError
from armloop.goodness import Parts, merged
from armloop.log import require_different
from armloop.model import ReconstructedModel
from armloop.motion import Motion, Samples
from armloop.pieces import IN_MEMORY, LogSource
from armloop.progress import Progress, silent
from armloop.reconstruction.data import Data
from armloop.reconstruction.excitation import check_recorded
from armloop.reconstruction.fitted import in_memory as kept_in_memory
from armloop.reconstruction.fitted import uncertainty
from armloop.reconstruction.found import Found
from armloop.reconstruction.friction_ladder import check_laws
from armloop.reconstruction.judged import held_out_parts
from armloop.reconstruction.lagrangian import lagrangian
from armloop.reconstruction.options import Options, StepReport
from armloop.reconstruction.rigid_body import rigid_body
from armloop.reconstruction.ripple import find_ripple
from armloop.reconstruction.ripple import notes as ripple_notes
from armloop.reconstruction.rival import Attempt, better
from armloop.reconstruction.shared import SHARED_CONDITIONING
from armloop.reconstruction.sindy import sindy
from armloop.reconstruction.stepwise import stepwise_on
from armloop.scoring import Score
from armloop.signals import Conditioning, condition
from armloop.workers import Workers

METHODS = ("stepwise", "sindy")
LIBRARIES = ("double-feature-set", "rigid-body", "lagrangian")


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """A model with the account of how it came about.

    Attributes:
        reports: one per step.
        held_out: score on blocks that no step has seen.
        notes: what the user should know.
        parts: how much of each joint's torque is explained, predictable but not explained, and noise, on the same
            blocks; empty where nobody asked.
    """

    model: ReconstructedModel
    reports: list[StepReport]
    held_out: Score
    notes: list[str]
    parts: list[Parts] = field(default_factory=list)

    @property
    def warnings(self) -> list[str]:
        """What must be said before anything else: joints of which the model leaves much that is predictable."""
        return [one.sentence() for one in self.parts if one.much_is_left]

    def to_dict(self) -> dict[str, Any]:
        """The answer of ``armloop reconstruct --json``, without the model's path."""
        return {
            "steps": [report.to_dict() for report in self.reports],
            "held_out": self.held_out.moving,
            "joints": merged(self.parts),
            "warnings": self.warnings,
            "notes": self.notes,
        }


def default_library(arm: Arm) -> str:
    """The double feature set up to four joints, beyond which it explodes; then rigid-body."""
    return "double-feature-set" if arm.n <= 4 else "rigid-body"


def default_conditioning(library: str) -> Conditioning:
    """Filter that suits a library: friction with memory needs every sample, sparse terms do not."""
    return Conditioning() if library == "double-feature-set" else SHARED_CONDITIONING


def reconstruct(
    logs: Sequence[LogSource],
    arm: Arm,
    method: str = "stepwise",
    library: str | None = None,
    conditioning: Conditioning | None = None,
    options: Options | None = None,
    progress: Progress = silent,
    recorded: dict[str, Any] | None = None,
    workers: Workers | None = None,
    in_memory: int = IN_MEMORY,
) -> Reconstruction:
    """Reconstruct a model of an arm's joint torques from its logs.

    Args:
        logs: runs of the same arm, in memory or read when needed (:mod:`armloop.pieces`); which sample serves
            which step is found from the samples.
        method: ``"stepwise"`` or ``"sindy"`` (one regression of everything, the baseline).
        library: one of :data:`LIBRARIES`; by default what suits the number of joints, or rigid-body where the double
            feature set turns out to be much worse (:mod:`armloop.reconstruction.rival`) and no option speaks of it.
        conditioning: filter; by default what suits the library.
        recorded: how the logs recorded the torque, kept in the model for later logs.
        workers: who passes over logs that are not kept in memory; by default this process.
        in_memory: number of samples up to which logs are kept in memory. More are read and conditioned anew on
            every pass by the stepwise method on the double feature set, in memory that does not grow with them;
            the other libraries read everything.

    Raises:
        InputError: logs that do not fit the arm, an unknown method or friction law, or too little excitation.
    """
    if method not in METHODS:
        raise InputError(f"unknown method {method!r}; there are: {', '.join(METHODS)}")
    asked = library is not None or (options is not None and options.of_double_feature_set)
    library = library or default_library(arm)
    if library not in LIBRARIES:
        raise InputError(f"unknown library {library!r}; there are: {', '.join(LIBRARIES)}")
    if method == "sindy" and library != "double-feature-set":
        raise InputError(f"method 'sindy' works on the library double-feature-set, not on {library!r}")
    options = options or Options()
    if options.friction is not None and library == "double-feature-set":
        raise InputError(
            "the double feature set has friction of its own (Coulomb, Stribeck, terms of the velocities); "
            "laws are chosen with --library rigid-body or lagrangian"
        )
    check_laws(options.friction)
    for log in logs:
        if log.joints != arm.n:
            raise InputError(f"{log.name}: {log.joints} joints, but {arm.name} has {arm.n}")

    large = sum(log.samples for log in logs) > in_memory
    kept = [] if large and method == "stepwise" else [log.read() for log in logs]
    require_different(kept)

    def attempt(library: str) -> Attempt:
        how = conditioning or default_conditioning(library)
        progress(f"conditioning {len(logs)} log(s), low-pass {how.cutoff_hz:g} Hz")
        if large and method == "stepwise" and library == "double-feature-set":
            data = Data.streamed(logs, how, options, workers)
        else:
            data = Data.of(condition(kept or [log.read() for log in logs], how), options)
        check_recorded(arm, data.reference.samples)
        return Attempt(library, how, data, _found(arm, data, method, library, options, progress))

    tried = attempt(library)
    if not asked and method == "stepwise" and tried.may_have_rival:
        progress("the same with the base parameters of the URDF, for comparison")
        tried = better(tried, attempt)
    return _finished(tried, arm, method, logs, options, progress, recorded)


def _found(arm: Arm, data: Data, method: str, library: str, options: Options, progress: Progress) -> Found:
    samples, held_out = data.reference.samples, data.reference.held_out
    if library == "rigid-body":
        return rigid_body(arm, samples, held_out, options, progress)
    if library == "lagrangian":
        return lagrangian(arm, samples, held_out, options, progress)
    if method == "sindy":
        return sindy(arm, samples, held_out, options, progress)
    return stepwise_on(arm, data, options, progress)


def _finished(
    tried: Attempt,
    arm: Arm,
    method: str,
    logs: Sequence[LogSource],
    options: Options,
    progress: Progress,
    recorded: dict[str, Any] | None,
) -> Reconstruction:
    """The model with its history, its baseline on held-out data and its standard errors."""
    found, data = tried.found, tried.data
    if method == "stepwise" and kept_in_memory(data):
        bare = ReconstructedModel(
            arm, tuple(found.components), found.law, tried.conditioning, effects=found.effects
        )
        chunk = data.reference
        ripple = find_ripple(bare, [log.read() for log in logs], chunk.samples, chunk.held_out)
        found.notes += ripple_notes(ripple)
        for one in (found, *([] if found.final is None else [found.final])):
            one.effects = (*one.effects, *ripple)
    model = ReconstructedModel(
        arm=arm,
        components=tuple(found.components),
        friction=found.law,
        effects=found.effects,
        conditioning=tried.conditioning,
        recorded=recorded or {"unit": "N*m", "drive_gains": None},
        history={
            "method": method,
            "library": tried.library,
            "logs": list(dict.fromkeys(log.name for log in logs)),
            "steps": [report.to_dict() for report in found.reports],
            "notes": found.notes,
            "range": _range(data.reference.samples.motion),
            **found.history,
        },
    )
    tally = tried.tally(found.sorter)
    parts = []
    if options.parts:
        progress("what a flexible regression still finds in what the model leaves")
        parts = held_out_parts(model, data)
    model = replace(model, baseline={**tally.baseline(), "joints": merged(parts)})
    if found.final is not None:
        history = {**model.history, **found.final.history}
        components = tuple(found.final.components)
        final = found.final
        model = replace(
            model, components=components, friction=final.law, effects=final.effects, history=history
        )
    if options.standard_errors:
        progress("standard errors of the coefficients")
        shared = tried.library in ("rigid-body", "lagrangian")
        model = replace(model, uncertainty=uncertainty(model, data, found, shared))
    return Reconstruction(model, found.reports, tally.score(), found.notes, parts)


def _range(motion: Motion) -> list[list[float]]:
    """Half ranges of q, v, vdot, then the centre of q: where the model knows the arm."""
    low, high = np.quantile(motion.q, 0.005, axis=0), np.quantile(motion.q, 0.995, axis=0)
    rates = [np.quantile(np.abs(x), 0.995, axis=0).tolist() for x in (motion.v, motion.vdot)]
    return [(0.5 * (high - low)).tolist(), *rates, (0.5 * (high + low)).tolist()]


def held_out_rows(samples: Samples, options: Options) -> NDArray[np.bool_]:
    """(N,) every ``folds``-th block, which no step may fit."""
    return folds(samples.motion, options.folds, options.block_seconds) == 0
