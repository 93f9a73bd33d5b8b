"""A reconstructed model: readable terms that predict joint torques, and its file."""

from armloop.model.added_effect import AddedEffect
from armloop.model.model import ReconstructedModel, load_model, model_of

__all__ = ["AddedEffect", "ReconstructedModel", "load_model", "model_of"]
