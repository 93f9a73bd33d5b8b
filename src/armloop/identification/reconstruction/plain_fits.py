"""Rigid bodies with Coulomb and viscous friction, regressed on a record at few instants: how well, and how physically.

It is what every check of a record begins with, quick enough to be asked of the record as it stands and of what it may mean.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from armloop.data.log import MotionLog
from armloop.data.signals import Conditioning
from armloop.features.rigid_body import BaseParameters
from armloop.identification.reconstruction.bandwidth import (
    LEAST,
    Table,
    determined_solution,
    root_mean_square,
    table_at,
)
from armloop.identification.reconstruction.physical import POSTURES
from armloop.identification.reconstruction.rigid_body import mass_columns
from armloop.robot.arm import Arm
from armloop.util.arrays import Array, Index, Mask

#: Least part of the torque that friction must be for its power to count.
_FRICTION = 0.02
#: Fewest instants at which a joint must move.
_FEWEST = 200
#: Of the instants at which corners are compared, every so manieth is used.
_EVERY = 3
#: A relative error is at least this: what is met exactly is met to round-off.
_EXACT = 1e-9
#: What explains a joint, in its place or unit, leaves a relative error below this; a gain is far off from this factor on.
GOOD, FAR = 0.6, 3.0


@dataclass(frozen=True, eq=False)
class Fit:
    """Relative errors (n,), the share of friction's power that dissipates (n,) from -1 to 1, and mean inertias (n,)."""

    relative: Array
    power: Array
    inertia: Array

    def over(self, other: Fit, joints: Sequence[int] | None = None) -> float:
        """Relative errors of joints, all by default, over the other's, in the geometric mean."""
        mine, others = (np.maximum(fit.relative, _EXACT) for fit in (self, other))
        ratio = np.log(mine / others)
        return float(np.exp(np.mean(ratio if joints is None else ratio[list(joints)])))

    @property
    def faults(self) -> Mask:
        """(n,) joints that have friction that drives or no positive inertia."""
        return np.asarray((self.power < 0) | (self.inertia <= 0))

    def physical(self, joints: Sequence[int]) -> bool:
        """Whether these joints have friction that brakes and positive inertia."""
        return not self.faults[list(joints)].any()

    def driven(self, joints: Sequence[int]) -> bool:
        """Whether these joints have negative inertia and friction that drives, as far as they have any."""
        own = list(joints)
        return bool((self.power[own] <= 0).all() and (self.inertia[own] < 0).all())


@dataclass(frozen=True, eq=False)
class PlainFits:
    """Columns and torques at a few instants, and mass matrices per unit of each parameter (P, n, n, r)."""

    table: Table
    mass: Array
    shared: int

    @classmethod
    def of(
        cls, logs: Sequence[MotionLog], arm: Arm, cutoff_hz: float, unit: Array | float = 1.0
    ) -> Self | None:
        """None where there is too little motion to judge; positions are in a unit (n,) of rad (m)."""
        base = BaseParameters.of_arm(arm, rotors=True)
        table = table_at(list(logs), arm, base, Conditioning(), cutoff_hz, [cutoff_hz], unit=unit)
        if table is None or (table.moving.sum(axis=0) < _FEWEST).any():
            return None
        q = np.concatenate([log.q for log in logs])
        q = q[:: max(1, len(q) // POSTURES)]
        return cls(table.every(_EVERY), mass_columns(arm, base, q), base.count)

    def fit(self, signs: Array, order: Index, half: int | None = None) -> Fit:
        """Regress the torques with these signs in this order, of all blocks or of every other one."""
        table, n, r = self.table, len(signs), self.shared
        tau = signs * table.tau[:, order]
        rows = table.moving if half is None else table.moving & (table.blocks % 2 == half)[:, None]
        scale = table.sizes(tau, rows)
        size = scale
        for _ in range(2):  # joints weigh by their torques first, then by what is left of them
            X, y, _ = table.weighed(tau, rows, size)
            theta = determined_solution(X, y)
            size = error = table.sizes(tau - table.columns @ theta, rows)
        power = np.zeros(n)
        for j, own in enumerate(rows.T):
            columns = table.columns[own, j, r + 3 * j : r + 3 * j + 2]
            parts = columns * theta[r + 3 * j : r + 3 * j + 2]
            v = columns[:, 1]
            if root_mean_square(parts.sum(axis=1)) > _FRICTION * scale[j]:
                power[j] = float((parts.sum(axis=1) * v).sum() / np.abs(parts * v[:, None]).sum())
        inertia = np.einsum("pjjr,r->j", self.mass, theta[:r]) / len(self.mass)
        return Fit(error / np.maximum(scale, LEAST), power, inertia)
