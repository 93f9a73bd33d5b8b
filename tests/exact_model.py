"""The model that a perfect reconstruction would find: what the simulated plant is made of."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pydrake.multibody.plant import MultibodyPlant

from armloop.drake.plant.fault_injection import UndeclaredEffect, realise
from armloop.drake.plant.friction import JointFriction
from armloop.drake.plant.plant import add_links
from armloop.laws.friction import KINDS
from armloop.robot.arm import Arm

Array = NDArray[np.float64]


class ExactModel:
    """Inverse dynamics of the plant (Drake) and Eq. (34), by steps as a reconstructed model has them.

    Step 1: gravity and dry friction as seen at creeping speed, f_s sign(v). Step 2: Coriolis and centrifugal
    terms and the whole of Eq. (34). Step 3: inertia. `effects` may hold a payload, a tilt and added friction.
    """

    def __init__(
        self, arm: Arm, friction: Sequence[JointFriction], effects: Sequence[UndeclaredEffect] = ()
    ) -> None:
        self.arm = arm
        realised = realise(arm, effects)
        level = [0.0] * arm.n
        for law in realised.laws:
            assert law.terms[0].element is KINDS["sign"]
            level[law.along.joint] += law.terms[0].coefficient
        self._friction = [
            JointFriction(f.static + more, f.coulomb + more, f.stribeck_velocity, f.viscous + viscous)
            for f, more, viscous in zip(friction, level, realised.viscous, strict=True)
        ]
        self._plant = MultibodyPlant(0.0)
        add_links(self._plant, arm, realised)
        self._plant.Finalize()
        self._context = self._plant.CreateDefaultContext()

    def feedforward(self, q: Array, v: Array, vdot: Array, step: int) -> Array:
        """Return (n,) drive torques at q, v, vdot (n,) by the terms of the first `step` steps."""
        plant, context = self._plant, self._context
        plant.SetPositions(context, q)
        plant.SetVelocities(context, v if step > 1 else np.zeros_like(v))
        tau = -plant.CalcGravityGeneralizedForces(context)
        if step == 1:
            return np.asarray(tau + [f.static * np.sign(x) for f, x in zip(self._friction, v, strict=True)])
        tau = tau + plant.CalcBiasTerm(context) + [f.force(x) for f, x in zip(self._friction, v, strict=True)]
        if step == 3:
            tau = tau + plant.CalcMassMatrix(context) @ vdot
        return np.asarray(tau)
