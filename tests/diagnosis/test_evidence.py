"""Which samples count, which are alike, and what is kept of them, by hand."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rubbing_arm import model_with_baseline, motion_of, torque
from synthetic import measured, rigid_torque, three_axis

from armloop.data.log import MotionLog
from armloop.data.motion import Motion
from armloop.data.signals import preprocess, smooth
from armloop.diagnosis import evidence
from armloop.diagnosis.evidence import Evidence
from armloop.laws.effects import Estimate, effect
from armloop.laws.effects.encoder_offset import EncoderOffset
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import AddedEffect, ReconstructedModel
from armloop.model.components import RigidBody
from armloop.robot.kinematics import nominal_parameters


def motion(q: Any, v: Any = None) -> Motion:
    q = np.asarray(q, dtype=float)
    v = np.zeros_like(q) if v is None else np.asarray(v, dtype=float)
    return Motion(0.1 * np.arange(len(q)), q, v, np.zeros_like(q), np.array([0]))


def test_columns_are_kept_while_there_is_room(monkeypatch: pytest.MonkeyPatch) -> None:
    for room, kept in ((1, 1), (8, 1), (9, 2), (16, 2), (17, 3)):
        monkeypatch.setattr(evidence, "_KEPT", room)
        columns = evidence._Columns()
        for shape in range(4):
            columns.of(("a", 1, None), float(shape), lambda: np.zeros(1))  # eight bytes
        assert len(columns) == kept and columns.size == 8 * kept


@pytest.mark.parametrize(("steps", "near"), [(0, [5]), (1, [4, 5, 6]), (2, [3, 4, 5, 6, 7])])
def test_what_the_filter_brings_in_of_a_standstill_comes_from_either_side(
    steps: int, near: list[int]
) -> None:
    moving = np.ones((12, 3), dtype=bool)
    moving[5, 1] = False
    samples: Any = SimpleNamespace(
        moving=moving, reach=0.1 * steps, period=0.1, motion=motion(np.zeros((12, 3)))
    )
    found = evidence.near_standstill(samples)
    assert np.flatnonzero(found[:, 1]).tolist() == near and not found[:, [0, 2]].any()
    assert moving.sum() == 35  # what it was given is left as it is


def test_like_places_at_like_speeds_are_a_cell_of_a_joint_and_a_standstill_is_one_of_its_own() -> None:
    places, speeds = np.meshgrid(np.arange(9.0), np.arange(9.0), indexing="ij")
    q, v = np.column_stack([places.ravel()] * 2), np.column_stack([speeds.ravel()] * 2)
    moving = np.ones(q.shape, dtype=bool)
    moving[[80, 40], 0] = False
    samples = SimpleNamespace(moving=moving, reach=0.0, period=0.1, motion=motion(q, v))
    rows = np.ones(q.shape, dtype=bool)
    cells = Evidence._cells.func(SimpleNamespace(samples=samples, rows=rows))  # type: ignore[attr-defined]
    third = np.digitize(np.arange(9), [2.7, 5.4])  # thirds of what is there
    kinds = [
        (j, *((third[int(q[k, j])], third[int(v[k, j])]) if moving[k, j] else ("still", 0)))
        for k in range(81)
        for j in range(2)
    ]
    labels = cells.ravel().tolist()
    assert len(set(kinds)) == len(set(labels)) == len(set(zip(kinds, labels, strict=True))) == 19


def test_a_models_own_errors_are_weighted_like_the_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    errors = np.arange(24.0).reshape(4, 2, 3)
    asked: list[bool] = []

    def torque_errors(model: Any, samples: Any, between_logs: bool) -> np.ndarray:
        asked.append(between_logs)
        return errors * (1 if between_logs else 2)

    monkeypatch.setattr(evidence, "torque_errors", torque_errors)
    rows = np.array([[True, False], [False, False], [True, True], [False, True]])
    own = SimpleNamespace(
        _of_motion=evidence._Columns(),
        model=None,
        samples=None,
        independent=np.arange(4),
        rows=rows,
        stacking=(np.array([0, 2, 2, 3]), np.array([0, 1, 1, 2]), np.array([0, 0, 1, 1])),
        _places=np.array([0, 2, 3]),
        scale=np.array([0.5, 4.0]),
        with_assumed=True,
        _whitened=lambda x: x,
    )
    expected = [errors[0, 0] / 0.5, errors[2, 0] / 0.5, errors[2, 1] / 4, errors[3, 1] / 4]
    for _ in range(2):  # the second time what is kept
        own.errors = Evidence.errors.fget(own)  # type: ignore[attr-defined]
        np.testing.assert_array_equal(Evidence._model_errors.func(own), expected)  # type: ignore[attr-defined]
    # within a log friction does not differ: these errors are others, and kept beside them
    own.with_assumed = False
    np.testing.assert_array_equal(Evidence.errors.fget(own), 2 * errors)  # type: ignore[attr-defined]
    assert asked == [True, False]


def test_columns_between_the_nodes_of_a_mesh_are_interpolated(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of however many encoder offsets, those at the nodes around them alone ask the model."""
    model = model_with_baseline()
    samples = preprocess(
        [measured(motion_of(3, 5.0), torque(motion_of(3, 5.0)), 3, 0.01)], model.conditioning
    )
    offset = EncoderOffset(2)
    given = Evidence.of(model, samples, [offset])
    shapes = np.linspace(0.0411, 0.0587, 30)
    exact = [smooth(samples, offset.columns(given.context, x))[given.independent] for x in shapes]
    asked: list[float] = []
    columns = EncoderOffset.columns

    def ask(self: EncoderOffset, context: Any, shape: float) -> Any:
        asked.append(shape)
        return columns(self, context, shape)

    monkeypatch.setattr(EncoderOffset, "columns", ask)
    off = [np.abs(given.smoothed(offset, x) - each).max() for x, each in zip(shapes, exact, strict=True)]
    assert asked == pytest.approx([0.02, 0.04, 0.06, 0.08])
    assert max(off) < 1e-6 * np.abs(exact).max()


@pytest.mark.parametrize("known", [False, True])
def test_a_mesh_is_as_fine_as_what_ripples(known: bool) -> None:
    """Of a ripple of 90 in a turn nodes two hundredths of a radian apart say nothing, in the model or beside it."""
    p = {
        "amplitude": Estimate(5.0, 0.0, "N*m"),
        "order": Estimate(90.0, 0.0, ""),
        "phase": Estimate(0.3, 0.0, "rad"),
    }
    ripple = AddedEffect(effect("torque_ripple", 2), p)
    model = model_with_baseline()
    samples = preprocess(
        [measured(motion_of(3, 5.0), torque(motion_of(3, 5.0)), 3, 0.01)], model.conditioning
    )
    bare = Evidence.of(model if known else model.with_effects([ripple]), samples, [])
    given, offset = bare.knowing([ripple]) if known else bare, EncoderOffset(2)
    assert given.context.ripples == {2: (90.0,)}
    for shape in (0.0137, -0.055):
        exact = smooth(samples, offset.columns(given.context, shape))[given.independent]
        np.testing.assert_allclose(given.smoothed(offset, shape), exact, atol=1e-3 * np.abs(exact).max())


def test_what_is_tried_is_asked_once_of_a_model() -> None:
    """A model that knows more is another."""
    asked: list[Any] = []
    law: Any = SimpleNamespace(
        place=("a", 1, None), shapes=lambda context: asked.append(context) or [1.0, 2.0]
    )
    model = model_with_baseline()
    samples = preprocess(
        [measured(motion_of(3, 5.0), torque(motion_of(3, 5.0)), 3, 0.01)], model.conditioning
    )
    given = Evidence.of(model, samples, [])
    assert given.tried(law) == given.tried(law) == (1.0, 2.0) and asked == [given.context]
    again = given.knowing([])
    assert again.tried(law) == (1.0, 2.0) and asked == [given.context, again.context]


def test_a_joint_has_slid_that_travels_far_enough() -> None:
    moving = np.ones((6, 3), dtype=bool)
    moving[3] = False
    q = np.zeros((6, 3))
    least = evidence.TRAVEL
    q[2] = [least, 0.99 * least, 2 * least]
    q[4:] = q[2]
    q[5, 2] = 4 * least
    samples: Any = SimpleNamespace(motion=motion(q), moving=moving)
    for ranges, slid in (
        (None, [[1, 0, 1], [0, 0, 1]]),
        ([[1.0, 0.5, 4.0]], [[1, 1, 0], [0, 0, 0]]),
    ):
        model: Any = SimpleNamespace(history={"range": ranges} if ranges else {})
        found = evidence._sliding(samples, model)
        first, second = np.array(slid, dtype=bool)
        np.testing.assert_array_equal(found, [first] * 3 + [[False] * 3] + [second] * 2)


def test_a_true_model_leaves_little_of_jumps_of_the_acceleration_and_all_of_a_step_of_friction() -> None:
    """The torque has passed the filter once; filtered once more, it would lose what the jumps hold near the corner."""
    time = np.arange(0.0, 12.0, 0.002)
    way = np.array([1.0, -0.7, 0.9])
    saw = 2 * np.abs(time % 2.0 - 1.0) - 1.0  # the acceleration jumps where the joints are fastest
    v, vdot = np.outer(saw, way), np.outer(np.where(time % 2.0 < 1.0, -2.0, 2.0), way)
    q = np.outer(np.cumsum(saw) * 0.002, way)
    friction = 2.0 * np.sign(v)
    tau = rigid_torque(three_axis(), q, v, vdot) + friction
    body = RigidBody(nominal_parameters(three_axis()), (), np.zeros(0))
    model = ReconstructedModel(three_axis(), (body,), FrictionLaw(((FrictionTerm("sign", 2.0),),) * 3))
    samples = preprocess([MotionLog(time, q, v, tau)], model.conditioning)
    own = Evidence.of(model, samples, [])
    left = own.residual([])
    np.testing.assert_array_equal(own.left_by(model), left)
    lost = samples.tau - smooth(samples, samples.tau)
    for j in range(3):
        rows = samples.moving[:, j]
        assert np.sqrt(np.mean(left[rows, j] ** 2)) < 0.3 * np.sqrt(np.mean(lost[rows, j] ** 2))
    # where the joints turn round, friction steps, and the step is as smeared as in the record
    assert np.abs(left).max() < 0.3 * np.abs(lost).max()


@pytest.mark.parametrize(("known", "assumed"), [("assumed", True), ("different", False)])
def test_of_how_friction_differs_the_part_that_is_merely_assumed_is_kept(known: str, assumed: bool) -> None:
    model = model_with_baseline()
    spread = {"between_logs": [[[0.04, 0.0], [0.0, 0.0]], None, None], "between_logs_known": known}
    model = replace(model, uncertainty={**model.uncertainty, **spread})
    samples = preprocess(
        [measured(motion_of(3, 5.0), torque(motion_of(3, 5.0)), 3, 0.01)], model.conditioning
    )
    whole, bare = Evidence.of(model, samples, []), model.baseline["rmse"][0]
    assert whole.scale[0] > 1.5 * bare
    own = whole.within_a_log()
    assert (own is whole) == (not assumed)
    if assumed:
        assert own.scale[0] == pytest.approx(bare)
        # two directions less
        assert own.errors.shape[2] == whole.errors.shape[2] - 2


def test_within_a_log_its_friction_does_not_differ() -> None:
    model = model_with_baseline()
    samples = preprocess(
        [measured(motion_of(3, 5.0), torque(motion_of(3, 5.0)), 3, 0.01)], model.conditioning
    )
    assumed = np.array([0.3, 0.0, 0.4])
    whole = replace(Evidence.of(model, samples, []), scale=np.array([0.5, 2.0, 0.5]), assumed=assumed)
    own = whole.within_a_log()
    np.testing.assert_allclose(own.scale, [0.4, 2.0, 0.3])
    assert not own.assumed.any() and own.samples is samples and own.within_a_log() is own


@pytest.mark.parametrize(
    ("turns", "counts", "told"), [(1000, 50, True), (1000, 49, False), (5000, 100, True), (5000, 99, False)]
)
def test_a_joint_that_turns_while_few_samples_count_is_not_judged(
    turns: int, counts: int, told: bool
) -> None:
    """A twentieth of those in which it turns, no closer than the filter can tell apart, or a hundred; one that rests may."""
    N = 12000
    v = np.zeros((N, 3))
    v[: 2 * turns, 0], v[:, 1], v[:20, 2] = 0.5, 0.5, 0.5
    rows = np.zeros((N, 3), dtype=bool)
    rows[:counts, 0] = rows[:, 1] = rows[:10, 2] = True
    model: Any = SimpleNamespace(history={}, arm=SimpleNamespace(n=3))
    run: Any = SimpleNamespace(motion=SimpleNamespace(v=v))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(evidence, "independent_rows", lambda samples: np.arange(N) % 2 == 0)
        assert evidence.seldom(model, run, rows).tolist() == [not told, False, False]


def test_no_row_of_such_a_joint_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    model = model_with_baseline()
    samples = preprocess(
        [measured(motion_of(3, 5.0), torque(motion_of(3, 5.0)), 3, 0.01)], model.conditioning
    )
    assert Evidence.of(model, samples, []).rows.any(axis=0).tolist() == [True, True, True]
    monkeypatch.setattr(evidence, "seldom", lambda model, samples, rows: np.array([False, True, False]))
    assert Evidence.of(model, samples, []).rows.any(axis=0).tolist() == [True, False, True]
