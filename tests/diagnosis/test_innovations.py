"""Rest as event detection sees it: a joint that stands, and not one that turns round fast within the filter's reach."""

import numpy as np

from armloop.data.motion import Motion, Samples
from armloop.diagnosis.innovations import CREEP, at_rest


def samples(v: np.ndarray, moving: np.ndarray) -> Samples:
    """One joint at 100 Hz, filtered at 5 Hz: a standstill smears its torque by 0.1 s."""
    time = 0.01 * np.arange(len(v))
    motion = Motion(
        time, np.cumsum(v)[:, None] * 0.01, v[:, None], np.gradient(v, 0.01)[:, None], np.array([0])
    )
    return Samples(motion, np.zeros((len(v), 1)), moving[:, None], 0.01, 5.0)


def test_a_fast_reversal_is_no_rest_and_a_standstill_is() -> None:
    turning = np.linspace(-2.0, 2.0, 200)
    near = (
        np.abs(np.arange(200) - 99.5) <= 10.5
    )  # the samples whose torque the filter has mixed with the standstill's
    assert at_rest(samples(turning, ~near)).sum() <= 2 < near.sum()
    standing = np.concatenate([np.linspace(2.0, 0.0, 100), np.zeros(100), np.linspace(0.0, 2.0, 100)])
    still = np.zeros(300, dtype=bool)
    still[90:210] = True
    rest = at_rest(samples(standing, ~still))[:, 0]
    assert rest[100:200].all() and not rest[:98].any() and not rest[202:].any()
    assert np.abs(standing[rest]).max() <= 2 * CREEP + 0.02
