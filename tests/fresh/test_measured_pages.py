"""The commands of docs/measured.md, and the way from a bag in docs/convert.md, run as they stand."""

import json
import re

import pytest
from page_commands import ROOT, armloop, commands


@pytest.mark.long
@pytest.mark.measured
def test_the_commands_on_the_measured_arm_give_the_figures_of_the_text(tmp_path, measured):
    lines = commands("armloop", "docs/measured.md")
    assert [line.split()[1] for line in lines] == ["reconstruct", "evaluate", "diagnose", "crossvalidate"]
    *_, diagnosed, answered = (
        armloop(
            line.replace("$UR10E", str(measured / "ur10e")) + " --json" * ("crossvalidate" in line), tmp_path
        )
        for line in lines
    )
    text = (ROOT / "docs/measured.md").read_text(encoding="utf-8")
    (mass,) = re.findall(r"`payload`, ([\d.]+) ± ", text)
    assert mass in diagnosed
    answer = json.loads((tmp_path / "out" / "ur10e" / "diagnosis.json").read_text(encoding="utf-8"))
    nrmse = answer["error"]["nrmse"]
    for values in nrmse.values():
        assert f"| {sum(values) / 6:.3f} |" in text
    found = json.loads(answered)
    assert found["leave_out"] == "file" and len(found["files"]) == 9
    assert f"| each of the nine no-load files left out in turn | {found['mean']['nrmse']:.3f} |" in text
    assert found["mean"]["nrmse"] <= 0.045
    ladder = {note.split(":")[0] for notes in found["notes"].values() for note in notes}
    assert "friction, presliding" in ladder


@pytest.mark.long
@pytest.mark.measured
def test_the_way_from_a_bag_to_a_simulator_and_c(tmp_path, measured):
    found = {
        "$BAG": measured / "ros2bag" / "ur10_exciting_trajectory.db3",
        "$URDF": measured / "ur10e" / "ur10e.urdf",
    }
    lines = commands("armloop", "docs/convert.md")
    assert [line.split()[1] for line in lines] == ["convert", "reconstruct", "diagnose", "export", "export"]
    for line in lines:
        for name, path in found.items():
            line = line.replace(name, str(path))
        out = armloop(line, tmp_path)
        if "diagnose" in line:
            assert "Verdict: no effect" in out  # the model of this very log
        if "export" in line:
            assert "read back by" in out
    assert (tmp_path / "out" / "ur10.xml").is_file() and (tmp_path / "out" / "ur10.c").is_file()
