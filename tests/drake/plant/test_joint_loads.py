"""What rubs along a direction: the level that turns with the sliding, what does not, and what grows with the load."""

import pytest

from armloop.drake.plant.friction import JointFriction
from armloop.drake.plant.joint_loads import _Rubbing, _rubbing
from armloop.laws.effects.base import Placed
from armloop.laws.friction import KINDS, Acting, Direction, Sliding
from armloop.util.functions import MATH

EQ34 = JointFriction(0.6, 0.4, 0.1, 2.0)
NONE = JointFriction(0.0, 0.0, 0.1, 2.0)


def acting(kind: str, coefficient: float, parameter: float = 0.0) -> Acting:
    return Acting(coefficient, KINDS[kind], parameter)


def rubbing(*terms: Acting, friction: JointFriction | None = EQ34) -> _Rubbing:
    return _Rubbing(Direction(0), friction, terms)


def at(v: float) -> Sliding:
    return Sliding(0.0, v, 1.0, 0.0)


def test_a_joints_own_friction_stands_alone_where_nothing_else_rubs() -> None:
    plain = rubbing()
    assert plain.alone is EQ34 and plain and not plain.smooth and plain.more == []
    assert plain.level(at(0.2), MATH) == pytest.approx(EQ34.level(0.2, MATH))
    assert not rubbing(friction=NONE) and not rubbing(friction=None)
    # what remembers is told elsewhere
    remembers = rubbing(acting("hysteresis", 3.0, 0.01), friction=NONE)
    assert not remembers and remembers.alone is NONE


def test_what_turns_with_the_sliding_adds_to_the_level() -> None:
    both = rubbing(acting("sign", 0.3), acting("stribeck", -0.1, 0.5))
    fall = 1 - 2.718281828459045 ** -((0.2 / 0.5) ** 2)
    assert both.level(at(0.2), MATH) == pytest.approx(EQ34.level(0.2, MATH) + 0.3 - 0.1 * fall)
    assert both.alone is None and not both.smooth and both
    alone = rubbing(acting("sign", 0.3), friction=None)
    assert alone.level(at(-0.2), MATH) == pytest.approx(0.3)


def test_what_does_not_turn_is_taken_to_first_order_where_it_resists() -> None:
    drag = rubbing(acting("quadratic", 2.0), friction=None)
    assert drag.smooth and drag.level(at(0.5), MATH) == pytest.approx(0.0)
    assert drag.smoothly(at(0.5), MATH) == pytest.approx((0.5, 2.0))
    assert drag.smoothly(at(-0.5), MATH) == pytest.approx((-0.5, 2.0))
    driving = rubbing(acting("cubic", -1.0), friction=None)
    assert driving.smoothly(at(2.0), MATH) == (-8.0, 0.0)
    assert rubbing(acting("offset", 3.0), friction=None).smoothly(at(0.5), MATH) == (3.0, 0.0)
    one_way = rubbing(acting("viscous_forward", 2.0), friction=None)
    assert one_way.smooth and one_way.smoothly(at(0.5), MATH) == pytest.approx((1.0, 2.0))
    other_way = rubbing(acting("viscous_backward", 2.0), friction=None)
    assert other_way.smooth and other_way.smoothly(at(-0.5), MATH) == pytest.approx((-1.0, 2.0))


def test_what_grows_with_the_load_is_apart() -> None:
    heavy = rubbing(acting("load_sign", 0.1), acting("sign", 0.3))
    assert [t.coefficient for t in heavy.more] == [0.1] and heavy.alone is None
    assert heavy.level(at(1.0), MATH) == pytest.approx(EQ34.level(1.0, MATH) + 0.3)
    only = rubbing(acting("load_sign", 0.1), friction=NONE)
    assert only and only.alone is None


def test_directions_that_joints_share_have_no_friction_of_their_own() -> None:
    shared = Direction(0, 1, -1.0)
    laws = [
        Placed(shared, (acting("sign", 0.2), acting("viscous", 0.1))),
        Placed(Direction(1), (acting("sign", 0.5),)),
        Placed(Direction(1), (acting("sign", 0.25),)),
    ]
    found = {each.along: each for each in _rubbing([EQ34, NONE, NONE], laws)}
    assert set(found) == {Direction(0), Direction(1), shared}
    assert found[Direction(0)].alone is EQ34
    assert found[Direction(1)].level(at(1.0), MATH) == pytest.approx(0.75)
    assert found[shared].level(at(1.0), MATH) == pytest.approx(0.2)
    assert found[shared].smoothly(at(1.0), MATH) == pytest.approx((0.1, 0.1))
