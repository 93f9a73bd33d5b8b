"""Export of a reconstructed model to other tools: URDF, SDFormat, MJCF, Drake and C99, each read back and compared."""

from armloop.export.export import TARGETS, export
from armloop.export.exported import Exported, states_of

__all__ = ["TARGETS", "Exported", "export", "states_of"]
