"""Where a next run may go, what of a joint it must show, and how a design is made anew for the rivals it raises."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import three_axis

from armloop.data.motion import Motion
from armloop.diagnosis import planning
from armloop.diagnosis.isolability import Stage
from armloop.diagnosis.planning import Planner, Wish, training_ranges
from armloop.experiment.excitation import MotionRanges
from armloop.util.errors import InputError


def test_the_ranges_are_those_of_the_training_within_the_arms_limits() -> None:
    """Joint 1 well inside, joint 2 beyond the arm's ends and speed, joint 3 at rest at its upper end."""
    arm = three_axis()
    joints = [
        replace(joint, lower=-low, upper=high, velocity=speed)
        for joint, low, high, speed in zip(
            arm.joints, (3.0, 1.0, 2.0), (3.0, 1.5, 2.0), (2.0, 2.0, 2.0), strict=True
        )
    ]
    half, speed, pull, centre = [0.5, 9.0, 0.0], [1.0, 9.0, 0.0], [4.0, 5.0, 0.0], [0.2, 0.0, 2.0]
    history = {"range": [half, speed, pull, centre]}
    model: Any = SimpleNamespace(arm=replace(arm, joints=tuple(joints)), history=history)
    found = training_ranges(model)
    np.testing.assert_allclose(found.lower, [-0.3, -1.0, 2.0 - 1e-6], rtol=1e-12)
    np.testing.assert_allclose(found.upper, [0.7, 1.5, 2.0], rtol=1e-12)
    assert found.velocity.tolist() == [1.0, 2.0, 1e-6] and found.acceleration.tolist() == [4.0, 5.0, 1e-6]
    # at its lower end: a range all the same
    model.history = {"range": [half, speed, pull, [0.2, 0.0, -2.0]]}
    found = training_ranges(model)
    np.testing.assert_allclose(found.lower[2], -2.0, rtol=1e-12)
    np.testing.assert_allclose(found.upper[2], -2.0 + 1e-6, rtol=1e-12)
    model.history = {}
    np.testing.assert_array_equal(training_ranges(model).upper, MotionRanges.of(model.arm).upper)


@pytest.mark.parametrize(
    ("wish", "fine"),
    [
        (Wish(duration=12.0), True),
        (Wish(duration=11.9), False),
        (Wish(duration=3600.0), True),
        (Wish(duration=3601.0), False),
        (Wish(reserve=0.0), True),
        (Wish(reserve=-0.01), False),
        (Wish(reserve=0.99), True),
        (Wish(reserve=1.0), False),
    ],
)
def test_wishes_within_reason(wish: Wish, fine: bool) -> None:
    if fine:
        wish.check()
    else:
        with pytest.raises(InputError):
            wish.check()


def test_the_usual_wish_and_whole_periods() -> None:
    usual = Wish()
    assert (usual.reserve, usual.duration, usual.starts, usual.seed) == (0.2, 60.0, None, 0)
    lengths = [Wish(duration=x).whole_duration for x in (12.0, 20.0, 20.0 + 1e-10, 20.1, 60.0)]
    assert lengths == [20.0, 20.0, 20.0, 40.0, 60.0]


def test_a_joint_is_shown_by_its_places_and_speeds_and_the_others_beside_it() -> None:
    ranges = MotionRanges(
        np.array([-1.0, 0.0, -3.0]),
        np.array([3.0, 4.0, 1.0]),
        np.array([2.0, 4.0, 0.5]),
        np.array([10.0, 5.0, 2.0]),
    )
    q = np.array([[2.0, 1.0, 0.0], [-0.5, 3.0, -2.0], [9.0, 2.0, -9.0]])
    v = np.array([[1.0, -2.0, 0.1], [0.02, 1.0, 0.2], [-0.06, 3.0, -0.4]])
    pull = np.array([[5.0, 1.0, 1.0], [-2.0, 2.0, 0.5], [1.0, 3.0, 2.0]])
    columns, names = planning._anything(ranges, 0)
    found = columns(Motion(np.arange(3.0), q, v, pull, np.array([0])))
    # relative to the ranges' middles and halves, no farther out than a fifth of a half
    x = np.array([[0.5, -0.5, 0.5], [-0.75, 0.5, -0.5], [1.2, 0.0, -1.2]])
    u, w = v / [2.0, 4.0, 0.5], pull / [10.0, 5.0, 2.0]
    expected = []
    for k in range(3):
        angle = [1.0, x[k, 0], 2 * x[k, 0] ** 2 - 1, 4 * x[k, 0] ** 3 - 3 * x[k, 0]]
        # a direction fades in over a fiftieth of the largest speed
        speeds = [1.0, u[k, 0], u[k, 0] ** 2, np.tanh(v[k, 0] / 0.04)]
        row = [a * b for a in angle for b in speeds] + [w[k, 0]]
        for j in (1, 2):
            row += [x[k, j], 2 * x[k, j] ** 2 - 1, u[k, j], u[k, j] ** 2, u[k, j] * u[k, 0], w[k, j]]
        expected.append(row)
    assert found.shape == (3, 1, 29) and names == [str(k) for k in range(29)]
    np.testing.assert_allclose(found[:, 0], expected, atol=1e-12)
    # of the second joint, the first stands beside it
    second = planning._anything(ranges, 1)[0](Motion(np.arange(3.0), q, v, pull, np.array([0])))
    np.testing.assert_allclose(second[:, 0, 17], x[:, 0])


class Designs:
    """A planner whose motions are numbers."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.told: list[str] = []
        self.asked: list[Any] = []
        nothing: Any = None
        self.planner = Planner(nothing, nothing, [], [], Wish(), self.told.append)
        monkeypatch.setattr(planning, "unexplained", lambda rivalries, enough: enough)
        monkeypatch.setattr(planning.Stage, "of_reference", lambda evidence, motion: motion)
        monkeypatch.setattr(Planner, "whole", lambda planner, design: design)
        monkeypatch.setattr(Planner, "_regression", lambda planner, rivals: ([*rivals], None))

        def optimised(planner: Any, regression: Any, criterion: float) -> int:
            self.asked.append((regression, criterion))
            return len(self.asked)

        monkeypatch.setattr(Planner, "_optimised", optimised)


def way(law: Any, left: dict[int, float], harder: float | None = None, place: str = "rival") -> Any:
    """What so many designs leave; the rival's shape at which it is hardest, if that is another one."""
    effect = SimpleNamespace(place=place)
    made = SimpleNamespace(law=law, rival=SimpleNamespace(effect=effect, shape=1.0), left=left.__getitem__)
    made.hardest = lambda stage: SimpleNamespace(
        law=law, rival=SimpleNamespace(effect=effect, shape=1.0 if harder is None else harder)
    )
    return made


def test_a_motion_is_designed_once_if_no_rival_comes_near(monkeypatch: pytest.MonkeyPatch) -> None:
    made, one, other = Designs(monkeypatch), object(), object()
    # what leaves more than three tenths does not come near, whatever its hardest shape
    ways = [way(one, {1: 0.31}, harder=2.0), way(one, {1: 0.1}, place="b"), way(other, {1: 0.2})]
    assert made.planner.alternatives(ways) == 1
    assert [criterion for _, criterion in made.asked] == [25.0] and len(made.asked[0][0]) == 3
    assert made.told == ["designing a motion that tells 2 laws from their rivals"]


@pytest.mark.parametrize(
    ("first", "second", "best"), [((0.1, 0.2), (0.3, 0.1), 2), ((0.1, 0.3), (0.3, 0.09), 1)]
)
def test_anew_with_the_rival_that_comes_near_and_the_better_of_both_is_taken(
    first: tuple[float, float], second: tuple[float, float], best: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    made, one = Designs(monkeypatch), object()
    ways = [way(one, {1: first[k], 2: second[k]}, harder=2.0 + k, place=str(k)) for k in (0, 1)]
    assert made.planner.alternatives(ways) == best
    # both were asked, beside what brings them nearer; and not a third time
    assert [len(rivals) for rivals, _ in made.asked] == [2, 4]


def test_beyond_three_tenths_more_is_no_better(monkeypatch: pytest.MonkeyPatch) -> None:
    made, one = Designs(monkeypatch), object()
    # at the edge it is near; the second leaves far more of one, a little less of the other
    ways = [way(one, {1: 0.3, 2: 0.9}, harder=2.0), way(one, {1: 0.2, 2: 0.19}, place="b")]
    assert made.planner.alternatives(ways) == 1 and len(made.asked) == 2
    # a pair that nothing tells apart counts for a millionth
    made = Designs(monkeypatch)
    ways = [way(one, {1: 0.0, 2: 1e-7}, harder=2.0), way(one, {1: 0.2, 2: 0.1}, place="b")]
    assert made.planner.alternatives(ways) == 1


def test_samples_are_forty_to_the_highest_harmonics_period() -> None:
    nothing: Any = None
    assert Planner(nothing, nothing, [], [], Wish(), lambda text: None).fine_step == 20.0 / 8 / 40


class TestDesign:
    def test_a_wish_is_for_whole_periods_within_limits(self) -> None:
        for asked, made in ((12.0, 20.0), (20.0, 20.0), (20.1, 40.0), (60.0, 60.0)):
            wish = planning.Wish(duration=asked)
            wish.check()
            assert wish.whole_duration == made
        planning.Wish(duration=3600.0, reserve=0.0).check()
        for wrong in ({"duration": 11.9}, {"duration": 3601.0}, {"reserve": 1.0}, {"reserve": -0.1}):
            with pytest.raises(InputError, match=r"^(next run of|reserve)"):
                planning.Wish(**wrong).check()

    def test_functions_of_which_a_law_may_be_made(self) -> None:
        ends = np.array([1.0, 2.0])
        ranges = MotionRanges(-ends + 1, ends + 1, np.array([2.0, 4.0]), np.array([5.0, 10.0]))
        columns, names = planning._anything(ranges, 1)
        motion = Motion(
            np.zeros(2),
            np.array([[1.5, 2.0], [9.0, -9.0]]),
            np.array([[1.0, -2.0], [0.0, 0.0]]),
            np.array([[2.5, 5.0]] * 2),
            np.array([0]),
        )
        X = columns(motion)[:, 0]
        assert X.shape == (2, len(names)) == (2, 23)
        x, v = 0.5, -0.5  # of the second joint, in its range; the law's direction fades in at 0.02 * 4 rad/s
        places, speeds = [1, x, 2 * x**2 - 1, 4 * x**3 - 3 * x], [1, v, v**2, np.tanh(-2 / 0.08)]
        own = [a * b for a in places for b in speeds]
        np.testing.assert_allclose(X[0], [*own, 0.5, 0.5, -0.5, 0.5, 0.25, -0.25, 0.5], atol=1e-12)
        # no farther than 1.2 of the range
        assert X[1, 4] == pytest.approx(-1.2) and X[1, 17] == pytest.approx(1.2)

    def test_where_a_model_knows_its_arm(self) -> None:
        arm = three_axis()
        low, high, fastest = (
            np.array([getattr(j, k) for j in arm.joints]) for k in ("lower", "upper", "velocity")
        )
        model: Any = SimpleNamespace(arm=arm, history={})
        assert np.array_equal(planning.training_ranges(model).lower, MotionRanges.of(arm).lower)
        model.history["range"] = [[0.1, 0.0, 99.0], [0.2, 0.0, 99.0], [0.3, 0.0, 4.0], [0.05, 0.0, 0.0]]
        found = planning.training_ranges(model)
        assert found.lower[0] == pytest.approx(-0.05) and found.upper[0] == pytest.approx(0.15)
        assert found.velocity[0] == pytest.approx(0.2) and found.acceleration[[0, 2]] == pytest.approx(
            [0.3, 4.0]
        )
        assert found.lower[2] == low[2] and found.upper[2] == high[2] and found.velocity[2] == fastest[2]
        assert 0 < found.upper[1] - found.lower[1] < 1e-4 and 0 < found.velocity[1] < 1e-4

    @pytest.mark.parametrize(
        ("left", "known", "rounds", "made"),
        [
            ([(0.5, 0.1), (0.5, 0.2)], False, 2, 2),
            ([(0.5, 0.1), (0.5, 0.05)], False, 2, 1),
            ([(0.5, 0.1), (0.31, 0.1)], False, 2, 1),  # what is far enough already counts no more
            ([(0.5, 0.1), (0.29, 0.2)], False, 2, 2),
            ([(0.5, 0.31)], False, 1, 1),
            ([(0.5, 0.1)], True, 1, 1),  # the rival comes no nearer elsewhere
        ],
    )
    def test_a_motion_is_designed_anew_with_what_rivals_turn_out_to_be_able_to(
        self, left: list[Any], known: bool, rounds: int, made: int, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        stages = iter(range(len(left)))
        monkeypatch.setattr(Stage, "of_reference", staticmethod(lambda evidence, reference: next(stages)))
        law: Any = SimpleNamespace()

        def way(k: int, shape: float) -> Any:
            rival = SimpleNamespace(effect=SimpleNamespace(place=("a", k, None)), shape=shape)
            nearer = SimpleNamespace(
                law=law, rival=SimpleNamespace(effect=rival.effect, shape=shape + (not known))
            )
            return SimpleNamespace(
                law=law, rival=rival, left=lambda stage: left[stage][k], hardest=lambda stage: nearer
            )

        asked: list[int] = []

        class Known(planning.Planner):
            def __init__(self) -> None:
                object.__setattr__(self, "progress", lambda text: None)
                object.__setattr__(self, "evidence", None)

            def _regression(self, ways: Any) -> Any:
                asked.append(len(ways))
                return None, []

            def _optimised(self, regression: Any, criterion: Any) -> Any:
                return len(asked)

            def whole(self, design: Any) -> Any:
                return design

        design: Any = Known().alternatives([way(0, 0.0), way(1, 0.0)])
        assert design == made and asked == [2, 3][:rounds]
