"""A reconstructed model as a Drake feedforward system."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import isfinite
from typing import Any, Protocol

import numpy as np
from pydrake.systems.framework import LeafSystem_

from armloop.drake.given import require_joints, require_model, require_predicts, require_step
from armloop.drake.scalar_types import scalar_template
from armloop.drake.scalars import functions_of, vector
from armloop.dynamics import ModelEquations
from armloop.model import ReconstructedModel
from armloop.util.arrays import Array
from armloop.util.errors import InputError
from armloop.util.given import require


class FeedforwardModel(Protocol):
    """Anything that predicts the drive torque of one state."""

    def feedforward(self, q: Array, v: Array, vdot: Array, step: int) -> Array:
        """Return (n,) torques at q, v, vdot (n,) by the terms of the first `step` steps (1, 2 or 3)."""


Models = Mapping[str, FeedforwardModel]
"""Models by the names that controllers know them by."""


class HoldsModel:
    """A system whose model can be exchanged: in float for any that predicts, else for a `ReconstructedModel` alone."""

    _n: int
    _given: dict[str, Any]

    @staticmethod
    def _converts(given: Mapping[str, Any]) -> bool:
        # numbers alone can be neither differentiated nor written out
        return isinstance(given["model"], ReconstructedModel)

    def set_model(self, model: Any) -> None:
        """Take another model of the same arm from the next step on, between two `AdvanceTo`.

        Raises `ModelError` for a model of other joints and, unless the scalar type is float, for one that is no
        `ReconstructedModel`.
        """
        require_predicts(model)
        require_joints(model, self._n, "this system is for")
        self._take(model)
        self._given["model"] = model

    def _take(self, model: Any) -> None:
        raise NotImplementedError


def require_finite(tau: Sequence[float], context: Any) -> None:
    """Raise `RuntimeError` for a torque with a number that is not: the sum shows it, sooner than numpy's test does."""
    if not isfinite(sum(tau)):
        raise RuntimeError(f"the model's torque is not finite at t = {context.get_time():.4f} s: {tau}")


@scalar_template("Feedforward_", __name__)
def Feedforward_(T: type) -> Any:
    """Return the class for one scalar type."""

    class Impl(HoldsModel, LeafSystem_[T]):
        """Torque that a model says the reference needs: the sum of Y^S Xi^S over steps in Eqs. (35), (36).

        tau_ff = model(q_ref, v_ref, vdot_ref), by its terms up to `step`: 1 gravity and dry friction, 2 with
        velocity terms, 3 with acceleration terms.

        Input ports: `q_ref`, `v_ref`, `vdot_ref`, (n,) each, or with `stacked` one, `motion_ref` (3n,), all three
        behind each other: reading one port instead of three saves a sixth of the time of 300 terms. Output port:
        `tau_ff` (n,), N*m (N). A reference that is known ahead is cheaper still: `ReferenceSource`.

        Precondition: the model is of n joints, and the reference within what it was fitted on. Not supported: effects of
        the sensors, which no controller should supply.

        Stateless, direct feedthrough. Scalar types float, AutoDiffXd and Expression; for the last two the model
        must be a `ReconstructedModel`, and dry friction has the derivative 0, which is wrong at rest. Friction
        with memory acts as if fully slid. A prediction that is not finite raises `RuntimeError`: an unset or
        NaN torque would silently spoil a simulation.
        """

        def _construct(
            self,
            model: FeedforwardModel,
            step: int = 3,
            *,
            n: int | None = None,
            stacked: bool = False,
        ) -> None:
            """model : see `FeedforwardModel`; step : 1, 2 or 3; n : joints of a model without an arm; stacked : one port.

            Raises `InputError` for what is no model, another step, a number of joints that is not known or another.
            """
            require_predicts(model)
            require_step(step, " (a model knows its joints)")
            n = _joints(model, n)
            self._n, self._step = n, step
            self._take(model)
            names, size = (("motion_ref",), 3 * n) if stacked else (("q_ref", "v_ref", "vdot_ref"), n)
            self._inputs = [self.DeclareVectorInputPort(name, size) for name in names]
            # Named, or Drake would find out by writing all the formulas out.
            self.DeclareVectorOutputPort("tau_ff", n, self._calc_tau_ff, {self.all_input_ports_ticket()})

        def _take(self, model: FeedforwardModel) -> None:
            if T is float:
                self._drive = _drive(model, self._step)
            else:
                require_model(model)
                assert isinstance(model, ReconstructedModel)
                self._equations = ModelEquations(model, functions_of(T), step=self._step)

        def _calc_tau_ff(self, context: Any, output: Any) -> None:
            x = np.concatenate([port.Eval(context) for port in self._inputs])
            if T is not float:
                q, v, vdot = (part.tolist() for part in np.split(x, 3))
                output.SetFromVector(vector(T, self._equations.torque(q, v, vdot)))
                return
            tau = self._drive(x)
            require_finite(tau, context)
            output.SetFromVector(tau)

    return Impl


Feedforward = Feedforward_[None]


def _joints(model: FeedforwardModel, n: int | None) -> int:
    """The number of joints of a model, or as it is said to be."""
    known: int | None = getattr(getattr(model, "arm", None), "n", None)
    if known is None:
        if n is None:
            raise InputError(f"{type(model).__name__} has no arm: say its number of joints with n=")
        require("a whole number above 0", n=n)
        return n
    if n is not None and not (isinstance(n, int) and known == n):
        raise InputError(f"n is {n}; the model's arm has {known} joints")
    return int(known)


def _drive(model: FeedforwardModel, step: int) -> Callable[[Array], Sequence[float]]:
    """A model's torque at q, v and vdot behind each other, (3n,)."""
    if isinstance(model, ReconstructedModel):
        return model.stacked_drive(step)

    def drive(x: Array) -> Sequence[float]:
        q, v, vdot = np.split(x, 3)
        return np.asarray(model.feedforward(q, v, vdot, step)).tolist()

    return drive
