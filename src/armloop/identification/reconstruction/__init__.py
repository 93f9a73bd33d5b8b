"""System identification from motion logs: the stepwise method, one-shot SINDy as its reference, and scalable libraries."""

from armloop.identification.reconstruction.libraries import LIBRARIES
from armloop.identification.reconstruction.library import METHODS
from armloop.identification.reconstruction.options import Options, StepReport
from armloop.identification.reconstruction.reconstruct import Reconstruction, reconstruct

__all__ = ["LIBRARIES", "METHODS", "Options", "Reconstruction", "StepReport", "reconstruct"]
