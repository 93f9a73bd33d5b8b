"""Tracing a residual to the physical effect that a model lacks. Sees a model and logs, nothing else."""

from armloop.diagnosis.compensation import Closing, close
from armloop.diagnosis.diagnose import diagnose
from armloop.diagnosis.verdict import Diagnosis

__all__ = ["Closing", "Diagnosis", "close", "diagnose"]
