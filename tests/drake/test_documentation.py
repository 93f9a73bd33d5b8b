"""Every system that users can take says what Drake's own say: its ports by name, its scalar types, what it cannot do."""

import inspect

import pytest
from pydrake.systems.framework import Diagram, LeafSystem
from pydrake.systems.scalar_conversion import TemplateSystem

import armloop.drake as room

SYSTEMS = {
    name: value
    for name in room.__all__
    if inspect.isclass(value := getattr(room, name)) and issubclass(value, LeafSystem | Diagram)
}


def test_there_are_systems() -> None:
    assert {"ArmPlant", "Feedforward", "ComputedTorque", "ForwardDynamics", "RateLimiter"} <= set(SYSTEMS)
    templates = {name for name in room.__all__ if isinstance(getattr(room, name), TemplateSystem)}
    assert templates == {f"{name}_" for name in SYSTEMS if f"{name}_" in room.__all__}


@pytest.mark.parametrize("name", SYSTEMS)
def test_its_documentation_is_complete(name: str) -> None:
    text = " ".join((inspect.getdoc(SYSTEMS[name]) or "").split())
    assert " = " in text, "the law as an equation"
    assert "port" in text and "(n,)" in text, "ports by name and size"
    assert "Scalar type" in text, "scalar types"
    assert "Not supported" in text or "cannot" in text, "what it does not do"


@pytest.mark.parametrize("name", [name for name in SYSTEMS if f"{name}_" in room.__all__])
def test_its_signature_names_its_arguments(name: str) -> None:
    parameters = inspect.signature(SYSTEMS[name]).parameters
    assert parameters and not {"args", "kwargs", "self", "converter"} & set(parameters)
