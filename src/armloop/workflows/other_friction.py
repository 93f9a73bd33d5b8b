"""Joint friction of a model beside that of the simulated arm, which is of a usual size where a scenario states none."""

from __future__ import annotations

import numpy as np

from armloop.drake.experiments.scenarios import Plant
from armloop.drake.plant.nearest_friction import nearest_friction
from armloop.model import ReconstructedModel

#: A joint rubs otherwise from this factor on, at this part of the largest speed that the model was trained at.
_OTHER, _SLIDING = 1.5, 0.5


def other_friction(model: ReconstructedModel, plant: Plant) -> str:
    """What to say where the simulated joints rub by far more or less than a model says; empty if none does.

    What to state of the plant's friction to have the model's is said, too (Eq. 34, the nearest to the model's).
    """
    v = _SLIDING * np.maximum(model.ranges[1], 1e-2)
    nearest = nearest_friction(model)
    pairs = zip(nearest, plant.config.friction, v, strict=True)
    known, simulated = np.array([(float(m.force(x)), float(p.force(x))) for m, p, x in pairs]).T
    low, high = np.minimum(known, simulated), np.maximum(known, simulated)
    other = np.flatnonzero(high > _OTHER * low)
    if not len(other):
        return ""
    each = ", ".join(f"{simulated[j]:.3g} where the model has {known[j]:.3g} at joint {j + 1}" for j in other)
    stated = ", ".join(
        f"{{static: {f.static:.3g}, coulomb: {f.coulomb:.3g}, stribeck_velocity: {f.stribeck_velocity:.3g}, "
        f"viscous: {f.viscous:.3g}}}"
        for f in nearest
    )
    return (
        f"the simulated joints rub otherwise than the model's at half of its largest speed (N·m, N): {each}; with "
        f"own_plant: {{friction: [{stated}]}} they have the model's"
    )
