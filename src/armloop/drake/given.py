"""Checks of what systems and controllers are made with: models, numbers of joints, the joints of a plant."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex, PrismaticJoint, RevoluteJoint

from armloop.model import ReconstructedModel
from armloop.robot.arm import Arm
from armloop.util.arrays import Array
from armloop.util.doubts import warn
from armloop.util.errors import ArmError, InputError, ModelError


def require_model(model: Any) -> None:
    """Raise `ModelError` for what is no reconstructed model."""
    if not isinstance(model, ReconstructedModel):
        raise ModelError(
            "the model must be a ReconstructedModel, such as of armloop.model.load_model; it is of type "
            f"{type(model).__name__}"
        )


def require_predicts(model: Any) -> None:
    """Raise `ModelError` for what predicts no torque of a state."""
    if not callable(getattr(model, "feedforward", None)):
        raise ModelError(
            "the model must be one, such as of armloop.model.load_model, or have a method feedforward; it is of type "
            f"{type(model).__name__}"
        )


def require_joints(model: Any, n: int, whose: str) -> None:
    """Raise `ModelError` for a model that is known to have another number of joints than who takes it."""
    known = getattr(getattr(model, "arm", None), "n", n)
    if known != n:
        raise ModelError(f"the model's arm {model.arm.name} has {known} joints; {whose} {n}")


def require_step(step: Any, more: str = "") -> None:
    """Raise `InputError` for a step that no model has."""
    if isinstance(step, bool) or step not in (1, 2, 3):
        raise InputError(f"step is {step!r:.60}; it must be 1, 2 or 3{more}")


def require_of(kind: type, **given: Any) -> None:
    """Raise `InputError` for an argument that is not of a class."""
    for name, value in given.items():
        if not isinstance(value, kind):
            raise InputError(f"{name} must be {kind.__name__}; it is of type {type(value).__name__}")


def require_each(kind: type, given: Iterable[Any], name: str) -> None:
    """Raise `InputError` for an entry that is not of a class, called by its name and number."""
    for k, each in enumerate(given, 1):
        require_of(kind, **{f"{name} {k}": each})


def require_plant(plant: Any) -> None:
    """Raise `InputError` for what is no plant whose joints are settled."""
    require_of(MultibodyPlant, plant=plant)
    if not plant.is_finalized():
        raise InputError("the plant is not finalized: call plant.Finalize() first")


def joints_for(
    plant: MultibodyPlant, who: str, n: int, arm: Arm | None, instance: ModelInstanceIndex | None = None
) -> list[Any]:
    """Return the plant's joints that a system of n joints acts on, in its order: all that move, else those of its arm's
    names, where others move, too.

    instance : whose joints are looked at; None for all. Raises `InputError` where they cannot be told, or the arm floats.
    """
    joints = [j for j in moving(plant) if instance is None or j.model_instance() == instance]
    joints = [j for j in joints if j.num_velocities() == 1]
    if len(joints) != n:
        names = [joint.name() for joint in joints]
        unclear = [name for name in arm.joint_names if names.count(name) != 1] if arm else []
        if arm is None or unclear:
            why = f": {unclear[0]!r} stands there {names.count(unclear[0])} times" if unclear else ""
            raise InputError(
                f"{who}: is for {n} joints, the plant has {len(joints)}{why}; where others move, too, the arm's must have "
                "their names, or give the systems by its model instance, {instance: systems}"
            )
        joints = [joints[names.index(name)] for name in arm.joint_names]
    elif arm is not None:
        require_order(joints, arm)
    parents = {joint.child_body().index(): joint for joint in moving(plant, still=True)}
    for joint in joints:
        above: Any = joint
        while above is not None and above.num_velocities() <= 1:
            above = parents.get(above.parent_body().index())
        if above is not None:
            raise ArmError(
                f"the plant's {above.child_body().name()!r} floats; weld the arm's base to the world (plant.WeldFrames)"
            )
    return joints


def require_order(joints: Sequence[Any], arm: Arm) -> None:
    """Raise `ArmError` for a plant's as many joints that are others, or stand in another order, as far as that shows."""
    wanted, found = arm.joint_names, [joint.name() for joint in joints]
    if sorted(wanted) == sorted(found) and wanted != found:
        raise ArmError(
            f"the plant's velocities are those of {', '.join(found)}, in this order; the joints of {arm.name} are "
            f"{', '.join(wanted)}"
        )
    for own, joint in zip(arm.joints, joints, strict=True):
        slides = isinstance(joint, PrismaticJoint)
        if isinstance(joint, PrismaticJoint | RevoluteJoint) and slides != (own.kind == "prismatic"):
            raise ArmError(
                f"the plant's joint {joint.name()!r} is {'prismatic' if slides else 'revolute'}; {own.name!r}, which has "
                f"its place in {arm.name}, is {own.kind}"
            )


def warn_of_damping(joints: Sequence[Any], damping: Array | None) -> None:
    """Say where a plant's joints have not the damping (n,) that a system leaves to them."""
    found = [joint.default_damping_vector()[0] for joint in joints]
    wanted = found if damping is None else damping
    wrong = [
        f"{joint.name()} has {has:.3g}, not {c:.3g}"
        for joint, has, c in zip(joints, found, wanted, strict=True)
        if not np.isclose(has, c, rtol=0.01)
    ]
    if wrong:
        warn(
            f"damping of the plant's joints is not the model's viscous friction: {', '.join(wrong)} N*m*s/rad (N*s/m); "
            "before Finalize, give them armloop.dynamics.viscous_coefficients(model) by set_default_damping"
        )


def moving(plant: MultibodyPlant, still: bool = False) -> list[Any]:
    """The plant's joints that move, in the order of its velocities; with those that do not, if `still`."""
    joints = [plant.get_joint(index) for index in plant.GetJointIndices()]
    return sorted((j for j in joints if still or j.num_velocities()), key=lambda j: j.velocity_start())
