"""What is left out of a reconstruction judges it, and nothing of it is fitted."""

import numpy as np
import pytest
from synthetic import fourier_motion, friction, measured

from armloop.data.log import MotionLog
from armloop.data.signals import Conditioning, preprocess
from armloop.identification.validation.splits import by_blocks, by_file, judging_rows, told_apart
from armloop.util.errors import InputError


def a_run(name: str = "run", seconds: float = 10.0) -> MotionLog:
    motion = fourier_motion(seconds, 100.0, 1)
    return measured(motion, friction(motion.v), 1, name=name)


def test_each_file_is_left_out_once():
    logs = [a_run(name) for name in "abc"]
    splits = by_file(logs)
    assert [split.name for split in splits] == ["a", "b", "c"]
    assert [[log.name for log in split.training] for split in splits] == [["b", "c"], ["a", "c"], ["a", "b"]]
    with pytest.raises(InputError, match="a single log cannot be left out"):
        by_file(logs[:1])


def test_a_name_that_stands_twice_gets_a_number_that_no_other_log_has():
    logs = [a_run(name, 1.0) for name in ("a", "a", "b", "a (2)")]
    assert [log.name for log in told_apart(logs)] == ["a", "a (3)", "b", "a (2)"]


def test_alternating_blocks_share_every_sample_out():
    log = a_run()
    odd, even = by_blocks([log], 1.0)
    times = [split.training[0].time for split in (odd, even)]
    assert not set(times[0]) & set(times[1])
    assert len(times[0]) + len(times[1]) == log.samples
    assert [len(split.training[0].runs()) for split in (odd, even)] == [5, 5]


def test_no_filtered_sample_of_what_judges_was_near_what_is_fitted():
    log = a_run()
    samples = preprocess([log], Conditioning(cutoff_hz=10.0))
    for split in by_blocks([log], 1.0):
        time = samples.motion.time[judging_rows(samples.motion.time, samples, split.left_out[0])]
        nearest = np.abs(time[:, None] - split.training[0].time).min()
        assert nearest > 0.05 - 1e-9  # half a period of the filter
        assert 0.3 < len(time) / samples.motion.samples < 0.5


@pytest.mark.parametrize(("seconds", "what"), [(0.1, "too short"), (30.0, "shorter than two blocks")])
def test_blocks_that_do_not_work_are_refused(seconds: float, what: str):
    with pytest.raises(InputError, match=what):
        by_blocks([a_run()], seconds)
