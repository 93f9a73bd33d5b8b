"""Readers and writers held against any content: properties that hypothesis tries to break."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from armloop.model import load_model
from armloop.util.errors import InputError, ModelError
from armloop.util.files import strict
from armloop.util.reading import read_json, read_yaml

JSON = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(10**20), 10**20)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=4), inner, max_size=4),
    max_leaves=8,
)
QUICK = settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def leaves(data: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    yield path
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in items:
        yield from leaves(value, (*path, key))


@QUICK
@given(data=st.data())
def test_any_change_of_a_model_is_read_or_refused_in_one_line(
    right: Path, tmp_path: Path, data: st.DataObject
) -> None:
    model = json.loads((right / "model.json").read_text())
    for _ in range(data.draw(st.integers(1, 3))):
        path = data.draw(st.sampled_from(list(leaves(model))[1:]))
        inner = model
        for key in path[:-1]:
            inner = inner[key]
        if data.draw(st.booleans()):
            inner[path[-1]] = data.draw(JSON)
        elif isinstance(inner, dict):
            del inner[path[-1]]
        else:
            inner.pop(path[-1])
        if not isinstance(model, dict) or len(list(leaves(model))) < 2:
            break
    file = tmp_path / "any.json"
    file.write_text(json.dumps(model))
    try:
        found = load_model(file)
    except InputError as error:
        assert str(error).startswith(f"{file}: ") and "\n" not in str(error)
    else:  # what is read can be written and read again
        found.save(tmp_path / "again.json")
        assert load_model(tmp_path / "again.json").to_dict() == found.to_dict()


@QUICK
@given(
    content=st.binary(max_size=60)
    | st.text(max_size=60).map(str.encode)
    | JSON.map(lambda x: json.dumps(x).encode())
)
def test_any_bytes_are_no_model(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "any.json").write_bytes(content)
    with pytest.raises(ModelError):
        load_model(tmp_path / "any.json")


@QUICK
@given(content=st.text(max_size=60) | JSON.map(json.dumps))
def test_any_text_is_yaml_or_refused(tmp_path: Path, content: str) -> None:
    (tmp_path / "any.yaml").write_text(content, encoding="utf-8", errors="replace")
    try:
        read_yaml(tmp_path / "any.yaml", InputError, "it")
    except InputError as error:
        assert "\n" not in str(error) and "any.yaml" in str(error)


@QUICK
@given(value=JSON)
def test_what_is_written_is_read_as_it_was(tmp_path: Path, value: Any) -> None:
    (tmp_path / "any.json").write_text(strict(value))
    assert read_json(tmp_path / "any.json", InputError, "it") == value
