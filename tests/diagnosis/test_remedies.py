"""Every sensor's fault comes with what to do about it; what acts on the arm needs no such words."""

import pytest

from armloop.laws.effects import EFFECTS, Estimate, Law, Parameter, effect

FAULTS = {
    "torque_gain": (2, "gain", 1.25, "1", ["Divide the torque readings of joint 2 by 1.25", "0.8 times"]),
    "torque_offset": (
        1,
        "offset",
        -0.4,
        "N*m",
        ["Subtract -0.4 N*m from the torque readings of joint 1", "it must command -0.4 N*m in addition"],
    ),
    "encoder_offset": (
        3,
        "offset",
        0.04,
        "rad",
        ["Subtract 0.04 rad from the position readings of joint 3", "the joint stands -0.04 rad from where"],
    ),
    "torque_drift": (2, "rate", 0.01, "N*m/s", ["Let the sensor of joint 2 warm up"]),
    "time_delay": (None, "seconds", 0.03, "s", ["Shift the torque record by 30 ms back"]),
    "torque_delay": (2, "seconds", 0.03, "s", ["Shift the torque record of joint 2 by 30 ms back"]),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_has_its_remedy(name: str) -> None:
    joint, key, value, unit, parts = FAULTS[name]
    words = effect(name, joint).remedy({key: Estimate(value, 0.0, unit)})
    assert all(part in words for part in parts), words
    assert "feedforward" in words and not words.endswith(".")


def test_all_listed_sensors_have_one_and_nothing_else_has() -> None:
    assert {name for name, kind in EFFECTS.items() if kind.sensor} == set(FAULTS)
    for name, kind in EFFECTS.items():
        if not kind.sensor:
            one = effect(name, 1 if kind.joint_wise else None, 2 if kind.pair_wise else None)
            assert one.remedy({}) == ""


def test_a_sensor_of_the_users_own_gets_general_words() -> None:
    class Bent(Law):
        name, role, law, elements = "bent_sensor", "sensor", "b v", ("viscous",)
        parameters = (Parameter("bend", "TAU*s/POS"),)

    assert Bent(2).remedy({}).startswith("Correct the reading of joint 2 before anything uses it")
