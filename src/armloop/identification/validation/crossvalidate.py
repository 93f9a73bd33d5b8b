"""Reconstruct with part of the data left out, in turn, and score what was left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from armloop.data.log import MotionLog
from armloop.data.repeats import require_different
from armloop.data.signals import Conditioning, preprocess
from armloop.identification.reconstruction import Options, reconstruct
from armloop.identification.scoring import Score, residual, score_errors
from armloop.identification.shared_motors import without_shared_standstill
from armloop.identification.validation.splits import Split, by_blocks, by_file, judging_rows, told_apart
from armloop.model import ReconstructedModel, model_of
from armloop.robot.arm import Arm
from armloop.util.arrays import Array, Mask
from armloop.util.checkpoints import Kept, digest
from armloop.util.errors import InputError
from armloop.util.progress import Progress, silent
from armloop.util.workers import Serial, Workers

LEAVE_OUT = ("file", "blocks")


@dataclass(frozen=True)
class LeftOut:
    """The score of one log on what was left out of it, by models that had not seen it."""

    name: str
    score: Score

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready values."""
        moving, standstill = self.score.moving, self.score.standstill
        return {"file": self.name, "samples": self.score.samples, "moving": moving, "standstill": standstill}


@dataclass(frozen=True, eq=False)
class Fit:
    """A model of the rest of the data, and what its reconstruction noted."""

    model: ReconstructedModel
    notes: list[str]


@dataclass(frozen=True, eq=False)
class CrossValidation:
    """Scores of all logs on data left out, and the models behind them.

    Attributes:
        leave_out: ``"file"`` or ``"blocks"``; ``block_seconds`` is None for files.
        files: one per log.
        results: (what was left out, the fit to the rest) of every split.
    """

    leave_out: str
    block_seconds: float | None
    files: list[LeftOut]
    results: list[tuple[str, Fit]] = field(repr=False)

    @property
    def per_joint(self) -> list[float | None]:
        """Mean nRMSE of each moving joint over the files; None for a joint that moves in no file."""
        table = np.array([[np.nan if x is None else x for x in f.score.moving["nrmse"]] for f in self.files])
        return [float(np.nanmean(c)) if np.isfinite(c).any() else None for c in table.T]

    @property
    def mean(self) -> float | None:
        """Mean nRMSE of the moving joints over joints and files."""
        values = [x for f in self.files for x in f.score.moving["nrmse"] if x is not None]
        return float(np.mean(values)) if values else None

    def to_dict(self) -> dict[str, Any]:
        """The answer of ``armloop crossvalidate --json``."""
        return {
            "leave_out": self.leave_out,
            "block_seconds": self.block_seconds,
            "library": self.results[0][1].model.history["library"],
            "files": [f.to_dict() for f in self.files],
            "mean": {"nrmse": self.mean, "nrmse_per_joint": self.per_joint},
            "notes": {name: result.notes for name, result in self.results},
        }


def crossvalidate(
    logs: Sequence[MotionLog],
    arm: Arm,
    *,
    leave_out: str | None = None,
    block_seconds: float = 1.0,
    method: str = "stepwise",
    library: str | None = None,
    conditioning: Conditioning | None = None,
    options: Options | None = None,
    progress: Progress = silent,
    kept: Kept | None = None,
    workers: Workers | None = None,
) -> CrossValidation:
    """Reconstruct several times, each time without some of the data, and score those.

    Args:
        leave_out: one of :data:`LEAVE_OUT`; files by default where there are at least two.
        block_seconds: length of the alternating blocks.
        method, library, conditioning, options: as of :func:`armloop.identification.reconstruction.reconstruct`.
        kept: where finished fits are kept, and taken from: the same data and settings, and what was left out, give
            the same fit.
        workers: who makes the fits; by default this process. They are the same whoever does.

    Raises:
        InputError: too little data to leave any out, or to reconstruct from the rest.
    """
    leave_out = leave_out or ("file" if len(logs) > 1 else "blocks")
    if leave_out not in LEAVE_OUT:
        raise InputError(f"unknown --leave-out {leave_out!r}; there are: {', '.join(LEAVE_OUT)}")
    require_different(logs)
    logs = told_apart(logs)
    splits = by_file(logs) if leave_out == "file" else by_blocks(logs, block_seconds)
    options = replace(options or Options(), standard_errors=False, parts=False)
    errors: list[list[_Judged]] = [[] for _ in logs]
    kept = kept or Kept(None, None)
    settings = [leave_out, block_seconds, method, library, repr(conditioning), repr(options)]
    signals = [(log.name, log.time, log.q, log.v, log.tau, log.vdot) for log in logs]
    data = [arm.to_dict(), [[name, digest(*(x for x in xs if x is not None))] for name, *xs in signals]]

    def fitted(numbered: tuple[int, Split]) -> dict[str, Any]:
        number, split = numbered

        def fit() -> dict[str, Any]:
            found = reconstruct(
                split.training,
                arm,
                method=method,
                library=library,
                conditioning=conditioning,
                options=options,
            )
            return {"model": found.model.to_dict(), "notes": list(found.notes)}

        answer: dict[str, Any] = kept.once([number, split.name, settings, data], fit)
        return answer

    results = []
    progress(f"0 of {len(splits)} fitted: {splits[0].name} left out")
    fits = (workers or Serial()).map(fitted, list(enumerate(splits, 1)))
    for number, (split, found) in enumerate(zip(splits, fits, strict=True), 1):
        if number < len(splits):
            progress(f"{number} of {len(splits)} fitted: {splits[number].name} left out")
        # Judged is what was kept, just made or not, so that both give the same figures.
        fit = Fit(model_of(found["model"], f"the model without {split.name}"), found["notes"])
        results.append((split.name, fit))
        for k, judged in _judge(split, logs, fit.model):
            errors[k].append(judged)
    files = []
    for log, parts in zip(logs, errors, strict=True):
        error, tau, moving = (np.concatenate(column) for column in zip(*parts, strict=True))
        files.append(LeftOut(log.name, score_errors(error, tau, moving)))
    seconds = block_seconds if leave_out == "blocks" else None
    return CrossValidation(leave_out, seconds, files, results)


#: (N, n) residual, measured torque, and which samples move, of the samples that judge.
_Judged = tuple[Array, Array, Mask]


def _judge(split: Split, logs: Sequence[MotionLog], model: ReconstructedModel) -> list[tuple[int, _Judged]]:
    found = []
    for k, blocks in split.left_out.items():
        samples = without_shared_standstill(preprocess([logs[k]], model.conditioning), model)
        # unfiltered samples are numbered; where they lie in the log is its time
        time = samples.motion.time if samples.cutoff_hz > 0 else logs[k].time
        rows = judging_rows(time, samples, blocks)
        found.append((k, (residual(model, samples)[rows], samples.tau[rows], samples.moving[rows])))
    return found
