"""The reproduction of the paper is a package of its own; its command says so where it is missing."""

import sys
from pathlib import Path

import pytest

from armloop.cli import main


def test_without_the_papers_package_one_line_says_so(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in [name for name in sys.modules if name.split(".")[0] == "armloop_paper"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "armloop_paper", None)
    assert main(["reproduce", "fig9", "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "armloop_paper is not installed" in said
    assert not (tmp_path / "out").exists()
