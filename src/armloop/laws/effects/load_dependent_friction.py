"""Load-dependent friction: dry friction that grows with the torque that passes the joint's gear."""

from __future__ import annotations

from armloop.laws.effects.base import Parameter
from armloop.laws.effects.law import Law


class LoadDependentFriction(Law):
    """tau_j += mu |load_j| sign(v_j), the load being the rigid-body torque of the known model."""

    name = "load_dependent_friction"
    parameters = (Parameter("coefficient", "1", least=0.0, positive=True),)
    law = "mu |load| sign(v)"
    elements = ("load_sign",)
