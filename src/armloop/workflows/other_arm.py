"""Inertia and friction of a model's joints beside the simulated arm's: where a plant is not the arm that was identified.

A URDF states no rotors, and a geared arm's outweigh its links; friction is of a usual size where a scenario states none.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from armloop.drake.experiments.scenarios import Plant
from armloop.drake.plant.exact import exact_model
from armloop.drake.plant.fault_injection import Effects
from armloop.drake.plant.nearest_friction import nearest_friction
from armloop.drake.tuning.loop_analysis import posture_model
from armloop.dynamics import Dynamics
from armloop.model import ReconstructedModel
from armloop.util.arrays import Array, Mask

#: A joint is another than that of the simulated arm from this factor on.
_OTHER = 1.5
#: Part of the largest speed of its training at which a model's friction is compared.
_SLIDING = 0.5


def other_inertia(model: ReconstructedModel, plant: Plant, q0: ArrayLike, effects: Effects = ()) -> str:
    """What to say where a model's joints are heavier or lighter to accelerate than the simulated arm's; empty if none is.

    Where the plant's rotors make the difference up, what to state of them is said, too.

    Args:
        q0: (n,) posture, rad (m), at which the diagonals of M(q) are compared.
        effects: that the plant has beside, of which a model may know or not.

    Raises:
        ModelError: the model has no mass matrix.
    """
    known = np.diag(Dynamics(model, symmetric=True).mass_matrix(np.asarray(q0, dtype=float)))
    config = plant.config
    bare, changed = (
        np.diag(posture_model(plant.arm, config.friction, q0, config.with_rotors(given))[0])
        for given in ((), effects)
    )
    other = _is_other(known, bare, changed)
    if not other.any():
        return ""
    said = f"the simulated arm's inertia is another than the model's (kg m², kg): {_each(bare, known, other)}"
    rotors = np.array(config.rotor_inertia or np.zeros(plant.arm.n)) + known - bare
    if (rotors < 0)[other].any():
        return said
    # links of other joints that the model has a little lighter than the URDF are no matter of rotors
    stated = ", ".join(f"{max(x, 0.0):.3g}" for x in rotors)
    return (
        f"{said}; its rotors are those that the scenario states: with own_plant: {{rotor_inertia: [{stated}]}} it has the "
        "model's"
    )


def other_friction(model: ReconstructedModel, plant: Plant, effects: Effects = ()) -> str:
    """What to say where the simulated joints rub by far more or less than a model says; empty if none does.

    What to state of the plant's friction to have the model's is said, too (Eq. 34, the nearest to the model's).

    Args:
        effects: that the plant has beside, of which a model may know or not.
    """
    v = _SLIDING * np.maximum(model.ranges[1], 1e-2)
    nearest, own = nearest_friction(model), plant.config.friction
    whole = nearest_friction(exact_model(plant.arm, own, effects)) if effects else own
    known, bare, changed = (
        np.array([float(f.force(x)) for f, x in zip(each, v, strict=True)]) for each in (nearest, own, whole)
    )
    other = _is_other(known, bare, changed)
    if not other.any():
        return ""
    stated = ", ".join(
        f"{{static: {f.static:.3g}, coulomb: {f.coulomb:.3g}, stribeck_velocity: {f.stribeck_velocity:.3g}, "
        f"viscous: {f.viscous:.3g}}}"
        for f in nearest
    )
    return (
        "the simulated joints rub otherwise than the model's at half of its largest speed (N·m, N): "
        f"{_each(bare, known, other)}; with own_plant: {{friction: [{stated}]}} they have the model's"
    )


def _is_other(known: Array, bare: Array, changed: Array) -> Mask:
    """(n,) joints of which a model's number is another than that of the plant, with its effects and without."""
    return np.asarray(np.minimum(_times(known, bare), _times(known, changed)) > _OTHER)


def _times(one: Array, other: Array) -> Array:
    """(n,) how many times the larger of two numbers is larger; infinite where one of them alone is nothing."""
    low, high = np.minimum(one, other), np.maximum(one, other)
    return np.asarray(
        np.where(high > low, np.where(low > 0, high / np.where(low > 0, low, 1.0), np.inf), 1.0)
    )


def _each(simulated: Array, known: Array, other: Mask) -> str:
    """Both numbers of each joint that is another."""
    return ", ".join(
        f"{simulated[j]:.3g} where the model has {known[j]:.3g} at joint {j + 1}"
        for j in np.flatnonzero(other)
    )
