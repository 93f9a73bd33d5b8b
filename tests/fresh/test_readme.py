"""Every command and every line of Python in the README, and the way from a bag in docs/convert.md, run as they stand."""

import glob
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from armloop.drake_systems.scenario_schema import FILES
from armloop.schemas.checking import checked

ROOT = Path(__file__).resolve().parents[2]
# the command with the package of a wheel before that of the checkout
FROM_WHEEL = """
import sys
sys.path.insert(0, sys.argv.pop(1))
import armloop.cli
assert armloop.__file__.startswith(sys.path[0]), armloop.__file__
sys.exit(armloop.cli.main())
"""
BLOCK = re.compile(r"```(\w+)\n(.*?)```", re.DOTALL)


def blocks(language: str, page: str = "README.md") -> list[str]:
    text = (ROOT / page).read_text(encoding="utf-8")
    return [body for kind, body in BLOCK.findall(text) if kind == language]


def commands(program: str, page: str = "README.md") -> list[str]:
    lines = "\n".join(blocks("sh", page)).replace("\\\n", " ").splitlines()
    return [line for line in lines if line.startswith(program)]


def run(command: list[str], cwd: Path) -> str:
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False, timeout=500)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def armloop(line: str, cwd: Path) -> str:
    """Run one line as a shell would, wildcards included."""
    words: list[str] = []
    for word in shlex.split(line)[1:]:
        found = sorted(glob.glob(word, root_dir=cwd)) if "*" in word else [word]
        assert found, f"{word} matches nothing"
        words += found
    return run([sys.executable, "-m", "armloop", *words], cwd)


def test_every_line_of_shell_is_make_or_armloop():
    lines = [line for block in blocks("sh") for line in block.splitlines() if line.strip()]
    assert all(line.startswith(("make ", "armloop ", "  ")) for line in lines)
    assert len(commands("armloop")) >= 6


def test_make_targets_exist():
    make = shutil.which("make")
    if make is None:
        pytest.skip("make is not installed")
    named = [line.split()[1] for line in commands("make")] + ["bench", "blind"]
    run([make, "-n", "-C", str(ROOT), *named], ROOT)


def test_pictures_and_paths_of_the_text_exist():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert "@" not in re.sub(r"`[^`]*`", "", text), "a figure is still to be filled in"
    for path in re.findall(r"\]\(([^)#]+)\)", text):
        assert (ROOT / path).exists(), path


@pytest.mark.slow
def test_every_command_and_the_python_run(tmp_path, unpacked):
    assert "make loop" in commands("make")
    page = tmp_path / "out" / "loop" / "report.html"
    # What `make loop` calls, without setting up an environment of its own, and from the wheel.
    out = run([sys.executable, "-c", FROM_WHEEL, str(unpacked), "loop", "--out", "out/loop"], tmp_path)
    assert "the verdict was right" in out
    assert page.is_file() and (page.parent / "replay.html").is_file()
    checked(json.loads((page.parent / "loop.json").read_text(encoding="utf-8")), FILES["loop"])
    for line in commands("armloop"):
        if "$UR10E" not in line:
            assert armloop(line, tmp_path).strip(), line
    whole_loop, diagram = blocks("python")
    for example, lines in ((whole_loop, 15), (diagram, 10)):
        assert len([line for line in example.splitlines() if line.strip()]) <= lines
        (tmp_path / "example.py").write_text(example, encoding="utf-8")
        run([sys.executable, "example.py"], tmp_path)
    assert (tmp_path / "out" / "augmented.json").is_file() and (tmp_path / "out" / "arm.c").is_file()
    assert os.path.isfile(tmp_path / "out" / "track" / "tracking.json")


@pytest.mark.slow
@pytest.mark.measured
def test_the_commands_on_the_measured_arm_give_the_figures_of_the_text(tmp_path, measured):
    lines = [line for line in commands("armloop") if "$UR10E" in line]
    assert [line.split()[1] for line in lines] == ["reconstruct", "evaluate", "diagnose", "crossvalidate"]
    *_, diagnosed, answered = (
        armloop(
            line.replace("$UR10E", str(measured / "ur10e")) + " --json" * ("crossvalidate" in line), tmp_path
        )
        for line in lines
    )
    text = (ROOT / "README.md").read_text(encoding="utf-8")
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


@pytest.mark.slow
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
            assert "no_effect" in out
        if "export" in line:
            assert "read back by" in out
    assert (tmp_path / "out" / "ur10.xml").is_file() and (tmp_path / "out" / "ur10.c").is_file()
