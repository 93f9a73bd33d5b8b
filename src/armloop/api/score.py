"""Prediction error of a model on logs, as objects: per joint, and sample by sample."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from armloop.api.reading import as_logs, require_model, require_some
from armloop.api.shown import displayed, page
from armloop.data.log import MotionLog
from armloop.data.motion import Samples
from armloop.data.signals import preprocess
from armloop.identification.scoring import Score as Numbers
from armloop.identification.scoring import residual, score
from armloop.identification.shared_motors import without_shared_standstill
from armloop.identification.validation.misrecorded import say_misrecorded
from armloop.model import ReconstructedModel
from armloop.reports.tables import score_table
from armloop.reports.words import counted
from armloop.robot.arm import Arm
from armloop.robot.plausibility import say_implausible
from armloop.util.arrays import Array, Index, Mask
from armloop.util.errors import InputError
from armloop.util.files import write_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, repr=False)
class Score(Numbers):
    """Errors per joint: ``overall``, ``moving`` and ``standstill``, each with lists ``rmse`` and ``nrmse``."""

    arm: Arm | None = None
    units: tuple[str, ...] = ()

    @property
    def rmse(self) -> list[float | None]:
        """(n,) RMSE of the moving joints, N·m (N, A); None for one that does not move."""
        return list(self.moving["rmse"])

    @property
    def nrmse(self) -> list[float | None]:
        """(n,) RMSE over the RMS of the measured torque, of the moving joints."""
        return list(self.moving["nrmse"])

    def __repr__(self) -> str:
        shown = ", ".join("–" if x is None else f"{x:.3g}" for x in self.nrmse)
        return f"<armloop.Score of {self.samples} samples, nRMSE {shown}>"

    def __str__(self) -> str:
        assert self.arm is not None
        return str(score_table(self, self.arm, units=self.units))

    def _repr_html_(self) -> str:
        return page(str(self), self.plot())

    def plot(self) -> Figure:
        """nRMSE per joint as bars."""
        from armloop.reports.score_report import score_figure

        assert self.arm is not None
        return displayed(score_figure(self, self.arm))

    def report(self, path: str | Path) -> Path:
        """Write one HTML page; raises ``InputError`` where the place cannot be written to."""
        from armloop.reports.score_report import score_report

        assert self.arm is not None
        write_text(path, score_report(self, self.arm, self.units))
        return Path(path)


@dataclass(frozen=True, repr=False)
class Comparison:
    """Measured and predicted torque of logs, sample by sample, as :func:`armloop.evaluate` compares them.

    Both have passed the filter that the model was made with: samples are thinned to what the filter leaves, its reach is
    cut off at the ends of each run, and vdot is derived where the log has none.

    Attributes:
        time: (N,) the logs' own clocks, s, run after run.
        starts: first sample of each run; a log is one run or several.
        q, v, vdot: (N, n) the motion that the model was asked about, rad (m), and per second once and twice.
        measured, predicted: (N, n) torque, in ``units``.
        moving: (N, n) samples of joints that slide, by which a model is judged; at rest friction may be anything.
        units: (n,) N*m, N for a prismatic joint, or A.
    """

    time: Array
    starts: Index
    q: Array
    v: Array
    vdot: Array
    measured: Array
    predicted: Array
    moving: Mask
    units: tuple[str, ...]

    @property
    def residual(self) -> Array:
        """(N, n) measured minus predicted torque."""
        return self.measured - self.predicted

    def __repr__(self) -> str:
        samples, joints = self.measured.shape
        return f"<armloop.Comparison of {samples} samples of {joints} joints, {counted(len(self.starts), 'run')}>"

    @staticmethod
    def of(model: ReconstructedModel, logs: MotionLog | Sequence[MotionLog]) -> Comparison:
        """Ask a model about the samples of logs; see :meth:`armloop.Model.compare`."""
        samples = without_shared_standstill(samples_for(model, as_logs(logs)), model)
        motion, predicted = samples.motion, samples.tau - residual(model, samples)
        state = motion.time, motion.starts, motion.q, motion.v, motion.vdot
        return Comparison(*state, samples.tau, predicted, samples.moving, tuple(model.torque_units))


def evaluate(model: ReconstructedModel, logs: MotionLog | Sequence[MotionLog]) -> Score:
    """Compare a model's prediction with logs: RMSE and nRMSE per joint, standstill apart.

    Every sample of a joint that moves counts; of these :func:`armloop.diagnose` does not judge those near the start and end
    of a run, within an event, far outside the trained range or slower than in training.

    Raises:
        InputError: a log does not fit the model's arm or its unit of torque.
    """
    found = score(model, samples_for(model, as_logs(logs)))
    numbers = {f.name: getattr(found, f.name) for f in fields(Numbers)}
    return Score(**numbers, arm=model.arm, units=tuple(model.torque_units))


def logs_for(model: ReconstructedModel, logs: Sequence[MotionLog]) -> list[MotionLog]:
    """The logs in the unit that the model predicts; raises ``InputError`` where they cannot be."""
    require_model(model)
    gains = model.recorded["drive_gains"]
    predicts = "A" if model.in_amperes else "N*m"
    fitting = []
    for log in logs:
        if log.joints != model.arm.n:
            raise InputError(
                f"{log.name}: {log.joints} joints, the model's arm {model.arm.name} has {model.arm.n}"
            )
        if log.tau_unit == "A" and gains is not None:
            log = replace(log, tau=log.tau * np.asarray(gains, dtype=np.float64), tau_unit="N*m")
        if log.tau_unit != predicts:
            raise InputError(
                f"{log.name}: tau is in {log.tau_unit}, but the model predicts {predicts}; read it with drive_gains"
            )
        fitting.append(log)
    return fitting


def samples_for(model: ReconstructedModel, logs: Sequence[MotionLog]) -> Samples:
    """The logs conditioned as the model's training logs were, with warnings of gross errors of theirs.

    Raises:
        InputError: there is no log, one does not fit the model's arm or unit, or every torque is zero.
    """
    found = logs_for(model, logs)
    require_some(found)
    say_implausible(model.arm, found)
    samples = preprocess(found, model.conditioning)
    say_misrecorded(model, samples, [log.name for log in found])
    return samples
