"""The wheel, unpacked and installed far from the checkout."""

import os
import subprocess
import sys
import zipfile
from importlib.metadata import distribution
from pathlib import Path

import pytest
from packaging.requirements import Requirement


@pytest.fixture(scope="session")
def wheel(repository: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the wheel from the checkout, without a network."""
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir"]
    answer = subprocess.run([*build, str(folder), str(repository)], capture_output=True, text=True)
    assert answer.returncode == 0, answer.stderr
    (found,) = folder.glob("armloop-*.whl")
    return found


@pytest.fixture(scope="session")
def unpacked(wheel: Path) -> Path:
    """The folder that the wheel was unpacked to."""
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(wheel.parent / "site")
    return wheel.parent / "site"


@pytest.fixture(scope="session")
def installed(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Python of an environment that has the wheel and what the wheel asks for, and nothing else.

    `make wheel` installs it with pip, and ARMLOOP_PYTHON names that; otherwise the packages are taken from this environment.
    """
    if "ARMLOOP_PYTHON" in os.environ:
        return Path(os.environ["ARMLOOP_PYTHON"])
    unpacked: Path = request.getfixturevalue("unpacked")
    place = tmp_path_factory.mktemp("environment")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(place)], check=True)
    (packages,) = place.glob("lib/python3*/site-packages")
    for entry in unpacked.iterdir():
        (packages / entry.name).symlink_to(entry)
    for name in asked_for("armloop"):
        there = distribution(name)
        for entry in {path.parts[0] for path in there.files or ()} - {"..", "__pycache__"}:
            if not (packages / entry).exists():
                (packages / entry).symlink_to(there.locate_file(entry))
    return place / "bin" / "python"


def asked_for(name: str) -> set[str]:
    """The distributions that one needs, and those need, without any extra."""
    found: set[str] = set()
    waiting = [name]
    while waiting:
        for line in distribution(waiting.pop()).requires or ():
            need = Requirement(line)
            if need.name not in found and (need.marker is None or need.marker.evaluate({"extra": ""})):
                found.add(need.name)
                waiting.append(need.name)
    return found
