"""Turning motion logs into a model: the stepwise method, the one-shot baseline, and scalable libraries."""

from armloop.reconstruction.libraries import LIBRARIES
from armloop.reconstruction.library import METHODS
from armloop.reconstruction.options import Options, StepReport
from armloop.reconstruction.reconstruct import Reconstruction, reconstruct

__all__ = ["LIBRARIES", "METHODS", "Options", "Reconstruction", "StepReport", "reconstruct"]
