"""The wheel carries arms, scenarios, measured logs and the reports' templates, and works with no checkout near it."""

import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = """
import sys
import armloop
from armloop.util.resources import measured_folder, scenario_names, scenario_path, urdf_names, urdf_path
home = sys.argv[1]
assert not armloop.__file__.startswith(home), armloop.__file__
for path in [*map(urdf_path, urdf_names()), *map(scenario_path, scenario_names()), measured_folder("ur5")]:
    assert not str(path).startswith(home) and path.exists(), path
import importlib, pkgutil
import armloop_paper
packages = [each for package in (armloop, armloop_paper)
            for each in pkgutil.walk_packages(package.__path__, f"{package.__name__}.")]
for module in packages:
    if not module.name.endswith("__main__"):
        importlib.import_module(module.name)
print(*urdf_names())
print(*scenario_names())
"""


def run(python: Path, *words: str, cwd: Path) -> str:
    answer = subprocess.run([python, *words], capture_output=True, text=True, cwd=cwd, check=False)
    assert answer.returncode == 0, answer.stderr
    return answer.stdout


@pytest.mark.slow
def test_wheel_holds_what_is_no_module(repository: Path, unpacked: Path) -> None:
    kinds = (("urdf", "*.urdf"), ("scenarios", "*.yaml"), ("scenarios/measured", "*/*.parquet"))
    for kind, suffix in (*kinds, ("reports/templates", "*")):
        folder = repository / ("src/armloop" if kind.startswith("reports") else ".") / kind
        expected = {str(path.relative_to(folder)): path.read_bytes() for path in folder.glob(suffix)}
        folder = unpacked / "armloop" / kind
        packed = {str(path.relative_to(folder)): path.read_bytes() for path in folder.glob(suffix)}
        assert expected and packed == expected
    assert (unpacked / "armloop" / "py.typed").is_file()


@pytest.mark.slow
def test_resources_are_found_in_the_wheel(repository: Path, installed: Path, tmp_path: Path) -> None:
    arms, scenarios = run(installed, "-c", PROGRAM, str(repository), cwd=tmp_path).splitlines()
    assert arms.split() == sorted(path.stem for path in (repository / "urdf").glob("*.urdf"))
    assert scenarios.split() == sorted(path.stem for path in (repository / "scenarios").glob("*.yaml"))


@pytest.mark.slow
def test_commands_run_with_what_the_wheel_asks_for(installed: Path, tmp_path: Path) -> None:
    packages = "import importlib.metadata as m; print(*sorted(d.name.lower() for d in m.distributions()))"
    there = run(installed, "-c", packages, cwd=tmp_path).split()
    assert "armloop" in there and not {"pytest", "mujoco", "hypothesis", "distributed"} & set(there)
    version = run(Path(sys.executable), "-m", "armloop", "--version", cwd=tmp_path)
    assert run(installed, "-m", "armloop", "--version", cwd=tmp_path) == version
    assert "--measured" in run(installed, "-m", "armloop", "loop", "--help", cwd=tmp_path)
    # an arm that comes along, Drake, a report's templates and plots
    words = "excite three_axis --library rigid-body --duration 6 --starts 1 --random 3 --out ref.csv --report ref.html"
    assert run(installed, "-m", "armloop", *words.split(), cwd=tmp_path)
    assert "</html>" in (tmp_path / "ref.html").read_text(encoding="utf-8")
