"""How much room a PID loop has before it rings: margins of each joint's loop about a posture.

The arm at rest at q0 is linearised, M(q0) dv + F dq' + G(q0) dq = du, with F the viscous friction and G the stiffness
of gravity. Dry friction is not linear and left out: it only adds damping where the joint slides. The loop of joint i
is cut at its drive while the other joints' loops stay closed, and judged from frequency-response data.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import control
import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.multibody.plant import MultibodyPlant

from armloop.arm import Arm
from armloop.drake_systems.friction import JointFriction
from armloop.drake_systems.pid import PidGains
from armloop.drake_systems.plant import add_links

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LoopMargins:
    """One joint's loop.

    gain_margin : factor by which the gains may grow (inf: any); phase_margin : deg
    bandwidth : rad/s, where the closed loop's gain falls 3 dB below its gain at low frequency
    sensitivity_peak : largest |1 / (1 + L)|; below 2 is comfortable
    """

    gain_margin: float
    phase_margin: float
    bandwidth: float
    sensitivity_peak: float


def posture_model(arm: Arm, friction: Sequence[JointFriction], q0: ArrayLike) -> tuple[Array, Array, Array]:
    """Return M, F, G (n, n) of the arm linearised at rest at q0 (n,)."""
    plant = MultibodyPlant(0.0)
    add_links(plant, arm)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    q0 = np.asarray(q0, dtype=float)

    def gravity(q: Array) -> Array:
        plant.SetPositions(context, q)
        return np.asarray(-plant.CalcGravityGeneralizedForces(context))

    h = 1e-5
    G = np.stack([(gravity(q0 + h * e) - gravity(q0 - h * e)) / (2 * h) for e in np.eye(arm.n)], axis=1)
    plant.SetPositions(context, q0)
    return np.asarray(plant.CalcMassMatrix(context)), np.diag([f.viscous for f in friction]), G


def loop_margins(
    arm: Arm,
    friction: Sequence[JointFriction],
    gains: PidGains,
    q0: ArrayLike,
    *,
    period: float = 1e-3,
    omega: ArrayLike | None = None,
) -> list[LoopMargins]:
    """Return the margins of every joint's loop at posture q0 (n,).

    period : s of the controller, whose hold delays by half of it; omega : rad/s, rising, the frequencies looked at
    """
    w = np.geomspace(1e-2, 0.9 * np.pi / period, 4000) if omega is None else np.asarray(omega, dtype=float)
    M, F, G = posture_model(arm, friction, q0)
    s = 1j * w[:, None, None]
    stiffness = s**2 * M + s * F + G  # (W, n, n), from position to torque
    hold = np.exp(-0.5j * w * period)[:, None]
    C = hold * (gains.kp + gains.ki / s[:, :, 0] + gains.kd * s[:, :, 0])  # (W, n)
    margins = []
    for i in range(arm.n):
        others = C * (np.arange(arm.n) != i)
        response = np.linalg.inv(stiffness + others[:, :, None] * np.eye(arm.n))[:, i, i]
        margins.append(_margins(C[:, i] * response, w))
    return margins


def _margins(L: Array, w: Array) -> LoopMargins:
    loop = control.FrequencyResponseData(L[None, None], w, smooth=True)
    gain_margin, phase_margin, *_ = control.stability_margins(loop)
    closed = np.abs(L / (1 + L))
    below = np.flatnonzero(closed < closed[0] / np.sqrt(2.0))
    bandwidth = float(w[below[0]]) if len(below) else float("inf")
    return LoopMargins(float(gain_margin), float(phase_margin), bandwidth, float(np.abs(1 / (1 + L)).max()))
