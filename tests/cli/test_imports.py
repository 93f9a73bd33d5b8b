"""What a command imports before it has anything to do: not Drake, nor anything else that takes long."""

import subprocess
import sys

import pytest

HEAVY = ("pydrake", "scipy", "sklearn", "pysindy", "matplotlib", "control", "osqp", "pyarrow")
SCRIPT = """
import sys
from armloop.cli import main
try:
    main(sys.argv[1:])
except SystemExit:
    pass
print(*sorted(name.split(".")[0] for name in sys.modules if "." not in name))
"""


def imported(*words: str) -> set[str]:
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, *words], capture_output=True, text=True, check=True, timeout=60
    )
    assert "Traceback" not in done.stderr
    return set(done.stdout.splitlines()[-1].split())


@pytest.mark.parametrize(
    "words",
    [
        "--help",
        "--version",
        "track --help",
        "reconstruct --help",
        "bogus",
        "track",
        "tune x --bandwidth wide",
    ],
)
def test_help_and_wrong_words_import_not_even_numpy(words: str) -> None:
    # inspect, which dataclasses import, alone takes a fifth of the time
    assert not imported(*words.split()) & {*HEAVY, "numpy", "msgspec", "inspect"}


@pytest.mark.parametrize(
    "words",
    [
        "track nowhere",
        "track nowhere.yaml:name",
        "track three_axis_tracking --model step3=nowhere.json",
        "track three_axis_tracking --model nowhere.json",
        "track three_axis_tracking --rate 2",
        "tune nowhere",
        "evaluate nowhere.json nowhere.csv",
    ],
)
def test_a_file_that_is_not_there_is_told_without_them(words: str) -> None:
    assert not imported(*words.split()) & set(HEAVY)
