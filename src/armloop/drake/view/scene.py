"""Arms drawn in a scene, and the Meshcat server that shows them to this computer alone."""

from __future__ import annotations

import logging
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from pydrake.geometry import Cylinder, Meshcat, MeshcatParams, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex

from armloop.drake.plant.plant import add_links
from armloop.robot.arm import Arm
from armloop.robot.urdf import base_links, urdf_tree
from armloop.util.quiet import quiet

COLOURS = (
    (0.93, 0.70, 0.13),
    (0.20, 0.45, 0.80),
    (0.85, 0.30, 0.55),
    (0.25, 0.65, 0.40),
    (0.55, 0.40, 0.75),
    (0.50, 0.32, 0.20),
    (0.10, 0.70, 0.75),
)
"""One per controller: yellow, blue and pink as in Fig. 15, then more, as many as controllers are listed."""
GHOST = (0.6, 0.6, 0.6, 0.35)
LOOPBACK = "127.0.0.1"
_SPACING = 2.4  # times the arm's half reach, between two controllers' arms
_STICK = 0.02  # m, radius of a link drawn without the URDF's shapes


class Actors(NamedTuple):
    """One controller's arm in the scene, and the grey ghost of its reference."""

    arm: ModelInstanceIndex
    ghost: ModelInstanceIndex


def local_meshcat() -> Meshcat:
    """Return a Meshcat server on the loopback interface, on a free port: no other computer can reach it."""
    with quiet("drake", logging.WARNING):  # it would write the address where messages of faults belong
        return Meshcat(MeshcatParams(host=LOOPBACK, show_stats_plot=False))


def add_actors(plant: MultibodyPlant, arm: Arm, names: Sequence[str]) -> list[Actors]:
    """Add an arm and a ghost for each name, side by side, a colour each, to a plant with a scene graph.

    Arms are drawn with the URDF's own shapes (sticks when it has none, or needs meshes). The plant is not finalized.
    """
    spread = _SPACING * 0.5 * _reach(arm)
    actors = []
    for k, name in enumerate(names):
        X_WB = RigidTransform([0.0, (0.5 * (len(names) - 1) - k) * spread, 0.0])
        colour = (*COLOURS[k % len(COLOURS)], 1.0)
        actors.append(
            Actors(
                _add_arm(plant, arm, X_WB, colour, name),
                _add_arm(plant, arm, X_WB, GHOST, f"{name}_reference"),
            )
        )
    return actors


def look_at(meshcat: Meshcat, arm: Arm, count: int) -> None:
    """Place the camera so that ``count`` arms side by side fill a wide window, seen from the front and a little above."""
    reach = _reach(arm)
    width = _SPACING * 0.5 * reach * (count - 1) + reach
    target = np.array([0.2 * reach, 0.0, 0.35 * reach])
    meshcat.SetCameraPose(target + max(0.66 * width, 1.3 * reach) * np.array([0.86, -0.36, 0.36]), target)


def _reach(arm: Arm) -> float:
    """Return the stretched length of the arm, m."""
    steps = [np.linalg.norm(X[:3, 3]) for X in (*arm.X_PF, arm.X_tool)]
    return float(sum(steps)) or 1.0


def _add_arm(
    plant: MultibodyPlant, arm: Arm, X_WB: RigidTransform, colour: tuple[float, ...], label: str
) -> ModelInstanceIndex:
    """Add one arm of one colour with its base at X_WB; return its model instance."""
    if "<visual" not in arm.urdf or "<mesh" in arm.urdf:
        return _add_sticks(plant, arm, X_WB, colour, label)
    root = urdf_tree(arm.urdf)
    root.set("name", label)
    rgba = " ".join(f"{value:g}" for value in colour)
    for material in root.iter("material"):
        for child in list(material):
            material.remove(child)
        # A name of its own: materials of one name must agree over all arms.
        material.set("name", f"{label}_{material.get('name', '')}")
        ElementTree.SubElement(material, "color", rgba=rgba)
    base = _own_base(root)
    with quiet("drake"):  # what there is to warn of was said when the arm was loaded
        (instance,) = Parser(plant).AddModelsFromString(
            ElementTree.tostring(root, encoding="unicode"), "urdf"
        )
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(base, instance), X_WB)
    return instance


def _own_base(root: ElementTree.Element) -> str:
    """Return the name of the base link; one called `world`, declared or not, is Drake's world: it gets another, in place."""
    (base,) = base_links(root)
    if base != "world":
        return base
    names = [link.get("name", "") for link in root.findall("link")]
    new = "world_" + max(names, key=len)  # longer than any
    if "world" not in names:
        ElementTree.SubElement(root, "link", name=new)
    for link in root.findall("link[@name='world']"):
        link.set("name", new)
    for parent in root.findall("joint/parent[@link='world']"):
        parent.set("link", new)
    return new


def _add_sticks(
    plant: MultibodyPlant, arm: Arm, X_WB: RigidTransform, colour: tuple[float, ...], label: str
) -> ModelInstanceIndex:
    """Add an arm drawn as sticks between its joints."""
    X_PF = arm.X_PF.copy()
    X_PF[0] = X_WB.GetAsMatrix4() @ X_PF[0]
    add_links(plant, replace(arm, name=label, X_PF=X_PF))
    instance = plant.GetModelInstanceByName(label)
    for i, X_next in enumerate((*arm.X_PF[1:], arm.X_tool)):
        body = plant.GetBodyByName(f"link_{i + 1}", instance)
        tip = X_next[:3, 3]
        length = float(np.linalg.norm(tip))
        plant.RegisterVisualGeometry(body, RigidTransform(), Sphere(1.3 * _STICK), f"joint_{i + 1}", colour)
        if length > _STICK:
            along = RigidTransform(RotationMatrix.MakeFromOneVector(tip, 2), 0.5 * tip)
            plant.RegisterVisualGeometry(body, along, Cylinder(_STICK, length), f"stick_{i + 1}", colour)
    return instance
