"""What every listed effect is said to be follows from its law: who asks for it, and who may supply it."""

from __future__ import annotations

import numpy as np
import pytest
from exact_parts import STATED
from synthetic import three_axis

from armloop.laws.effects import effect
from armloop.laws.effects.listed import EFFECTS

FRICTION = (
    "coulomb_friction friction_asymmetry friction_drift load_dependent_friction presliding_hysteresis quadratic_drag "
    "stribeck_friction viscous_asymmetry viscous_friction"
)
KINDS = {
    "rubs": FRICTION,
    "needs_model": "encoder_offset external_contact gravity_tilt load_dependent_friction time_delay torque_gain",
    "memory": "external_contact external_torque friction_drift presliding_hysteresis",
    "of_time": "friction_drift",
    "sensor": "encoder_offset time_delay torque_gain torque_offset",
    "event": "external_contact external_torque",
    "pair_wise": "coupling_spring transmission_coupling",
}
#: Parameters that a run determines; an event's interval is none of them.
COMPLEXITY = {
    **dict.fromkeys(("friction_drift", "joint_spring", "stribeck_friction", "gravity_tilt"), 2),
    **dict.fromkeys(("upper_end_stop", "lower_end_stop"), 2),
    **dict.fromkeys(("presliding_hysteresis", "torque_ripple", "external_contact", "coupling_spring"), 3),
    "transmission_coupling": 4,
    "payload": 5,
    "elastic_cable": 8,
}


@pytest.mark.parametrize("said", KINDS)
def test_what_an_effect_is_said_to_be(said: str) -> None:
    assert {name for name in STATED if getattr(EFFECTS[name], said)} == set(KINDS[said].split())


def test_an_effect_is_as_complex_as_it_has_parameters() -> None:
    assert {name: EFFECTS[name].complexity for name in STATED} == {
        name: COMPLEXITY.get(name, 1) for name in STATED
    }


@pytest.mark.parametrize(("slope", "known"), [(0.29, True), (0.31, False), (-0.5, False)])
def test_a_parameter_held_where_the_first_order_ends_has_no_standard_error(slope: float, known: bool) -> None:
    """A level x0, and x1 times what a change of log T does to it: beyond a ratio of 0.3 that is none of the law."""
    found = effect("friction_drift", 1).estimates(
        three_axis(), np.array([2.0, 2.0 * slope]), np.diag([1e-4, 4e-4]), 10.0
    )
    assert found["level"].std_error == pytest.approx(0.01)
    assert found["time_constant"].value == pytest.approx(10.0 * np.exp(np.clip(slope, -0.3, 0.3)))
    error = found["time_constant"].value * np.hypot(0.02 / 2.0, slope * 0.01 / 2.0)
    assert found["time_constant"].std_error == pytest.approx(
        error if known else np.nan, nan_ok=True, rel=1e-5
    )
