"""The rigid body nearest to a model: for what needs a mass matrix that can be inverted."""

from __future__ import annotations

from dataclasses import replace

from armloop.components import RigidBody
from armloop.library.rigid_body import BaseParameters
from armloop.model import ReconstructedModel


def nearest_rigid_body(model: ReconstructedModel) -> ReconstructedModel:
    """The model with its sparse terms or energies replaced by the rigid body that gives most nearly their torques.

    Terms that were found joint by joint in noisy data predict torques well, and yet the mass matrix that they imply
    may have a wrong sign somewhere; one body's inertias, shared by all joints, average the noise out and make M
    symmetric, C and gravity consistent with it. Found by least squares on random motion within the range that the model
    was fitted on (:meth:`ReconstructedModel.inertial_parameters`), with the arm's kinematics. Friction and effects stay.

    What the torques do not reveal is taken from the arm's nominal parameters. Nothing forces the
    parameters to be physical: :func:`require_mass_matrix` still has the last word.
    """
    full = model.inertial_parameters()
    base = BaseParameters.of_arm(model.arm)
    return replace(model, components=(RigidBody(full, tuple(base.names), base.from_full(full)),))
