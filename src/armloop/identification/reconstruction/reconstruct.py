"""Reconstruction pipeline: preprocess logs, hold data out, run a method, score what it predicts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from armloop.data.pieces import IN_MEMORY, LogSource
from armloop.data.repeats import require_different
from armloop.data.signals import FELT, Conditioning
from armloop.dynamics.physics import check_physics
from armloop.identification.goodness import Parts, merged, parts_of, witness
from armloop.identification.goodness.features import Scales
from armloop.identification.goodness.witness import MOST, Witness
from armloop.identification.reconstruction.bandwidth import check_nyquist
from armloop.identification.reconstruction.data import Chunk, Data, View
from armloop.identification.reconstruction.excitation import check_recorded, determined
from armloop.identification.reconstruction.fitted import left_out, uncertainty
from armloop.identification.reconstruction.friction_selection import check_laws
from armloop.identification.reconstruction.left_out_logs import notes as left_out_logs_notes
from armloop.identification.reconstruction.libraries import (
    Attempt,
    Contender,
    candidates,
    check_suits,
    choose,
    comparison_notes,
    contender,
    left_behind,
    named,
)
from armloop.identification.reconstruction.library import METHODS, REFERENCE, Library
from armloop.identification.reconstruction.options import Options, StepReport
from armloop.identification.reconstruction.outlying_stretch import doubtful, outlying_stretches
from armloop.identification.reconstruction.preparation import Prepared, prepared
from armloop.identification.reconstruction.ripple import find_ripple
from armloop.identification.reconstruction.ripple import notes as ripple_notes
from armloop.identification.reconstruction.shared import motion_range, slowest_sliding
from armloop.identification.reconstruction.stances import as_it_stands, stance_history
from armloop.identification.reconstruction.tally import Part, Tally, at_least
from armloop.identification.reconstruction.torque_checks import check_torques
from armloop.identification.reconstruction.torque_lag import Beside
from armloop.identification.scoring import Score, residual
from armloop.identification.shared_motors import sharing, without_shared_standstill
from armloop.identification.uncertainty.between_logs import notes as between_logs_notes
from armloop.identification.uncertainty.heterogeneity import notes as heterogeneity_notes
from armloop.identification.uncertainty.sensor_drift import notes as drift_notes
from armloop.model import ReconstructedModel
from armloop.model.added_effect import ripples
from armloop.robot.arm import Arm
from armloop.robot.plausibility import say_implausible
from armloop.util.doubts import warn
from armloop.util.errors import InputError
from armloop.util.progress import Progress, paced, silent
from armloop.util.workers import Workers, one_thread

#: nRMSE on held-out data from which a model is of no use: a torque of zero has 1.
_NO_USE = 0.95
#: Samples as recorded in which ripples are looked for, where the logs are not kept in memory.
_RIPPLE = 300_000
#: Of streamed logs, so many chunks stand for all where the torque is parted.
_CHUNKS = 16
#: What a reader of a model of currents else learns at the first diagnosis.
_IN_AMPERES = (
    "the model predicts motor currents (A), which only evaluate and export --to c can use: give --drive-gains K1,..,KN "
    "(N·m/A) to diagnose or track with it; what is found at a joint is then as exact as its gain"
)


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """A model with the account of how it came about.

    Attributes:
        reports: one per step.
        held_out: score on blocks that no step has seen, and that chose nothing: no term, no orders, no library.
        notes: what the user should know.
        libraries: those that were compared; the one taken alone where the user named it.
        parts: how much of each joint's torque is explained, predictable but not explained, and noise, on the same
            blocks; empty where nobody asked.
    """

    model: ReconstructedModel
    reports: list[StepReport]
    held_out: Score
    notes: list[str]
    libraries: list[Contender] = field(default_factory=list)
    parts: list[Parts] = field(default_factory=list)

    @property
    def warnings(self) -> list[str]:
        """What must be said before anything else: joints of which the model leaves all, much, or nearly all; no physics."""
        faults = self.model.history["physics"]["faults"]
        much = of_no_use(self.held_out)
        much += [f"no arm has this model, whatever it leaves: {'; '.join(faults)}"] if faults else []
        much += [one.sentence() for one in self.parts if one.much_is_left]
        return much + [one.little() for one in self.parts if one.little_is_explained]

    def to_dict(self) -> dict[str, Any]:
        """The answer of ``armloop reconstruct --json``, without the model's path."""
        return {
            "steps": [report.to_dict() for report in self.reports],
            "held_out": self.held_out.moving,
            "library": self.model.history["library"],
            "libraries": [one.to_dict() for one in self.libraries],
            "physics": self.model.history["physics"],
            "joints": merged(self.parts),
            "warnings": self.warnings,
            "notes": self.notes,
        }


def of_no_use(held_out: Score) -> list[str]:
    """A warning of each joint that the model predicts about as badly as a torque of zero would, or worse."""
    return [
        f"joint {j}: its model is of no use: on held-out data it errs by {x:.0%} of the torque (nRMSE), a torque of zero by "
        "100%; neither control nor a diagnosis can rely on it there"
        for j, x in enumerate(held_out.moving["nrmse"], 1)
        if x is not None and x >= _NO_USE
    ]


def default_library(arm: Arm) -> str:
    """The library that a motion is designed for where none is named: the richest that is compared."""
    return candidates(arm, Options())[0].name


def default_conditioning(library: str) -> Conditioning:
    """Filter that suits a library."""
    return named(library).conditioning


@determined()
@one_thread
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
        logs: runs of the same arm, in memory or read when needed (:mod:`armloop.data.pieces`); which sample serves
            which step is found from the samples.
        method: ``"stepwise"`` or ``"sindy"`` (one regression of everything, the reference method).
        library: the name of one of :mod:`reconstruction.libraries`; by default the best of them, unless an
            option speaks of one.
        conditioning: filter; by default what suits the library, with a lower corner where the data ask for it
            (:mod:`armloop.identification.reconstruction.bandwidth`).
        recorded: how the logs recorded the torque, kept in the model for later logs.
        workers: who passes over logs that are not kept in memory; by default this process.
        in_memory: number of samples up to which logs are kept in memory. More are read and conditioned anew on
            every pass by the stepwise method, whatever the library, in memory that does not grow with them.

    Raises:
        InputError: logs that do not fit the arm, an unknown method or friction law, a corner above the Nyquist rate,
            torques that cannot be those of the arm (:mod:`reconstruction.torque_checks`), or too little excitation.
    """
    if method not in METHODS:
        raise InputError(f"unknown method {method!r}; there are: {', '.join(METHODS)}")
    settings = options or Options()
    wanted = candidates(arm, settings, method) if library is None else [named(library)]
    for one in wanted:
        check_suits(one, method, settings)
    check_laws(settings.friction)
    for log in logs:
        if log.joints != arm.n:
            raise InputError(f"{log.name}: {log.joints} joints, but {arm.name} has {arm.n}")
    streamed = sum(log.samples for log in logs) > in_memory and method != REFERENCE
    kept = [] if streamed else [log.read() for log in logs]
    require_different(kept)
    if kept:
        check_recorded(arm, np.max([np.abs(log.tau).max(axis=0) for log in kept], axis=0))
    say_implausible(arm, kept)
    if conditioning is not None:
        check_nyquist(kept or logs, conditioning.cutoff_hz)
        # samples that are no time series show the first library alone what it needs
        wanted = wanted if conditioning.cutoff_hz > 0 else wanted[:1]
    usual = [one.conditioning for one in wanted]
    preparing = partial(
        prepared, logs, kept, usual=usual, given=conditioning, options=settings, progress=progress
    )
    ready = preparing(arm=arm, corrected=method != REFERENCE)
    progress("whether the torques are this arm's")
    stances = check_torques(ready.runs, arm, ready.bandwidth.cutoff_hz, ready.aside)
    if stances:
        progress("the arm stands slightly otherwise than its URDF says: anew as it stands")
        ready = preparing(arm=as_it_stands(arm, stances), corrected=method != REFERENCE)
        # other blocks may be held out now
        stances = check_torques(ready.runs, arm, ready.bandwidth.cutoff_hz, ready.aside)
        if not stances:
            ready = preparing(arm=arm, corrected=method != REFERENCE)
        arm = as_it_stands(arm, stances)

    def attempt(library: Library, nested: bool = False, view: View | None = None) -> Attempt:
        how = ready.conditioning(library.conditioning)
        progress(f"{library.name}: conditioning {len(logs)} log(s), low-pass {how.cutoff_hz:g} Hz")
        if streamed:
            data = Data.streamed(ready.logs, how, ready.options, workers, progress)
        else:
            data = Data.kept(ready.kept, how, ready.options)
            data = data.nested() if nested else data
        data = data if view is None else data.through(view)
        check_recorded(arm, np.abs(data.reference.samples.tau).max(axis=0))
        found = library.methods[method](arm, data, ready.options, progress)
        found.history |= ready.history()
        found.notes += ready.notes(arm, how)
        found.history |= stance_history(stances)
        found.notes += [stance.note() for stance in stances]
        return Attempt(library, how, data, found, ready.blocks.margin)

    refused = {} if library is not None else _refused(arm, wanted, ready)
    tried, part = _compared(wanted, refused, attempt, ready)
    if method != REFERENCE:
        _find_ripple(_chosen(tried), ready.logs)
        again, seen = _in_step(ready, _chosen(tried), partial(preparing, arm=arm)), _chosen(tried).model()
        shared = any(sharing(seen, j) for j in range(arm.n))
        if again is not None:
            ready = again
            progress("what was found has a part in when the torque seems to be recorded: anew beside it")
        if shared:
            progress(
                "samples in which a motor that two joints share stands still tell nothing: anew without them"
            )
        if again is not None or shared:
            view = partial(without_shared_standstill, model=seen) if shared else None
            tried, part = _compared(wanted, refused, partial(attempt, view=view), ready, left_behind(tried))
            _find_ripple(_chosen(tried), ready.logs)
    return _finished(tried, part, method, ready, progress, recorded)


def _refused(arm: Arm, wanted: Sequence[Library], ready: Prepared) -> dict[Library, str]:
    """Libraries whose terms the logs do not determine, and why."""
    reasons = {one: one.undetermined(arm, ready.runs, ready.bandwidth.cutoff_hz) for one in wanted}
    return {one: why for one, why in reasons.items() if why}


def _compared(
    wanted: Sequence[Library],
    refused: dict[Library, str],
    attempt: Callable[..., Attempt],
    ready: Prepared,
    behind: Sequence[Contender] = (),
) -> tuple[list[Contender], Part]:
    """What each library comes to, one of them chosen, and the part of the held-out blocks that judges it.

    Args:
        behind: what was tried before and is not tried again, nor taken.
    """
    left = [one for one in wanted if one not in refused and one not in [each.library for each in behind]]
    tried = [Contender(one, refused=why) for one, why in refused.items()]
    if len(left) == 1 and not behind:
        made = attempt(left[0])
        tried.append(Contender(left[0], made, coefficients=made.coefficients(), chosen=True))
        return sorted(tried, key=lambda one: wanted.index(one.library)), "all"
    # half of the held-out blocks may be too few to judge by; a fold of the others then chooses the library
    few = len(left) + len(behind) > 1 and ready.few_held_out(wanted[0].conditioning)
    tried = [*choose([*tried, *(contender(one, partial(attempt, nested=few)) for one in left)]), *behind]
    tried.sort(key=lambda one: wanted.index(one.library))
    if few:
        tried = [replace(one, attempt=attempt(one.library)) if one.chosen else one for one in tried]
    return tried, "all" if few else "test"


def _chosen(libraries: Sequence[Contender]) -> Attempt:
    """What the library came to that is taken."""
    (tried,) = [one.attempt for one in libraries if one.chosen]
    assert tried is not None
    return tried


def _in_step(ready: Prepared, tried: Attempt, preparing: Callable[..., Prepared]) -> Prepared | None:
    """The logs with another lag of their torque, beside friction and ripples found; None where it is felt to be the same."""
    if not ready.late:
        return None
    again = preparing(beside=Beside(ripples(tried.found.effects), tried.found.friction))
    return again if abs(again.late - ready.late) * tried.conditioning.cutoff_hz >= FELT else None


def _finished(
    libraries: list[Contender],
    part: Part,
    method: str,
    ready: Prepared,
    progress: Progress,
    recorded: dict[str, Any] | None,
) -> Reconstruction:
    """The model with its history, its baseline on held-out data and its standard errors."""
    tried = _chosen(libraries)
    found, data, compared = tried.found, tried.data, len(libraries) > 1
    notes = [*(comparison_notes(libraries) if compared else []), *found.notes, *ready.blocks.notes()]
    # what dead zones went by, by which a later log's reversals are told from rest
    noise = data.reference.samples.velocity_noise
    model = found.model(
        conditioning=tried.conditioning,
        recorded=recorded or {"unit": "N*m", "drive_gains": None},
        history={
            "method": method,
            "library": tried.library.name,
            "logs": list(dict.fromkeys(log.name for log in ready.logs)),
            "steps": [report.to_dict() for report in found.reports],
            "range": motion_range(data.reference.samples.motion),
            "slowest": slowest_sliding(data.reference.samples),
            **({} if noise is None else {"velocity_noise": noise.tolist()}),
            **found.history,
        },
    )
    tally = tried.tally(found.sorter, part)
    parts = []
    if ready.options.parts:
        progress("what a flexible regression still finds in what the model leaves")
        parts = held_out_parts(model, data, part, progress)
    yardsticks = tried.yardsticks(found.sorter, Options().block_seconds)
    model = replace(model, baseline={**tally.baseline(), **yardsticks, "joints": merged(parts)})
    if found.final is not None:
        last = found.final.model(history={**model.history, **found.final.history})
        names = ("components", "friction", "effects", "history")
        model = replace(model, **{name: getattr(last, name) for name in names})
    whole = partial(Tally.fitted, model=model, sorter=found.sorter, seconds=Options().block_seconds)
    model = replace(model, baseline=at_least(model.baseline, data.sum(whole)))
    if ready.options.parts and method != REFERENCE:
        progress("what laws of the catalogue find in runs left out of the regression")
        parts_left_out = left_out(model, data, found, tried.library.shared)
        model = replace(model, baseline={**model.baseline, **parts_left_out})
        notes += left_out_logs_notes(model)
    for doubt in doubtful(outlying_stretches(model, data.by_log), model.torque_units):
        warn(doubt)
    checks = check_physics(model)
    notes += checks.faults()
    if model.in_amperes:
        notes.append(_IN_AMPERES)
    history = {**model.history, "physics": checks.to_dict(), "notes": notes}
    if compared:
        history["libraries"] = [one.to_dict() for one in libraries]
    model = replace(model, history=history)
    if ready.options.standard_errors:
        progress("standard errors of the coefficients")
        model = replace(model, uncertainty=uncertainty(model, data, found, tried.library.shared))
        notes += [*between_logs_notes(model), *drift_notes(model), *heterogeneity_notes(model)]
        model = replace(model, history={**model.history, "notes": notes})
    return Reconstruction(model, found.reports, tally.score(), notes, libraries, parts)


def _find_ripple(tried: Attempt, logs: Sequence[LogSource]) -> None:
    """Add the gears' ripples, looked for in the logs as they were recorded, to what was found."""
    found, data = tried.found, tried.data
    bare = found.model(conditioning=tried.conditioning)
    if data.in_memory:
        recorded_logs, chunk = [log.read() for log in logs], data.reference
    else:
        recorded_logs, chunk = data.recorded(_RIPPLE)
    ripple = find_ripple(bare, recorded_logs, chunk.samples, chunk.held_out)
    found.notes += ripple_notes(ripple)
    for one in (found, *([] if found.final is None else [found.final])):
        one.effects = (*one.effects, *ripple)


def held_out_parts(model: ReconstructedModel, data: Data, part: Part, progress: Progress) -> list[Parts]:
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
