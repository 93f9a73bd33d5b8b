"""Whole loops without the tracking, from data collection to verdict; `make blind` runs many more."""

import importlib.util
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parents[1] / "blind" / "loops.py"


def blind():
    spec = importlib.util.spec_from_file_location("undeclared_script", SCRIPT)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    # Dataclasses look their module up by name.
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


# The README's loop, and a clean run of the small blind part, are run every time (tests/fresh, tests/blind).
@pytest.mark.long
@pytest.mark.parametrize(("seed", "clean"), [(2, False), (13, False), (101, True)])
def test_the_verdict_is_right(seed, clean):
    case = blind().run("three_axis", seed, clean)
    assert case.right, f"hidden: {case.hidden}; verdict: {case.found}"
    assert case.after < 3.5
