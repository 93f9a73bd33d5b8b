"""What a monitor hands on of a block: its samples in their order, their times, and which of them slide."""

import dataclasses

import numpy as np
import pytest
from exact_parts import model_of
from numpy.testing import assert_allclose

from armloop.drake.control import residual_monitor
from armloop.drake.control.residual_monitor import ResidualMonitor
from armloop.monitoring.blockwise import Known, Watch
from armloop.robot.arm import load_arm


@pytest.fixture(scope="module")
def model():
    return model_of(load_arm("three_axis"))


def test_a_block_needs_ten_samples_and_learning_four_blocks(model) -> None:
    ResidualMonitor(model, period=0.05, block=0.5, learn=2.0)
    for times in ((0.055, 0.5, 2.0), (0.05, 0.5, 1.7), (0.0501, 0.45, 2.0)):
        with pytest.raises(ValueError, match="a block needs ten samples, learning four blocks"):
            ResidualMonitor(model, period=times[0], block=times[1], learn=times[2])


def test_it_samples_a_hundred_times_a_second_for_blocks_of_half_a_second(model) -> None:
    timing = ResidualMonitor(model).GetUniquePeriodicDiscreteUpdateAttribute()
    assert (timing.period_sec(), timing.offset_sec()) == (0.01, 0.0)
    # fifty samples a block, forty blocks to learn from
    ResidualMonitor(model, learn=2.0)
    with pytest.raises(ValueError, match=r"period 0\.01 s, block 0\.5 s, learn 1\.7 s"):
        ResidualMonitor(model, learn=1.7)
    with pytest.raises(ValueError, match=r"period 0\.3 s, block 0\.5 s, learn 20\.0 s"):
        ResidualMonitor(model, period=0.3)


def test_a_block_is_handed_on_as_it_was_sampled(model, monkeypatch) -> None:
    """Ten samples a block, twice the period of a tenth of a second; of a model that knows the speeds of its joints."""
    knowing = dataclasses.replace(
        model, history={"range": [[1.0] * 3, [1.0, 2.0, 4.0], [1.0] * 3, [0.0] * 3]}
    )
    handed = []

    def block_sums(model, motion, tau, slides):
        handed.append((motion, tau, slides))
        return [], "sums"

    def advance(model, columns, watch, block, learn):
        assert (block, learn) == ("sums", 4)
        return watch

    monkeypatch.setattr(residual_monitor, "block_sums", block_sums)
    monkeypatch.setattr(residual_monitor, "advance", advance)
    monitor = ResidualMonitor(knowing, period=0.1, block=1.0, learn=4.0)
    context = monitor.CreateDefaultContext()
    rows = np.arange(10 * 12.0).reshape(10, 12)
    v = rows[:, 6:9]
    v[:] = 1.0
    limit = 0.02 * np.array([1.0, 2.0, 4.0])
    v[3], v[4] = 0.99 * limit, -1.01 * limit
    for k in [*range(10), *range(10)]:  # the second block writes over the first
        context.SetTime(3.0 + 0.1 * k)
        monitor.GetInputPort("tau").FixValue(context, rows[k, :3])
        monitor.GetInputPort("state").FixValue(context, rows[k, 3:9])
        monitor.GetInputPort("vdot").FixValue(context, rows[k, 9:])
        discrete = context.get_mutable_discrete_state()
        monitor._sample(context, discrete)
    handed.clear()
    context.SetTime(4.0)
    monitor._advance(context, context.get_mutable_state())
    ((motion, tau, slides),) = handed
    assert_allclose(motion.time, 3.0 + 0.1 * np.arange(10))
    assert motion.starts.tolist() == [0]
    # what warms up has done so since time 0
    assert motion.elapsed.tolist() == motion.time.tolist()
    assert_allclose(np.hstack([tau, motion.q, motion.v, motion.vdot]), rows)
    assert np.argwhere(~slides).tolist() == [[3, 0], [3, 1], [3, 2]]


def test_an_alarm_is_from_the_first_block_on(model) -> None:
    monitor = ResidualMonitor(model)
    context = monitor.CreateDefaultContext()
    assert monitor.GetOutputPort("alarm").Eval(context).tolist() == [0.0]
    assert np.isnan(monitor.GetOutputPort("score").Eval(context)).all()
    assert monitor.GetOutputPort("named").Eval(context).revision == Known().revision == 0
    for alarmed, raised in ((1, 1.0), (0, 0.0)):
        state = context.get_mutable_abstract_state(int(monitor._watch))
        state.set_value(dataclasses.replace(Watch(), alarmed=alarmed))
        assert monitor.GetOutputPort("alarm").Eval(context).tolist() == [raised]
