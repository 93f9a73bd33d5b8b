"""Stability margins of each joint's PID loop about a posture: how much room it has before it rings.

The arm at rest at q0 is linearised by Drake, M(q0) dv + F dq' + G(q0) dq = du, with F the viscous friction and G the
stiffness of gravity. Dry friction is not linear and left out: it only adds damping where the joint slides.
The controller is discrete, so the arm is sampled with a zero-order hold. The loop of joint i is cut at its
drive while the other joints' loops stay closed, and judged from frequency-response data up to the Nyquist
frequency.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import control
import numpy as np
from numpy.typing import ArrayLike
from pydrake.autodiffutils import AutoDiffXd, InitializeAutoDiff
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.primitives import Linearize

from armloop.drake.control.pid import PidGains
from armloop.drake.plant.fault_injection import Effects, realise
from armloop.drake.plant.friction import JointFriction
from armloop.drake.plant.plant import add_links
from armloop.drake.scalars import functions_of
from armloop.dynamics import ModelEquations
from armloop.model import ReconstructedModel
from armloop.robot.arm import Arm
from armloop.util.arrays import Array
from armloop.util.functions import MATH


@dataclass(frozen=True)
class LoopMargins:
    """One joint's loop.

    gain_margin : factor above 1 by which the gains may grow (inf: any)
    gain_reduction : factor below 1 to which they may shrink (0: any); an arm that gravity tips over needs
        some gain
    phase_margin : deg
    bandwidth : rad/s, where the closed loop's gain first falls to 0.707; inf if it does not below Nyquist
    sensitivity_peak : largest |1 / (1 + L)|; below 2 is comfortable

    Where the closed loop is not stable there is no margin and no peak: they are NaN, and only the gain reduction says
    how far the gains must shrink.
    """

    gain_margin: float
    gain_reduction: float
    phase_margin: float
    bandwidth: float
    sensitivity_peak: float


def posture_model(
    arm: Arm, friction: Sequence[JointFriction], q0: ArrayLike, effects: Effects = ()
) -> tuple[Array, Array, Array]:
    """Return M, F, G (n, n) of the arm linearised at rest at q0 (n,) by Drake's `Linearize`.

    effects : that it has, too; of these payloads, rotors, a tilt and viscous friction count
    """
    has = realise(arm, effects)
    plant = MultibodyPlant(0.0)
    add_links(plant, arm, has)
    for joint, f, more in zip(arm.joints, friction, has.viscous, strict=True):
        plant.GetJointByName(joint.name).set_default_damping(f.viscous + more)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, np.asarray(q0, dtype=float))
    torque, n = plant.get_applied_generalized_force_input_port(), arm.n
    # at rest under the torques that hold it
    torque.FixValue(context, -plant.CalcGravityGeneralizedForces(context))
    linear = Linearize(plant, context, torque.get_index(), plant.get_state_output_port().get_index())
    M = np.linalg.inv(linear.B()[n:])
    return M + np.diag(has.rotor_inertia), -M @ linear.A()[n:, n:], -M @ linear.A()[n:, :n]


def model_posture(model: ReconstructedModel, q0: ArrayLike) -> tuple[Array, Array, Array]:
    """Return M, F, G (n, n) of an identified model at rest at q0 (n,), as `posture_model` does of the arm itself.

    F is the derivative of the model's friction at 1 rad/s (0.1 m/s), where dry friction is level, the mean of both ways.
    """
    equations = ModelEquations(model, MATH, symmetric=True)
    q, n = np.asarray(q0, dtype=float).tolist(), model.arm.n
    speed = np.where(model.arm.revolute, 1.0, 0.1)
    slopes = ModelEquations(model, functions_of(AutoDiffXd))
    ways = [slopes.friction(InitializeAutoDiff(way * speed).ravel().tolist(), q=q) for way in (1.0, -1.0)]
    rates = [
        [x.derivatives() if isinstance(x, AutoDiffXd) else np.zeros(n) for x in friction] for friction in ways
    ]
    F = np.mean(rates, axis=0)
    h, columns = 1e-5, []
    for e in np.eye(n):
        ahead, behind = (equations.gravity((np.array(q) + s * h * e).tolist()) for s in (1.0, -1.0))
        columns.append((np.array(ahead, dtype=float) - np.array(behind, dtype=float)) / (2 * h))
    return np.array(equations.mass_matrix(q), dtype=float), F, np.stack(columns, axis=1)


@dataclass(frozen=True, eq=False)
class SampledArm:
    """An arm about a posture under torques held over each period: x+ = A x + B u, x = (dq, dq').

    A : (2n, 2n); B : (2n, n); period : s
    """

    A: Array
    B: Array
    period: float

    @staticmethod
    def of(linear: tuple[Array, Array, Array], period: float) -> SampledArm:
        """Sample M, F, G with a zero-order hold."""
        M, F, G = linear
        n = len(M)
        inverse = np.linalg.inv(M)
        A = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ G, -inverse @ F]])
        B = np.vstack([np.zeros((n, n)), inverse])
        sampled = control.sample_system(control.ss(A, B, np.eye(2 * n), np.zeros((2 * n, n))), period, "zoh")
        return SampledArm(np.asarray(sampled.A), np.asarray(sampled.B), period)

    def frequencies(self, points: int) -> Array:
        """Return (points,) rad/s up to Nyquist."""
        return np.geomspace(1e-2, np.pi / self.period, points)

    def response(self, w: Array) -> Array:
        """Return (W, 2n, n), the state's answer to torques at frequencies w (W,)."""
        z = np.exp(1j * w * self.period)
        size = len(self.A)
        return np.asarray(
            np.linalg.solve(
                z[:, None, None] * np.eye(size) - self.A, np.broadcast_to(self.B, (len(w), *self.B.shape))
            )
        )

    def loops(self, gains: PidGains, w: Array) -> Array:
        """Return (W, n, n) open loops of PID: what the controllers of the rows answer to torques of the columns."""
        X, n = self.response(w), len(gains.kp)
        # The controller's law, with the sum that stands for the integral.
        position = gains.kp + gains.ki * self.period / (np.exp(1j * w * self.period)[:, None] - 1)
        return np.asarray(position[:, :, None] * X[:, :n] + gains.kd[:, None] * X[:, n:])

    def closed(self, gains: PidGains) -> tuple[Array, Array]:
        """Return A (3n, 3n) and B (3n, n) of the closed loop: state dq, dq', sum of errors; input the reference's dq."""
        n = len(gains.kp)
        kp, ki, kd, h = np.diag(gains.kp), np.diag(gains.ki), np.diag(gains.kd), self.period
        A = np.block(
            [
                [self.A - self.B @ np.hstack([kp, kd]), self.B @ ki],
                [-h * np.eye(n), np.zeros((n, n)), np.eye(n)],
            ]
        )
        return A, np.vstack([self.B @ kp, h * np.eye(n)])

    def is_stable(self, gains: PidGains) -> bool:
        """Tell whether every mode of the closed loop decays; a sum of errors that nothing answers to is no mode of it."""
        kept = np.append(np.ones(len(self.A), dtype=bool), np.asarray(gains.ki) != 0)
        modes = np.linalg.eigvals(self.closed(gains)[0][np.ix_(kept, kept)])
        return bool(np.abs(modes).max() < 1 - 1e-9)


def sampled_margins(sampled: SampledArm, gains: PidGains, *, points: int = 2000) -> list[LoopMargins]:
    """Return the margins of every joint's loop of a sampled arm, from so many frequencies up to Nyquist."""
    w = sampled.frequencies(points)
    L = sampled.loops(gains, w)
    found = [_margins(cut_loop(L, i), w) for i in range(len(gains.kp))]
    if sampled.is_stable(gains):
        return found
    return [replace(m, gain_margin=np.nan, phase_margin=np.nan, sensitivity_peak=np.nan) for m in found]


def cut_loop(L: Array, i: int) -> Array:
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
