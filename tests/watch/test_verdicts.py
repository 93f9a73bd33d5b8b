"""What an arm's answer says of the promise's premise."""

import numpy as np
import pytest

from armloop.watch.verdicts import _notes


@pytest.mark.parametrize("programmes", [1, 2])
def test_programmes_of_different_level_are_no_resemblance(programmes: int) -> None:
    rng = np.random.default_rng(0)
    programme = np.repeat(np.arange(programmes), 20 // programmes)
    healthy = 100.0 * programme[:, None] + rng.standard_normal((20, 30))
    assert _notes(healthy, programme) == ()
    assert _notes(np.full((20, 3), np.nan), programme) == ()
    (note,) = _notes(healthy + 10.0 * np.arange(20)[:, None], programme)
    assert ("sort them by programme" in note) == (programmes == 1)
    assert ("of one programme" in note) == (programmes == 2)
