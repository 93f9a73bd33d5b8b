"""Turning motion logs into a model: the stepwise method, the one-shot baseline, and scalable libraries."""

from armloop.identification.reconstruction.libraries import LIBRARIES
from armloop.identification.reconstruction.library import METHODS
from armloop.identification.reconstruction.options import Options, StepReport
from armloop.identification.reconstruction.reconstruct import Reconstruction, reconstruct

__all__ = ["LIBRARIES", "METHODS", "Options", "Reconstruction", "StepReport", "reconstruct"]
