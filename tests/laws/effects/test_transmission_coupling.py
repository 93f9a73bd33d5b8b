"""A motor that two joints share: where it may be, and what of it is possible."""

import numpy as np
import pytest

from armloop.data.motion import Motion
from armloop.laws.effects import Context, Estimate, effect
from armloop.robot.arm import load_arm


@pytest.mark.parametrize(("joints", "ratios"), [((1, 2), (1.0, -1.0)), ((2, 3), ()), ((1, 4), (1.0, -1.0))])
def test_joints_of_one_kind_share_a_motor(joints: tuple[int, int], ratios: tuple[float, ...]) -> None:
    """The third joint of a SCARA slides."""
    still = np.zeros((2, 4))
    context = Context(load_arm("scara"), Motion(np.arange(2.0), still, still, still, np.array([0])))
    assert effect("transmission_coupling", *joints).shapes(context) == ratios


@pytest.mark.parametrize("of", ["inertia", "viscous", "coulomb"])
def test_none_of_its_coefficients_is_clearly_negative(of: str) -> None:
    for value, plausible in ((-0.29, True), (-0.31, False), (0.0, True)):
        parameters = {name: Estimate(1.0, 0.1, "1") for name in ("inertia", "viscous", "coulomb")}
        parameters |= {of: Estimate(value, 0.1, "1"), "ratio": Estimate(-1.0, 0.1, "1")}
        assert effect("transmission_coupling", 1, 2).plausible(load_arm("scara"), parameters) == plausible


def test_the_motor_sees_the_sum_or_the_difference() -> None:
    made = effect("transmission_coupling", 1, 2)
    assert [made.fault({"ratio": x}) == "" for x in (1, -1.0, 2, 0)] == [True, True, True, False]
    said = {name: Estimate(1.0, 0.1, "1") for name in ("inertia", "viscous", "coulomb")}
    for ratio, word in ((1.0, "sum"), (-1.0, "difference")):
        assert f"the {word} of the speeds" in made.sentence({**said, "ratio": Estimate(ratio, 0.0, "1")})
    for ratio, word in ((5.54, "plus"), (-5.54, "minus")):
        words = made.sentence({**said, "ratio": Estimate(ratio, float("nan"), "1")})
        assert f"turns with the speed of joint 1 {word} 5.54 times that of joint 2" in words


def test_what_an_arm_was_built_with_may_be_any_ratio_and_has_no_error() -> None:
    made = effect("transmission_coupling", 1, 2)
    coarse, fine = made.geared(-1.0), made.geared(-5.0)
    assert {1.0, -1.0} <= {*coarse}
    assert (
        min(coarse) == pytest.approx(-8)
        and max(coarse) == pytest.approx(8)
        and 1 / 8 <= min(map(abs, coarse)) + 1e-9
    )
    # a step of the coarse ones is within the fine ones
    steps = np.sort([x for x in coarse if x > 0])
    assert (
        max(fine) / -5.0 < 1 < min(fine) / -5.0
        and (steps[1:] / steps[:-1]).max() < (min(fine) / max(fine)) ** 2
    )
    for shape, known in ((1.0, True), (5.5, False)):
        found = made.estimates(load_arm("scara"), np.array([0.1, 0.2, 0.3]), np.eye(3), shape)
        assert found["ratio"].value == shape and (found["ratio"].std_error == 0.0) == known
