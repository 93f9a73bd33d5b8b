"""Turning motion logs into a model: the stepwise method, the one-shot baseline, and scalable libraries."""

from armloop.reconstruction.options import Options, StepReport
from armloop.reconstruction.reconstruct import LIBRARIES, METHODS, Reconstruction, reconstruct

__all__ = ["LIBRARIES", "METHODS", "Options", "Reconstruction", "StepReport", "reconstruct"]
