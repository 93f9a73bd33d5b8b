"""Every command and every line of Python in the README runs, in the order in which they stand there."""

import json
import os
import re
import shutil
import sys

import numpy as np
import pytest
from page_commands import ROOT, armloop, blocks, commands, run

from armloop.schemas.checking import checked
from armloop.schemas.published import FILES

BIN = os.path.dirname(sys.executable)


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


def test_figures_of_the_measured_arm_are_those_of_their_page():
    text, page = ((ROOT / name).read_text(encoding="utf-8") for name in ("README.md", "docs/measured.md"))
    section = text[text.index("## On a measured arm") : text.index("## More")]
    figures = re.findall(r"\d+\.\d+", section)
    assert len(figures) >= 5 and all(figure in page for figure in figures)


@pytest.fixture(scope="module")
def done(installed, tmp_path_factory):
    """The folder in which everything was run, in turn, in an environment that has the wheel and what it asks for."""
    place = tmp_path_factory.mktemp("readme")
    # what `make loop` calls, without setting up an environment of its own
    out = armloop("armloop loop --out out/loop", place, installed)
    assert "the verdict was right" in out
    # each stage heads what it prints
    stages = [int(k) for k in re.findall(r"^(\d)/7 \S", out, re.MULTILINE)]
    assert stages == [1, 2, 3, 4, 5, 6, 7]
    for line in commands("armloop"):
        assert armloop(line, place, installed).strip(), line
    for example in blocks("python"):
        (place / "example.py").write_text(example, encoding="utf-8")
        run([str(installed), "example.py"], place)
    return place


@pytest.mark.slow
def test_every_command_and_the_python_run(done):
    page = done / "out" / "loop" / "report.html"
    assert page.is_file() and (page.parent / "replay.html").is_file()
    checked(json.loads((page.parent / "loop.json").read_text(encoding="utf-8")), FILES["loop"])
    for example, lines in zip(blocks("python"), (15, 10), strict=True):
        assert len([line for line in example.splitlines() if line.strip()]) <= lines
    assert (done / "out" / "augmented.json").is_file() and (done / "out" / "arm.c").is_file()
    assert os.path.isfile(done / "out" / "track" / "tracking.json")


@pytest.mark.slow
def test_the_loop_finds_the_pushes_of_the_measured_run(done):
    folder = done / "out" / "loop"
    answer = json.loads((folder / "measured" / "measured.json").read_text(encoding="utf-8"))
    checked(answer, FILES["measured"])
    pushes = [effect for effect in answer["diagnosis"]["effects"] if effect["effect"] == "external_contact"]
    assert 4 <= len(pushes) <= 6  # five times or so
    for push in pushes:
        p = {key: np.asarray(each["value"]) for key, each in push["parameters"].items()}
        assert 0.2 < p["end"] - p["start"] < 2.0 and 15 < np.linalg.norm(p["force"]) < 70
    before, after = (np.array(answer["rmse_while_pushed"][key]) for key in ("before", "after"))
    assert (after[:3] < 0.6 * before[:3]).all()
    assert max(answer["free_run"]["moving"]["nrmse"]) < 0.25
    text = (folder / "report.html").read_text(encoding="utf-8")
    assert "The same on measured data" in text and 'href="measured/report.html"' in text


# Commands of the gallery that the README does not have, at a size that suits a test.
SHORTER = {
    "armloop excite three_axis --library rigid-body --out out/reference.csv --report out/reference.html": "armloop excite "
    "three_axis --library rigid-body --duration 6 --starts 1 --random 4 --out out/r.csv --report out/reference.html",
    "armloop tune three_axis_tracking --out out/tune": "armloop tune short.yaml --out out/tune",
}
SHORT = "plant: three_axis\nreference: {kind: fourier, duration: 5.0}\nscore: [1.0, 5.0]\n"


@pytest.mark.long
def test_the_site_is_built_strictly_with_its_tutorials_executed(done, installed, tmp_path):
    if shutil.which("mkdocs", path=BIN) is None:
        pytest.skip("the packages of requirements-docs.lock are not installed (`make docs` installs them)")
    here = {"armloop loop --out out/loop", *map(one_blank, commands("armloop"))}
    (done / "short.yaml").write_text(SHORT, encoding="utf-8")
    for line in map(one_blank, commands("armloop", "docs/gallery.md")):
        if line not in here:
            armloop(SHORTER[line], done, installed)
    shutil.copytree(ROOT / "docs", tmp_path / "docs", ignore=shutil.ignore_patterns("reports", "out"))
    shutil.copy(ROOT / "mkdocs.yml", tmp_path)
    (tmp_path / "src").symlink_to(ROOT / "src")
    path = f"{BIN}{os.pathsep}{os.environ['PATH']}"
    # as from a shell, where nobody has chosen a backend
    command = [sys.executable, "docs/build.py", "--reports", str(done / "out")]
    run(command, tmp_path, PATH=path, MPLBACKEND="")
    site = tmp_path / "out" / "site"
    for tutorial in (ROOT / "docs" / "tutorials").glob("*.py"):
        text = (site / "tutorials" / f"{tutorial.stem}.html").read_text(encoding="utf-8")
        assert "jp-OutputArea-output" in text, tutorial
    pushes = (site / "tutorials" / "3_pushes.html").read_text(encoding="utf-8")
    assert "image/png" in pushes and "Figure size" not in pushes
    for page in ("loop/report.html", "tune/report.html"):
        assert (site / "reports" / page).read_bytes() == (done / "out" / page).read_bytes()


def one_blank(line):
    return " ".join(line.split())
