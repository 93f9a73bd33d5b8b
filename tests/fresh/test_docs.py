"""The documentation has a place for every page, and its commands are commands; `make docs` runs them."""

import ast
import re
import shlex
from pathlib import Path

import pytest
import yaml

from armloop.cli import build_parser
from armloop.drake.control.controllers import LISTED as CONTROLLERS
from armloop.laws.effects import EFFECTS
from armloop.util.errors import InputError

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(path for path in DOCS.rglob("*.md") if "reports" not in path.parts)
TUTORIALS = sorted((DOCS / "tutorials").glob("*.py"))
#: YAML in `scenarios/` that is no tracking scenario.
BESIDE = ("plants", "collection")


def site() -> dict:
    return yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))


def places(nav: object) -> list[str]:
    if isinstance(nav, str):
        return [nav]
    return [place for each in (nav.values() if isinstance(nav, dict) else nav) for place in places(each)]


def commands(text: str) -> list[str]:
    """Lines that call armloop in blocks without a language, or of the shell, and in a tutorial's magics."""
    blocks = [body for kind, body in re.findall(r"```(\w*)\n(.*?)```", text, re.DOTALL) if kind in ("", "sh")]
    lines = "\n".join(blocks).replace("\\\n", " ").splitlines()
    magics = re.findall(r"^# !(.*)$", text, re.MULTILINE)
    return [line.split(" | ")[0] for line in [*lines, *magics] if line.startswith("armloop ")]


def test_every_page_has_a_place():
    assert sorted(places(site()["nav"])) == sorted(
        path.relative_to(DOCS).as_posix() for path in [*PAGES, *TUTORIALS]
    )


@pytest.mark.parametrize("page", [*PAGES, *TUTORIALS], ids=lambda path: path.name)
def test_what_a_page_calls_is_a_command_with_these_options(page):
    for line in commands(page.read_text(encoding="utf-8")):
        try:
            build_parser().parse_args(shlex.split(line)[1:])
        except InputError as error:
            pytest.fail(f"{line}: {error}")


@pytest.mark.parametrize("page", TUTORIALS, ids=lambda path: path.name)
def test_a_tutorial_is_python_with_text(page):
    text = page.read_text(encoding="utf-8")
    assert text.startswith("# %% [markdown]\n# # ")
    assert any(isinstance(node, ast.Import) for node in ast.parse(text.replace(";\n", "\n")).body)


def test_what_the_guide_names_is_there():
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    named = [
        *re.findall(r"`((?:src|tests|scenarios|docs)/[\w./]*)`", text),
        *re.findall(r"\]\(([^)\s]+)\)", text),
    ]
    assert len(named) > 12
    for path in named:
        assert (ROOT / path).exists(), path


def test_the_page_of_effects_has_each_by_its_name_and_its_law():
    text = (DOCS / "effects.md").read_text(encoding="utf-8")
    assert not [name for name in EFFECTS if f"`{name}`" not in text]
    laws = [f"::: {kind.__module__}.{kind.__name__}\n" for kind in EFFECTS.values()]
    assert not [law for law in laws if law not in text]


def test_the_page_of_scenarios_has_every_controller_and_every_file():
    text = (DOCS / "scenarios.md").read_text(encoding="utf-8")
    files = {path.stem for path in (ROOT / "scenarios").glob("*.yaml")} - {*BESIDE}
    assert not [name for name in (*CONTROLLERS, *sorted(files)) if f"`{name}`" not in text]
