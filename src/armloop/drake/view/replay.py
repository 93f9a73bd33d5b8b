"""A recorded replay of tracking runs as one HTML file that works offline (Meshcat)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Protocol

import numpy as np
from pydrake.geometry import MeshcatVisualizer
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from armloop.drake.view.scene import COLOURS, add_actors, local_meshcat, look_at
from armloop.robot.arm import Arm
from armloop.util.arrays import Array
from armloop.util.files import write_text

_LEGEND = (
    "position:fixed;left:0;bottom:0;padding:.5em .8em;border-radius:0 8px 0 0;background:rgba(255,255,255,.85);"
    "color:#1b2430;font:16px/1.5 system-ui,sans-serif;z-index:10"
)


class Recorded(Protocol):
    """Samples of a run: time (N,) in s, positions and the reference's positions (N, n)."""

    @property
    def time(self) -> Array: ...
    @property
    def q(self) -> Array: ...
    @property
    def q_ref(self) -> Array: ...


def write_replay(
    path: str | Path,
    arm: Arm,
    results: Mapping[str, Recorded],
    *,
    labels: Mapping[str, str] | None = None,
    frames_per_second: float = 25.0,
) -> None:
    """Write a replay of tracking runs: the arms side by side, a colour per controller, each in a grey ghost.

    A legend says whose each colour is; ``labels`` are what it calls the results, else their names.
    The ghost is the reference. The Meshcat server listens on the loopback interface only and ends with this call. The
    file is written whole or not at all; raises `InputError` when it cannot be.
    """
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
    actors = add_actors(plant, arm, list(results))
    plant.Finalize()
    meshcat = local_meshcat()
    visualizer = MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat)
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    plant_context = plant.GetMyMutableContextFromRoot(context)
    visualizer.StartRecording(set_transforms_while_recording=False)
    time = next(iter(results.values())).time
    for t in np.arange(time[0], time[-1], 1.0 / frames_per_second):
        row = int(np.searchsorted(time, t))
        context.SetTime(float(t))
        for pair, result in zip(actors, results.values(), strict=True):
            plant.SetPositions(plant_context, pair.arm, result.q[row])
            plant.SetPositions(plant_context, pair.ghost, result.q_ref[row])
        diagram.ForcedPublish(context)
    visualizer.StopRecording()
    visualizer.PublishRecording()
    look_at(meshcat, arm, len(results))
    write_text(path, _labelled(meshcat.StaticHtml(), [(labels or {}).get(name, name) for name in results]))


def _labelled(page: str, names: Sequence[str]) -> str:
    """The page with a legend below the scene: whose arm has which colour."""
    dots = [
        (f"rgb({', '.join(str(round(255 * part)) for part in COLOURS[k % len(COLOURS)])})", name)
        for k, name in enumerate(names)
    ]
    shown = "".join(
        f'<span style="white-space:nowrap;margin-right:1em"><span style="color:{colour}">&#9679;</span> '
        f"{escape(name)}</span> "
        for colour, name in [*dots, ("rgb(140, 140, 140)", "grey: the reference")]
    )
    at = page.rindex("</body>")
    return f'{page[:at]}<div id="legend" style="{_LEGEND}">{shown}</div>{page[at:]}'
