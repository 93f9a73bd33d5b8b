"""The PID law of Eqs. (35) and (36), run by a controller with a fixed period."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PidGains:
    """Gains (n,): kp N*m/rad, ki N*m/(rad s), kd N*m*s/rad (N/m, .. for a prismatic joint).

    Raises `ValueError` when they are not finite numbers of at least 0, one per joint.
    """

    kp: Array
    ki: Array
    kd: Array

    def __post_init__(self) -> None:
        for name in ("kp", "ki", "kd"):
            value = np.atleast_1d(np.asarray(getattr(self, name), dtype=float))
            object.__setattr__(self, name, value)
            if (
                value.ndim != 1
                or value.shape != self.kp.shape
                or not np.isfinite(value).all()
                or np.any(value < 0)
            ):
                raise ValueError(f"{name} must be finite numbers of at least 0, one per joint; it is {value}")

    @staticmethod
    def paper(n: int) -> PidGains:
        """Return the gains of Sect. 4.3, 80, 8, 2, for n joints."""
        return PidGains(np.full(n, 80.0), np.full(n, 8.0), np.full(n, 2.0))


class PidController(LeafSystem):
    """tau = K_p e + K_i integral(e) + K_d de/dt + tau_ff, with e = q_ref - q and de/dt = v_ref - v.

    q is read through encoders of the given resolution; v is the joint module's own velocity signal. The
    integral is the sum of e times the period (forward Euler).

    Input ports: `q_ref`, `v_ref`, `tau_ff` (n,), `state` (2n,). Output port: `tau` (n,), held by the discrete
    plant, whose time step must be `period`. One discrete state (n,), the integral. Scalar type float only.
    """

    def __init__(self, gains: PidGains, period: float, resolution: ArrayLike = 0.0) -> None:
        """gains : n joints; period : s; resolution : rad (m) per encoder count, 0 for ideal encoders."""
        super().__init__()
        n = len(gains.kp)
        self._n = n
        self._period = period
        self._gains = list(zip(gains.kp.tolist(), gains.ki.tolist(), gains.kd.tolist(), strict=True))
        self._counts = np.broadcast_to(np.asarray(resolution, dtype=float), (n,)).tolist()
        self._q_ref = self.DeclareVectorInputPort("q_ref", n)
        self._v_ref = self.DeclareVectorInputPort("v_ref", n)
        self._tau_ff = self.DeclareVectorInputPort("tau_ff", n)
        self._state = self.DeclareVectorInputPort("state", 2 * n)
        self.DeclareVectorOutputPort("tau", n, self._calc_tau)
        self.DeclareDiscreteState(n)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update_integral)

    # Both run at every step: for a handful of joints plain floats are several times faster than arrays.

    def _error(self, context: Context, state: list[float]) -> list[float]:
        q_ref = self._q_ref.Eval(context).tolist()
        return [
            reference - (round(q / count) * count if count else q)
            for reference, q, count in zip(q_ref, state, self._counts, strict=False)
        ]

    def _calc_tau(self, context: Context, output: BasicVector) -> None:
        state = self._state.Eval(context).tolist()
        terms = zip(
            self._gains,
            self._error(context, state),
            context.get_discrete_state_vector().value().tolist(),
            self._v_ref.Eval(context).tolist(),
            state[self._n :],
            self._tau_ff.Eval(context).tolist(),
            strict=True,
        )
        output.SetFromVector(
            [kp * e + ki * integral + kd * (w - v) + ff for (kp, ki, kd), e, integral, w, v, ff in terms]
        )

    def _update_integral(self, context: Context, update: DiscreteValues) -> None:
        error = self._error(context, self._state.Eval(context).tolist())
        integral = context.get_discrete_state_vector().value().tolist()
        update.get_mutable_vector().SetFromVector(
            [x + self._period * e for x, e in zip(integral, error, strict=True)]
        )
