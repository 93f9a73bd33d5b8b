"""A reconstructed model that scores, plots and shows itself."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from armloop.api.reading import as_arm, as_logs
from armloop.api.score import Comparison, Score, evaluate, samples_for
from armloop.api.shown import displayed, page
from armloop.commands.reconstruct import Reconstruct as Command
from armloop.commands.reconstruct import require_ratios_used
from armloop.data.log import MotionLog
from armloop.data.signals import Conditioning
from armloop.export import Exported, states_of
from armloop.export import export as write_export
from armloop.identification.reconstruction import Options
from armloop.identification.reconstruction import reconstruct as run
from armloop.identification.reconstruction.reconstruct import Reconstruction
from armloop.model import ReconstructedModel
from armloop.model import load_model as read_model
from armloop.regression.sparse import Sparse
from armloop.reports.tables import formulas, score_table, steps_table
from armloop.reports.words import counted
from armloop.robot.arm import Arm
from armloop.robot.levelling import of_a_lean, of_a_zero
from armloop.util.errors import InputError
from armloop.util.files import write_text
from armloop.util.given import numbers_of, require
from armloop.util.progress import Progress, silent

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False, repr=False)
class Model(ReconstructedModel):
    """A reconstructed model of an arm's joint torques.

    ``compare(log)`` gives measured and predicted torques (N, n) of a log, ``predict(motion)`` those of arrays of samples
    (``armloop.data.motion.Motion``), ``feedforward(q, v, vdot)`` (n,) those of one;
    ``formulas()`` one readable formula per joint; ``save(path)`` writes the file that commands read. Without the logs
    it was made of (a model read from its file) ``account`` is None, and ``report`` has nothing to tell.
    """

    account: Reconstruction | None = None
    logs: tuple[MotionLog, ...] = ()

    @staticmethod
    def of(model: ReconstructedModel) -> Model:
        """The same model with what this class adds."""
        if isinstance(model, Model):
            return model
        return Model(**_parts(model))

    def score(self, logs: MotionLog | Sequence[MotionLog]) -> Score:
        """Errors on logs; see :func:`armloop.evaluate`."""
        return evaluate(self, logs)

    def compare(self, logs: MotionLog | Sequence[MotionLog]) -> Comparison:
        """Measured and predicted torque of logs, sample by sample, filtered as :func:`armloop.evaluate` does it.

        Raises:
            InputError: a log does not fit the model's arm or its unit of torque, or is too short for the filter.
        """
        return Comparison.of(self, logs)

    def plot(self, logs: MotionLog | Sequence[MotionLog] | None = None, *, seconds: float = 20.0) -> Figure:
        """Measured and predicted torque of each joint over the first seconds of the longest run, a matplotlib figure.

        Without logs, of those that the model was made of.
        """
        from armloop.reports.plots.torque import torque_figure

        require("a finite number", seconds=seconds)
        if seconds <= 0:
            raise InputError(f"seconds must be above 0; it is {seconds:g}")
        chosen = self.logs if logs is None else as_logs(logs)
        if not chosen:
            raise InputError(
                "plot: give a log; a model read from its file does not know those it was made of"
            )
        return displayed(torque_figure(self, samples_for(self, chosen), seconds))

    def report(self, path: str | Path) -> Path:
        """Write the page of ``armloop reconstruct --report``, without a network.

        Raises:
            InputError: the model comes from a file, or the place cannot be written to.
        """
        from armloop.reports.reconstruction_report import reconstruction_report

        if self.account is None:
            raise InputError(
                "report: only a model of armloop.reconstruct has an account to give; plot(log) shows any"
            )
        write_text(path, reconstruction_report(self.account, list(self.logs)))
        return Path(path)

    def export(
        self, to: str, path: str | Path, *, log: MotionLog | Sequence[MotionLog] | None = None
    ) -> Exported:
        """Write the model for another tool and read it back; see ``armloop export``.

        Args:
            to: "urdf", "sdf", "mjcf", "drake" (a folder) or "c".
            log: compare on its motion instead of random states within the training range.

        Raises:
            InputError: the target is unknown, or the place cannot be written to.
            ModelError: the model cannot be said in this form.
        """
        require("a word", to=to)
        samples = None if log is None else samples_for(self, as_logs(log))
        motion = None if samples is None else states_of(samples.motion, samples.moving)
        return write_export(self.plain(), to, path, motion)

    def plain(self) -> ReconstructedModel:
        """The model without the logs it was made of."""
        return ReconstructedModel(**_parts(self))

    def __repr__(self) -> str:
        held_out = self.account is not None
        errors = (
            self.account.held_out.moving["nrmse"]
            if self.account is not None
            else self.baseline.get("nrmse", [])
        )
        known = [x for x in errors if x is not None]
        error = f", {'held-out' if held_out else 'baseline'} nRMSE {np.mean(known):.3g}" if known else ""
        kinds = ", ".join(dict.fromkeys(component.kind for component in self.components))
        more = f", {counted(len(self.effects), 'effect')} added" if self.effects else ""
        return f"<armloop.Model of {self.arm.name}, {self.arm.n} joints: {kinds}{more}{error}>"

    def __str__(self) -> str:
        parts = [repr(self).strip("<>")]
        if self.account is not None:
            parts += [
                str(steps_table(self.account.reports)),
                str(score_table(self.account.held_out, self.arm, units=self.torque_units)),
            ]
        parts.append("\n".join([formulas(self), *self.legend()]))
        parts += [added.sentence() for added in self.effects]
        if lean := self.history.get("leaning"):
            parts.append(of_a_lean(**lean))
        parts += [of_a_zero(**zero) for zero in self.history.get("zeros", [])]
        return "\n\n".join(parts)

    def _repr_html_(self) -> str:
        return page(str(self), self.plot() if self.logs else None)


def load_model(path: str | Path, arm: Arm | str | Path | None = None) -> Model:
    """Read a model file.

    Args:
        arm: refuse the model unless it was made for an arm of this one's joints and kinematics; that links weigh otherwise
            is said as a warning.

    Raises:
        ModelError: the file is no model; ``ArmError``: it is that of another arm.
    """
    return Model.of(read_model(path, None if arm is None else as_arm(arm)))


def reconstruct(
    logs: MotionLog | Sequence[MotionLog],
    arm: Arm | str | Path,
    *,
    method: str = Command.method,
    library: str | None = Command.library,
    estimator: str = Command.estimator,
    penalty: float | None = Command.penalty,
    snr: tuple[float, float, float] | None = None,
    max_order: int = Command.max_order,
    cutoff: float | None = Command.cutoff,
    torque_lag: float | None = Command.torque_lag,
    friction: Sequence[str] | None = None,
    physical: bool = True,
    progress: Progress = silent,
) -> Model:
    """Reconstruct a model of an arm's joint torques from its logs; the options of ``armloop reconstruct``.

    Args:
        method: "stepwise" or "sindy", one regression of everything, the reference method.
        library: "double-feature-set" (default up to four joints), "rigid-body" (default beyond) or "lagrangian".
        estimator: how terms are chosen.
        penalty: of the Lassos, or the threshold; by held-out error if None.
        snr: signal-to-noise ratios in dB of q, v, vdot of samples that are no time series.
        max_order: largest truncation order tried.
        cutoff: low-pass in Hz, 0 for none; by library if None.
        torque_lag: seconds by which tau is recorded later than q; found in the logs, where it is clear, if None.
        friction: laws that may be chosen with rigid-body and lagrangian; None for all.
        physical: keep M(q) positive definite and friction from driving.
        progress: is told where the work stands.

    Raises:
        InputError: logs that do not fit the arm, an unknown option, or too little excitation.
    """
    Command.checked(method=method, library=library, estimator=estimator, penalty=penalty)
    Command.checked(max_order=max_order, cutoff=cutoff, torque_lag=torque_lag)
    require("True or False", physical=physical)
    require("a function", progress=progress)
    given, arm = as_logs(logs), as_arm(arm)
    if not given:
        raise InputError("reconstruct: there is no log; give one at least")
    units = {log.tau_unit for log in given}
    if len(units) != 1:
        raise InputError("reconstruct: give logs, all of them with torques or all with currents")
    options = Options(
        sparse=Sparse(estimator, penalty),
        max_order=max_order,
        physical=physical,
        snr=_ratios(snr, method, library, cutoff),
        friction=_laws(friction),
        torque_lag=None if torque_lag is None else float(torque_lag),
    )
    conditioning = None if cutoff is None else Conditioning(cutoff_hz=float(cutoff))
    recorded: dict[str, Any] = {"unit": units.pop(), "drive_gains": None}
    account = run(given, arm, method, library, conditioning, options, progress, recorded)
    return Model(**_parts(account.model), account=account, logs=tuple(given))


def _parts(model: ReconstructedModel) -> dict[str, Any]:
    return {f.name: getattr(model, f.name) for f in fields(ReconstructedModel)}


def _ratios(
    snr: Sequence[float] | None, method: str, library: str | None, cutoff: float | None
) -> tuple[float, float, float] | None:
    """The signal-to-noise ratios; raises ``InputError`` where they are none, or would not be looked at."""
    if snr is None:
        return None
    q, v, vdot = numbers_of(snr, (3,), "snr", "dB of q, v and vdot").tolist()
    if min(q, v, vdot) <= 0:
        raise InputError(f"snr must be positive ratios in dB; it is {(q, v, vdot)}")
    require_ratios_used("snr", "cutoff=0", method, library, cutoff)
    return q, v, vdot


def _laws(friction: Sequence[str] | None) -> tuple[str, ...] | None:
    """The names of friction laws; raises ``InputError`` where they are no names."""
    if friction is None:
        return None
    if isinstance(friction, str) or not isinstance(friction, Iterable):
        raise InputError(
            f"friction must be a list of laws, such as ['coulomb', 'viscous']; it is {friction!r:.60}"
        )
    laws = tuple(friction)
    require("a word", **{f"friction {k + 1}": law for k, law in enumerate(laws)})
    return laws
