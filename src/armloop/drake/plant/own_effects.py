"""Effects of a user's own that are known for floats alone, in the simulated plant: their torque at each step's start."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from armloop.dynamics.own_effects import OwnEffectEquations
from armloop.laws.effects import Effect
from armloop.robot.arm import Arm
from armloop.robot.kinematics import nominal_parameters
from armloop.util.errors import ModelError, ScenarioError

Law = Callable[[list[float], list[float]], Sequence[float]]
"""Further torques (n,) that the drives must supply, of positions and velocities."""


def own_law(arm: Arm, effect: Effect, parameters: Mapping[str, Any]) -> Law:
    """Return the torque that the drives must supply because of an effect, of positions and velocities.

    The law is explicit, at the state of the step's start: a jump at zero velocity, as dry friction has, would chatter. One
    written as elements (`armloop.laws.effects.Law`) is taken implicitly, and sticks.

    Raises `ScenarioError` when the parameters are not the effect's, or its torque depends on the acceleration.
    """
    values = {key: np.asarray(value, dtype=float).tolist() for key, value in parameters.items()}
    try:
        equations = OwnEffectEquations(arm, effect, values, nominal_parameters(arm))
    except ModelError as error:
        raise ScenarioError(str(error)) from error
    if equations.has_inertia:
        raise ScenarioError(
            f"effect {effect.name}: its torque depends on the acceleration; the plant takes torques of q and v"
        )
    return equations.rest
