"""Effects of a user's own in the simulated plant: their torque at single samples, taken at each step's start."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from armloop.arm import Arm
from armloop.dynamics.own_effects import OwnEffectEquations
from armloop.effects import EFFECTS, effect, effect_kind, own_names
from armloop.errors import ModelError, ScenarioError
from armloop.kinematics import nominal_parameters

Law = Callable[[list[float], list[float]], Sequence[float]]
"""Further torques (n,) that the drives must supply, of positions and velocities."""


def check_own(name: str, joint: int | None, other_joint: int | None) -> None:
    """Raise `ScenarioError` unless there is such an effect, it can be in a plant, and its joints are given."""
    try:
        kind = effect_kind(name)
    except ModelError as error:
        names = ", ".join([*EFFECTS, *own_names()])
        raise ScenarioError(f"effect {name!r} is unknown; the plant can have: {names}") from error
    try:
        effect(name, joint, other_joint)
    except ModelError as error:
        raise ScenarioError(str(error)) from error
    if kind.sensor or kind.memory:
        why = "falsifies the record" if kind.sensor else "depends on the past"
        raise ScenarioError(f"effect {name}: {why}; the plant takes effects that are torques of q and v")


def own_law(
    arm: Arm, name: str, joint: int | None, other_joint: int | None, parameters: Mapping[str, Any]
) -> Law:
    """Return the torque that the drives must supply because of an effect, of positions and velocities.

    The law is explicit, at the state of the step's start: a jump at zero velocity, as dry friction has, would chatter.

    Raises `ScenarioError` when the parameters are not the effect's, or its torque depends on the acceleration.
    """
    values = {key: np.asarray(value, dtype=float).tolist() for key, value in parameters.items()}
    try:
        equations = OwnEffectEquations(arm, effect(name, joint, other_joint), values, nominal_parameters(arm))
    except ModelError as error:
        raise ScenarioError(str(error)) from error
    if equations.has_inertia:
        raise ScenarioError(
            f"effect {name}: its torque depends on the acceleration; the plant takes torques of q and v"
        )
    return equations.rest
