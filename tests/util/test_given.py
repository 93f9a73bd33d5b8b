"""What Python code hands in is shown so that one sees what is wrong with it."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.autodiffutils import InitializeAutoDiff
from pydrake.symbolic import MakeVectorVariable

from armloop.util.errors import InputError
from armloop.util.given import numbers_of, shown


@pytest.mark.parametrize(
    ("given", "kind"),
    [
        (InitializeAutoDiff(np.zeros(7)).ravel(), "AutoDiffXd"),
        (MakeVectorVariable(7, "quite_a_long_name_of_q"), "Variable"),
    ],
)
def test_drakes_scalars_are_told_where_they_belong(given: np.ndarray, kind: str) -> None:
    with pytest.raises(
        InputError, match=rf"shape \(7,\), of {kind}s, for which there is armloop\.drake\.model_equations"
    ):
        numbers_of(given, (7,), "q")


def test_other_objects_are_shown_by_their_type_alone() -> None:
    assert shown(np.array(["a" * 40, None] * 9, dtype=object)) == "of type ndarray and shape (18,)"
    assert "with a number that is not finite" in shown(np.full(40, np.nan))
