"""Every command and every line of Python in the README runs, in the order in which they stand there."""

import json
import os
import re
import shutil
import sys

import pytest
from page_commands import ROOT, armloop, blocks, commands, run

from armloop.drake_systems.scenario_schema import FILES
from armloop.schemas.checking import checked

# the command with the package of a wheel before that of the checkout
FROM_WHEEL = """
import sys
sys.path.insert(0, sys.argv.pop(1))
import armloop.cli
assert armloop.__file__.startswith(sys.path[0]), armloop.__file__
sys.exit(armloop.cli.main())
"""


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
