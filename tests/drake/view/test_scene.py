"""Where arms stand in a scene, how sticks are drawn, and from where it is seen."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations, pairwise
from typing import Any

import numpy as np
import pytest
from pydrake.geometry import Cylinder, Role, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder
from synthetic import three_axis

from armloop.drake.view.scene import COLOURS, GHOST, add_actors, look_at

#: Steps of 0.3, 0.4 and 0.5 m beside a tool's 0.01 m, which is shorter than a stick is thick; it reaches 1.21 m.
STEPS = ([0.0, 0.0, 0.3], [0.4, 0.0, 0.0], [0.3, 0.0, 0.4], [0.01, 0.0, 0.0])


def sticks() -> Any:
    """An arm without shapes of its own."""
    poses = []
    for step in STEPS:
        X = np.eye(4)
        X[:3, 3] = step
        poses.append(X)
    return replace(three_axis(), urdf="<robot/>", X_PF=np.array(poses[:3]), X_tool=poses[3])


@pytest.mark.parametrize("count", [1, 2, 3, len(COLOURS) + 1])
def test_arms_stand_side_by_side_with_their_ghosts(count: int) -> None:
    builder = DiagramBuilder()
    plant, graph = AddMultibodyPlantSceneGraph(builder, 0.0)
    names = [f"c{k}" for k in range(count)]
    actors = add_actors(plant, sticks(), names)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    inspector = graph.model_inspector()
    assert [plant.GetModelInstanceName(own.arm) for own in actors] == names
    for k, own in enumerate(actors):
        # half of 2.4 reaches apart, the first to the left, around the middle
        base = np.array([0.0, ((count - 1) / 2 - k) * 1.2 * 1.21, 0.0])
        for instance, colour in ((own.arm, (*COLOURS[k % len(COLOURS)], 1.0)), (own.ghost, GHOST)):
            place = base.copy()
            for link, (step, tip) in enumerate(pairwise(STEPS)):
                place = place + step
                body = plant.GetBodyByName(f"link_{link + 1}", instance)
                np.testing.assert_allclose(
                    plant.EvalBodyPoseInWorld(context, body).translation(), place, atol=1e-12
                )
                shapes = plant.GetVisualGeometriesForBody(body)
                assert len(shapes) == (1 if link == 2 else 2)
                for shape in shapes:
                    kind, X = inspector.GetShape(shape), inspector.GetPoseInFrame(shape)
                    assert isinstance(X, RigidTransform)
                    shown = inspector.GetProperties(shape, Role.kIllustration).GetProperty("phong", "diffuse")
                    assert np.allclose([shown.r(), shown.g(), shown.b(), shown.a()], colour)
                    if isinstance(kind, Sphere):
                        assert kind.radius() == pytest.approx(0.026) and not X.translation().any()
                        continue
                    # from this joint to the next
                    length = float(np.linalg.norm(tip))
                    assert isinstance(kind, Cylinder)
                    assert (kind.radius(), kind.length()) == (0.02, pytest.approx(length))
                    np.testing.assert_allclose(X.translation(), np.array(tip) / 2, atol=1e-12)
                    np.testing.assert_allclose(X.rotation().col(2), np.array(tip) / length, atol=1e-12)


def test_the_first_arms_are_yellow_blue_and_pink_and_none_is_like_another() -> None:
    assert len(COLOURS) == 7
    # told apart from each other and from the ghosts: by a quarter of what a colour's part goes through, at least
    for one, other in combinations([*COLOURS, GHOST[:3]], 2):
        assert np.linalg.norm(np.subtract(one, other)) > 0.25
    assert all(0.0 <= part <= 1.0 for colour in COLOURS for part in colour)
    yellow, blue, pink = COLOURS[:3]
    assert (
        yellow[0] > yellow[1] > 3 * yellow[2] and blue[2] > blue[1] > blue[0] and pink[0] > pink[2] > pink[1]
    )
    assert GHOST[0] == GHOST[1] == GHOST[2] and GHOST[3] < 0.5


@pytest.mark.parametrize(
    ("count", "distance"), [(1, 1.3 * 1.21), (2, 0.66 * 2.2 * 1.21), (3, 0.66 * 3.4 * 1.21)]
)
def test_the_camera_goes_back_for_more_arms(count: int, distance: float) -> None:
    placed: list[Any] = []
    meshcat: Any = type("Meshcat", (), {"SetCameraPose": lambda self, *of: placed.append(of)})()
    look_at(meshcat, sticks(), count)
    ((camera, target),) = placed
    np.testing.assert_allclose(target, [0.2 * 1.21, 0.0, 0.35 * 1.21])
    np.testing.assert_allclose(camera - target, distance * np.array([0.86, -0.36, 0.36]))


@pytest.mark.parametrize("base", ["foot", "world", "an undeclared world"])
def test_an_arm_with_shapes_of_its_own_keeps_them_in_its_colour(base: str) -> None:
    urdf = """<robot name="one"><material name="m"><color rgba="1 1 1 1"/></material>
      <link name="foot"/><link name="rod"><inertial><mass value="1"/>
      <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>
      </inertial><visual><geometry><box size="1 2 3"/></geometry>
      <material name="m"><color rgba="1 1 1 1"/></material></visual>
      </link><joint name="j" type="revolute"><parent link="foot"/><child link="rod"/><origin xyz="0 0 1"/><axis xyz="0 0 1"/>
      <limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>"""
    if "undeclared" in base:
        urdf = urdf.replace('<link name="foot"/>', "")
    urdf = urdf.replace('"foot"', f'"{base.split()[-1]}"')
    arm = replace(sticks(), urdf=urdf)
    builder = DiagramBuilder()
    plant, graph = AddMultibodyPlantSceneGraph(builder, 0.0)
    first, second = add_actors(plant, arm, ["a", "b"])
    plant.Finalize()
    context, inspector = plant.CreateDefaultContext(), graph.model_inspector()
    for own, side, colour in ((first, 1, COLOURS[0]), (second, -1, COLOURS[1])):
        body = plant.GetBodyByName("rod", own.arm)
        place = plant.EvalBodyPoseInWorld(context, body).translation()
        np.testing.assert_allclose(place, [0.0, side * 0.6 * 1.21, 1.0], atol=1e-12)
        (shape,) = plant.GetVisualGeometriesForBody(body)
        shown = inspector.GetProperties(shape, Role.kIllustration).GetProperty("phong", "diffuse")
        assert np.allclose([shown.r(), shown.g(), shown.b(), shown.a()], (*colour, 1.0))
