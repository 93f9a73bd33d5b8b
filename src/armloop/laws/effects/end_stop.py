"""Unilateral spring: an elastic end stop, a bumper, a cable or hose that pulls taut, on one side of a position alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from armloop.laws.effects.base import Context, Estimate, Parameter
from armloop.laws.effects.law import Law
from armloop.laws.friction import Element

#: Where a stop may begin: parts of the joint's travel, from the side on which it is free.
_PLACES = (0.1, 0.95)
#: So many are tried, each of which stands for what lies around it.
_TRIED = 8
#: A joint that travels less, rad (m), meets none.
_TRAVELS = 0.02


class _EndStop(Law):
    """A spring that begins at a position, which is the law's shape; found between the positions tried to first order."""

    parameters = (
        Parameter("stiffness", "TAU/POS", least=0.0, positive=True),
        Parameter("begins", "POS", shape="continuous"),
    )
    load = True
    watched = False
    #: rad (m).
    _STEP = 0.005
    _FARTHEST = 0.1
    #: 1 where it acts above its position, -1 below.
    side: ClassVar[int]
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
    }

    def _moved(self, shape: float, by: float) -> float:
        return shape + by

    def shapes(self, context: Context) -> Sequence[float]:
        q = context.motion.q[:, self.index]
        free, far = (float(q.min()), float(q.max()))[:: self.side]
        if abs(far - free) < _TRAVELS:
            return []
        return [free + part * (far - free) for part in np.linspace(*_PLACES, _TRIED)]

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        k, begins = parameters["stiffness"], parameters["begins"]
        return (
            f"{'above' if self.side > 0 else 'below'} {begins.words(3)} a stop pushes joint {self.joint} back with "
            f"{k.words()}; on the other side it is free"
        )


class UpperEndStop(_EndStop):
    """tau_j += k max(q_j − q_0, 0): beyond q_0 it pushes the joint back.

    Cable looms that pull taut and bumpers before the end of a joint's travel begin somewhere within it. Without this law
    such a spring is taken for one of both sides with a ripple, or for a load that comes and goes.
    """

    name = "upper_end_stop"
    side = 1
    law = "k max(q - q0, 0)"
    elements = (
        Element(lambda x, p, f: 0.5 * ((x.q - p) + abs(x.q - p)), "max(q{j}-({p:g}),0)", part="position"),
    )


class LowerEndStop(_EndStop):
    """tau_j += k min(q_j − q_0, 0): below q_0 it pushes the joint back; see :class:`UpperEndStop`."""

    name = "lower_end_stop"
    side = -1
    law = "k min(q - q0, 0)"
    elements = (
        Element(lambda x, p, f: 0.5 * ((x.q - p) - abs(x.q - p)), "min(q{j}-({p:g}),0)", part="position"),
    )
