"""A reconstructed model as a Drake feedforward system."""

from __future__ import annotations

from math import isfinite
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import BasicVector, Context, LeafSystem

Array = NDArray[np.float64]


class FeedforwardModel(Protocol):
    """Anything that predicts the drive torque of one state."""

    def feedforward(self, q: Array, v: Array, vdot: Array, step: int) -> Array:
        """Return (n,) torques at q, v, vdot (n,) by the terms of the first `step` steps (1, 2 or 3)."""


class Feedforward(LeafSystem):
    """Torque that a model says the reference needs: the sum of Y^S Xi^S over steps in Eqs. (35), (36).

    tau_ff = model(q_ref, v_ref, vdot_ref), by its terms up to `step`: 1 gravity and dry friction, 2 with
    velocity terms, 3 with acceleration terms.

    Input ports: `q_ref`, `v_ref`, `vdot_ref`, (n,) each. Output port: `tau_ff` (n,), N*m (N).
    Stateless, direct feedthrough; scalar type float only. A prediction that is not finite raises
    `RuntimeError`: an unset or NaN torque would silently spoil a simulation.
    """

    def __init__(self, model: FeedforwardModel, n: int, step: int = 3) -> None:
        """model : see `FeedforwardModel`; n : its joints; step : 1, 2 or 3."""
        super().__init__()
        self._model = model
        self._step = step
        self._inputs = [self.DeclareVectorInputPort(name, n) for name in ("q_ref", "v_ref", "vdot_ref")]
        self.DeclareVectorOutputPort("tau_ff", n, self._calc_tau_ff)

    def _calc_tau_ff(self, context: Context, output: BasicVector) -> None:
        q, v, vdot = (port.Eval(context) for port in self._inputs)
        tau = self._model.feedforward(q, v, vdot, self._step)
        if not isfinite(
            sum(tau.tolist())
        ):  # a NaN or an infinity shows in the sum; several times faster than numpy
            raise RuntimeError(f"the model's torque is not finite at t = {context.get_time():.4f} s: {tau}")
        output.SetFromVector(tau)
