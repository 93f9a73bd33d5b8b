"""Torque rate limit: what a drive's amplifier does to a torque that is asked for too soon."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.framework import LeafSystem_

from armloop.drake.scalar_types import scalar_template
from armloop.drake.scalars import functions_of, vector
from armloop.util.errors import InputError
from armloop.util.given import require


@scalar_template("RateLimiter_", __name__)
def RateLimiter_(T: type) -> Any:
    """Return the class for one scalar type."""

    class Impl(LeafSystem_[T]):
        """Torque that changes no faster than a drive can change it, and stays within the drive's limits.

        y_k = clip(clip(u_k, -effort, effort), y_k-1 - h rate, y_k-1 + h rate)

        Input port: `u` (n,), the torque asked for. Output port: `tau` (n,), N*m (N). One discrete state (n,), y of the
        last period, updated with the period h; zero at the start unless `set_torque` is called. Direct feedthrough: it
        is meant for a discrete plant of the same period. Scalar types float, AutoDiffXd and Expression. Not supported:
        telling the controller, whose integral goes on growing behind the limits.
        """

        def _construct(self, effort: ArrayLike, rate: ArrayLike, period: float) -> None:
            """effort : (n,) N*m (N); rate : (n,) N*m/s (N/s); period : s.

            Raises `InputError` when they are not above 0, or not for the same joints.
            """
            require("a number above 0", period=period)
            limits, rates = (np.atleast_1d(np.asarray(x)) for x in (effort, rate))
            if not {limits.dtype.kind, rates.dtype.kind} <= set("fiu"):
                raise InputError("effort and rate must be numbers above 0, one per joint")
            if limits.shape != rates.shape or limits.ndim != 1:
                raise InputError(f"effort is for {limits.size} joints, rate for {rates.size}")
            if not (np.all(limits > 0) and np.all(rates > 0)):
                raise InputError("effort and rate must be above 0")
            self._limits = list(zip(limits.tolist(), (period * rates).tolist(), strict=True))
            self._u = self.DeclareVectorInputPort("u", limits.size)
            self.DeclareDiscreteState(limits.size)
            self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
            sources = {self.all_input_ports_ticket(), self.all_state_ticket()}
            self.DeclareVectorOutputPort("tau", limits.size, self._calc_tau, sources)

        def set_torque(self, context: Any, tau: Any) -> None:
            """Let the drive have had the torques tau (n,) before, in this system's own context."""
            context.SetDiscreteState(vector(T, list(tau)))

        def _limited(self, context: Any) -> np.ndarray:
            last = context.get_discrete_state_vector().CopyToVector().tolist()
            clip, asked = functions_of(T).clip, self._u.Eval(context).tolist()
            values = [
                clip(clip(u, -limit, limit), y - step, y + step)
                for u, y, (limit, step) in zip(asked, last, self._limits, strict=True)
            ]
            return vector(T, values)

        def _calc_tau(self, context: Any, output: Any) -> None:
            output.SetFromVector(self._limited(context))

        def _update(self, context: Any, discrete: Any) -> None:
            discrete.set_value(self._limited(context))

    return Impl


RateLimiter = RateLimiter_[None]
