"""A recorded replay of tracking runs as one HTML file that works offline (Meshcat)."""

from __future__ import annotations

import logging
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Cylinder, Meshcat, MeshcatParams, MeshcatVisualizer, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.systems.framework import DiagramBuilder

from armloop.arm import Arm
from armloop.drake_systems.plant import add_links
from armloop.drake_systems.tracking import TrackingResult
from armloop.files import write_text

Array = NDArray[np.float64]

COLOURS = ((0.93, 0.70, 0.13), (0.20, 0.45, 0.80), (0.85, 0.30, 0.55), (0.25, 0.65, 0.40), (0.55, 0.40, 0.75))
"""One per controller: yellow, blue and pink as in Fig. 15, then more."""
GHOST = (0.6, 0.6, 0.6, 0.35)
_SPACING = 2.4  # times the arm's half reach, between two controllers' arms
_STICK = 0.02  # m, radius of a link drawn without the URDF's shapes


def write_replay(
    path: str | Path, arm: Arm, results: Mapping[str, TrackingResult], *, frames_per_second: float = 25.0
) -> None:
    """Write a replay of tracking runs: the arms side by side, a colour per controller, each in a grey ghost.

    The ghost is the reference. Arms are drawn with the URDF's own shapes (sticks when it has none, or needs
    meshes). The Meshcat server listens on the loopback interface only and ends with this call. The file is
    written whole or not at all; raises `InputError` when it cannot be.
    """
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
    spread = _SPACING * 0.5 * _reach(arm)
    actors: list[tuple[ModelInstanceIndex, Array]] = []
    for k, (controller, result) in enumerate(results.items()):
        X_WB = RigidTransform([0.0, (0.5 * (len(results) - 1) - k) * spread, 0.0])
        colour = (*COLOURS[k % len(COLOURS)], 1.0)
        actors.append((_add_arm(plant, arm, X_WB, colour, controller), result.q))
        actors.append((_add_arm(plant, arm, X_WB, GHOST, f"{controller}_reference"), result.q_ref))
    plant.Finalize()
    with _drake_says_less():  # the address that it listens on is gone before anybody could look there
        meshcat = Meshcat(MeshcatParams(host="localhost", show_stats_plot=False))
    visualizer = MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat)
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    plant_context = plant.GetMyMutableContextFromRoot(context)
    visualizer.StartRecording(set_transforms_while_recording=False)
    time = next(iter(results.values())).time
    for t in np.arange(time[0], time[-1], 1.0 / frames_per_second):
        row = int(np.searchsorted(time, t))
        context.SetTime(float(t))
        for instance, q in actors:
            plant.SetPositions(plant_context, instance, q[row])
        diagram.ForcedPublish(context)
    visualizer.StopRecording()
    visualizer.PublishRecording()
    write_text(path, meshcat.StaticHtml())


@contextmanager
def _drake_says_less() -> Iterator[None]:
    """Let Drake's logger pass warnings only, for the time of the block."""
    logger = logging.getLogger("drake")
    level = logger.level
    logger.setLevel(logging.WARNING)
    try:
        yield
    finally:
        logger.setLevel(level)


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
    root = ElementTree.fromstring(arm.urdf)
    root.set("name", label)
    rgba = " ".join(f"{value:g}" for value in colour)
    for material in root.iter("material"):
        for child in list(material):
            material.remove(child)
        # A name of its own: materials of one name must agree over all arms.
        material.set("name", f"{label}_{material.get('name', '')}")
        ElementTree.SubElement(material, "color", rgba=rgba)
    links = {link.get("name", "") for link in root.findall("link")}
    children = {child.get("link", "") for child in root.findall("joint/child")}
    (instance,) = Parser(plant).AddModelsFromString(ElementTree.tostring(root, encoding="unicode"), "urdf")
    (base,) = links - children
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(base, instance), X_WB)
    return instance


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
