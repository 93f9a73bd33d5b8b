"""What acts on the joints of a simulated arm besides torque-mode drives: friction, servos, springs, ripples."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from armloop.drake_systems.friction import JointFriction
from armloop.drake_systems.implicit import ClampedLaw, implicit_torques

Array = NDArray[np.float64]

STICKING_GAIN = 1e8
"""A sticking joint creeps at its load divided by this, N*m*s/rad (N*s/m)."""


@dataclass(frozen=True)
class ServoGains:
    """A drive in speed mode.

    p : N*m/rad (N/m) on the position, d : N*m*s/rad (N*s/m) on the velocity
    """

    p: float = 5e4
    d: float = 1e3


class JointLoads(LeafSystem):
    """Generalized forces on a discrete plant's joints, for the step that starts now.

    tau = -f(w) + clamp(p (q_d - q - h w) + d (v_d - w), +-effort) - sum k (q - q0) - sum A sin(N q + phi)

    h is the plant's time step, w the velocity at its end: the plant's own step is predicted, so that joints
    really stick and servos may be stiff (see `implicit`). f is the dry part of Eq. (34) with the sign of w and
    the level at the velocity of the step's start. The servo is there in speed mode only.

    Input ports: `state` (2n,) positions, then velocities; torque mode: `tau` (n,) of the drives, clamped here
    as in the plant; speed mode: `desired_state` (2n,) at the end of the step. Output port `load` (n,).
    Stateless; scalar type float only.
    """

    def __init__(
        self,
        plant: MultibodyPlant,
        friction: Sequence[JointFriction],
        *,
        servo: ServoGains | None = None,
        springs: Array | None = None,
        ripples: Array | None = None,
    ) -> None:
        """plant : finalized and discrete, its joints' damping is the viscous friction, a drive on each joint;
        friction : n joints; springs, ripples : rows as in `effects.Realisation`."""
        super().__init__()
        n = len(friction)
        self._n = n
        self._plant = plant
        self._scratch = plant.CreateDefaultContext()  # to predict with; not the simulated one
        self._step = plant.time_step()
        drives = [plant.get_joint_actuator(index) for index in plant.GetJointActuatorIndices()]
        self._effort = [drive.effort_limit() for drive in drives]
        self._damping = [self._step * drive.joint().default_damping() for drive in drives]
        self._drops = [
            # Python's own floats: numpy's scalars take three times as long.
            (j, float(f.coulomb), float(f.static - f.coulomb), 1.0 / float(f.stribeck_velocity))
            for j, f in enumerate(friction)
            if f.static > 0
        ]
        self._springs = [] if springs is None else [(int(j), float(k), float(rest)) for j, k, rest in springs]
        self._ripples = (
            []
            if ripples is None
            else [(int(j), float(a), float(order), float(phase)) for j, a, order, phase in ripples]
        )
        self._servo = servo
        self._state = self.DeclareVectorInputPort("state", 2 * n)
        if servo is None:
            self._command = self.DeclareVectorInputPort("tau", n)
        else:
            self._command = self.DeclareVectorInputPort("desired_state", 2 * n)
        self.DeclareVectorOutputPort("load", n, self._calc_load)

    def _calc_load(self, context: Context, output: BasicVector) -> None:
        # Called every step: for a handful of joints plain floats are several times faster than arrays.
        x = self._state.Eval(context)
        command = self._command.Eval(context).tolist()
        state = x.tolist()
        n, h, servo = self._n, self._step, self._servo
        q, v = state[:n], state[n:]
        load = [0.0] * n
        for j, stiffness, rest in self._springs:
            load[j] -= stiffness * (q[j] - rest)
        for j, amplitude, order, phase in self._ripples:
            load[j] -= amplitude * math.sin(order * q[j] + phase)

        plant, scratch = self._plant, self._scratch
        plant.SetPositionsAndVelocities(scratch, x)
        inertia = plant.CalcMassMatrix(scratch)
        bias = plant.CalcBiasTerm(scratch) - plant.CalcGravityGeneralizedForces(scratch)
        momentum = (inertia.dot(x[n:]) - h * bias).tolist()
        A = inertia.tolist()
        laws, pieces = [], []
        for j, coulomb, drop, inverse_vs in self._drops:
            speed = v[j]
            law = ClampedLaw(j, 0.0, STICKING_GAIN, coulomb + drop * math.exp(-((speed * inverse_vs) ** 2)))
            laws.append(law)
            pieces.append(law.piece(speed))
        for j in range(n):
            A[j][j] += self._damping[j]
            limit, acting = self._effort[j], load[j]
            if servo is None:
                acting += min(max(command[j], -limit), limit)
            else:
                pull = servo.p * (command[j] - q[j]) + servo.d * command[n + j]
                laws.append(ClampedLaw(j, pull, servo.d + h * servo.p, limit))
                pieces.append(0)
            momentum[j] += h * acting
        implicit = implicit_torques(A, momentum, laws, pieces, h)
        output.SetFromVector([x + y for x, y in zip(load, implicit, strict=True)])
