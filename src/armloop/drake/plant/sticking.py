"""Forward dynamics of a reconstructed model with stick-slip: a plant whose joints really stick."""

from __future__ import annotations

from typing import Any

from pydrake.autodiffutils import AutoDiffXd
from pydrake.systems.framework import LeafSystem_

from armloop.drake.given import require_model
from armloop.drake.plant.implicit import ClampedLaw, implicit_torques
from armloop.drake.scalar_types import scalar_template
from armloop.drake.scalars import functions_of, vector
from armloop.dynamics import ModelEquations, require_mass_matrix
from armloop.dynamics.model import solve
from armloop.model import ReconstructedModel
from armloop.util.given import require


@scalar_template("StickingForwardDynamics_", __name__, [float, AutoDiffXd])
def StickingForwardDynamics_(T: type) -> Any:
    """Return the class for one scalar type."""

    class Impl(LeafSystem_[T]):
        """An arm that moves as an identified model says, in steps of h, with dry friction that sticks.

        M(q) (w - v) = h (tau - C(q, v) v - tau_g(q) - f(w)),  q' = q + h w,  v' = w

        Dry friction has the sign of the velocity w that the step ends with, and the level at the velocity v that it
        starts with: a joint holds still below its static friction and creeps no faster than its load / 1e8. What is
        smooth in v (viscous friction) is taken at v and needs h f_v (M^-1)_ii < 2. Smoothed Coulomb terms of a model
        stick too. Friction that grows with the load takes the load without the acceleration's part.

        Input port: `tau` (n,), the drives' torques over the step, N*m (N). Output port: `state` (2n,), q, then v.
        2n discrete states with the period `time_step`. Scalar types float and AutoDiffXd, in which a joint
        that sticks stays and one that slides keeps the sign of its friction; not Expression, which cannot tell one from
        the other. To plan take `ForwardDynamics`, which is smooth.

        Precondition: (M + M^T) / 2, which is taken for M, is positive definite over the training range (checked on
        construction, raises `ModelError`). Effects that a diagnosis added are included, sensor effects left out.

        Not supported: joint and torque limits, contact, friction with memory (as if fully slid).
        """

        def _construct(
            self,
            model: ReconstructedModel,
            time_step: float = 1e-3,
            *,
            check: bool = True,
        ) -> None:
            """model : of n joints; time_step : h in s; check : whether to try M over the training range."""
            require_model(model)
            require("a number above 0", time_step=time_step)
            if check:
                require_mass_matrix(model)
            # What is converted has been checked: M does not change with the scalar type.
            self._given["check"] = False
            self._equations = ModelEquations(model, functions_of(T), sharp=True, symmetric=True)
            self._step = float(time_step)
            n = self._n = model.arm.n
            self._tau = self.DeclareVectorInputPort("tau", n)
            index = self.DeclareDiscreteState(2 * n)
            self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.0, self._update)
            self.DeclareStateOutputPort("state", index)

        def _update(self, context: Any, discrete: Any) -> None:
            n, h, equations = self._n, self._step, self._equations
            state = context.get_discrete_state_vector().CopyToVector().tolist()
            q, v, tau, t = state[:n], state[n:], self._tau.Eval(context).tolist(), context.get_time()
            still = [0.0] * n
            M, rest = equations.mass_matrix(q), equations.rigid(q, v, still)
            load = equations.load(q, v, still) if equations.load_matters else None
            laws: list[ClampedLaw] = []
            for along, level, smooth in equations.dry_and_smooth(q, v, load, t):
                along.add(rest, smooth)
                laws.append(ClampedLaw.dry(along, max(level, 0.0)))
            momentum = [
                sum(m * x for m, x in zip(M[j], v, strict=True)) + h * (tau[j] - rest[j]) for j in range(n)
            ]
            pieces = [law.piece(law.speed(v)) for law in laws]
            dry = implicit_torques(M, momentum, laws, pieces, h)
            w = solve(M, [p + h * x for p, x in zip(momentum, dry, strict=True)])
            discrete.set_value(vector(T, [x + h * y for x, y in zip(q, w, strict=True)] + w))

    return Impl


StickingForwardDynamics = StickingForwardDynamics_[None]
