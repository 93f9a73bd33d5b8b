"""The rigid body nearest to a model: for what needs a mass matrix that can be inverted."""

from __future__ import annotations

from dataclasses import replace

from armloop.dynamics.arrays import require_mass_matrix
from armloop.features.rigid_body import BaseParameters
from armloop.model import ReconstructedModel
from armloop.model.components import RigidBody
from armloop.util.errors import ModelError


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


def with_mass_matrix(model: ReconstructedModel) -> ReconstructedModel:
    """The model itself where its M is positive definite over the training range, else the rigid body nearest to it.

    Sparse terms of noisy data may lack the inertia of a light joint altogether: they predict its torque well, but a
    controller that multiplies an acceleration by M would not move it.

    Raises:
        ModelError: M of the nearest rigid body is not positive definite either.
    """
    try:
        require_mass_matrix(model)
    except ModelError:
        model = nearest_rigid_body(model)
        require_mass_matrix(model)
    return model
