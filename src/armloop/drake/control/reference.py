"""Motions as Drake sources: tables, sampled once, held over each period as a controller of that period reads them."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pydrake.autodiffutils import AutoDiffXd
from pydrake.systems.framework import Diagram, DiagramBuilder, LeafSystem_
from pydrake.systems.primitives import Demultiplexer
from pydrake.trajectories import PiecewisePolynomial, Trajectory

from armloop.drake.control.feedforward import FeedforwardModel
from armloop.drake.given import require_joints, require_predicts, require_step
from armloop.drake.scalar_types import scalar_template
from armloop.dynamics import ModelEquations
from armloop.experiment.excitation import Reference
from armloop.model import ReconstructedModel
from armloop.util.arrays import Array
from armloop.util.errors import InputError, ModelError
from armloop.util.functions import NUMPY
from armloop.util.given import numbers_of, require

_CHUNK = 1000  # rows of feedforward evaluated at once, when the first of them is needed


def held_rows(rows: Array, period: float) -> PiecewisePolynomial:
    """Return rows (K, m) as a trajectory that holds row k around k periods, and the last one afterwards."""
    breaks = period * (np.arange(len(rows) + 1) - 0.5)
    return PiecewisePolynomial.ZeroOrderHold(breaks, np.vstack([rows, rows[-1:]]).T)


class TrajectoryReference:
    """A Drake trajectory as a motion to follow: its value is q, its derivatives are v and vdot; at rest after its end."""

    def __init__(self, trajectory: Trajectory) -> None:
        """trajectory : of n rows and one column; its start is time 0."""
        if trajectory.cols() != 1 or not trajectory.has_derivative():
            raise InputError(
                f"the trajectory has {trajectory.rows()} rows and {trajectory.cols()} columns; a motion to follow has a row "
                "per joint, one column, and derivatives"
            )
        self._start = trajectory.start_time()
        self._derivatives = [trajectory.MakeDerivative(order) for order in range(3)]
        self.duration = float(trajectory.end_time() - self._start)

    def evaluate(self, t: ArrayLike) -> tuple[Array, Array, Array]:
        """Return q, v, vdot, each (N, n), at the times `t` (N,)."""
        t = np.atleast_1d(np.asarray(t, dtype=float))
        inside = np.clip(t, 0.0, self.duration)
        q, v, vdot = (each.vector_values(self._start + inside).T for each in self._derivatives)
        moves = (t == inside)[:, None]
        return q, v * moves, vdot * moves


ReferenceLike = Reference | Trajectory
"""What can be followed."""


def as_reference(given: Any) -> Reference:
    """Return a motion to follow of one, or of a Drake trajectory; raises `InputError` for what is neither."""
    if isinstance(given, Trajectory):
        return TrajectoryReference(given)
    if not (callable(getattr(given, "evaluate", None)) and hasattr(given, "duration")):
        raise InputError(
            "the reference must have evaluate(t) and a duration, such as one of armloop.experiment.excitation, or be a "
            f"Trajectory of pydrake; it is of type {type(given).__name__}"
        )
    motion: Reference = given
    return motion


class ReferenceSource(Diagram):
    """Give q_ref(t), v_ref(t), vdot_ref(t) of a reference, held over each period, and a model's feedforward of it.

    tau_ff = model(q_ref, v_ref, vdot_ref), as from the system `Feedforward`, but as the reference is known ahead it is
    evaluated for a thousand periods at once: during a simulation it costs next to nothing.

    Output ports: `q_ref`, `v_ref`, `vdot_ref`, (n,) each, in rad, rad/s, rad/s^2 (m, ..); `tau_ff` (n,), N*m (N),
    zero without a model. After the reference's duration the last values are held. Scalar types float and
    AutoDiffXd, in which they are constants; not Expression, in which a table cannot be looked up.
    A torque that is not finite raises `RuntimeError` when its time has come.

    Precondition: whoever reads it has the same period and no offset. Not supported: a model's friction with memory (as if
    fully slid).
    """

    def __init__(
        self,
        reference: Reference | Trajectory,
        period: float,
        model: FeedforwardModel | None = None,
        step: int = 3,
    ) -> None:
        """reference : what to follow, or a Drake trajectory of it; period : s; model, step : see `Feedforward`.

        Raises `InputError` for what is none, or where the model is of another number of joints.
        """
        require("a number above 0", period=period)
        reference = as_reference(reference)
        if not period <= reference.duration:
            raise InputError(f"the period is {period:g} s, the reference lasts {reference.duration:g} s only")
        super().__init__()
        self.tables = reference.evaluate(period * np.arange(round(reference.duration / period) + 1))
        n = self.tables[0].shape[1]
        builder = DiagramBuilder()
        self._table = builder.AddNamedSystem("table", _ReferenceTable(self.tables, period))
        self._table.set_model(model, step)
        split = builder.AddNamedSystem("split", Demultiplexer([n, n, n, n]))
        builder.Connect(self._table.get_output_port(), split.get_input_port())
        for index, name in enumerate(("q_ref", "v_ref", "vdot_ref", "tau_ff")):
            builder.ExportOutput(split.get_output_port(index), name)
        builder.BuildInto(self)

    def set_model(self, model: FeedforwardModel | None, step: int = 3) -> None:
        """Take another model from the next period on; between two calls of `Simulator.AdvanceTo`."""
        self._table.set_model(model, step)

    def set_torques(self, tau: Array) -> None:
        """Take torques (K, n) in place of a model's, one row per period, K as in `tables`."""
        self._table.set_torques(tau)


@scalar_template("_ReferenceTable_", __name__, [float, AutoDiffXd])
def _ReferenceTable_(T: type) -> Any:
    """Return the class for one scalar type."""

    class Impl(LeafSystem_[T]):
        """A table, held row by row, whose last n columns are filled in, chunk by chunk, when they are needed."""

        def _construct(self, tables: tuple[Array, Array, Array], period: float) -> None:
            n = self._n = tables[0].shape[1]
            self._period = period
            self._rows = np.hstack([*tables, np.zeros_like(tables[0])])
            # what is constant has no derivatives: only the time is looked at
            self.DeclareVectorOutputPort("row", 4 * n, self._calc_row, {self.time_ticket()})
            self.set_model(None, 3)

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, **{**other._given, "converter": converter})
            self._model, self._step, self._equations = other._model, other._step, other._equations
            self._rows, self._filled = other._rows.copy(), list(other._filled)

        def set_model(self, model: FeedforwardModel | None, step: int) -> None:
            require_step(step)
            if model is not None:
                require_predicts(model)
                require_joints(model, self._n, "the reference is for")
            self._model, self._step = model, step
            self._equations = None
            if isinstance(model, ReconstructedModel):
                # An added effect may have a law for samples only: then each period is asked for by itself.
                with suppress(ModelError):
                    self._equations = ModelEquations(model, NUMPY, step=step)
            self._rows[:, 3 * self._n :] = 0.0
            self._filled = [model is None] * (len(self._rows) // _CHUNK + 1)

        def set_torques(self, tau: Array) -> None:
            self._rows[:, 3 * self._n :] = numbers_of(
                tau, (len(self._rows), self._n), "tau", "a row per period"
            )
            self._filled = [True] * len(self._filled)

        def _calc_row(self, context: Any, output: Any) -> None:
            time = context.get_time()
            seconds = time if T is float else time.value()
            row = min(int(seconds / self._period + 0.5), len(self._rows) - 1)
            if not self._filled[row // _CHUNK]:
                self._fill(row // _CHUNK)
            output.SetFromVector(self._rows[row])

        def _fill(self, chunk: int) -> None:
            part = slice(chunk * _CHUNK, (chunk + 1) * _CHUNK)
            rows, n = self._rows[part], self._n
            q, v, vdot = rows[:, :n], rows[:, n : 2 * n], rows[:, 2 * n : 3 * n]
            if self._equations is not None:
                columns = self._equations.torque(*(list(x.T) for x in (q, v, vdot)))
                rows[:, 3 * n :] = np.stack([np.broadcast_to(x, len(rows)) for x in columns], axis=1)
            else:
                assert self._model is not None
                tau = [self._model.feedforward(*state, self._step) for state in zip(q, v, vdot, strict=True)]
                if np.shape(tau) != (len(rows), n):
                    raise InputError(
                        f"feedforward of {type(self._model).__name__} must give {n} numbers; it gives {tau[0]!r:.60}"
                    )
                rows[:, 3 * n :] = tau
            wrong = np.flatnonzero(~np.isfinite(rows).all(axis=1))
            if len(wrong):
                time = self._period * (part.start + wrong[0])
                raise RuntimeError(
                    f"the model's torque is not finite at t = {time:.4f} s: {rows[wrong[0], 3 * n :]}"
                )
            self._filled[chunk] = True

    return Impl


_ReferenceTable = _ReferenceTable_[None]
