"""What docs/own_effect.md says, done as it says: a class, its entry point, a run, a model file, and without it."""

import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

TEXT = (Path(__file__).resolve().parents[2] / "docs" / "own_effect.md").read_text(encoding="utf-8")
CLASS, SCRIPT = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
PROJECT = tomllib.loads(re.findall(r"```toml\n(.*?)```", TEXT, re.DOTALL)[0])

# the same run and model as the document's, looked at by one who has not installed the effect
WITHOUT = """
from armloop.diagnosis import diagnose
from armloop.drake.plant.exact import exact_model
from armloop.drake.experiments.scenarios import load_plant
from armloop.data.log import read_log

plant = load_plant("three_axis")
found = diagnose(exact_model(plant.arm, plant.config.friction), [read_log("run.csv")])
print(found.verdict, found.errors()["after"][1], *(effect["effect"] for effect in found.to_dict()["effects"]))
"""


def python(*words: str, cwd: Path, installed: Path | None) -> subprocess.CompletedProcess[str]:
    """Run Python with or without the folder that the package is installed in."""
    environment = {**os.environ, "PYTHONPATH": "" if installed is None else str(installed)}
    return subprocess.run(
        [sys.executable, *words], cwd=cwd, env=environment, capture_output=True, text=True, timeout=120
    )


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    """The document's module and what an installer makes of its project file."""
    folder = tmp_path_factory.mktemp("site")
    project = PROJECT["project"]
    (folder / "my_effects.py").write_text(CLASS)
    info = folder / f"my_effects-{project['version']}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n"
    )
    lines = [
        f"[{group}]\n" + "".join(f"{name} = {value}\n" for name, value in entries.items())
        for group, entries in project["entry-points"].items()
    ]
    (info / "entry_points.txt").write_text("\n".join(lines))
    return folder


@pytest.fixture(scope="module")
def done(site, tmp_path_factory) -> tuple[Path, str]:
    """The folder that the document's script was run in, and what it printed."""
    folder = tmp_path_factory.mktemp("run")
    keep = (
        "from armloop.data.log import write_log\nwrite_log('run.csv', log)\n"
        "from armloop.reports.diagnosis_tables import effects_table\n"
        "likely = diagnosis.to_dict()['effects'][0]['probability']\n"
        "open('found.txt', 'w').write(f'{likely}\\n{effects_table(diagnosis)}')\n"
        "print(diagnosis.verdict, diagnosis.errors()['after'][1], len(diagnosis.outcome.found))\n"
    )
    answer = python("-c", SCRIPT + keep, cwd=folder, installed=site)
    assert answer.returncode == 0, answer.stderr
    return folder, answer.stdout


def test_the_effect_is_found_with_its_parameters_and_compensated(done):
    folder, printed = done
    (added,) = json.loads((folder / "model.json").read_text())["effects"]
    assert (added["effect"], added["joint"]) == ("eddy_brake", 2)
    for key, truth in (("peak", 1.5), ("speed", 0.25)):
        value, error = (added["parameters"][key][what] for what in ("value", "std_error"))
        assert abs(value - truth) < max(3 * error, 0.02 * truth) and error < 0.02 * truth
    words, supplied, verdict = printed.strip().splitlines()
    assert verdict.startswith("effects_found ") and verdict.endswith(" 1")
    assert words.startswith("joint 2 needs 2 T / (v/w + w/v) in addition, with peak 1.5")
    # at the critical speed it is the peak
    np.testing.assert_allclose([float(x) for x in supplied.strip("[]").split()], [0, 1.5, 0], atol=0.01)


def test_no_blind_test_says_how_often_it_is_there(done):
    probability, *table = (done[0] / "found.txt").read_text().splitlines()
    assert probability == "None"
    (row,) = [line for line in table if "eddy" in line]
    assert "%" in row and row.split()[-2:] == ["–", "arm"]


def test_the_command_line_knows_it_where_it_is_installed_and_says_so_where_not(done, site):
    folder, _ = done
    words = ("-m", "armloop", "evaluate", "model.json", "run.csv")
    answer = python(*words, cwd=folder, installed=site)
    assert answer.returncode == 0, answer.stderr
    answer = python(*words, cwd=folder, installed=None)
    assert answer.returncode == 2
    (line,) = answer.stderr.strip().splitlines()
    assert line.startswith("armloop: model.json: unknown effect 'eddy_brake'; install the package")


@pytest.mark.long
def test_without_it_the_run_shows_something_else(done):
    folder, printed = done
    answer = python("-c", WITHOUT, cwd=folder, installed=None)
    assert answer.returncode == 0, answer.stderr
    verdict, left, *names = answer.stdout.split()
    assert verdict in ("effects_found", "unlisted_effect") and "eddy_brake" not in names
    # whatever is named in its place does not explain the run as it does
    assert float(left) > 3 * float(printed.split()[-2])


def test_help_does_not_look_for_effects(site, tmp_path):
    (tmp_path / "my_effects.py").write_text("raise RuntimeError('imported')\n")
    os.symlink(next(site.glob("*.dist-info")), tmp_path / "my_effects-1.0.dist-info")
    for words in (["--help"], ["diagnose", "--help"]):
        answer = python("-X", "importtime", "-m", "armloop", *words, cwd=tmp_path, installed=tmp_path)
        assert answer.returncode == 0, answer.stderr
        assert "armloop.commands.arguments" in answer.stderr and "armloop.laws.effects" not in answer.stderr
