"""Reference governor: the motion nearest to a reference that the drives can do, by quadratic programs (torque, its rate).

Where a reference asks for more torque than there is, or for it sooner, the drives clip: the arm falls behind, the
integrator winds up, and it overshoots. Known ahead, the shortage can be met before it comes: the reference gives way, as
little as it can. `bounded_program` holds the program; it is solved again about its own answer until that moves no more,
as the arm's torques are not linear in the deviation.

Dry friction has the sign of the reference's velocity. Where that is slower than 0.05 rad/s (m/s), or the deviation turns a
joint round, the sign is open: friction may take any value up to its level, at a price, so that torque need not jump when
a joint turns, and the level is kept in reserve for both ways.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from armloop.drake.control.bounded_program import Program
from armloop.drake.control.reference import ReferenceLike, as_reference
from armloop.drake.given import require_joints, require_model
from armloop.dynamics import ModelEquations
from armloop.experiment.excitation import Reference, TableReference
from armloop.model import ReconstructedModel
from armloop.util.arrays import Array, Mask
from armloop.util.errors import InputError
from armloop.util.functions import NUMPY
from armloop.util.given import require, shown

_ROUNDS = 40
# w of the program once a round moves the velocities farther than the one before, by how much it grows, and until when
_NEAR, _NEARER, _NEAREST = 0.3, 5.0, 1e4
_STILL = 1e-4  # rad (m), by which a round that is the last moves positions
_EXCEEDS = 0.01  # of a limit, by which the torque of the motion that was found may exceed it
_FAR = 0.3  # rad (m); beyond it, as where an arm would have to fall, nothing is near
_NONE, _REMEDY = (
    "no motion near the reference keeps the torque limits",
    "raise them or slow the reference down",
)
_SLOW = 0.05  # rad/s (m/s), slower than which a deviation may turn a joint round
_APART = 1e-5  # rad/s (m/s), rad (m), between the ends of a difference
_CREEP = 1e-9  # rad/s (m/s), where friction is that of breaking loose
_AMPLE = 10.0  # times what the reference asks for and 1 N*m (N), which stands for a torque without a limit


@dataclass(frozen=True, eq=False)
class BoundedReference:
    """A reference with a deviation from it, and the torques that keep the limits on the way."""

    reference: Reference
    deviation: TableReference
    torques: Array

    @property
    def duration(self) -> float:
        """Length in seconds."""
        return self.reference.duration

    def evaluate(self, t: ArrayLike) -> tuple[Array, Array, Array]:
        """Return q, v, vdot, each (N, n), at the times `t` (N,)."""
        q, v, vdot = (
            x + d for x, d in zip(self.reference.evaluate(t), self.deviation.evaluate(t), strict=True)
        )
        return q, v, vdot

    def torque(self, t: ArrayLike) -> Array:
        """Return (N, n) the feedforward torques at the times `t` (N,): linear between the knots, within the limits."""
        return np.stack(
            [np.interp(np.asarray(t, dtype=float), self.deviation.time, x) for x in self.torques.T], axis=1
        )


def bounded_reference(
    reference: ReferenceLike,
    model: ReconstructedModel,
    effort: ArrayLike,
    rate: ArrayLike | None = None,
    *,
    knot: float = 0.01,
) -> BoundedReference:
    """Return the motion nearest to the reference within limits of torque and of its rate, starting on it.

    model : whose torques are bounded; effort : (n,) N*m (N), inf for none; rate : (n,) N*m/s (N/s), none by default;
        knot : s

    Raises `InputError` when no motion near the reference keeps the limits, such as where gravity alone exceeds them, and
    for limits that are none.
    """
    require_model(model)
    require("a number above 0", knot=knot)
    reference = as_reference(reference)
    n, steps = model.arm.n, max(2, round(reference.duration / knot))
    effort, rate = _limits(effort, n, "effort"), _limits(np.inf if rate is None else rate, n, "rate")
    limits = f"{np.round(effort, 3).tolist()}"
    if np.isfinite(rate).any():
        limits += f" and rates {np.round(rate, 3).tolist()}"
    time = np.linspace(0.0, reference.duration, steps + 1)
    h = float(time[1])
    base = reference.evaluate(time)
    require_joints(model, base[0].shape[1], "the reference is for")
    equations = ModelEquations(model, NUMPY, sharp=True)
    dry, _, slow = _dry_friction(equations, *base)
    level = _dry_friction(equations, base[0], _CREEP + 0 * base[1], base[2])[1]
    asked = _torque(equations, *base) + _smooth_friction(equations, *base[:2])[0]
    effort = np.where(np.isinf(effort), _AMPLE * (1.0 + (np.abs(asked) + level).max(axis=0)), effort)
    d, torques, excess = np.zeros((3, steps + 1, n)), np.zeros((steps + 1, n)), np.inf
    near, moved = 0.0, np.full(2, np.inf)
    for _ in range(_ROUNDS):
        state = [x + y for x, y in zip(base, d, strict=True)]
        opened = (np.sign(state[1]) != np.sign(base[1])) & ~slow
        if moved[0] < _STILL and excess < _EXCEEDS and not opened.any():
            break
        slow |= opened
        reserve = effort - np.where(slow, level, 0.0)
        if np.any(reserve <= 0):
            raise InputError(f"{_NONE} {limits}: dry friction alone takes them; {_REMEDY}")
        # the torque about the present answer, told as a function of the whole deviation
        rigid, J = _derivatives(equations, *state)
        smooth, slope = _smooth_friction(equations, *state[:2])
        J[1] = J[1] + slope
        offset = rigid + smooth - _linear(J, d)
        program = Program(h, offset, J, effort, rate, dry, np.where(slow, level, 0.0), reserve, d[1], near)
        found = program.solve()
        if found is None or not np.abs(found.d[0]).max() < _FAR:
            raise InputError(f"{_NONE} {limits}; {_REMEDY}")
        moved, before = np.abs(found.d[:2] - d[:2]).max(axis=(1, 2)), moved
        if moved[1] > before[1] and near <= _NEAREST:
            near, moved = near * _NEARER or _NEAR, before
            continue
        d, torques = found.d, found.torque
        # what the program took to be linear in the deviation is not
        state = [x + y for x, y in zip(base, d, strict=True)]
        smooth = _torque(equations, *state) + _smooth_friction(equations, *state[:2])[0]
        needed = torques + smooth - offset - _linear(J, d)
        excess = float((np.abs(needed) / effort).max()) - 1
    if excess >= _EXCEEDS:
        raise InputError(
            f"{_NONE} {limits}, or none was found: the nearest that was needs {1 + excess:.2g} times as much; {_REMEDY}"
        )
    return BoundedReference(reference, TableReference(time, *d), torques)


def _limits(given: ArrayLike, n: int, what: str) -> Array:
    """Return (n,) limits, of one for all joints or one for each; raises `InputError` unless they are above 0."""
    found = np.asarray(given)
    if found.dtype.kind not in "fiu" or found.shape not in ((), (n,)) or not (found > 0).all():
        raise InputError(
            f"{what} must be above 0, one number or one for each of {n} joints; it is {shown(given)}"
        )
    return np.broadcast_to(found, n).astype(float)


def _linear(J: list[Array], d: Array) -> Array:
    """Return (K, n) what derivatives (K, n, n) by the deviation and its rates (3, K, n) come to."""
    return np.asarray(sum(np.einsum("kij,kj->ki", each, x) for each, x in zip(J, d, strict=True)))


def _torque(equations: ModelEquations, q: Array, v: Array, vdot: Array) -> Array:
    columns = equations.rigid(*(list(x.T) for x in (q, v, vdot)))
    return np.stack([np.broadcast_to(x, len(q)) for x in columns], axis=1)


def _derivatives(equations: ModelEquations, q: Array, v: Array, vdot: Array) -> tuple[Array, list[Array]]:
    """Return torques (K, n) without friction, and their derivatives (K, n, n) by q, v and vdot."""
    n, state, J = q.shape[1], (q, v, vdot), []
    for which in range(3):
        columns = []
        for e in np.eye(n):
            ends = [
                _torque(
                    equations, *(x + (s * _APART * e if a == which else 0.0) for a, x in enumerate(state))
                )
                for s in (1.0, -1.0)
            ]
            columns.append((ends[0] - ends[1]) / (2 * _APART))
        J.append(np.stack(columns, axis=2))
    return _torque(equations, q, v, vdot), J


def _dry_friction(equations: ModelEquations, q: Array, v: Array, vdot: Array) -> tuple[Array, Array, Mask]:
    """Return the dry friction (K, n), its level, and where the sliding is too slow to tell its sign."""
    dry, level, slow = np.zeros_like(v), np.zeros_like(v), np.zeros(v.shape, dtype=bool)
    columns = [list(x.T) for x in (q, v, vdot)]
    load = equations.load(*columns) if equations.load_matters else None
    for along, size, _ in equations.dry_and_smooth(columns[0], columns[1], load):
        w = along.of(columns[1])
        for joint, part in ((along.joint, 1.0), (along.other, along.ratio)):
            if part:
                dry[:, joint] += part * size * np.sign(w)
                level[:, joint] += np.abs(part * size)
                slow[:, joint] |= np.abs(w) < _SLOW
    return dry, level, slow


def _smooth_friction(equations: ModelEquations, q: Array, v: Array) -> tuple[Array, Array]:
    """Return the smooth part of friction (K, n), such as drag, and its derivative by v (K, n, n).

    Slower than `_SLOW`, where some laws are infinitely steep, it is the straight line from one way to the other.
    """
    K, n = v.shape
    tau, slope, columns = np.zeros((K, n)), np.zeros((K, n, n)), list(q.T)
    for index, (along, *_) in enumerate(equations.dry_and_smooth(columns, list(v.T))):
        slow = np.abs(v[:, along.joint]) < _SLOW
        speeds, smooth = [], []
        for way in (-1.0, 1.0):
            ahead = list(v.T)
            ahead[along.joint] = np.where(slow, way * _SLOW, ahead[along.joint] + way * _APART)
            speeds.append(along.of(ahead))
            smooth.append(equations.dry_and_smooth(columns, ahead)[index][2])
        rate = (smooth[1] - smooth[0]) / (speeds[1] - speeds[0])
        for joint, part in ((along.joint, 1.0), (along.other, along.ratio)):
            if part:
                tau[:, joint] += part * (smooth[0] + rate * (along.of(list(v.T)) - speeds[0]))
                slope[:, joint, along.joint] += part * rate
                slope[:, joint, along.other] += part * along.ratio * rate
    return tau, slope
