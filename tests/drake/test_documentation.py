"""Every system that users can take says what Drake's own say: its ports by name, its scalar types, what it cannot do."""

import inspect
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from exact_parts import ARMS, model_of, rigid_body
from pydrake.systems.framework import Diagram, LeafSystem
from pydrake.systems.scalar_conversion import TemplateSystem

import armloop.drake as room
from armloop.commands.collect import Collect
from armloop.drake.plant.usual_friction import usual_friction
from armloop.robot.arm import load_arm

PAGE = Path(__file__).resolve().parents[2] / "docs" / "drake.md"
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


def test_what_the_page_shows_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    model_of(ARMS["three_axis"], rigid_body(ARMS["three_axis"])).save(tmp_path / "model.json")
    diagram, arrays = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    made: dict[str, object] = {}
    exec(diagram, made)
    system = made["builder"].Build()  # type: ignore[attr-defined]
    assert [system.get_input_port(k).get_name() for k in range(3)] == ["q_ref", "v_ref", "vdot_ref"]
    exec(arrays, made)
    assert np.shape(made["tau"]) == (1000, 3) and np.shape(made["M"]) == (3, 3)


def test_the_help_says_which_friction_a_urdfs_joints_get() -> None:
    arm = load_arm("scara")
    strong = replace(
        arm, mass=10 * arm.mass, joints=tuple(replace(joint, effort=1e3) for joint in arm.joints)
    )
    kinds = dict(zip(arm.revolute.tolist(), usual_friction(strong), strict=True))
    said = vars(Collect)["arm"].more["help"]
    for friction, text in (
        (kinds[True], "static {}, Coulomb {} N·m and viscous {} N"),
        (kinds[False], "{}, {} N and {} N"),
    ):
        assert text.format(*(f"{x:g}" for x in (friction.static, friction.coulomb, friction.viscous))) in said
