"""A reconstructed model as a plant: to simulate, linearise and plan with what was identified."""

from __future__ import annotations

from typing import Any

from pydrake.systems.framework import LeafSystem_

from armloop.drake.given import require_model
from armloop.drake.scalar_types import scalar_template
from armloop.drake.scalars import functions_of, vector
from armloop.dynamics import ModelEquations, require_mass_matrix
from armloop.model import ReconstructedModel
from armloop.util.given import require

SMOOTHING = 0.01
"""Speed within which dry friction changes sign, rad/s (m/s)."""


@scalar_template("ForwardDynamics_", __name__)
def ForwardDynamics_(T: type) -> Any:
    """Return the class for one scalar type."""

    class Impl(LeafSystem_[T]):
        """An arm that moves as an identified model says.

        dq/dt = v,  M(q) dv/dt = tau - C(q, v) v - tau_g(q) - f(v)

        M, bias and gravity are those of the model and of the effects that a diagnosis added to it (payload,
        rotor inertia, spring, ripple, tilt); f is the model's friction with that of added effects, its sign
        smoothed: sign(v), and what fades in over less, becomes tanh(v / `smoothing`), and a root of the speed is rounded
        off below it. Such a joint creeps instead of sticking, at the speed at which tanh carries the load;
        `StickingForwardDynamics` sticks. A small `smoothing` makes the equations stiff: error-controlled integrators
        slow down, and fixed steps h need h f_c (M^-1)_ii < 2 `smoothing`.

        Input port: `tau` (n,), the drives' torques, N*m (N). Output port: `state` (2n,), q, then v.
        2n continuous states, n of them positions, n velocities. No direct feedthrough.

        Scalar types float, AutoDiffXd and Expression: for `Linearize`, `DirectCollocation` and other planners,
        and for the equations as formulas.

        Precondition: M has a positive definite symmetric part over the range that the model was fitted on (checked
        on construction, raises `ModelError`). M of sparse terms need not be symmetric, as its rows were found joint
        by joint; `symmetric` takes (M + M^T) / 2 instead. In noisy data it may not be positive definite either: then
        plan with `armloop.dynamics.nearest_rigid_body(model)`. Outside the training range nothing holds M positive
        definite but a rigid body's physical parameters.

        Not supported: joint and torque limits, contact, sensor effects, friction with memory (as if fully
        slid), models with terms that are not linear in the acceleration alone (one-shot SINDy may have them).
        """

        def _construct(
            self,
            model: ReconstructedModel,
            *,
            smoothing: float = SMOOTHING,
            symmetric: bool = False,
            check: bool = True,
        ) -> None:
            """model : of n joints; smoothing : rad/s (m/s); check : whether to try M over the training range."""
            require_model(model)
            require("a number above 0", smoothing=smoothing)
            equations = ModelEquations(model, functions_of(T), smoothing=smoothing, symmetric=symmetric)
            if check:
                require_mass_matrix(model)
            # What is converted has been checked: M does not change with the scalar type.
            self._given["check"] = False
            self._equations = equations
            n = self._n = equations.n
            self._tau = self.DeclareVectorInputPort("tau", n)
            self.DeclareStateOutputPort("state", self.DeclareContinuousState(n, n, 0))

        def DoCalcTimeDerivatives(self, context: Any, derivatives: Any) -> None:
            state = context.get_continuous_state_vector().CopyToVector().tolist()
            q, v = state[: self._n], state[self._n :]
            tau = self._tau.Eval(context).tolist()
            vdot = self._equations.acceleration(q, v, tau, context.get_time())
            derivatives.get_mutable_vector().SetFromVector(vector(T, [*v, *vdot]))

    return Impl


ForwardDynamics = ForwardDynamics_[None]
