"""Whether a plant's joints stand where those of an arm do, as far as their names and kinds show."""

from __future__ import annotations

from dataclasses import replace

import pytest
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import PrismaticJoint, RevoluteJoint, SpatialInertia
from synthetic import three_axis

from armloop.drake.given import joints_for, moving, require_order, require_plant
from armloop.util.errors import ArmError, InputError


def plant_of(*joints: tuple[str, type]) -> MultibodyPlant:
    """A chain of these joints, each of which moves a kilogram."""
    plant = MultibodyPlant(0.0)
    parent = plant.world_body()
    for k, (name, kind) in enumerate(joints):
        body = plant.AddRigidBody(f"b{k}", SpatialInertia.SolidSphereWithMass(1.0, 0.1))
        plant.AddJoint(kind(name, parent.body_frame(), body.body_frame(), [0, 0, 1]))
        parent = body
    plant.Finalize()
    return plant


def arm_of(*joints: tuple[str, str]):
    own = three_axis()
    named = zip(own.joints, joints, strict=True)
    return replace(own, joints=tuple(replace(joint, name=name, kind=kind) for joint, (name, kind) in named))


ARM = arm_of(("a", "revolute"), ("b", "prismatic"), ("c", "revolute"))


@pytest.mark.parametrize("names", ["abc", "xyz", "bay"])
def test_joints_in_their_places_or_of_other_names_are_taken(names: str) -> None:
    plant = plant_of(*zip(names, (RevoluteJoint, PrismaticJoint, RevoluteJoint), strict=True))
    require_order(moving(plant), ARM)
    assert [joint.name() for joint in moving(plant)] == list(names)


def test_the_same_joints_in_another_order_are_refused() -> None:
    plant = plant_of(("c", RevoluteJoint), ("b", PrismaticJoint), ("a", RevoluteJoint))
    with pytest.raises(ArmError, match=r"are those of c, b, a, in this order; the joints of .* are a, b, c"):
        require_order(moving(plant), ARM)


def test_a_joint_that_slides_where_the_arms_turns_is_refused_and_the_other_way_round() -> None:
    for kinds, told in (
        ((PrismaticJoint, PrismaticJoint, RevoluteJoint), "'x' is prismatic; 'a', .* is revolute"),
        ((RevoluteJoint, RevoluteJoint, RevoluteJoint), "'y' is revolute; 'b', .* is prismatic"),
    ):
        with pytest.raises(ArmError, match=f"the plant's joint {told}"):
            require_order(moving(plant_of(*zip("xyz", kinds, strict=True))), ARM)


def test_a_plant_is_finalized_and_stands_on_the_ground() -> None:
    require_plant(plant_of(("a", RevoluteJoint)))
    with pytest.raises(InputError, match="not finalized"):
        require_plant(MultibodyPlant(0.0))
    floats = MultibodyPlant(0.0)
    ball = SpatialInertia.SolidSphereWithMass(1.0, 0.1)
    thrown, arm = floats.AddRigidBody("thrown", ball), floats.AddRigidBody("arm", ball)
    floats.AddJoint(RevoluteJoint("a", thrown.body_frame(), arm.body_frame(), [0, 0, 1]))
    floats.Finalize()
    with pytest.raises(ArmError, match="'thrown' floats"):
        joints_for(floats, "friction", 1, None)
