"""A blow of a twentieth to a fifth of a second is an event, as a push of seconds is."""

from __future__ import annotations

import numpy as np
import pytest
from rubbing_arm import model_with_baseline, run

from armloop.data.motion import Motion
from armloop.diagnosis import diagnose
from armloop.diagnosis.event_size import pieces_of
from armloop.model import ReconstructedModel


@pytest.fixture(scope="module")
def model() -> ReconstructedModel:
    return model_with_baseline()


@pytest.mark.parametrize("seconds", [0.06, 0.1, 0.15, 0.2])
@pytest.mark.parametrize("start", [7.0, 11.3])
def test_a_blow_is_seen_with_its_time(model: ReconstructedModel, seconds: float, start: float) -> None:
    log = run(6, 20.0)
    inside = (log.time >= start) & (log.time <= start + seconds)
    log.tau[inside, 1] += 4.0 * np.sin(np.pi * (log.time[inside] - start) / seconds)
    (event,) = diagnose(model, [log], jobs=1).contacts
    first, last = (float(np.asarray(event.added.parameters[key].value)) for key in ("start", "end"))
    assert abs(0.5 * (first + last) - start - 0.5 * seconds) < 0.05 and last - first < seconds + 0.15
    assert 1 in event.shown


@pytest.mark.parametrize(("seconds", "count"), [(0.04, 2), (0.12, 2), (0.19, 2), (0.2, 2), (0.31, 4)])
def test_a_short_event_is_judged_by_its_halves(seconds: float, count: int) -> None:
    time = np.arange(round(seconds / 0.01)) * 0.01
    x = np.zeros((len(time), 1))
    pieces = pieces_of(Motion(time, x, x, x, np.array([0])), 0.1)
    sizes = np.unique(pieces, return_counts=True)[1]
    assert len(sizes) == count
    if count == 2:
        assert abs(sizes[0] - sizes[1]) <= 1
