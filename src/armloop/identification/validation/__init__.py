"""Cross-validation of reconstruction: logs or blocks left out in turn, and what physical constraints cost."""

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
