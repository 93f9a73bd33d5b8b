"""Every module that has moved is still imported by its former name, as the same object, with a warning."""

import json
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

from armloop.moved import MOVED, present_name

ROOT = Path(__file__).resolve().parents[1]
#: Every module as it was called before the move.
FORMER = (ROOT / "tests" / "former_modules.txt").read_text(encoding="utf-8").split()
PROGRAM = """
import json, sys, warnings
from importlib import import_module
wrong = []
for former, present in json.load(sys.stdin).items():
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        module = import_module(former)
    said = [str(each.message) for each in heard if each.category is DeprecationWarning]
    if module is not import_module(present) or module.__spec__.name != present:
        wrong.append(f"{former} is another module than {present}")
    if former != present and not any(f"{former} is now {present};" in each for each in said):
        wrong.append(f"{former}: no warning that names {present}")
print(*wrong, sep="\\n", end="")
"""


def path_of(module: str) -> Path:
    place = ROOT / "src" / Path(*module.split("."))
    return place / "__init__.py" if place.is_dir() else place.with_suffix(".py")


@pytest.mark.parametrize("module", FORMER)
def test_a_former_name_leads_to_a_module(module: str) -> None:
    assert path_of(present_name(module) or module).is_file()


@pytest.mark.slow
def test_former_names_give_the_same_modules_and_a_warning() -> None:
    names = {module: present_name(module) or module for module in FORMER}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], input=json.dumps(names), capture_output=True, text=True, check=True
    )
    assert not done.stdout


def test_a_former_import_statement_works_and_warns_where_it_stands(tmp_path: Path) -> None:
    script = tmp_path / "old.py"
    script.write_text(
        "import armloop.effects.base as base\nfrom armloop.errors import InputError\nprint(base.__name__)\n"
    )
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True)
    assert done.stdout == "armloop.laws.effects.base\n"
    assert f"{script}:1: DeprecationWarning: armloop.effects is now armloop.laws.effects;" in done.stderr
    assert f"{script}:2: DeprecationWarning: armloop.errors is now armloop.util.errors;" in done.stderr


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.parametrize("module", ["armloop.nowhere", "armloop.effects.nowhere", "armloop.errors.nowhere"])
def test_a_name_that_never_was_is_not_found(module: str) -> None:
    with pytest.raises(ModuleNotFoundError, match="nowhere"):
        import_module(module)


def test_nothing_of_it_is_loaded_without_a_former_name() -> None:
    program = "import sys, armloop.cli; print('armloop.moved' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"


def test_the_page_shows_the_table() -> None:
    page = (ROOT / "docs" / "moved.md").read_text(encoding="utf-8")
    assert dict(re.findall(r"^\| `([\w.]+)` \| `([\w.]+)` \|$", page, re.M)) == MOVED
