"""When an effect that was named is supplied, blended, settled and given back: the law of adaptive feedforward by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector
from synthetic import three_axis

from armloop.drake.control.adaptive_feedforward import AdaptiveFeedforward
from armloop.monitoring.blockwise import Known


def torque(size: float, name: str = "load", sensor: bool = False) -> Any:
    """An effect that is a torque on the first joint, and half of the reference's position on the second."""
    law = lambda q, v, vdot: np.array([size, 0.5 * q[1], 0.0])  # noqa: E731
    effect = SimpleNamespace(sensor=sensor, place=(name, None, None), needs_inertial=False)
    return SimpleNamespace(effect=effect, pointwise=lambda arm, inertial: law)


class Loop:
    """The system with its inputs fixed, looked at every 0.05 s."""

    def __init__(self, bound: float = 100.0, **of: float) -> None:
        model: Any = SimpleNamespace(arm=three_axis())
        self.system = AdaptiveFeedforward(model, bound=bound, **of)
        self.context = self.system.CreateDefaultContext()
        self.known, self.error, self.integral = Known(), 0.1, 0.0
        self.step = 0

    def to(self, time: float) -> np.ndarray:
        """Looks until then; the torque there."""
        while self.step < round(time / 0.05):
            self.step += 1
            self.context.SetTime(0.05 * self.step)
            self._fix()
            self.system._look(self.context, self.context.get_mutable_state())
        self._fix()
        output = BasicVector(3)
        self.system._calc_tau_ff(self.context, output)
        return output.CopyToVector()

    def _fix(self) -> None:
        for name, value in (
            ("q_ref", [0.0, 4.0, 0.0]),
            ("v_ref", np.zeros(3)),
            ("vdot_ref", np.zeros(3)),
            ("state", [-self.error, 4.0 + self.error, 0.0, 9.0, 9.0, 9.0]),
            ("integral", [self.integral, 0.0, 0.0]),
        ):
            self.system.GetInputPort(name).FixValue(self.context, np.array(value))
        self.system.GetInputPort("named").FixValue(self.context, Value(self.known))

    @property
    def given_back(self) -> float:
        return float(self.system.GetOutputPort("given_back").Eval(self.context).item())


def test_nothing_before_the_first_name_then_a_ramp_with_what_the_integrator_learned_taken_off() -> None:
    loop = Loop(trial=0.2)
    loop.integral = 0.2
    assert_allclose(loop.to(0.6), 0.0)
    loop.known, loop.integral = Known(1, (torque(2.0),), since=0.58), 0.7
    assert_allclose(loop.to(0.65), 0.0)
    # named at 0.65 s; the integrator is remembered every 0.25 s: before the change it held 0.2
    assert_allclose(loop.to(1.15), 0.5 * np.array([2.0 - 0.5, 2.0, 0.0]))
    assert_allclose(loop.to(1.6), 0.95 * np.array([2.0 - 0.5, 2.0, 0.0]))
    # after the ramp what was learned during it is taken off by another
    loop.integral = 0.9
    assert_allclose(loop.to(1.65), [1.5, 2.0, 0.0])
    assert_allclose(loop.to(1.65 + 0.1), [0.1 * (2.0 - 0.7) + 0.9 * 1.5, 2.0, 0.0])
    assert_allclose(loop.to(2.8), [1.3, 2.0, 0.0])
    assert loop.given_back == 0


@pytest.mark.parametrize("since", [0.05 * 6, 0.53])
def test_the_integrator_is_remembered_every_quarter_of_a_second(since: float) -> None:
    loop = Loop()
    for time, held in ((0.25, 0.1), (0.3, 0.2), (0.5, 0.3)):
        loop.integral = held
        loop.to(time)
    loop.known, loop.integral = Known(1, (torque(2.0),), since=since), 0.7
    loop.to(0.55)
    assert_allclose(loop.to(1.05), 0.5 * np.array([2.0 - 0.5, 2.0, 0.0]))


def test_of_a_change_longer_ago_than_it_remembers_the_oldest_tells() -> None:
    loop = Loop()
    for step in range(1, 243):  # remembered at 0.05 s, 0.3 s, ...: the last 240 of 242
        loop.integral = 0.01 * step
        loop.to(0.05 + 0.25 * (step - 1))
    loop.known = Known(1, (torque(2.0),), since=0.0)
    loop.to(60.35)
    assert_allclose(loop.to(60.85), 0.5 * np.array([2.0 + 0.03 - 2.42, 2.0, 0.0]))


def test_its_ramp_is_as_long_as_asked_for() -> None:
    loop = Loop(ramp=2.0)
    loop.known = Known(1, (torque(2.0),), since=0.0)
    loop.to(0.05)
    assert_allclose(loop.to(0.55), 0.25 * np.array([2.0, 2.0, 0.0]))


def test_it_stays_within_its_bound_and_goes_on_from_one_name_to_the_next() -> None:
    loop = Loop(bound=1.5)
    loop.to(0.2)
    loop.known = Known(1, (torque(-2.0),), since=0.1)
    loop.to(0.25)
    assert_allclose(loop.to(0.75), [-1.0, 1.0, 0.0])
    # another name waits until the first is supplied, and until it has settled: two ramps of 1 s
    loop.known = Known(2, (torque(-1.0), torque(-0.25, "more")), since=0.6)
    assert_allclose(loop.to(2.25), [-1.5, 1.5, 0.0])
    assert_allclose(loop.to(2.75), [-1.5, 1.5, 0.0])
    assert_allclose(loop.to(3.0), [0.25 * -2.0 + 0.75 * -1.25, 1.5, 0.0])
    assert_allclose(loop.to(3.3), [-1.25, 1.5, 0.0])
    # what comes later is judged with the first: 5 s after that one's ramp
    loop.error = 0.2
    loop.to(6.2)
    assert loop.given_back == 0
    loop.to(6.25)
    assert loop.given_back == 1


@pytest.mark.parametrize(("after", "back"), [(0.112, True), (0.108, False)])
def test_it_is_given_back_where_tracking_becomes_a_tenth_worse(after: float, back: bool) -> None:
    loop = Loop(trial=1.25)
    loop.error, loop.integral = 5.0, 0.2
    loop.to(0.15)
    loop.error = 0.1  # the last 25 looks count
    loop.to(1.35)
    loop.known, loop.integral = Known(1, (torque(2.0),), since=1.32), 0.7
    loop.to(1.4)
    loop.error, loop.integral = after, 0.9
    assert_allclose(loop.to(3.6), [2.0 - 0.7, 2.0, 0.0])
    assert loop.given_back == 0
    # without a jump, and with what was taken off for the integrator, which is needed again
    assert_allclose(loop.to(3.65), [2.0 - 0.7, 2.0, 0.0])
    assert loop.given_back == back
    if not back:
        assert_allclose(loop.to(6.5), [2.0 - 0.7, 2.0, 0.0])
        return
    assert_allclose(loop.to(3.9), 0.75 * np.array([2.0 - 0.7, 2.0, 0.0]))
    assert_allclose(loop.to(4.65), 0.0)
    # it is not taken again, but another is
    loop.known = Known(2, (torque(2.0), torque(7.0, "faulty sensor", sensor=True)), since=0.2)
    assert_allclose(loop.to(6.5), 0.0)
    loop.known = Known(3, (torque(2.0), torque(1.0, "more")), since=6.4)
    assert_allclose(loop.to(9.0), [1.0, 2.0, 0.0])
    assert loop.given_back == 1


def test_by_default_half_of_the_effort_and_times_above_zero() -> None:
    model: Any = SimpleNamespace(arm=three_axis())
    system = AdaptiveFeedforward(model)
    assert_allclose(system._bound, [0.5 * joint.effort for joint in three_axis().joints])
    AdaptiveFeedforward(model, ramp=0.1, trial=0.06, bound=0.1)
    for wrong in ({"ramp": 0.0}, {"trial": 0.05}, {"bound": [1.0, 0.0, 1.0]}):
        with pytest.raises(ValueError, match="above 0"):
            AdaptiveFeedforward(model, **wrong)  # type: ignore[arg-type]


def test_it_is_not_judged_in_the_middle_of_a_blend_so_that_its_torque_never_jumps() -> None:
    loop = Loop(trial=1.5)
    loop.to(0.2)
    loop.known = Known(1, (torque(2.0),), since=0.1)
    loop.to(0.25)
    loop.error = 1.0  # named at 0.25 s, to be judged at 2.75 s
    # blended in from 2.25 s on, and to settle from 3.25 s on
    loop.known = Known(2, (torque(2.0), torque(1.0, "more")), since=0.1)
    full = np.array([3.0, 4.0, 0.0])
    assert_allclose(loop.to(2.75), 0.5 * full + 0.5 * np.array([2.0, 2.0, 0.0]))
    loop.to(3.2)
    assert loop.given_back == 0
    assert_allclose(loop.to(3.25), full)
    assert loop.given_back == 1
    # by the whole ramp, and nothing is left to settle
    assert_allclose(loop.to(3.7), 0.55 * full)
    assert_allclose(loop.to(4.0), 0.25 * full)
    assert_allclose(loop.to(4.25), 0.0, atol=1e-12)
