"""Coupling spring: an elastic tendon, belt or hose over two joints, which its own direction of both stretches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from armloop.laws.effects.base import Array, Context, Estimate, Parameter, Values, less, number
from armloop.laws.effects.joint_spring import JointSpring
from armloop.laws.effects.law import Law
from armloop.robot.arm import Arm

#: A tendon moves with either joint by at least this part of what it moves with the other.
_LEAST = 0.1


class CouplingSpring(Law):
    """tau_j += k (w − w_0), tau_k += r k (w − w_0), w = q_j + r q_k: the gradient of the potential k (w − w_0)² / 2.

    Its torques are linear in a symmetric stiffness of both joints, which has rank one, and two constants: five coefficients
    of three free parameters, k, k r and k w_0. So the ratio r is found with them, and need not be tried.
    """

    name = "coupling_spring"
    scope = "pair"
    parameters = (
        Parameter("stiffness", "TAU/POS", least=0.0, positive=True),
        Parameter("rest", "POS"),
        Parameter("ratio"),
    )
    law = "k (w - w0), w = q + r q'"
    elements = JointSpring.elements
    load = True
    watched = False
    nested = 1
    alike: ClassVar = {
        "joint_spring": (
            "where the other joint hardly moves a spring between both is one of this joint alone; a run that moves both, "
            "each in its own time, would tell them apart"
        ),
        "gravity_tilt": (
            "over a small range turned gravity is a spring; a run over all postures would tell them apart"
        ),
    }

    def shapes(self, context: Context) -> Sequence[float]:
        kinds = {context.arm.joints[k].kind for k in self.indices}
        return (0.0,) if len(kinds) == 1 else ()

    def columns(self, context: Context, shape: float) -> Array:
        j, k = self.indices
        q = context.motion.q
        full = np.zeros((len(q), context.arm.n, 5))
        full[:, j, 0] = full[:, k, 1] = q[:, j]
        full[:, j, 1] = full[:, k, 2] = q[:, k]
        full[:, j, 3] = full[:, k, 4] = -1.0
        return full

    def fixed_columns(self, context: Context, shape: float) -> Array:
        """To first order around a ratio: per unit of k, of k times what the ratio is off by, and of k w_0."""
        j, k = self.indices
        q = context.motion.q
        along = q[:, j] + shape * q[:, k]
        full = np.zeros((len(q), context.arm.n, 3))
        full[:, j, 0], full[:, k, 0] = along, shape * along
        full[:, j, 1], full[:, k, 1] = q[:, k], along + shape * q[:, k]
        full[:, j, 2], full[:, k, 2] = -1.0, -shape
        return full

    def fixed_refined(self, x: Array, shape: float) -> float:
        return self.named(x, shape)[2]

    def start(self, beta: Array) -> Array:
        return beta[[0, 1, 3]]

    def embed(self, x: Array) -> tuple[Array, Array]:
        own, across, rest = x.tolist()
        own = own if abs(own) > 1e-12 else 1e-12
        ratio, place = across / own, rest / own
        beta = np.array([own, across, ratio * across, rest, ratio * rest])
        J = np.zeros((5, 3))
        J[[0, 1, 3], [0, 1, 2]] = 1.0
        J[2] = -ratio * ratio, 2 * ratio, 0.0
        J[4] = -ratio * place, place, ratio
        return beta, J

    def named(self, x: Array, shape: float) -> tuple[float, ...]:
        own = float(x[0]) if abs(x[0]) > 1e-12 else 1e-12
        return own, float(x[2]) / own, shape + float(x[1]) / own

    def _numbers(self, parameters: Values) -> tuple[tuple[float, ...], float]:
        k, rest, ratio = (number(parameters[p.name]) for p in self.parameters)
        return (k, k * rest), ratio

    def plausible(self, arm: Arm, parameters: dict[str, Estimate]) -> bool:
        # A tendon is stretched by both joints, if by one more than by the other.
        return super().plausible(arm, parameters) and self._stretched_by_both(parameters)

    def comes_off(self, arm: Arm, parameters: dict[str, Estimate]) -> bool:
        return number(parameters["stiffness"].value) < 0 and self._stretched_by_both(parameters)

    def _stretched_by_both(self, parameters: Mapping[str, Estimate]) -> bool:
        return _LEAST < abs(number(parameters["ratio"].value)) < 1 / _LEAST

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        k, rest, ratio = (parameters[p.name] for p in self.parameters)
        sign = "-" if number(ratio.value) < 0 else "+"
        factor = Estimate(abs(number(ratio.value)), ratio.std_error, "1").words()
        if number(k.value) < 0:
            return (
                f"the spring over joints {self.joint} and {self.other_joint}, which pulls q{self.joint} {sign} ({factor}) "
                f"q{self.other_joint} towards {rest.words()}, has become weaker, by {less(k).words()}: it is worn, or "
                "broken, or was taken off"
            )
        return (
            f"a spring over joints {self.joint} and {self.other_joint} pulls q{self.joint} {sign} ({factor}) "
            f"q{self.other_joint} towards {rest.words()} with {k.words()}"
        )
