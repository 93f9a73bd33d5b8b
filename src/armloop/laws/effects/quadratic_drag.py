"""Quadratic drag: it grows with the square of one joint's speed, by churning oil or a fan."""

from __future__ import annotations

from armloop.laws.effects.base import Parameter
from armloop.laws.effects.law import Law


class QuadraticDrag(Law):
    """tau_j += c v_j |v_j|."""

    name = "quadratic_drag"
    parameters = (Parameter("coefficient", "TAU*s^2/POS^2", least=0.0),)
    law = "c v |v|"
    elements = ("quadratic",)
