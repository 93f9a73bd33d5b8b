"""Unilateral spring: an elastic end stop, a bumper, a cable or hose that pulls taut, on one side of a position alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from armloop.laws.effects.base import Context, Estimate, Parameter
from armloop.laws.effects.law import Law
from armloop.laws.friction import Element

#: Where a stop may begin: parts of the joint's travel, from the side on which it is free.
_PLACES = (0.1, 0.95)
#: So many are tried, each of which stands for what lies around it.
_TRIED = 8


class _EndStop(Law):
    """A spring that begins at a position, which is the law's shape; found between the positions tried to first order."""

    needs_model = False
    load = True
    watched = False
    #: rad (m).
    _STEP = 0.005
    _FARTHEST = 0.1
    alike: ClassVar = {
        "joint_spring": (
            "on one side of where it begins it is a spring; a run to both sides would tell them apart"
        ),
        "torque_ripple": (
            "over a part of its period a ripple begins to pull like a stop; a run over several periods would tell them apart"
        ),
        "gravity_tilt": (
            "over a small range turned gravity is a spring; a run over all postures would tell them apart"
        ),
        "external_torque": "a stop that is met once in a run is an event; a run that meets it again would tell them apart",
    }

    def _moved(self, shape: float, by: float) -> float:
        return shape + by

    def _tried(self, q: np.ndarray) -> list[float]:
        """Positions from the free side of the joint's travel to the other."""
        raise NotImplementedError

    def shapes(self, context: Context) -> Sequence[float]:
        q = context.motion.q[:, self.index]
        return self._tried(q) if np.ptp(q) > 2 * self._FARTHEST * _PLACES[0] else []


class UpperEndStop(_EndStop):
    """tau_j += k max(q_j − q_0, 0): beyond q_0 it pushes the joint back.

    Cable looms that pull taut and bumpers before the end of a joint's travel begin somewhere within it. Without this law
    such a spring is taken for one of both sides with a ripple, or for a load that comes and goes.
    """

    name = "upper_end_stop"
    parameters = (
        Parameter("stiffness", "TAU/POS", least=0.0, positive=True),
        Parameter("begins", "POS", shape="continuous"),
    )
    law = "k max(q - q0, 0)"
    elements = (
        Element(lambda x, p, f: 0.5 * ((x.q - p) + abs(x.q - p)), "max(q{j}-({p:g}),0)", part="position"),
    )

    def _tried(self, q: np.ndarray) -> list[float]:
        low, high = float(q.min()), float(q.max())
        return [low + part * (high - low) for part in np.linspace(*_PLACES, _TRIED)]

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        return _sentence(self, parameters, "above")


class LowerEndStop(_EndStop):
    """tau_j += k min(q_j − q_0, 0): below q_0 it pushes the joint back; see :class:`UpperEndStop`."""

    name = "lower_end_stop"
    parameters = UpperEndStop.parameters
    law = "k min(q - q0, 0)"
    elements = (
        Element(lambda x, p, f: 0.5 * ((x.q - p) - abs(x.q - p)), "min(q{j}-({p:g}),0)", part="position"),
    )

    def _tried(self, q: np.ndarray) -> list[float]:
        low, high = float(q.min()), float(q.max())
        return [high - part * (high - low) for part in np.linspace(*_PLACES, _TRIED)]

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        return _sentence(self, parameters, "below")


def _sentence(stop: _EndStop, parameters: Mapping[str, Estimate], side: str) -> str:
    k, begins = parameters["stiffness"], parameters["begins"]
    back = f"a stop pushes joint {stop.joint} back with {k.words()}"
    return f"{side} {begins.words(3)} {back}; on the other side it is free"
