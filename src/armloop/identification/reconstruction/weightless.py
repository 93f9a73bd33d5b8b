"""Gravity compensation in a record: torques that hold no weight, where the drives add it themselves and report the rest.

Or torques that hold the weight alone, where a hand leads the arm and overcomes its inertia and its friction.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from armloop.identification.reconstruction.plain_fits import AS_GOOD, GOOD, Fit, PlainFits

#: Without gravity the torques must be explained so many times as well (geometric mean of the joints): it is one reading
#: of a record more, as a unit is. Measured and simulated arms whose torques hold their weight came to 1.01 at the most.
_LIGHTER = 1.5


def times_lighter(problem: PlainFits, plain: Fit) -> float:
    """How many times as well the torques are explained by links without weight; 0 where that does not speak plainly.

    Args:
        problem: what is regressed of the record as it stands.
        plain: what is left of it.
    """
    light = problem.as_of(replace(problem.arm, gravity=np.zeros(3))).fit()
    if light.faults.sum() > plain.faults.sum() or light.relative.max() >= GOOD:
        return 0.0
    times = plain.over(light)
    return times if times > _LIGHTER else 0.0


def lighter(times: float) -> str:
    """What a record says that is explained so many times as well without weight."""
    return (
        f"the torques hold no weight: without gravity all are explained {times:.2g} times as well, as where the drives "
        "compensate it themselves and report the rest"
    )


def weight_alone(problem: PlainFits, plain: Fit) -> bool:
    """Whether weight without inertia and friction explains the torques as well: arms that their drives move came to .46.

    Args:
        problem: what is regressed of the record as it stands.
        plain: what is left of it.
    """
    still = problem.of_weight_alone().fit()
    # of an upright joint, which carries none, nothing is explained either way
    return bool(still.relative.min() < GOOD and plain.over(still) >= AS_GOOD)


#: What a record says of which that is so.
WEIGHT_ALONE = (
    "the torques hold weight, and neither inertia nor friction explain any more of them, as where a hand leads the arm or "
    "it moves too slowly: M(q) and friction cannot be learnt from them; log motion that the drives make"
)
