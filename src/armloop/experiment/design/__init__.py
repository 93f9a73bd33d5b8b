"""Experiment design: references that determine the coefficients of a later regression as well as the arm allows.

The columns whose information is made large are handed in as a function of the motion, so that a library, or two
competing effects that a run should tell apart (`criteria.unexplained`), are designed for alike.
"""

from armloop.experiment.design.criteria import CRITERIA, Criterion, condition_number, unexplained
from armloop.experiment.design.data_ratio import DataRatio, amount_needed, data_ratio
from armloop.experiment.design.excite import Excitation, Measure, excite, measured
from armloop.experiment.design.information import Columns, Regression
from armloop.experiment.design.limits import Limits, TorqueLaw, check_rest, hardly_any_motion, nominal_torque
from armloop.experiment.design.optimise import Design, Problem
from armloop.experiment.design.random import random_references
from armloop.experiment.design.series import Series, sampled
from armloop.experiment.design.settings import Settings, Timing, baseline_noise

__all__ = [
    "CRITERIA",
    "Columns",
    "Criterion",
    "DataRatio",
    "Design",
    "Excitation",
    "Limits",
    "Measure",
    "Problem",
    "Regression",
    "Series",
    "Settings",
    "Timing",
    "TorqueLaw",
    "amount_needed",
    "baseline_noise",
    "check_rest",
    "condition_number",
    "data_ratio",
    "excite",
    "hardly_any_motion",
    "measured",
    "nominal_torque",
    "random_references",
    "sampled",
    "unexplained",
]
