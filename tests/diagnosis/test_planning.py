"""What every design of a next run shares: its laws and rivals as columns, in units that compare."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import three_axis

from armloop.data.motion import Motion
from armloop.diagnosis import planning
from armloop.util.errors import InputError


def planner(**of: Any) -> planning.Planner:
    """Two joints with baselines of 0.5 and 2 N·m, and typical motions of which the second is twice the first."""
    q = np.array([[1.0, 2.0], [3.0, -4.0]])
    typical = [Motion(np.arange(2.0), s * q, q, q, np.array([0])) for s in (1.0, 2.0)]
    limits: Any = SimpleNamespace(effort=of.get("effort", np.ones(2)), ranges=None)
    evidence: Any = SimpleNamespace(scale=np.array([0.5, 2.0]))
    wish = planning.Wish(starts=of.get("starts"), seed=7, duration=50.0)
    return planning.Planner(evidence, limits, typical, of.get("stages", []), wish, lambda text: None)


def law(*columns: float) -> Any:
    """A law whose columns are so many times the positions."""

    def full(context: Any, shape: float) -> np.ndarray:
        return context.q[:, :, None] * np.array(columns) * shape

    effect = SimpleNamespace(full_columns=full)
    return SimpleNamespace(
        effect=effect,
        shape=1.0,
        added=SimpleNamespace(effect=effect, torque=lambda context: columns[0] * context.q),
    )


@pytest.fixture(autouse=True)
def contexts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(planning, "context_of", lambda evidence, motion, effects=None: motion)


def test_torques_keep_their_size_and_rivals_columns_have_that_of_one_baseline() -> None:
    first, second, rival, other = law(5.0), law(3.0), law(10.0, 0.0), law(1.0)
    ways: Any = [
        SimpleNamespace(law=first, rival=rival, others=(other,)),
        SimpleNamespace(law=second, rival=rival, others=()),
    ]
    regression, rivalries = planner()._regression(ways)
    # torques of the two laws, two columns of the rival, one of the other effect
    assert rivalries == [(0, [2, 3, 4]), (1, [2, 3])]
    assert regression.kept.tolist() == [0, 1, 2, 3, 4]
    # squares in baselines: joint 1 (1 + 9) / 2 / 0.25, joint 2 (4 + 16) / 2 / 4; of both motions, 1 and 4 times as much
    root = np.sqrt((20 + 2.5) * (1 + 4) / 2)
    np.testing.assert_allclose(regression.size, [1.0, 1.0, 10 * root, 1.0, root])
    made = regression.columns(planner().typical[0])
    np.testing.assert_allclose(made[0], [[5, 3, 10, 0, 1], [10, 6, 20, 0, 2]])


def test_what_leaves_more_than_three_hundredths_can_be_told() -> None:
    ways: Any = [SimpleNamespace(left_on_all=lambda stages, x=x: x * len(stages)) for x in (0.014, 0.016)]
    stages: Any = [0, 1]
    assert planner(stages=stages).possible(ways) == ways[1:]


@pytest.mark.parametrize(("joints", "asked", "starts"), [(4, None, 2), (5, None, 1), (5, 3, 3)])
def test_two_starts_up_to_four_joints(
    joints: int, asked: int | None, starts: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[Any] = []

    class Problem:
        def __init__(self, series: Any, regression: Any, criterion: Any, limits: Any) -> None:
            self.series = series

        def optimise(self, *of: Any) -> Any:
            seen.append(of[:3])
            return "design" if len(seen) == 1 else None

    monkeypatch.setattr(planning, "Problem", Problem)
    given, nothing = planner(effort=np.ones(joints), starts=asked), None
    assert given.series.joints == joints
    assert given._optimised(nothing, nothing) == "design"  # type: ignore[arg-type, comparison-overlap]
    # three tenths of the optimiser's iterations
    assert seen == [(starts, 7, 0.3)]
    with pytest.raises(InputError, match="no motion within the limits"):
        given._optimised(nothing, nothing)  # type: ignore[arg-type]


def test_a_residual_is_measured_at_its_joint_and_laws_with_all_their_columns(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    seen: list[Any] = []

    class Regression:
        @staticmethod
        def of(columns: Any, names: list[str], scale: np.ndarray, typical: Any) -> Any:
            seen.append((columns(typical[0]).shape, names, scale.tolist()))

    monkeypatch.setattr(planning, "Regression", Regression)
    monkeypatch.setattr(
        planning, "_anything", lambda ranges, joint: (lambda motion: np.zeros((1, 1, joint + 1)), ["a"])
    )
    monkeypatch.setattr(planning.Planner, "_optimised", lambda self, regression, criterion: criterion)
    given = planner()
    given.unlisted(2)
    given.precision([law(1.0, 2.0), law(3.0)])
    assert seen == [((1, 1, 2), ["a"], [2.0]), ((2, 2, 3), ["0", "1", "2"], [0.5, 2.0])]


def test_typical_motions_leave_the_reserve_and_last_whole_periods(monkeypatch: pytest.MonkeyPatch) -> None:
    arm, drawn = three_axis(), []

    def references(limits: Any, period: float, count: int, seed: int) -> Any:
        drawn.append((limits.effort, period, count, seed))
        return [Reference(k) for k in range(count)]

    class Reference(SimpleNamespace):
        def __init__(self, k: int, duration: float = planning.PERIOD) -> None:
            super().__init__(k=k, duration=duration)

    monkeypatch.setattr(planning, "random_references", references)
    monkeypatch.setattr(planning, "check_rest", lambda arm, limits: None)
    monkeypatch.setattr(planning, "replace", lambda each, duration: Reference(each.k, duration))
    monkeypatch.setattr(planning, "sampled", lambda each, step: (each.k, each.duration, step))
    monkeypatch.setattr(
        planning.Stage, "of_reference", staticmethod(lambda evidence, each: (each.k, each.duration))
    )
    model: Any = SimpleNamespace(
        arm=arm, history={}, predict=lambda motion, sensors: np.full_like(motion.q, [1, 2, 1e4])
    )
    diagnosis: Any = SimpleNamespace(model=model, evidence=None)
    made = planning.Planner.of(
        diagnosis, planning.Wish(seed=3, reserve=0.25, duration=41.0), lambda text: None
    )
    effort, *rest = drawn[0]
    np.testing.assert_allclose(effort, 0.75 * np.array([joint.effort for joint in arm.joints]))
    assert rest == [20.0, 8, 3]
    # of two of them, in their whole length, it is judged what can be told apart
    assert made.stages == [(0, 60.0), (1, 60.0)]
    assert made.typical == [(k, 20.0, 0.05) for k in range(8)]
    monkeypatch.setattr(planning, "random_references", lambda *_: [])
    with pytest.raises(InputError, match=r"hardly any motion .* 'joint_3' may give .* up to 1e"):
        planning.Wish().check(model)
