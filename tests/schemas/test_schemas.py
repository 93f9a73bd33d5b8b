"""The published schemas are those of the descriptions; a misfit is told with its place."""

from pathlib import Path
from typing import Annotated

import msgspec
import pytest
from msgspec import Meta, Struct

from armloop.schemas.checking import Misfit, checked
from armloop.schemas.published import FILES, schemas
from armloop.schemas.types import MOST_JOINTS

DOCS = Path(__file__).resolve().parents[2] / "docs"


def test_the_published_schemas_are_current() -> None:
    found = {path.name: path.read_text(encoding="utf-8") for path in (DOCS / "schemas").iterdir()}
    assert found == schemas()
    for name in found:
        assert name in (DOCS / "files.md").read_text(encoding="utf-8")


def test_descriptions_are_not_indented_whatever_python_leaves_of_docstrings() -> None:
    assert all("\\n " not in text for text in schemas().values())


@pytest.mark.parametrize(
    ("page", "words"), [("limits.md", "at most {}."), ("files.md", "an arm at most {} joints")]
)
def test_the_pages_say_how_many_joints_an_arm_may_have(page: str, words: str) -> None:
    assert words.format(MOST_JOINTS) in (DOCS / page).read_text(encoding="utf-8")


@pytest.mark.parametrize("name", FILES)
def test_every_field_of_a_number_is_bounded(name: str) -> None:
    def numbers(part: object, place: str) -> list[str]:
        if isinstance(part, dict):
            if part.get("type") in ("number", "integer") and not {"minimum", "exclusiveMinimum"} & set(part):
                return [place]
            return [each for key, inner in part.items() for each in numbers(inner, f"{place}.{key}")]
        return [each for inner in part for each in numbers(inner, place)] if isinstance(part, list) else []

    assert numbers(msgspec.json.schema(FILES[name]), name) == []


class Leaf(Struct, forbid_unknown_fields=True):
    size: Annotated[float, Meta(gt=0)]
    kind: str = ""
    width: Annotated[float, Meta(le=0.005)] = 0.0


class Tree(Struct):
    leaves: dict[str, Annotated[list[Leaf], Meta(max_length=2)]]


@pytest.mark.parametrize(
    ("leaves", "said"),
    [
        (
            {"a": [{"size": 1}], "b": [{"size": "x"}]},
            r"leaves\.b\[1\]\.size is 'x'; it must be a finite number",
        ),
        ({"a": [{"size": 1}], "b": [{"size": 1}, {"size": 0}]}, r"leaves\.b\[2\]\.size is 0; .* above 0"),
        ({"a": [{"size": 1, "width": 1}]}, r"width is 1; it must be a finite number of at most 0\.005$"),
        ({"a": [{"size": 1}] * 3}, r"leaves\.a is .*; it must be a list .*at most 2"),
        ({"a": [{}]}, r"leaves\.a\[1\]: field 'size' is missing"),
        (
            {"a": [{"size": 1, "shape": 2}]},
            r"leaves\.a\[1\]: field 'shape' is unknown; there are: size, kind, width",
        ),
        ([], r"leaves is \[\]; it must be a mapping of fields"),
    ],
)
def test_a_misfit_names_its_place(leaves: object, said: str) -> None:
    with pytest.raises(Misfit, match=said):
        checked({"leaves": leaves}, Tree)
