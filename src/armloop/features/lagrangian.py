"""The Lagrangian library: candidate terms of the energies, shared by all joints, instead of torques per joint.

A candidate is f(q) v_i v_j in the kinetic energy T or f(q) in the potential energy U, where f is the cosine
or the sine of an integer combination of the revolute coordinates times powers of the prismatic ones. Its
column of torques follows from the Euler-Lagrange equations

    tau_m = d/dt(dT/dv_m) - dT/dq_m + dU/dq_m,

so that every torque that the library can express conserves energy and has a symmetric mass matrix.

What can occur in a chain of rigid links, and therefore is a candidate:

- M_ij (i <= j) does not depend on q_1 … q_i: moving all that lies beyond joint i about or along its axis leaves
  it as it is. In particular q_1 is in no term of T.
- M_ij is of first degree (|k| <= 1, q_p) in the joints from i + 1 to j, which only turn one axis against the other,
  and of second degree (|k| <= 2, q_p^2) in those beyond j, which shape the inertia they carry.
- U is of first degree in every joint, and free of q_1 where gravity does not see that joint move.
- Neighbouring joints with parallel axes turn what lies beyond by the sum of their angles (the difference, of axes that
  point against each other): a link's direction is a wave of q_a + … + q_m, from the first joint a of the parallel ones.
  U, which is linear in the directions of the links, has one such sum of them, T two, added or subtracted. Two parallel axes
  have no weight of cos(q_1 - q_2), whatever their links are.

Up to four joints this is all there is. Beyond, a term of T reaches over at most three neighbouring joints, or
over four if all of them take part and the degree does not rise outwards (a short lever turned by a long one);
terms that reach further exist, but are products of more offsets than arms have large ones.

Waves are sparse where axes are parallel, as in SCARA and UR arms. Where every axis crosses the one before, a single
product of sines is a sum of many waves: seven such joints need more terms, and far more data, than base parameters do.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray

from armloop.data.motion import Motion
from armloop.features.double_feature_set import phase_name
from armloop.robot.arm import Arm
from armloop.util.arrays import Array, Index, Mask

#: Rows of columns evaluated at once.
_CHUNK = 256
#: Neighbouring joints that any term of T may reach over, and those that a term may if its degree falls outwards.
_REACH, _FALLING_REACH = 3, 4
#: Cosine of the angle between axes that count as parallel: those of a calibrated URDF are some thousandths of a radian off.
_PARALLEL = float(np.cos(0.02))


@dataclass(frozen=True, eq=False)
class EnergyTerms:
    """Terms of T and U for an arm with n joints.

    Attributes:
        revolute: (n,) which joints turn.
        degrees: (p, n) of the function f: the multiple of q in the phase for a revolute joint, the power of q
            for a prismatic one.
        sine: (p,) whether f is the sine of the phase, not the cosine.
        speeds: (p, 2) the joints i <= j (0-based) whose speeds are factors; -1, -1 for a term of U.
    """

    revolute: Mask
    degrees: NDArray[np.int_]
    sine: Mask
    speeds: NDArray[np.int_]

    @property
    def count(self) -> int:
        """The number p of terms."""
        return len(self.sine)

    @property
    def potential(self) -> Mask:
        """(p,) which terms belong to U."""
        return np.asarray(self.speeds[:, 0] < 0)

    @property
    def acts(self) -> Mask:
        """(n, p) which joints' torque each term appears in."""
        joints = np.arange(len(self.revolute))[:, None]
        return (self.degrees.T != 0) | (joints == self.speeds[:, 0]) | (joints == self.speeds[:, 1])

    @property
    def names(self) -> list[str]:
        """Readable names such as ``cos(2*q2 + q3)*v1^2``, joints counted from 1."""
        return [self._name(t) for t in range(self.count)]

    def take(self, index: Index) -> EnergyTerms:
        """Some of the terms."""
        return EnergyTerms(self.revolute, self.degrees[index], self.sine[index], self.speeds[index])

    def columns(self, motion: Motion) -> Array:
        """(N, n, p) torques per unit of every term."""
        out = np.empty((motion.samples, len(self.revolute), self.count))
        for start in range(0, motion.samples, _CHUNK):
            part = slice(start, start + _CHUNK)
            self._torques(motion.q[part], motion.v[part], motion.vdot[part], out[part])
        return out

    def mass(self, q: Array) -> Array:
        """(N, n, n, p) mass matrices per unit of every term at postures q (N, n)."""
        n = len(self.revolute)
        values, _ = self._functions(q)
        out = np.zeros((len(q), n, n, self.count))
        for t in np.flatnonzero(~self.potential):
            i, j = self.speeds[t]
            out[:, i, j, t] += values[:, t]
            out[:, j, i, t] += values[:, t]
        return out

    @cached_property
    def _waves(self) -> tuple[NDArray[np.int_], Index]:
        """The different wave vectors (w, n), and which of them each term has: terms share them."""
        waves, which = np.unique(self.degrees * self.revolute, axis=0, return_inverse=True)
        return waves, which.ravel()

    def _functions(self, q: Array) -> tuple[Array, list[Array | None]]:
        """(N, p) values of f, and for each joint its derivative (N, p), None where no term has the joint."""
        waves, which = self._waves
        phase = q @ waves.T
        sine, cosine = np.sin(phase)[:, which], np.cos(phase)[:, which]
        f = np.where(self.sine, sine, cosine)
        slope = np.where(self.sine, cosine, -sine)
        powers = [(p, self.degrees[:, p]) for p in np.flatnonzero(~self.revolute) if self.degrees[:, p].any()]
        factors = {p: q[:, [p]] ** power for p, power in powers}
        polynomial = np.prod(list(factors.values()), axis=0) if factors else np.ones((1, self.count))
        derivatives: list[Array | None] = [None] * len(self.revolute)
        for r in np.flatnonzero(self.revolute & self.degrees.any(axis=0)):
            derivatives[r] = self.degrees[:, r] * slope * polynomial
        for p, power in powers:
            rest = np.prod([f, *(factor for other, factor in factors.items() if other != p)], axis=0)
            derivatives[p] = rest * power * q[:, [p]] ** np.maximum(power - 1, 0)
        return f * polynomial, derivatives

    def _torques(self, q: Array, v: Array, vdot: Array, out: Array) -> None:
        f, derivatives = self._functions(q)
        rate = np.zeros_like(f)
        for m, derivative in enumerate(derivatives):
            if derivative is not None:
                rate += derivative * v[:, [m]]
        first, second = self.speeds.T
        speeds = np.where(self.potential, -1.0, v[:, first] * v[:, second])
        for m, derivative in enumerate(derivatives):
            out[:, m] = 0.0 if derivative is None else -derivative * speeds
            for own, other in ((first, second), (second, first)):
                t = np.flatnonzero(own == m)
                out[:, m, t] += rate[:, t] * v[:, other[t]] + f[:, t] * vdot[:, other[t]]

    def _name(self, t: int) -> str:
        degrees = self.degrees[t]
        phase = phase_name(degrees * self.revolute).replace("+", " + ").replace("-", " - ")
        parts = [f"{'sin' if self.sine[t] else 'cos'}({phase})"] if phase else []
        for m in np.flatnonzero(degrees * ~self.revolute):
            parts.append(f"q{m + 1}" + (f"^{degrees[m]}" if degrees[m] > 1 else ""))
        i, j = self.speeds[t]
        if i >= 0:
            parts.append(f"v{i + 1}^2" if i == j else f"v{i + 1}*v{j + 1}")
        return "*".join(parts)


def candidates(arm: Arm) -> EnergyTerms:
    """All candidates for an arm's structure (joint kinds, directions of axes and gravity; no lengths, no masses).

    The first n are the constant inertias v_i^2 of the joints: every joint has one.
    """
    n, revolute = arm.n, arm.revolute
    rows: list[tuple[tuple[int, ...], bool, tuple[int, int]]] = []
    parallel = parallel_axes(arm)
    none = (0,) * n
    rows += [(none, False, (j, j)) for j in range(n)]
    for i in range(n):
        for j in range(i, n):
            limits = [0] * (i + 1) + [1] * (j - i) + [2] * (n - 1 - j)
            for degrees in _degrees(limits, revolute):
                if (
                    (degrees != none or i != j)
                    and _within_reach(degrees, n)
                    and _turns(degrees, parallel) <= 2
                ):
                    rows += [(degrees, sine, (i, j)) for sine in _phases(degrees, revolute)]
    if arm.gravity.any():
        limits = [1] * n
        limits[0] = int(gravity_sees_first_joint(arm))
        for degrees in _degrees(limits, revolute):
            if degrees != none and _turns(degrees, parallel) <= 1:
                rows += [(degrees, sine, (-1, -1)) for sine in _phases(degrees, revolute)]
    return EnergyTerms(
        np.asarray(revolute, dtype=bool),
        np.array([row[0] for row in rows]),
        np.array([row[1] for row in rows]),
        np.array([row[2] for row in rows]),
    )


def _degrees(limits: list[int], revolute: Mask) -> Iterator[tuple[int, ...]]:
    """Degrees within limits; of a wave vector and its negative only the one that starts with a positive entry."""
    ranges = [range(-x if turns else 0, x + 1) for x, turns in zip(limits, revolute, strict=True)]
    for degrees in product(*ranges):
        wave = [k for k, turns in zip(degrees, revolute, strict=True) if turns and k]
        if not wave or wave[0] > 0:
            yield degrees


def _phases(degrees: tuple[int, ...], revolute: Mask) -> tuple[bool, ...]:
    """Cosine and sine, but only the cosine (one) where no revolute joint takes part."""
    waves = any(k for k, turns in zip(degrees, revolute, strict=True) if turns)
    return (False, True) if waves else (False,)


def parallel_axes(arm: Arm) -> list[dict[int, int]]:
    """Revolute joints (0-based) in runs with parallel axes, each with 1, or -1 where its axis points against the first's."""
    found: list[tuple[dict[int, int], Array]] = []
    R = np.eye(3)
    for j in range(arm.n):
        R = R @ arm.X_PF[j, :3, :3]
        axis = R @ arm.axis[j]
        along = float(found[-1][1] @ axis) if found else 0.0
        if not arm.revolute[j]:
            continue
        if abs(along) > _PARALLEL:
            found[-1][0][j] = 1 if along > 0 else -1
        else:
            found.append(({j: 1}, axis))
    return [run for run, _ in found]


def _turns(degrees: tuple[int, ...], parallel: list[dict[int, int]]) -> int:
    """How many directions of links a wave is a product of, at the most in one run of parallel joints.

    Sums of the angles from the first joint of a run on, added or subtracted: each ends at one joint.
    """
    most = 0
    for run in parallel:
        own = [sign * degrees[j] for j, sign in run.items()]
        most = max(most, sum(abs(one - beyond) for one, beyond in zip(own, [*own[1:], 0], strict=True)))
    return most


def _within_reach(degrees: tuple[int, ...], n: int) -> bool:
    used = [m for m, degree in enumerate(degrees) if degree]
    if n <= 4 or not used:
        return True
    reach = used[-1] - used[0] + 1
    sizes = [abs(degrees[m]) for m in used]
    falling = reach == len(used) and sizes == sorted(sizes, reverse=True)
    return reach <= _REACH or (falling and reach <= _FALLING_REACH)


def gravity_sees_first_joint(arm: Arm) -> bool:
    """Whether moving the whole arm by its first joint changes its height."""
    axis = arm.X_PF[0, :3, :3] @ arm.axis[0]
    change = np.cross(axis, arm.gravity) if arm.revolute[0] else axis @ arm.gravity
    return bool(np.linalg.norm(change) > 1e-9 * np.linalg.norm(arm.gravity))


def constant_weights(arm: Arm) -> list[int]:
    """Sliding joints (0-based) that lift the same weight at all postures: a constant force, as an offset of friction is."""
    found, R = [], np.eye(3)
    for j in range(arm.n):
        R = R @ arm.X_PF[j, :3, :3]
        axis = R @ arm.axis[j]
        turned, lifted = np.linalg.norm(np.cross(axis, arm.gravity)), abs(axis @ arm.gravity)
        if arm.revolute[j] and turned > 1e-9 * np.linalg.norm(arm.gravity):
            break  # what lies beyond is turned against gravity
        if not arm.revolute[j] and lifted > 1e-9 * np.linalg.norm(arm.gravity):
            found.append(j)
    return found
