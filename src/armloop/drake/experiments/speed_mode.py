"""An arm whose drives follow a reference in speed mode, and what its instruments record.

The diagram is built once; every motion starts at time 0 from the state it is given.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput, TrajectorySource

from armloop.drake.control.reference import held_rows
from armloop.drake.experiments.recording import Recording, record
from armloop.drake.plant.config import Instruments
from armloop.drake.plant.fault_injection import Effects
from armloop.drake.plant.friction import JointFriction
from armloop.drake.plant.joint_loads import Law, ServoGains
from armloop.drake.plant.plant import ArmPlant
from armloop.experiment.excitation import Reference
from armloop.robot.arm import Arm
from armloop.util.arrays import Array

STIFF = ServoGains(p=1e6, d=1e4)
"""A stiff drive: 10 N*m move it by 1e-5 rad, and it settles in d/p = 10 ms."""


class SpeedModeArm:
    """A simulated arm with drives in speed mode: `follow` a reference and get the recording."""

    def __init__(
        self,
        arm: Arm,
        friction: Sequence[JointFriction],
        *,
        effects: Effects = (),
        instruments: Instruments | None = None,
        time_step: float = 1e-3,
        servo: ServoGains = STIFF,
        law: Law | None = None,
    ) -> None:
        self.arm = arm
        self.instruments = instruments or Instruments()
        self._step = time_step
        builder = DiagramBuilder()
        self.plant = builder.AddSystem(
            ArmPlant(arm, friction, effects=effects, time_step=time_step, servo=servo, law=law)
        )
        self._source = builder.AddSystem(TrajectorySource(held_rows(np.zeros((1, 2 * arm.n)), time_step)))
        builder.Connect(self._source.get_output_port(), self.plant.GetInputPort("desired_state"))
        self._logger = LogVectorOutput(self.plant.GetOutputPort("state"), builder, time_step)
        self._simulator = Simulator(builder.Build())

    def follow(self, reference: Reference, *, rate: float = 500.0, settle: float = 0.0) -> Recording:
        """Start on the reference, follow it to its end; record from `settle` seconds on, `rate` Hz at most.

        tau is the drives' torque, without the friction, averaged over the steps before and after the sample, which
        centres it on the sample's time.
        """
        n, context = self.arm.n, self._simulator.get_mutable_context()
        half = self.instruments.half_window(self._step)
        last = round(reference.duration / self._step)
        first = max(half, round(settle / self._step))
        steps = last + half  # what the central difference needs beyond the end
        t: Array = self._step * np.arange(steps + 1, dtype=float)
        q_d, v_d, _ = reference.evaluate(t)
        desired = np.hstack([q_d, v_d])
        self._source.UpdateTrajectory(held_rows(desired[1:], self._step))
        context.SetTime(0.0)
        self.plant.set_state(context, q_d[0], v_d[0])
        log = self._logger.FindMutableLog(context)
        log.Clear()
        self._simulator.Initialize()
        self._simulator.AdvanceTo(steps * self._step)
        state = log.data().T
        if len(state) != steps + 1:
            raise RuntimeError(f"the simulation recorded {len(state)} steps; {steps + 1} were due")

        torque = self.plant.servo_torque(state, desired)
        rows = np.arange(first, last, max(1, round(1.0 / (rate * self._step))))
        tau = 0.5 * (torque[:-1] + torque[1:])
        return record(self.plant, self.instruments, self._step, t, state[:, :n], tau, rows)
