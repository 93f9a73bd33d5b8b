"""How much room a PID loop has before it rings: margins of each joint's loop about a posture.

The arm at rest at q0 is linearised, M(q0) dv + F dq' + G(q0) dq = du, with F the viscous friction and G the
stiffness of gravity. Dry friction is not linear and left out: it only adds damping where the joint slides.
The controller is discrete, so the arm is sampled with a zero-order hold. The loop of joint i is cut at its
drive while the other joints' loops stay closed, and judged from frequency-response data up to the Nyquist
frequency.
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

    gain_margin : factor above 1 by which the gains may grow (inf: any)
    gain_reduction : factor below 1 to which they may shrink (0: any); an arm that gravity tips over needs
        some gain
    phase_margin : deg
    bandwidth : rad/s, where the closed loop's gain first falls to 0.707; inf if it does not below Nyquist
    sensitivity_peak : largest |1 / (1 + L)|; below 2 is comfortable
    """

    gain_margin: float
    gain_reduction: float
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
    points: int = 2000,
) -> list[LoopMargins]:
    """Return the margins of every joint's loop at posture q0 (n,).

    period : s of the controller; points : frequencies looked at, up to Nyquist
    """
    n = arm.n
    M, F, G = posture_model(arm, friction, q0)
    inverse = np.linalg.inv(M)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ G, -inverse @ F]])
    B = np.vstack([np.zeros((n, n)), inverse])
    sampled = control.sample_system(control.ss(A, B, np.eye(2 * n), np.zeros((2 * n, n))), period, "zoh")
    w = np.geomspace(1e-2, np.pi / period, points)
    z = np.exp(1j * w * period)
    X = np.linalg.solve(
        z[:, None, None] * np.eye(2 * n) - sampled.A, np.broadcast_to(sampled.B, (points, 2 * n, n))
    )
    # The controller's law, with the sum that stands for the integral.
    position = gains.kp + gains.ki * period / (z[:, None] - 1)
    L = position[:, :, None] * X[:, :n] + gains.kd[:, None] * X[:, n:]  # (points, n, n)
    return [_margins(_cut(L, i), w) for i in range(n)]


def _cut(L: Array, i: int) -> Array:
    """Return (W,) joint i's loop with the others closed, out of the open loops L (W, n, n)."""
    others = np.arange(L.shape[1]) != i
    closed = np.eye(int(others.sum())) + L[:, others][:, :, others]
    answer = np.linalg.solve(closed, L[:, others, i][:, :, None])[:, :, 0]
    return np.asarray(L[:, i, i] - np.einsum("wk,wk->w", L[:, i, others], answer))


def _margins(L: Array, w: Array) -> LoopMargins:
    loop = control.FrequencyResponseData(L[None, None], w)
    gain_margins, phase_margins, *_ = control.stability_margins(loop, returnall=True)
    factors = list(gain_margins)
    if L[-1].real < 0:  # at Nyquist the loop is real: a crossing on the edge, which the search cannot see
        factors.append(-1.0 / L[-1].real)
    below = np.flatnonzero(np.abs(L / (1 + L)) < np.sqrt(0.5))
    return LoopMargins(
        gain_margin=float(min((f for f in factors if f > 1), default=np.inf)),
        gain_reduction=float(max((f for f in factors if f < 1), default=0.0)),
        phase_margin=float(min(np.abs(phase_margins), default=np.inf)),
        bandwidth=float(w[below[0]]) if len(below) else float("inf"),
        sensitivity_peak=float(np.abs(1 / (1 + L)).max()),
    )
