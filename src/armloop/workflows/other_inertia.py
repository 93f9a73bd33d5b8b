"""Joint inertias of a model beside the simulated arm's: a URDF states no rotors, and a geared arm's outweigh its links."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from armloop.drake.experiments.scenarios import Plant
from armloop.drake.plant.fault_injection import Effects
from armloop.drake.tuning.loop_analysis import posture_model
from armloop.dynamics import Dynamics
from armloop.model import ReconstructedModel
from armloop.util.arrays import Array

#: A joint's inertia in the model is another than that of the simulated arm from this factor on.
_OTHER = 1.5


def other_inertia(model: ReconstructedModel, plant: Plant, q0: ArrayLike, effects: Effects = ()) -> str:
    """What to say where a model's joints are heavier or lighter to accelerate than the simulated arm's; empty if none is.

    Where the plant's rotors make the difference up, what to state of them is said, too.

    Args:
        q0: (n,) posture, rad (m), at which the diagonals of M(q) are compared.
        effects: that the plant has beside; none of them is what makes a difference.

    Raises:
        ModelError: the model has no mass matrix.
    """
    known = np.diag(Dynamics(model, symmetric=True).mass_matrix(np.asarray(q0, dtype=float)))
    bare, whole = (_diagonal(plant, q0, given) for given in ((), effects))
    other = np.minimum(_ratio(known, bare), _ratio(known, whole)) > _OTHER
    if not other.any():
        return ""
    each = [
        f"{bare[j]:.3g} where the model has {known[j]:.3g} at joint {j + 1}" for j in np.flatnonzero(other)
    ]
    said = f"the simulated arm's inertia is another than the model's (kg m², kg): {', '.join(each)}"
    rotors = np.array(plant.config.rotor_inertia or np.zeros(plant.arm.n)) + known - bare
    if (rotors < 0)[other].any():
        return said
    # links of other joints that the model has a little lighter than the URDF are no matter of rotors
    stated = ", ".join(f"{max(x, 0.0):.3g}" for x in rotors)
    return (
        f"{said}; a URDF states no rotors: with own_plant: {{rotor_inertia: [{stated}]}} it has the model's"
    )


def _diagonal(plant: Plant, q0: ArrayLike, effects: Effects) -> Array:
    config = plant.config
    return np.diag(posture_model(plant.arm, config.friction, q0, config.with_rotors(effects))[0])


def _ratio(one: Array, other: Array) -> Array:
    """(n,) by how many times the larger of two is larger; infinite where one of them is no inertia."""
    low, high = np.minimum(one, other), np.maximum(one, other)
    return np.asarray(np.where(low > 0, high / np.where(low > 0, low, 1.0), np.inf))
