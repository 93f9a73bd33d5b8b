"""Values as strict JSON has them: no number that is not finite, nothing of numpy's."""

import json
import math

import numpy as np

from armloop.util.files import strict
from armloop.util.finite import finite


def test_what_is_not_finite_is_none_wherever_it_stands() -> None:
    value = {"a": [1.0, math.nan, (math.inf, "inf")], "b": {"c": -math.inf, "d": None, "e": True, "f": 3}}
    assert finite(value) == {"a": [1.0, None, [None, "inf"]], "b": {"c": None, "d": None, "e": True, "f": 3}}


def test_arrays_are_lists_and_numpys_numbers_are_pythons() -> None:
    found = finite(
        {"x": np.array([[1.5, np.nan]]), "y": np.float64(2.5), "z": np.float64("nan"), "n": np.int64(4)}
    )
    assert found == {"x": [[1.5, None]], "y": 2.5, "z": None, "n": 4}
    assert type(found["y"]) is float and type(found["n"]) is int
    assert json.loads(strict({**found, "worst": math.inf})) == {**found, "worst": None}
