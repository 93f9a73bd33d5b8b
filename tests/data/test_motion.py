"""A motion is floating-point numbers in runs that lie within it, whatever numbers it was made of."""

import numpy as np
import pytest

from armloop.data.motion import Motion
from armloop.util.errors import InputError

TIME, REST = np.arange(100) / 100, np.zeros((100, 3))


@pytest.mark.parametrize("kind", [int, np.int32, np.uint8, np.float32, list])
def test_any_numbers_become_doubles(kind: type) -> None:
    given = REST.tolist() if kind is list else REST.astype(kind)
    motion = Motion(TIME, given, given, given, [0, 50], [0, 1])  # type: ignore[arg-type]
    assert motion.begins is not None
    for numbers in (motion.time, motion.q, motion.v, motion.vdot, motion.begins):
        assert numbers.dtype == np.float64
    assert motion.runs() == [slice(0, 50), slice(50, 100)]


def test_what_is_right_is_not_copied() -> None:
    starts = np.array([0, 10])
    motion = Motion(TIME, REST, REST, REST, starts)
    assert motion.time is TIME and motion.q is REST and motion.starts is starts


@pytest.mark.parametrize(
    ("starts", "said"),
    [
        ([0, 500], "one of the 100 samples; the last is 500"),
        ([0, 100], "one of the 100 samples; the last is 100"),
        ([0, 50, 20], "starts must rise"),
        ([0, 50, 50], "starts must rise"),
        ([0.0, 50.0], "starts of a motion must be an array of whole numbers"),
    ],
)
def test_runs_lie_within_the_motion(starts: list[float], said: str) -> None:
    with pytest.raises(InputError, match=said):
        Motion(TIME, REST, REST, REST, starts)  # type: ignore[arg-type]


def test_a_motion_of_no_numbers_is_refused() -> None:
    with pytest.raises(InputError, match=r"q of a motion must be an array of numbers; .* holds complex128"):
        Motion(TIME, 1j * REST, REST, REST)


def test_time_does_not_fall_within_a_run() -> None:
    x = np.zeros((4, 1))
    for time, starts in (([0.0, 0.1, 0.1, 0.2], [0]), ([0.0, 0.1, 0.0, 0.1], [0, 2])):
        assert Motion(np.array(time), x, x, x, np.array(starts)).samples == 4
    with pytest.raises(InputError, match=r"within a run: it does at sample 2, 0\.1 to 0 s"):
        Motion(np.array([0.0, 0.1, 0.0, 0.1]), x, x, x)
    several = Motion(np.array([0.0, 0.1, 0.0, 0.1]), x, x, x, np.array([0, 2]))
    assert several.take([0, 1, 3]).starts.tolist() == [0] and several.take([1, 2, 3]).starts.tolist() == [
        0,
        1,
    ]
