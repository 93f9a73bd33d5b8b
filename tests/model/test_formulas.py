"""The formulas of a model say all that its torque is made of."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from synthetic import three_axis

from armloop.laws.effects import Estimate, effect
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import AddedEffect, ReconstructedModel

SIZES: dict[tuple[str, tuple[int, ...]], dict[str, Any]] = {
    ("transmission_coupling", (2, 3)): {"inertia": 0.5, "viscous": 4.0, "coulomb": 0.0, "ratio": 1.0},
    ("transmission_coupling", (1, 3)): {"inertia": 0.2, "viscous": 1.5, "coulomb": 0.7, "ratio": -0.25},
    ("torque_ripple", (2,)): {"amplitude": 0.4, "order": 12.5, "phase": 0.3},
    ("joint_spring", (1,)): {"stiffness": 6.0, "rest": -0.2},
    ("upper_end_stop", (3,)): {"stiffness": 20.0, "begins": -0.1},
    ("unlisted", (1,)): {"sin(3*q1)*v2^2": -2.0, "sign(v1)": 0.3},
    ("stribeck_friction", (3,)): {"static_excess": 0.6, "velocity": 0.4},
}
NAMES: dict[str, Callable[..., float]] = {
    **{name: getattr(math, name) for name in ("sin", "cos", "exp", "tanh")},
    "sign": lambda x: float(np.sign(x)),
    "abs": abs,
    "max": max,
    "min": min,
}


def model_with(sizes: dict[tuple[str, tuple[int, ...]], dict[str, Any]]) -> ReconstructedModel:
    friction = FrictionLaw(((FrictionTerm("viscous", 2.0),), (), (FrictionTerm("sign", 1.0),)))
    added = [
        AddedEffect(effect(name, *(joints or (None,))), {k: Estimate(x, 0.1, "1") for k, x in own.items()})
        for (name, joints), own in sizes.items()
    ]
    return ReconstructedModel(three_axis(), (), friction, effects=tuple(added))


@pytest.mark.parametrize("seed", range(3))
def test_a_formula_comes_to_the_torque_that_a_controller_supplies(seed: int) -> None:
    rng, model = np.random.default_rng(seed), model_with(SIZES)
    q, v, vdot = (rng.normal(0, 0.6, 3) for _ in range(3))
    state = {f"{name}{j + 1}": x[j] for name, x in (("q", q), ("v", v), ("vdot", vdot)) for j in range(3)}
    formulas = [line.split(" = ")[1].replace("^", "**") for line in model.formulas()]
    found = [eval(text, {"__builtins__": {}}, {**NAMES, **state}) for text in formulas]
    # coefficients are written to four digits, a shape to six
    np.testing.assert_allclose(found, model.feedforward(q, v, vdot), rtol=2e-3, atol=2e-3)
    assert model.legend() == [] and not any("-1" in text.replace("e-1", "") for text in formulas)


def test_what_is_no_formula_of_one_direction_is_named_and_said_in_words() -> None:
    payload = {"mass": 0.5, "com": [0.0, 0.0, 0.1], "own_inertia": 0.0}
    offset = {"offset": 3.0}
    model = model_with({("payload", ()): payload, ("torque_offset", (2,)): offset})
    first, second, third = model.formulas()
    assert first == "tau1 = 2*v1 + 1*payload(q,v,vdot)" and third == "tau3 = 1*sign(v3) + 1*payload(q,v,vdot)"
    assert second == "tau2 = 1*payload(q,v,vdot)"  # a sensor's offset is no torque of the arm
    (line,) = model.legend()
    assert line.startswith("payload(q,v,vdot): ") and "0.5" in line
