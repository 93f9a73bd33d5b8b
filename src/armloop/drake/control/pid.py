"""The PID law of Eqs. (35) and (36), run by a controller with a fixed period."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pydrake.autodiffutils import AutoDiffXd
from pydrake.systems.framework import Diagram, DiagramBuilder, LeafSystem_
from pydrake.systems.primitives import Demultiplexer, DiscreteTimeIntegrator

from armloop.drake.given import require_of
from armloop.drake.scalar_types import scalar_template
from armloop.util.arrays import Array
from armloop.util.given import levels_of, require


def check_gains(gains: Any, *names: str) -> None:
    """Make fields arrays (n,); raises `InputError` when they are not finite, of at least 0, as many as the first."""
    first = getattr(gains, names[0])
    n = len(first) if np.ndim(first) else 1
    for name in names:
        value = getattr(gains, name)
        object.__setattr__(gains, name, levels_of(value if np.ndim(value) else [value], n, name))


@dataclass(frozen=True, eq=False)
class PidGains:
    """Gains (n,): kp N*m/rad, ki N*m/(rad s), kd N*m*s/rad (N/m, .. for a prismatic joint).

    Raises `InputError` when they are not finite numbers of at least 0, one per joint.
    """

    kp: Array
    ki: Array
    kd: Array

    def __post_init__(self) -> None:
        check_gains(self, "kp", "ki", "kd")

    @staticmethod
    def paper(n: int) -> PidGains:
        """Return the gains of Sect. 4.3, 80, 8, 2, for n joints."""
        require("a whole number above 0", n=n)
        return PidGains(np.full(n, 80.0), np.full(n, 8.0), np.full(n, 2.0))


class PidController(Diagram):
    """tau = K_p e + K_i integral(e) + K_d de/dt + tau_ff, with e = q_ref - q and de/dt = v_ref - v.

    q is read through encoders of the given resolution; v is the joint module's own velocity signal. The
    integral is the sum of e times the period (forward Euler).

    Input ports: `q_ref`, `v_ref`, `tau_ff` (n,), `state` (2n,). Output ports: `tau` (n,), held by the discrete plant,
    whose time step must be `period`; `integral` (n,), integral(e) in rad s (m s). One discrete state (n,), the integral.
    Scalar types float, AutoDiffXd (in which reading an encoder has the derivative 1, as if it were ideal) and, with
    ideal encoders, Expression.

    Not supported: a bound on the integral (the plant clamps the torque; a controller that asks for more winds up), and a
    filter on v, which is taken as it is.
    """

    def __init__(self, gains: PidGains, period: float, resolution: ArrayLike = 0.0) -> None:
        """gains : n joints; period : s; resolution : rad (m) per encoder count, 0 for ideal encoders.

        Raises `InputError` for gains that are none, a period not above 0 or a resolution below 0.
        """
        require_of(PidGains, gains=gains)
        require("a number above 0", period=period)
        n = len(gains.kp)
        resolution = levels_of(resolution, n, "resolution")
        super().__init__()
        self.period = float(period)
        builder = DiagramBuilder()
        template = _EncodedPidLaw_ if np.any(resolution) else _PidLaw_
        law = builder.AddNamedSystem("law", template[None](gains, resolution))
        split = builder.AddNamedSystem("split", Demultiplexer([n, n]))
        integral = builder.AddNamedSystem("integral", DiscreteTimeIntegrator(n, period))
        for name in ("q_ref", "v_ref", "tau_ff", "state"):
            builder.ExportInput(law.GetInputPort(name), name)
        builder.Connect(law.get_output_port(), split.get_input_port())
        builder.Connect(split.get_output_port(1), integral.get_input_port())
        builder.Connect(integral.get_output_port(), law.GetInputPort("integral"))
        builder.ExportOutput(split.get_output_port(0), "tau")
        builder.ExportOutput(integral.get_output_port(), "integral")
        builder.BuildInto(self)


def _law(T: type) -> Any:
    """Return the class for one scalar type."""

    class Impl(LeafSystem_[T]):
        """The law without its memory. Output port: (2n,) torques, then e; one port, so that e is found once."""

        def _construct(self, gains: PidGains, resolution: ArrayLike) -> None:
            n = len(gains.kp)
            counts = np.broadcast_to(np.asarray(resolution, dtype=float), (n,)).tolist()
            self._joints = list(
                zip(gains.kp.tolist(), gains.ki.tolist(), gains.kd.tolist(), counts, strict=True)
            )
            self._n = n
            self._ports = [
                self.DeclareVectorInputPort(name, n) for name in ("q_ref", "v_ref", "tau_ff", "integral")
            ]
            self._state = self.DeclareVectorInputPort("state", 2 * n)
            sources = {self.all_input_ports_ticket()}
            self.DeclareVectorOutputPort("tau_and_e", 2 * n, self._calc, sources)

        def _calc(self, context: Any, output: Any) -> None:
            # Called every step: for a handful of joints plain floats are several times faster than arrays.
            state = self._state.Eval(context).tolist()
            signals = [port.Eval(context).tolist() for port in self._ports]
            tau, errors = [], []
            for (kp, ki, kd, count), q, v, q_ref, v_ref, tau_ff, integral in zip(
                self._joints, state[: self._n], state[self._n :], *signals, strict=True
            ):
                e = q_ref - (_read(q, count) if count else q)
                errors.append(e)
                tau.append(kp * e + ki * integral + kd * (v_ref - v) + tau_ff)
            output.SetFromVector(tau + errors)

    return Impl


def _read(q: Any, count: float) -> Any:
    """Return the position that an encoder says, in the scalar type of q."""
    value = q if isinstance(q, float) else q.value()
    rounded = round(value / count) * count
    return rounded if isinstance(q, float) else q + (rounded - value)


_PidLaw_ = scalar_template("_PidLaw_", __name__)(_law)
_EncodedPidLaw_ = scalar_template("_EncodedPidLaw_", __name__, [float, AutoDiffXd])(_law)
