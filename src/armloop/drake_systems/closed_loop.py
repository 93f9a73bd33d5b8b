"""An arm under control, added to any diagram in one call: plant with friction, reference, feedforward, PID."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydrake.systems.framework import Context, DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from armloop.drake_systems.effects import UndeclaredEffect
from armloop.drake_systems.feedforward import Feedforward, FeedforwardModel
from armloop.drake_systems.pid import PidController, PidGains
from armloop.drake_systems.plant import ArmPlant
from armloop.drake_systems.reference import ReferenceSource
from armloop.drake_systems.scenarios import Plant, plant_for
from armloop.excitation import Reference


@dataclass(frozen=True, eq=False)
class ControlledArm:
    """The systems that `add_arm_with_controller` added, to connect more to, or to log.

    plant : output ports `state` (2n,), `tau_drive` (n,)
    reference : `q_ref`, `v_ref`, `vdot_ref` (n,); pid : `tau` (n,)
    feedforward : output port 0, (n,); a constant zero without a model
    """

    plant: ArmPlant
    reference: ReferenceSource
    feedforward: Feedforward | ConstantVectorSource
    pid: PidController

    def start_on_reference(self, root_context: Context) -> None:
        """Put the arm where the reference begins, at its velocity, inside the diagram's context."""
        q_ref, v_ref, _ = self.reference.tables
        self.plant.set_state(root_context, q_ref[0], v_ref[0])


def add_arm_with_controller(
    builder: DiagramBuilder,
    arm: str | Path | Plant,
    gains: PidGains,
    reference: Reference,
    model: FeedforwardModel | None = None,
    step: int = 3,
    *,
    effects: Sequence[UndeclaredEffect] = (),
) -> ControlledArm:
    """Add an arm that follows a reference by Eq. (35), (36) or, without a model, by PID alone.

    The wires: `ReferenceSource` -> `Feedforward` -> `PidController` -> `ArmPlant` in torque mode -> back. The
    arm starts at its zero position, unless `ControlledArm.start_on_reference` or `ArmPlant.set_state` is called.

    arm : a plant of `scenarios.load_plant`; or a built-in name or the path of a URDF, then with the friction
        and encoders of `scenarios.plant_for`
    gains : of the arm's n joints, `PidGains.paper(n)` for instance
    model : feedforward of the reference by its terms up to `step` (1, 2 or 3), such as one of
        `armloop.model.load_model`
    effects : what the plant has and the model may not know

    Raises `ArmError` for an arm that cannot be simulated, `ValueError` when gains or reference do not fit it.
    """
    spec = arm if isinstance(arm, Plant) else plant_for(arm)
    n, config, period = spec.arm.n, spec.config, spec.config.time_step
    source = ReferenceSource(reference, period)
    followed = source.tables[0].shape[1]
    if not len(gains.kp) == followed == n:
        raise ValueError(
            f"{spec.arm.name} has {n} joints; the gains are for {len(gains.kp)}, the reference for {followed}"
        )
    plant = builder.AddSystem(ArmPlant(spec.arm, config.friction, effects=effects, time_step=period))
    builder.AddNamedSystem("reference", source)
    resolution = config.instruments.resolution(spec.arm)
    pid = builder.AddNamedSystem("pid", PidController(gains, period, resolution))
    if model is None:
        feedforward = builder.AddNamedSystem("feedforward", ConstantVectorSource(np.zeros(n)))
    else:
        feedforward = builder.AddNamedSystem("feedforward", Feedforward(model, n, step))
        for port in ("q_ref", "v_ref", "vdot_ref"):
            builder.Connect(source.GetOutputPort(port), feedforward.GetInputPort(port))
    for port in ("q_ref", "v_ref"):
        builder.Connect(source.GetOutputPort(port), pid.GetInputPort(port))
    builder.Connect(feedforward.get_output_port(0), pid.GetInputPort("tau_ff"))
    builder.Connect(plant.GetOutputPort("state"), pid.GetInputPort("state"))
    builder.Connect(pid.GetOutputPort("tau"), plant.GetInputPort("tau"))
    return ControlledArm(plant, source, feedforward, pid)
