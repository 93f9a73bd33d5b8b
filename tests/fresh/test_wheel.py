"""The wheel carries the arms and the scenarios, and finds them with no checkout near it."""

import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = """
import sys
sys.path.insert(0, sys.argv[1])
import armloop
from armloop.resources import scenario_names, scenario_path, urdf_names, urdf_path
assert armloop.__file__.startswith(sys.argv[1]), armloop.__file__
for path in [*map(urdf_path, urdf_names()), *map(scenario_path, scenario_names())]:
    assert str(path).startswith(sys.argv[1]), path
print(*urdf_names())
print(*scenario_names())
"""


@pytest.mark.slow
def test_wheel_holds_what_lies_at_the_top_of_the_checkout(repository: Path, unpacked: Path) -> None:
    for kind, suffix in (("urdf", "*.urdf"), ("scenarios", "*.yaml")):
        expected = {path.name: path.read_bytes() for path in (repository / kind).glob(suffix)}
        packed = {path.name: path.read_bytes() for path in (unpacked / "armloop" / kind).glob(suffix)}
        assert expected and packed == expected
    assert (unpacked / "armloop" / "py.typed").is_file()


@pytest.mark.slow
def test_resources_are_found_in_the_wheel(repository: Path, unpacked: Path, tmp_path: Path) -> None:
    answer = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(unpacked)], capture_output=True, text=True, cwd=tmp_path
    )
    assert answer.returncode == 0, answer.stderr
    arms, scenarios = (line.split() for line in answer.stdout.splitlines())
    assert arms == sorted(path.stem for path in (repository / "urdf").glob("*.urdf"))
    assert scenarios == sorted(path.stem for path in (repository / "scenarios").glob("*.yaml"))
