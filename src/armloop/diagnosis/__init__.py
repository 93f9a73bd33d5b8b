"""Tracing a residual to the physical effect that a model lacks. Sees a model and logs, nothing else."""

from armloop.diagnosis.diagnose import Diagnosis, diagnose

__all__ = ["Diagnosis", "diagnose"]
