"""The lock files can be installed by the oldest Python that armloop promises to work with."""

from importlib.metadata import PackageNotFoundError, metadata

import pytest
from packaging.specifiers import SpecifierSet
from page_commands import ROOT

OLDEST = "3.11.0"


@pytest.mark.parametrize("lock", ["requirements", "requirements-test", "requirements-docs"])
def test_every_locked_package_admits_the_oldest_python(lock: str) -> None:
    lines = (ROOT / f"{lock}.lock").read_text(encoding="utf-8").splitlines()
    seen, refused = 0, []
    for name, version in (line.split("==") for line in lines if "==" in line):
        try:
            found = metadata(name)
        except PackageNotFoundError:
            continue  # those of the documentation need not be there
        assert found["Version"] == version, f"{name} {found['Version']} is installed; the lock has {version}"
        seen += 1
        needs = found.get("Requires-Python", "")  # by [] a newer importlib raises where a package names none
        if OLDEST not in SpecifierSet(needs):
            refused.append(f"{name} {version} needs Python {needs}")
    assert refused == []
    assert seen or lock == "requirements-docs"
