"""The rigid-body library: base parameters, the combinations of link inertias that the torques reveal.

The torques of a rigid arm are linear in ten inertial parameters a link, and in one rotor inertia a joint
(the motor's, seen through the gear: tau_i = J_i vdot_i; in geared arms it rivals the links' own). Many of
them act only in sums. The base parameters are a smallest set of sums that determines all torques; their
columns have full rank. They are found numerically, by QR decompositions of the regressor on random
motion (Gautier, "Numerical calculation of the base inertial parameters of robots", J. Robotic Systems
8(4), 1991), for any chain of revolute and prismatic joints.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from armloop.data.motion import Motion
from armloop.regression.determined import combination
from armloop.robot.arm import Arm
from armloop.robot.kinematics import LINK_PARAMETERS, regressor
from armloop.util.arrays import Array, Index, Mask

#: Within a link, what to keep first when one of several parameters must stand for the sum.
_PREFERENCE = ("mx", "my", "mz", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz", "m")
#: Columns that differ by less than this, relative to their size, are one: URDFs write pi to seven digits or more.
_TOLERANCE = 1e-6
_EXCITATION = 200


def parameter_names(n: int, rotors: bool = False) -> list[str]:
    """Names of the full parameters of n links, ``m1, mx1, ... Iyz1, m2, ...``, then rotors ``J1 ... Jn``."""
    links = [f"{name}{link + 1}" for link in range(n) for name in LINK_PARAMETERS]
    return links + (rotor_names(n) if rotors else [])


def rotor_names(n: int) -> list[str]:
    """Names of the rotor inertias of n joints."""
    return [f"J{joint + 1}" for joint in range(n)]


def full_columns(arm: Arm, motion: Motion, rotors: bool = False) -> Array:
    """Torques per unit of every full parameter, (N, n, 10 n), or (N, n, 11 n) with rotor inertias."""
    columns = regressor(arm, motion.q, motion.v, motion.vdot)
    if not rotors:
        return columns
    return np.concatenate([columns, motion.vdot[:, :, None] * np.eye(arm.n)], axis=2)


def random_motion(n: int, samples: int, seed: int = 0) -> Motion:
    """A motion that excites every parameter: positions within half a turn, speeds of a few rad/s, accelerations likewise."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(-np.pi, np.pi, (samples, n))
    v, vdot = rng.normal(size=(2, samples, n))
    return Motion(np.arange(float(samples)), q, v, 3 * vdot)


@dataclass(frozen=True, eq=False)
class BaseParameters:
    """r sums of the P full parameters that determine the torques: ``base = grouping @ full``.

    Each sum is led by one kept parameter with coefficient one, and the kept parameter's column of the
    regressor is the column of the sum: ``full_columns == full_columns[:, :, kept] @ grouping``.

    Attributes:
        kept: (r,) indices of the leading parameters among the full ones, rising.
        grouping: (r, P) the sums.
        rotors: whether the full parameters include the joints' rotor inertias.
    """

    kept: Index
    grouping: Array
    rotors: bool = False

    @classmethod
    def of_arm(cls, arm: Arm, rotors: bool = False, seed: int = 0) -> BaseParameters:
        """The base parameters of an arm's structure, from its regressor on random motion.

        Sums are led by parameters near the base: a link's mass is shared out over the links before it,
        as is usual. Which parameters can be seen depends on ``arm.gravity`` too.
        """
        return _base_parameters(_Structure.of(arm), rotors, seed)

    @property
    def count(self) -> int:
        """The number r of base parameters."""
        return len(self.kept)

    @property
    def positive(self) -> Mask:
        """(r,) sums that no arm makes negative: of masses, principal and rotor inertias, each times a positive number."""
        links = self.grouping.shape[1] // (11 if self.rotors else 10)
        never = [name in ("m", "Ixx", "Iyy", "Izz") for _ in range(links) for name in LINK_PARAMETERS]
        never += [True] * (links if self.rotors else 0)
        return np.asarray(((self.grouping == 0) | ((self.grouping > 0) & np.array(never))).all(axis=1))

    @property
    def names(self) -> list[str]:
        """Every sum in readable form, such as ``"Izz1 + Iyy2 + 0.376 m3"`` (SI units)."""
        labels = parameter_names(self.grouping.shape[1] // (11 if self.rotors else 10), self.rotors)
        return [
            combination(row, labels, int(lead)) for row, lead in zip(self.grouping, self.kept, strict=True)
        ]

    def columns(self, arm: Arm, motion: Motion) -> Array:
        """(N, n, r) torques per unit of every base parameter."""
        return full_columns(arm, motion, self.rotors)[:, :, self.kept]

    def from_full(self, full: Array) -> Array:
        """(r,) base parameters of (P,) full ones."""
        return self.grouping @ full

    def to_full(self, base: Array, nominal: Array | None = None) -> Array:
        """The (P,) full parameters nearest to ``nominal`` (zero by default) that have these base parameters.

        They give the same torques as every other choice, but a link alone need not be physical.
        """
        start = np.zeros(self.grouping.shape[1]) if nominal is None else np.asarray(nominal, dtype=float)
        change = np.linalg.lstsq(self.grouping, base - self.grouping @ start, rcond=None)[0]
        return np.asarray(start + change)


@dataclass(frozen=True)
class _Structure:
    """An arm by what its regressor depends on, so that arms that agree in that are one."""

    arm: Arm = field(compare=False)
    kinds: tuple[str, ...]
    numbers: bytes

    @staticmethod
    def of(arm: Arm) -> _Structure:
        numbers = (np.ascontiguousarray(x, dtype=float).tobytes() for x in (arm.X_PF, arm.axis, arm.gravity))
        return _Structure(arm, tuple(joint.kind for joint in arm.joints), b"".join(numbers))


@lru_cache(maxsize=512)
def _base_parameters(structure: _Structure, rotors: bool, seed: int) -> BaseParameters:
    """Memoization of :meth:`BaseParameters.of_arm`: each check of a record, and each step of a fit, asks for its arm's."""
    arm = structure.arm
    columns = full_columns(arm, random_motion(arm.n, _EXCITATION, seed), rotors)
    rows = columns.reshape(-1, columns.shape[2])
    within = [LINK_PARAMETERS.index(name) for name in _PREFERENCE]
    order = [10 * link + index for link in range(arm.n) for index in within]
    kept = _independent(rows, [*order, *range(10 * arm.n, rows.shape[1])])
    grouping: Array = np.linalg.lstsq(rows[:, kept], rows, rcond=None)[0].astype(float)
    grouping[np.abs(grouping) < _TOLERANCE] = 0.0
    grouping[:, kept] = np.eye(len(kept))
    for shared in (kept, grouping):
        shared.setflags(write=False)
    return BaseParameters(kept, grouping, rotors)


def _independent(rows: Array, order: list[int]) -> Index:
    """Indices, rising, of the columns that are not sums of those before them in ``order``."""
    basis = np.empty((min(rows.shape), len(rows)))  # a unit vector a row
    kept: list[int] = []
    sizes = np.linalg.norm(rows, axis=0)
    for index in order:
        column, size = rows[:, index], sizes[index]
        if size <= _TOLERANCE * sizes.max():  # what no torque feels is round-off, not exactly zero
            continue
        own, known = column / size, basis[: len(kept)]
        for _ in range(2):  # Gram-Schmidt twice is orthogonal to machine precision
            own -= (known @ own) @ known
        left = np.linalg.norm(own)
        if left > _TOLERANCE:
            basis[len(kept)] = own / left
            kept.append(index)
    return np.sort(np.array(kept, dtype=np.intp))
