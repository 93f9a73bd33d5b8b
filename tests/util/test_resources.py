import pytest

from armloop.util.errors import ArmError, ScenarioError
from armloop.util.resources import scenario_names, scenario_path, urdf_names, urdf_path


def test_built_in_arms_are_found() -> None:
    assert set(urdf_names()) >= {"scara", "three_axis"}
    for name in urdf_names():
        assert "<robot" in urdf_path(name).read_text(encoding="utf-8")


def test_built_in_scenarios_are_found() -> None:
    assert "three_axis_tracking" in scenario_names()
    for name in scenario_names():
        assert scenario_path(name).is_file()


def test_an_unknown_arm_is_answered_with_those_there_are() -> None:
    with pytest.raises(ArmError, match=r"'puma': no built-in arm of this name; there are: .*three_axis"):
        urdf_path("puma")


def test_an_unknown_scenario_is_answered_with_those_there_are() -> None:
    with pytest.raises(ScenarioError, match=r"'nowhere': no built-in scenario of this name; there are: "):
        scenario_path("nowhere")


@pytest.mark.parametrize("name", ["../pyproject", "", ".", "three_axis.urdf", "/"])
def test_a_name_is_not_a_path(name: str) -> None:
    with pytest.raises(ArmError):
        urdf_path(name)
