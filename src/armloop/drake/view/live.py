"""Live view of simulated arms in a browser on the same computer (Meshcat)."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Protocol

import numpy as np
from pydrake.geometry import MeshcatVisualizer, SceneGraph
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, OutputPort
from pydrake.systems.primitives import MatrixGain, Multiplexer
from pydrake.systems.rendering import MultibodyPositionToGeometryPose

from armloop.drake.view.scene import add_actors, local_meshcat
from armloop.robot.arm import Arm

_ASK = 0.1  # s between two looks for a browser


class Shown(Protocol):
    """What moves and what it follows: a diagram with the output ports `state` (2n,) and `q_ref` (n,)."""

    def GetOutputPort(self, port_name: str) -> OutputPort:
        """Return the port of that name."""


class LiveView:
    """A Meshcat page with arms that move as they are simulated, each in the grey ghost of its reference.

    The server listens on the loopback interface only, as long as this object lives; `address` is its page. It takes
    part in a diagram by `add_to`, before `Build`, and slows a simulation down to real time by `pace`.
    """

    def __init__(self, arm: Arm, rate: float = 1.0) -> None:
        """arm : of all arms shown; rate : simulated seconds per second, 0 for as fast as it goes."""
        if not 0 <= rate < np.inf:
            raise ValueError(f"rate is {rate}; it must be a number of at least 0")
        self._arm, self._rate = arm, rate
        self._meshcat = local_meshcat()

    @property
    def address(self) -> str:
        """Where a browser on this computer finds the page."""
        return str(self._meshcat.web_url())

    def wait(self, seconds: float) -> bool:
        """Wait until a browser shows the page, at most so long; tell whether one does. Not with rate 0."""
        end = time.monotonic() + (seconds if self._rate else 0.0)
        while not self._meshcat.GetNumActiveConnections():
            if time.monotonic() >= end:
                return False
            time.sleep(_ASK)
        return True

    def add_to(self, builder: DiagramBuilder, shown: Mapping[str, Shown]) -> None:
        """Show systems of a diagram side by side by their names; what an earlier diagram showed goes away.

        Nothing that is simulated is changed: the arms drawn are a plant of their own, moved by its positions alone.
        """
        n = self._arm.n
        plant, scene_graph = MultibodyPlant(0.0), builder.AddSystem(SceneGraph())
        plant.RegisterAsSourceForSceneGraph(scene_graph)
        actors = add_actors(plant, self._arm, list(shown))
        plant.Finalize()
        signals = builder.AddSystem(Multiplexer([2 * n, n] * len(shown)))
        places = np.zeros((plant.num_positions(), 3 * n * len(shown)))
        for k, ((_, system), pair) in enumerate(zip(shown.items(), actors, strict=True)):
            for part, (port, instance) in enumerate((("state", pair.arm), ("q_ref", pair.ghost))):
                builder.Connect(system.GetOutputPort(port), signals.get_input_port(2 * k + part))
                rows = plant.GetPositionsFromArray(instance, np.arange(plant.num_positions())).astype(int)
                places[rows, 3 * n * k + 2 * n * part + np.arange(n)] = 1.0
        positions = builder.AddSystem(MatrixGain(places))
        builder.Connect(signals.get_output_port(), positions.get_input_port())
        poses = builder.AddSystem(MultibodyPositionToGeometryPose(plant))
        builder.Connect(positions.get_output_port(), poses.get_input_port())
        source = plant.get_source_id()
        builder.Connect(poses.get_output_port(), scene_graph.get_source_pose_port(source))
        MeshcatVisualizer.AddToBuilder(builder, scene_graph, self._meshcat)
        self._plant = plant  # what converts positions does not keep it alive

    def pace(self, simulator: Simulator) -> None:
        """Hold a simulation to the rate."""
        simulator.set_target_realtime_rate(self._rate)
