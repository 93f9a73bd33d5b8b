"""What files say stays within the folder and the page that they are meant for."""

import re
from pathlib import Path

import pytest

from armloop.cli import main
from armloop.drake.experiments.scenarios import load_tracking
from armloop.reports.html import Report, Section, render
from armloop.reports.tables import make_table
from armloop.util.errors import ScenarioError

OWN = "own_plant:\n  arm: {}\n  friction: [{{}}, {{}}, {{}}]\nreference: {{periods: 1}}\nscore: [5, 20]\n"
TABLE = "plant: three_axis\nreference: {{kind: csv, file: {}}}\n"


@pytest.mark.parametrize("text", [OWN, TABLE], ids=["arm", "table"])
@pytest.mark.parametrize("path", ["/etc/passwd", "../arm.urdf", "x/../../arm.urdf", "/dev/zero", "linked"])
def test_a_scenario_reaches_nothing_outside_its_folder(text: str, path: str, place: Path) -> None:
    inner = place / "inner"
    inner.mkdir()
    (inner / "linked").symlink_to(place / "arm.urdf")
    (inner / "bad.yaml").write_text(text.format(path))
    with pytest.raises(ScenarioError, match=r"lies outside the scenario's folder"):
        load_tracking(inner / "bad.yaml")


def test_it_reaches_what_lies_beside_and_below_it_and_what_the_user_names(place: Path) -> None:
    (place / "below").mkdir()
    (place / "arm.urdf").rename(place / "below" / "arm.urdf")
    (place / "good.yaml").write_text(OWN.format("below/arm.urdf"))
    assert load_tracking(place / "good.yaml").plant.arm.n == 3
    (place / "below" / "open.yaml").write_text(OWN.format('""'))
    assert load_tracking(place / "below" / "open.yaml", place / "below" / "arm.urdf").plant.arm.n == 3


NAME = '<script>alert("1")</script><img src=x onerror=alert(1)>'


def test_names_are_escaped_wherever_a_report_shows_them() -> None:
    section = Section(NAME, [NAME], tables=[make_table([NAME, "b"], [[NAME, NAME]], NAME)], notes=[NAME])
    page = render(Report(NAME, NAME, [section]))
    assert NAME not in page and "<script" not in page and "<img" not in page
    assert page.count("&lt;script&gt;") >= 6


def test_a_controllers_name_is_no_path(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("../x", "a/b", "", ".", "a b", "<b>"):
        assert main(["track", "scenario.yaml", "--model", f"{name}=model.json"]) == 2
        assert re.search("write NAME=MODEL.json", capsys.readouterr().err)


def test_pages_load_nothing() -> None:
    page = render(Report("a", "b", [Section("c")]))
    assert not re.search(r"""(?:src|href)\s*=\s*["'](?:https?:)?//|@import|url\(\s*["']?http""", page)
