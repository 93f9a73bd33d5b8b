"""A reconstructed model as inverse-dynamics (computed-torque) controller."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from pydrake.systems.framework import LeafSystem_

from armloop.drake.control.feedforward import HoldsModel, require_finite
from armloop.drake.control.pid import check_gains
from armloop.drake.given import require_joints, require_model, require_of, require_predicts
from armloop.drake.scalar_types import scalar_template
from armloop.drake.scalars import functions_of, vector
from armloop.dynamics import ModelEquations, require_mass_matrix
from armloop.model import ReconstructedModel
from armloop.model.pointwise import InverseDynamics
from armloop.util.arrays import Array
from armloop.util.errors import InputError, ModelError
from armloop.util.given import require

FRICTION_SOURCES = ("reference", "state", "none")
BANDWIDTH = 20.0  # rad/s, by default


class InverseDynamicsModel(Protocol):
    """Anything that predicts the drive torque of one state, with friction at velocities of the caller's choice."""

    def feedforward(
        self, q: Array, v: Array, vdot: Array, step: int = ..., sliding: Array | None = None
    ) -> Array:
        """Return (n,) torques at q, v, vdot (n,), friction taken at `sliding` (n,)."""


@dataclass(frozen=True, eq=False)
class AccelerationGains:
    """Gains (n,) on the acceleration: kp 1/s^2, kd 1/s, ki 1/s^3 (none by default).

    Raises `InputError` when they are not finite numbers of at least 0, one per joint.
    """

    kp: Array
    kd: Array
    ki: Array | None = None

    def __post_init__(self) -> None:
        if self.ki is None:
            object.__setattr__(self, "ki", np.zeros(np.size(self.kp)))
        check_gains(self, "kp", "kd", "ki")

    @staticmethod
    def critical(n: int, bandwidth: float = BANDWIDTH) -> AccelerationGains:
        """Return kp = w^2, kd = 2 w for n joints: errors decay critically damped at w = `bandwidth`, rad/s."""
        require("a whole number above 0", n=n)
        require("a number above 0", bandwidth=bandwidth)
        return AccelerationGains(np.full(n, bandwidth**2), np.full(n, 2 * bandwidth))


@scalar_template("ComputedTorque_", __name__)
def ComputedTorque_(T: type) -> Any:
    """Return the class for one scalar type."""

    class Impl(HoldsModel, LeafSystem_[T]):
        """Inverse dynamics of the state, with the acceleration that a linear law wants.

        tau = M(q) a + C(q, v) v + tau_g(q) + f(v_f),
        a = vdot_ref + K_d (v_ref - v) + K_p (q_ref - q) + K_i integral(q_ref - q)

        With an exact model the error obeys e'' + K_d e' + K_p e = 0 at every posture and speed.

        Friction is taken at v_f = v_ref (`friction_at` "reference", the default), at the measured v ("state"), or
        left out ("none"). The measured velocity is the wrong one near zero speed: its sign is noise there, which
        shakes the joint, and a joint that sticks has none, so that nothing helps it to break away. The reference
        knows where the joint is about to go; where it stands still, v_ref = 0, no friction is supplied. The
        joint's own viscous friction then still damps the error; "state" takes it away.

        Input ports: `q_ref`, `v_ref`, `vdot_ref` (n,), `state` (2n,) positions, then velocities. Output port:
        `tau` (n,), N*m (N).

        Without integral gains there is no state. With them, (n,) integrals: discrete with the given `period`
        (forward Euler), or continuous without one. Direct feedthrough of all inputs. Scalar types float,
        AutoDiffXd and Expression; for the last two the model must be a `ReconstructedModel`.

        Precondition: M is positive definite; where it is not, feedback drives errors away. A `ReconstructedModel` without
        such an M over its training range is refused, `ModelError`, by `set_model`, too: hand in
        `armloop.dynamics.with_mass_matrix(model)`. Of anything else that predicts it is not checked.

        Not supported: torque limits (saturate `tau` behind it), friction with memory (taken as fully slid),
        models of a step below 3, which hold no inertia. A torque that is not finite raises `RuntimeError`.
        """

        def _construct(
            self,
            model: InverseDynamicsModel,
            gains: AccelerationGains,
            *,
            friction_at: str = "reference",
            period: float | None = None,
        ) -> None:
            """model : such as one of `armloop.model.load_model`; gains : of its n joints; period : s.

            Raises `InputError` where they are none, or not of the same joints.
            """
            require_predicts(model)
            require_of(AccelerationGains, gains=gains)
            require_joints(model, len(gains.kp), "the gains are for")
            if period is not None:
                require("a number above 0", period=period)
            if not isinstance(friction_at, str) or friction_at not in FRICTION_SOURCES:
                raise InputError(f"friction_at is {friction_at!r}; it must be {', '.join(FRICTION_SOURCES)}")
            n = self._n = len(gains.kp)
            self._friction_at = friction_at
            self._take(model)
            assert gains.ki is not None
            self._gains = [gain.tolist() for gain in (gains.kp, gains.kd, gains.ki)]
            self._integrates = bool(gains.ki.any())
            self._period = period
            self._references = [
                self.DeclareVectorInputPort(name, n) for name in ("q_ref", "v_ref", "vdot_ref")
            ]
            self._state = self.DeclareVectorInputPort("state", 2 * n)
            if self._integrates and period is not None:
                self.DeclareDiscreteState(n)
                self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
            elif self._integrates:
                self.DeclareContinuousState(n)
            # Named, or Drake would find out by writing all the formulas out.
            sources = {self.all_input_ports_ticket(), self.all_state_ticket()}
            self.DeclareVectorOutputPort("tau", n, self._calc_tau, sources)

        def _take(self, model: InverseDynamicsModel) -> None:
            if isinstance(model, ReconstructedModel):
                _require_feedback(model)
            if T is float:
                self._drive = _drive(model)
            else:
                require_model(model)
                assert isinstance(model, ReconstructedModel)
                self._equations = ModelEquations(model, functions_of(T))

        def _calc_tau(self, context: Any, output: Any) -> None:
            n = self._n
            q_ref, v_ref, vdot_ref = (port.Eval(context).tolist() for port in self._references)
            state = self._state.Eval(context).tolist()
            q, v = state[:n], state[n:]
            kp, kd, ki = self._gains
            wanted = [
                a + d * (w - y) + p * (r - x)
                for a, d, w, y, p, r, x in zip(vdot_ref, kd, v_ref, v, kp, q_ref, q, strict=True)
            ]
            if self._integrates:
                integral = self._integral(context).tolist()
                wanted = [a + i * z for a, i, z in zip(wanted, ki, integral, strict=True)]
            sliding = {"reference": v_ref, "state": v, "none": [0.0] * n}[self._friction_at]
            output.SetFromVector(self._torque(q, v, wanted, sliding, context))

        def _torque(self, q: list, v: list, vdot: list, sliding: list, context: Any) -> np.ndarray:
            if T is float:
                tau = self._drive(np.array(q), np.array(v), np.array(vdot), np.array(sliding))
                require_finite(tau.tolist(), context)
                return tau
            equations = self._equations
            load = equations.load(q, v, vdot) if equations.load_matters else None
            friction = equations.friction(sliding, load, q=q)
            return vector(T, [x + y for x, y in zip(equations.rigid(q, v, vdot), friction, strict=True)])

        def _integral(self, context: Any) -> np.ndarray:
            if self._period is not None:
                return context.get_discrete_state_vector().CopyToVector()
            return context.get_continuous_state_vector().CopyToVector()

        def _error(self, context: Any) -> list[Any]:
            wanted, state = self._references[0].Eval(context), self._state.Eval(context)
            return [r - x for r, x in zip(wanted.tolist(), state.tolist()[: self._n], strict=True)]

        def _update(self, context: Any, discrete: Any) -> None:
            integral, error = self._integral(context).tolist(), self._error(context)
            discrete.set_value(
                vector(T, [z + self._period * e for z, e in zip(integral, error, strict=True)])
            )

        def DoCalcTimeDerivatives(self, context: Any, derivatives: Any) -> None:
            if self._integrates and self._period is None:
                derivatives.get_mutable_vector().SetFromVector(vector(T, self._error(context)))

    return Impl


ComputedTorque = ComputedTorque_[None]


def _require_feedback(model: ReconstructedModel) -> None:
    """Raise `ModelError` for a model whose M turns an acceleration wanted into a torque the other way."""
    try:
        require_mass_matrix(model)
    except ModelError as error:
        raise ModelError(
            f"computed torque would drive the arm away from its reference: {error}. "
            "armloop.dynamics.with_mass_matrix(model) takes the nearest rigid body where it has one"
        ) from error


def _drive(model: InverseDynamicsModel) -> InverseDynamics:
    """A model's torque at one sample, without the checks of what a caller of `feedforward` hands in."""
    if isinstance(model, ReconstructedModel):
        return model.drive()
    return lambda q, v, vdot, sliding=None: model.feedforward(q, v, vdot, sliding=sliding)
