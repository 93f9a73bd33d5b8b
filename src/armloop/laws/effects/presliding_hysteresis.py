"""Presliding hysteresis: before a joint slides, it stretches like a spring that yields; friction with memory."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armloop.laws.effects.base import Context, Estimate, Parameter, number
from armloop.laws.effects.law import Law


class PreslidingHysteresis(Law):
    """tau_j += f z / w, with z carried along by q_j and clipped at ±w (see :mod:`armloop.laws.hysteresis`).

    A model that has learned the same friction as a step sign(v) has that level already: ``level_change`` is
    what has to be added to it, so that -f says that the friction as a whole is one with memory.
    One sample has no past: a controller supplies it as if fully slid.
    """

    name = "presliding_hysteresis"
    parameters = (
        Parameter("level", "TAU", least=0.0, positive=True),
        Parameter("width", "POS", above=0.0, shape="continuous"),
        Parameter("level_change", "TAU", default=0.0),
    )
    law = "f z/w with dz = dq, |z| <= w"
    elements = ("hysteresis", "sign")
    nested = 1  # a level of sign(v) by itself is dry friction

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        said, change = super().sentence(parameters), parameters.get("level_change")
        if change is None or not number(change.value):
            return said
        sliding = number(parameters["level"].value) + number(change.value)
        unit = change.unit
        return f"{said}, beside {change.words()} of sign(v): {sliding:.3g} {unit} more dry friction once it slides"

    def shapes(self, context: Context) -> Sequence[float]:
        travel = float(np.ptp(context.motion.q[:, self.index]))
        return [] if travel <= 0 else [float(w) for w in np.geomspace(2e-4 * travel, 5e-2 * travel, 16)]
