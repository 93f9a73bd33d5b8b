"""M(q), bias, gravity and friction of a model for arrays of samples, and the model whose M can be inverted."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from armloop.dynamics.model import ModelEquations
from armloop.features.rigid_body import BaseParameters
from armloop.laws.effects.base import number
from armloop.model import ReconstructedModel
from armloop.model.components import RigidBody
from armloop.util.arrays import Array
from armloop.util.errors import InputError, ModelError
from armloop.util.functions import MATH, NUMPY
from armloop.util.given import shown

_POSTURES = 2000
#: What to do about a mass matrix that is not positive definite, of a model of rigid bodies and of any other.
_NO_BODIES = "No links and rotors that can exist have its parameters: `armloop export --to urdf` writes the nearest that do"
_NO_BODY = (
    "Take armloop.dynamics.nearest_rigid_body of it, or reconstruct with the library rigid-body or lagrangian"
)


class Dynamics:
    """The equations of motion tau = M(q) vdot + bias(q, v) + gravity(q) + friction(v) of a model.

    Every method takes vectors (n,) of one sample or (N, n) of many, and answers in kind. What belongs to which
    part, and what is left out, is said at :class:`ModelEquations`. What is no such vector of finite numbers is an
    ``InputError``.
    """

    def __init__(self, model: ReconstructedModel, *, symmetric: bool = False, sharp: bool = False) -> None:
        """Take a model.

        Args:
            symmetric: replace M by (M + M^T) / 2, as for sparse terms one may want.
            sharp: take dry friction that fades in with the speed as all there, as a joint that sticks feels it.
        """
        self.n = model.arm.n
        self._one = ModelEquations(model, MATH, symmetric=symmetric, sharp=sharp)
        self._many = ModelEquations(model, NUMPY, symmetric=symmetric, sharp=sharp)

    def mass_matrix(self, q: ArrayLike) -> Array:
        """M(q), (n, n) or (N, n, n), kg m² (kg m, kg).

        M_ij is the torque of joint i per unit of acceleration of joint j. It is symmetric for rigid bodies and
        energies; sparse terms are found joint by joint, and theirs is symmetric only as far as they are right.
        Raises ``ModelError`` where a term (of one-shot SINDy) is not linear in the acceleration alone.
        """
        return self._answer(lambda e, x: e.mass_matrix(x), q)

    def gravity(self, q: ArrayLike) -> Array:
        """The torques that hold the arm still at q, friction apart; springs, ripples and tilts included."""
        return self._answer(lambda e, x: e.gravity(x), q)

    def bias(self, q: ArrayLike, v: ArrayLike) -> Array:
        """C(q, v) v, the torques of the motion at constant velocities."""
        return self._answer(lambda e, x, y: e.bias(x, y), q, v)

    def friction(
        self,
        v: ArrayLike,
        *,
        load: ArrayLike | None = None,
        q: ArrayLike | None = None,
        t: float | Array = math.inf,
    ) -> Array:
        """Friction at velocities v, 0 at rest; ``load`` for friction that grows with it (0 by default).

        It may change with ``q``, and with ``t``, seconds since the start, one or (N,); by default the joints are warm.
        Raises ``ModelError`` where it changes with positions that are not given.
        """
        loads = np.zeros_like(_numbers(v)) if load is None else load
        if q is None:
            return self._answer(lambda e, x, y: e.friction(x, y, t), v, loads)
        return self._answer(lambda e, x, y, z: e.friction(x, y, t, z), v, loads, q)

    def torque(self, q: ArrayLike, v: ArrayLike, vdot: ArrayLike) -> Array:
        """Inverse dynamics: what the drives supply."""
        return self._answer(lambda e, x, y, z: e.torque(x, y, z), q, v, vdot)

    def acceleration(self, q: ArrayLike, v: ArrayLike, tau: ArrayLike) -> Array:
        """Forward dynamics, with dry friction by the sign of v.

        Whether M can be inverted is not looked at here: :func:`require_mass_matrix` does, over a whole range.
        """
        return self._answer(lambda e, x, y, z: e.acceleration(x, y, z), q, v, tau)

    def _answer(self, law: Callable[..., Any], *arguments: ArrayLike) -> Array:
        arrays = [_numbers(x) for x in arguments]
        shape = arrays[0].shape
        if shape[-1:] != (self.n,) or len(shape) not in (1, 2) or any(x.shape != shape for x in arrays):
            shapes = ", ".join(str(x.shape) for x in arrays)
            raise InputError(f"vectors must all be ({self.n},) or (N, {self.n}); they are {shapes}")
        if len(shape) == 1:
            return np.array(law(self._one, *(x.tolist() for x in arrays)), dtype=float)
        found = law(self._many, *([x[:, j] for j in range(self.n)] for x in arrays))
        return _stack(found, shape[0])


def _numbers(given: ArrayLike) -> Array:
    """What was given as an array of finite numbers; raises ``InputError`` where it is none."""
    try:
        found = np.asarray(given)
        fits = found.dtype.kind in "fiu"
    except ValueError:  # rows of several lengths
        fits = False
    if not fits or not np.isfinite(found).all():
        raise InputError(f"vectors must be of finite numbers; one is {shown(given)}")
    return found.astype(np.float64, copy=False)


def _stack(values: Sequence[Any], N: int) -> Array:
    """Vectors or matrices of (N,) arrays and plain numbers, samples first."""
    if isinstance(values[0], list):
        return np.stack([_stack(row, N) for row in values], axis=1)
    return np.stack([np.broadcast_to(np.asarray(x, dtype=float), (N,)) for x in values], axis=1)


def training_range(model: ReconstructedModel) -> tuple[Array, Array]:
    """Lower and upper positions (n,) that the model was fitted on; a radian (metre) about zero if it does not say."""
    half, _, _, centre = model.ranges
    return centre - half, centre + half


def coefficients(model: ReconstructedModel, kind: str, effect: str = "", key: str = "") -> Array:
    """(n,) sums of the coefficients of a kind of friction term and of a parameter of an effect that is the same."""
    found = np.array(
        [sum(t.coefficient for t in terms if t.kind == kind) for terms in model.friction.terms], float
    )
    for added in model.effects:
        if added.effect.name == effect and added.effect.joint is not None:
            found[added.effect.joint - 1] += number(added.parameters[key].value)
    return found


def viscous_coefficients(model: ReconstructedModel) -> Array:
    """(n,) sums of the joints' viscous coefficients."""
    return coefficients(model, "viscous", "viscous_friction", "coefficient")


def require_mass_matrix(model: ReconstructedModel) -> tuple[float, Array]:
    """Check that forward dynamics is possible: (M + M^T) / 2 is positive definite over the training range.

    Then M itself can be inverted too, and a torque always accelerates its own joint its own way. Many random postures within
    :func:`training_range` are tried.

    Returns:
        The smallest eigenvalue found and the posture (n,) it was found at.

    Raises:
        ModelError: it is not, or the model has no mass matrix.
    """
    lower, upper = training_range(model)
    q = np.random.default_rng(0).uniform(lower, upper, (_POSTURES, model.arm.n))
    smallest = np.linalg.eigvalsh(Dynamics(model, symmetric=True).mass_matrix(q))[:, 0]
    worst = int(np.argmin(smallest))
    value, at = float(smallest[worst]), q[worst]
    if not value > 0:
        posture = ", ".join(f"{x:.2f}" for x in at)
        bodies = all(isinstance(component, RigidBody) for component in model.components)
        raise ModelError(
            f"the model's mass matrix is not positive definite: its smallest eigenvalue is {value:.3g} at q = ({posture}), "
            f"within the range it was fitted on; forward dynamics is impossible. {_NO_BODIES if bodies else _NO_BODY}"
        )
    return value, at


def nearest_rigid_body(model: ReconstructedModel) -> ReconstructedModel:
    """The model with its sparse terms or energies replaced by the rigid body that gives most nearly their torques.

    Terms that were found joint by joint in noisy data predict torques well, and yet the mass matrix that they imply
    may have a wrong sign somewhere; one body's inertias, shared by all joints, average the noise out and make M
    symmetric, C and gravity consistent with it. Found by least squares on random motion within the range that the model
    was fitted on (:meth:`ReconstructedModel.inertial_parameters`, and rotors), with the arm's kinematics. Friction and
    effects stay.

    What the torques do not reveal is taken from the arm's nominal parameters. Nothing forces the
    parameters to be physical: :func:`require_mass_matrix` still has the last word.
    """
    full = np.concatenate([model.inertial_parameters(), model.rotor_inertias()])
    base = BaseParameters.of_arm(model.arm, rotors=True)
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
