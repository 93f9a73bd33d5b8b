"""Two joints whose motors share gears, as in many wrists."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armloop.arm import Arm
from armloop.effects.base import Array, Context, Effect, Estimate, Value, fill, number


class TransmissionCoupling(Effect):
    """A motor that turns with w = v_j ± v_k: tau_j += T(w), tau_k ±= T(w), T = I w' + c w + f sign(w).

    ``ratio`` is +1 where the motor sees the sum of the two speeds, -1 for their difference.
    """

    name = "transmission_coupling"
    needs_model = False
    pair_wise = True
    complexity = 4

    def shapes(self, context: Context) -> Sequence[float]:
        assert self.joint is not None and self.other_joint is not None
        kinds = {context.arm.joints[k - 1].kind for k in (self.joint, self.other_joint)}
        return (1.0, -1.0) if len(kinds) == 1 else ()

    def columns(self, context: Context, shape: float) -> Array:
        assert self.joint is not None and self.other_joint is not None
        j, k = self.joint - 1, self.other_joint - 1
        v, vdot = context.motion.v, context.motion.vdot
        w = v[:, j] + shape * v[:, k]
        law = np.column_stack([vdot[:, j] + shape * vdot[:, k], w, np.sign(w)])
        full = np.zeros((len(w), context.arm.n, 3))
        full[:, j], full[:, k] = law, shape * law
        return full

    def torque(self, context: Context, parameters: dict[str, Value]) -> Array:
        x = np.array([number(parameters[key]) for key in ("inertia", "viscous", "coulomb")])
        return np.asarray(self.columns(context, number(parameters["ratio"])) @ x)

    def estimates(self, arm: Arm, x: Array, covariance: Array, shape: float) -> dict[str, Estimate]:
        errors = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        units = [fill(arm, unit, self.joint) for unit in ("INERTIA", "TAU*s/POS", "TAU")]
        names = ("inertia", "viscous", "coulomb")
        found = {
            name: Estimate(float(value), float(error), unit)
            for name, value, error, unit in zip(names, x, errors, units, strict=True)
        }
        return {**found, "ratio": Estimate(shape, 0.0, "1")}

    def plausible(self, arm: Arm, parameters: dict[str, Estimate]) -> bool:
        # Each of the three may be absent, none may be clearly negative.
        return all(
            number(parameters[key].value) > -3 * number(parameters[key].std_error)
            for key in ("inertia", "viscous", "coulomb")
        )

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        parts = [
            f"{key} {number(parameters[key].value):.4g} ± {number(parameters[key].std_error):.2g} {parameters[key].unit}"
            for key in ("inertia", "viscous", "coulomb")
        ]
        way = "sum" if number(parameters["ratio"].value) > 0 else "difference"
        return (
            f"a motor turns with the {way} of the speeds of joints {self.joint} and {self.other_joint}: "
            + ", ".join(parts)
        )
