"""Laws that two joints share in the implicit step, friction fitted to curves, arms drawn side by side."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.geometry import SceneGraph
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from armloop.drake.plant.implicit import STICKING_GAIN, ClampedLaw, implicit_torques
from armloop.drake.plant.nearest_friction import _fitted
from armloop.drake.view import scene
from armloop.dynamics.model import solve
from armloop.laws.friction import Direction
from armloop.robot.arm import load_arm


@pytest.mark.parametrize("seed", range(20))
def test_a_motor_that_two_joints_share_pushes_both_at_the_velocity_it_leads_to(seed: int) -> None:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(3, 3))
    A, p, step = root @ root.T + 0.1 * np.eye(3), rng.normal(size=3), 0.1
    laws = [
        ClampedLaw(0, 0.5, 2.0, 0.3, 2, -0.7),
        ClampedLaw(1, -0.2, 1.0, 5.0, 0, 1.5),
        ClampedLaw(2, 0.1, 3.0, 0.2),
    ]
    torques = np.array(implicit_torques(A.tolist(), p.tolist(), laws, rng.integers(-1, 2, 3).tolist(), step))
    w = np.linalg.solve(A, p + step * torques)
    expected = np.zeros(3)
    for law in laws:
        torque = np.clip(law.command - law.slope * law.speed(w.tolist()), -law.limit, law.limit)
        expected[law.joint] += torque
        expected[law.other] += law.ratio * torque
    assert_allclose(torques, expected, atol=1e-9)


def test_pieces_and_dry_friction() -> None:
    law = ClampedLaw(0, 1.0, 2.0, 3.0, 1, 0.5)
    assert law.speed([4.0, 6.0]) == 7.0 and ClampedLaw(1, 1.0, 2.0, 3.0).speed([4.0, 6.0]) == 6.0
    assert [law.piece(w) for w in (-1.01, -0.99, 0.0, 1.99, 2.01)] == [1, 0, 0, 0, -1]
    dry = ClampedLaw.dry(Direction(2, 0, 0.3), 5.0)
    assert dry == (2, 0.0, STICKING_GAIN, 5.0, 0, 0.3)


def test_a_small_linear_system() -> None:
    rng = np.random.default_rng(1)
    for n in (1, 2, 5):
        root, b = rng.normal(size=(n, n)), rng.normal(size=n)
        A = root @ root.T + np.eye(n)
        assert_allclose(solve(A.tolist(), b.tolist()), np.linalg.solve(A, b))
    # joints that do not act on each other
    assert solve([[2.0, 0.0], [0.0, 4.0]], [1.0, 2.0]) == [0.5, 0.5]


def test_a_stribeck_curve_is_fitted_by_its_own_numbers() -> None:
    v = np.geomspace(1e-3, 2.0, 60)
    speed = 2.0 * np.geomspace(0.005, 1.0, 40)[20]
    found = _fitted(v, 0.8 * np.exp(-((v / speed) ** 2)) + 1.5 + 0.4 * v)
    assert_allclose(
        [found.static, found.coulomb, found.stribeck_velocity, found.viscous],
        [2.3, 1.5, speed, 0.4],
        rtol=1e-6,
    )
    rising = _fitted(v, 1.0 + 0.5 * v)
    assert_allclose([rising.static, rising.coulomb, rising.viscous], [1.0, 1.0, 0.5], atol=1e-9)


def test_arms_stand_side_by_side_a_colour_each_with_their_ghosts() -> None:
    arm = load_arm("three_axis")
    plant, graph = AddMultibodyPlantSceneGraph(DiagramBuilder(), 0.0)
    actors = scene.add_actors(plant, arm, ["pid", "exact", "mine"])
    plant.Finalize()
    context = plant.CreateDefaultContext()
    reach, spots = scene._reach(arm), []
    for k, actor in enumerate(actors):
        for instance in actor:
            first = plant.GetBodyByName("link_1", instance)
            X = first.EvalPoseInWorld(context) if hasattr(first, "EvalPoseInWorld") else None
            X = plant.EvalBodyPoseInWorld(context, first) if X is None else X
            spots.append(X.translation()[1] - arm.X_PF[0][1, 3])
            assert plant.num_positions(instance) == 3
        assert spots[-1] == pytest.approx((1 - k) * 1.2 * reach) and spots[-2] == spots[-1]
    colours = [_colour(graph, plant, instance) for actor in actors for instance in actor]
    assert colours[1::2] == [pytest.approx(scene.GHOST)] * 3
    assert colours[0::2] == [pytest.approx((*colour, 1.0)) for colour in scene.COLOURS[:3]]


def _colour(graph: SceneGraph, plant: object, instance: object) -> list[float]:
    body = plant.GetBodyByName("link_1", instance)  # type: ignore[attr-defined]
    (first, *_) = plant.GetVisualGeometriesForBody(body)  # type: ignore[attr-defined]
    shown = graph.model_inspector().GetIllustrationProperties(first).GetProperty("phong", "diffuse")
    return [shown.r(), shown.g(), shown.b(), shown.a()]
