"""How well reconstruction does on data it was not given: logs or blocks left out in turn."""

from armloop.identification.validation.crossvalidate import CrossValidation, LeftOut, crossvalidate
from armloop.identification.validation.physics import MassMatrixCheck, PhysicalComparison, compare_physical

__all__ = [
    "CrossValidation",
    "LeftOut",
    "MassMatrixCheck",
    "PhysicalComparison",
    "compare_physical",
    "crossvalidate",
]
