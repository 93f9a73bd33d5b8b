"""Friction drift: dry friction that changes as one joint warms up."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armloop.laws.effects.base import Context, Parameter
from armloop.laws.effects.law import Law


class FrictionDrift(Law):
    """tau_j += f exp(-t/T) sign(v_j), t from the start of the log, each log's own.

    Below zero it is friction that grows while the joint warms up: beside `coulomb_friction` of as much, f (1 - exp(-t/T)).
    A controller does not know when the joint was started: it supplies what is left once the joint is warm.
    """

    name = "friction_drift"
    parameters = (
        Parameter("level", "TAU", least=0.0),
        Parameter("time_constant", "s", above=0.0, shape="continuous"),
    )
    law = "f exp(-t/T) sign(v)"
    elements = ("fading_sign",)

    def shapes(self, context: Context) -> Sequence[float]:
        length = float(np.max(context.motion.elapsed))
        # Shorter than a few blocks it is no drift; longer than the run it is a constant level.
        return [] if length < 12.0 else [float(T) for T in np.geomspace(4.0, 1.5 * length, 10)]
