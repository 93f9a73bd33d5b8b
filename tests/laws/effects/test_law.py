"""What every listed effect is said to be follows from its law: who asks for it, and who may supply it."""

from __future__ import annotations

import pytest
from exact_parts import STATED

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
    "pair_wise": "transmission_coupling",
}
#: Parameters that a run determines; an event's interval is none of them.
COMPLEXITY = {
    **dict.fromkeys(("friction_drift", "joint_spring", "stribeck_friction", "gravity_tilt"), 2),
    **dict.fromkeys(("presliding_hysteresis", "torque_ripple", "external_contact"), 3),
    "transmission_coupling": 4,
    "payload": 5,
}


@pytest.mark.parametrize("said", KINDS)
def test_what_an_effect_is_said_to_be(said: str) -> None:
    assert {name for name in STATED if getattr(EFFECTS[name], said)} == set(KINDS[said].split())


def test_an_effect_is_as_complex_as_it_has_parameters() -> None:
    assert {name: EFFECTS[name].complexity for name in STATED} == {
        name: COMPLEXITY.get(name, 1) for name in STATED
    }
