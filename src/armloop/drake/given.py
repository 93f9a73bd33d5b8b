"""Checks of what systems and controllers are made with: models, numbers of joints, the joints of a plant."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import PrismaticJoint, RevoluteJoint

from armloop.model import ReconstructedModel
from armloop.robot.arm import Arm
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


def require_reference(reference: Any) -> None:
    """Raise `InputError` for what is no motion to follow."""
    if not (callable(getattr(reference, "evaluate", None)) and hasattr(reference, "duration")):
        raise InputError(
            "the reference must have evaluate(t) and a duration, such as one of armloop.experiment.excitation; it is of "
            f"type {type(reference).__name__}"
        )


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
    """Raise `InputError` for what is no plant whose joints are settled, each of one degree of freedom."""
    require_of(MultibodyPlant, plant=plant)
    if not plant.is_finalized():
        raise InputError("the plant is not finalized: call plant.Finalize() first")
    floating = [plant.get_body(index).name() for index in plant.GetFloatingBaseBodies()]
    if floating:
        raise ArmError(
            f"the plant's {', '.join(map(repr, floating))} floats; weld the arm's base to the world (plant.WeldFrames)"
        )


def require_order(plant: MultibodyPlant, arm: Arm) -> None:
    """Raise `ArmError` for a plant of as many joints that are others, or stand in another order, as far as that shows."""
    joints = moving(plant)
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


def moving(plant: MultibodyPlant) -> list[Any]:
    """The plant's joints that move, in the order of its velocities."""
    joints = [plant.get_joint(index) for index in plant.GetJointIndices()]
    return sorted((j for j in joints if j.num_velocities()), key=lambda j: j.velocity_start())
