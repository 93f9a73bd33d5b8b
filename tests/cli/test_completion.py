"""The shell completes commands, options and choices by what `armloop --print-completion` prints."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from armloop.cli import main

# what is typed, and what it may become
TYPED = {
    "rec": {"reconstruct"},
    "reconstruct --lib": {"--library"},
    "crossvalidate --leave-out b": {"blocks"},
    "export model.json --to m": {"mjcf"},
    "evaluate mod": {"model.json"},
}
ASK = """
source "$1"; shift
COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1))
_shtab_armloop 2>/dev/null
printf '%s\\n' "${COMPREPLY[@]}"
"""


@pytest.fixture(scope="module")
def script(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What is printed for bash."""
    pytest.importorskip("shtab")
    path = tmp_path_factory.mktemp("completion") / "bash"
    with path.open("w") as file, pytest.MonkeyPatch.context() as patch, pytest.raises(SystemExit) as ended:
        patch.setattr("sys.stdout", file)
        main(["--print-completion", "bash"])
    assert ended.value.code == 0
    return path


@pytest.mark.parametrize("typed", TYPED)
def test_what_is_typed_is_completed(typed: str, script: Path, tmp_path: Path) -> None:
    if shutil.which("bash") is None:
        pytest.skip("bash is not installed")
    (tmp_path / "model.json").touch()
    done = subprocess.run(
        ["bash", "-c", ASK, "bash", str(script), "armloop", *typed.split()],
        cwd=tmp_path,
        env=dict(os.environ),
        capture_output=True,
        text=True,
        check=False,
    )
    assert set(done.stdout.split()) == TYPED[typed]


def test_an_unknown_shell_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--print-completion", "fish"]) == 2
    assert "fish" in capsys.readouterr().err
