"""The text templates of the reports: what a block becomes, and that each is asked for."""

import ast
import re
from pathlib import Path
from types import SimpleNamespace

import jinja2
import pytest

import armloop.reports
from armloop.reports.prose import Prose

HOME = Path(armloop.reports.__file__).parent
TEMPLATES = sorted((HOME / "templates").glob("*.txt"))


def loop(stable: bool) -> SimpleNamespace:
    return SimpleNamespace(stable=stable)


def test_a_blank_line_ends_a_paragraph_and_a_line_end_is_a_blank() -> None:
    result = SimpleNamespace(diagnosis=SimpleNamespace(outcome=SimpleNamespace(found=[1])), right=False)
    lead = Prose("loop", result=result)["lead"]
    assert "\n" not in lead and "  " not in lead
    assert lead.endswith("traced to a cause that was not the true one, the model was augmented by it, and the arm was "
                         "controlled again.")  # fmt: skip
    said = Prose("reconstruction", warnings=["a fault", "another"])["lead"]
    assert said == (
        "a fault; another. From motion logs to a readable model of the joint torques, step by step."
    )


def test_conditions_decide_how_many_paragraphs_there_are() -> None:
    for present, proposed, count in ((True, True, 0), (True, False, 1), (False, False, 2)):
        tuning = SimpleNamespace(present=loop(present), proposed=loop(proposed))
        said = Prose("tuning", tuning=tuning).paragraphs("unstable")
        assert len(said) == count and all(
            one.endswith("are unstable in a posture of the reference.") for one in said
        )


def test_a_large_number_keeps_its_narrow_blanks() -> None:
    said = Prose("score", score=SimpleNamespace(samples=12345), what_counts="")["text"]
    assert "of 12\u202f345 samples, conditioned" in said


def test_a_value_that_is_missing_is_an_error_and_no_gap() -> None:
    with pytest.raises(jinja2.UndefinedError, match="hidden"):
        Prose("loop", parameters="mass 0.45", result=SimpleNamespace(right=True))["truth"]


def asked(source: str) -> set[str]:
    """Names of the blocks that a module asks for, as ``say["name"]`` or ``say.paragraphs("name")``."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Subscript) and ast.unparse(node.value).startswith(("say", "Prose(")):
            found.add(ast.literal_eval(node.slice))
        if isinstance(node, ast.Call) and ast.unparse(node.func).endswith(".paragraphs"):
            found.add(ast.literal_eval(node.args[0]))
    return found


@pytest.mark.parametrize("path", TEMPLATES, ids=lambda path: path.stem)
def test_every_block_is_asked_for_and_every_one_asked_for_is_there(path: Path) -> None:
    blocks = re.findall(r"{% block (\w+) %}", path.read_text(encoding="utf-8"))
    sources = [source.read_text(encoding="utf-8") for source in HOME.glob("*.py")]
    wanted = [asked(text) for text in sources if re.search(rf'Prose\(\s*"{path.stem}"', text)]
    assert set().union(*wanted) == set(blocks) and len(set(blocks)) == len(blocks)
