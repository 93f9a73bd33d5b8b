"""Stribeck friction: dry friction that is larger at low speed, a part of Eq. (34) of the paper."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armloop.laws.effects.base import Array, Context, Parameter
from armloop.laws.effects.law import Law


class StribeckFriction(Law):
    """tau_j += d exp(-(v_j/v_s)^2) sign(v_j)."""

    name = "stribeck_friction"
    parameters = (
        Parameter("static_excess", "TAU", least=0.0, positive=True),
        Parameter("velocity", "POS/s", above=0.0, shape="continuous"),
    )
    law = "d exp(-(v/vs)^2) sign(v)"
    elements = ("stribeck_peak",)

    def shapes(self, context: Context) -> Sequence[float]:
        speed = np.abs(context.motion.v[:, self.index])
        slowest, fastest = np.quantile(speed, 0.02), np.quantile(speed, 0.98)
        # Below the slowest speeds an exponential cannot be seen, beyond the fastest it is a level with drag. Nor is it a
        # fall where the known friction has not turned yet: friction that turns faster than the model says looks like one.
        fading = context.fading[self.index] if context.fading else 0.0
        low, high = max(float(slowest), 1e-3 * float(fastest), fading), float(fastest)
        return [] if high <= low else [float(v) for v in np.geomspace(low, high, 16)]

    def usual(self, context: Context) -> float | None:
        """The velocity at which the known friction falls: what has grown falls there, and few samples are so slow."""
        return context.falls[self.index] or None if context.falls else None

    def columns(self, context: Context, shape: float) -> Array:
        own = super().columns(context, shape)
        return own[:, :1] if shape == self.usual(context) else own
