"""Bounded reading: a key stands once, however many others there are."""

from pathlib import Path

import pytest

from armloop.util.errors import ScenarioError
from armloop.util.reading import read_yaml


@pytest.mark.parametrize("keys", [1, 2000])
def test_a_field_that_stands_twice_is_refused(keys: int, tmp_path: Path) -> None:
    lines = [f"field{k}: {k}" for k in range(keys)]
    path = tmp_path / "settings.yaml"
    path.write_text("\n".join([*lines, "field0: 1"]))
    with pytest.raises(ScenarioError, match="field 'field0' stands twice"):
        read_yaml(path, ScenarioError, "settings")
