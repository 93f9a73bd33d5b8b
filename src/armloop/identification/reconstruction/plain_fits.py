"""Rigid bodies with Coulomb and viscous friction, regressed on a record at few instants: how well, and how physically.

It is what every check of a record begins with, quick enough to be asked of the record as it stands and of what it may mean.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from armloop.data.log import MotionLog
from armloop.data.signals import Conditioning
from armloop.features.rigid_body import BaseParameters, full_columns
from armloop.features.springs import spring_columns
from armloop.identification.reconstruction.bandwidth import (
    LEAST,
    Table,
    determined_solution,
    root_mean_square,
    table_at,
)
from armloop.identification.reconstruction.physical import POSTURES
from armloop.identification.reconstruction.rigid_body import mass_columns
from armloop.robot.arm import STANDARD_GRAVITY, Arm
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
#: Readings are many: of every so manieth instant each must first explain so many times as much.
SCREENED, PROMISING = 3, 1.1
#: Readings of a record that explain nearly this part as much as the best are as good, and the simplest is meant.
AS_GOOD = 0.95


@dataclass(frozen=True, eq=False)
class Fit:
    """Relative errors (n,), the share of friction's power that dissipates (n,) from -1 to 1, and mean inertias (n,)."""

    relative: Array
    power: Array
    inertia: Array

    def over(self, other: Fit, joints: Sequence[int] | None = None, least: float = _EXACT) -> float:
        """Relative errors of joints, all by default, over the other's, each at least so large, in the geometric mean."""
        mine, others = (np.maximum(fit.relative, least) for fit in (self, other))
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
    """Columns and torques of an arm at a few instants, and postures (P, n) of the record."""

    arm: Arm
    base: BaseParameters
    table: Table
    postures: Array

    @classmethod
    def of(
        cls,
        logs: Sequence[MotionLog],
        arm: Arm,
        cutoff_hz: float,
        aside: Sequence[Array] | None = None,
    ) -> Self | None:
        """None where there is too little motion to judge.

        Args:
            aside: per log, (B, 2) intervals that take no part.
        """
        base = BaseParameters.of_arm(arm, rotors=True)
        table = table_at(list(logs), arm, base, Conditioning(), cutoff_hz, [cutoff_hz], aside)
        if table is None or (table.moving.sum(axis=0) < _FEWEST).any():
            return None
        q = np.concatenate([log.q for log in logs])
        return cls(arm, base, table.every(_EVERY), q[:: max(1, len(q) // POSTURES)])

    @cached_property
    def mass(self) -> Array:
        """(P, n, n, r) mass matrices per unit of each parameter."""
        return mass_columns(self.arm, self.base, self.postures)

    def read(self, order: Index, factors: Array, torque_signs: Array) -> Self:
        """The same with the columns of joint ``order[k]`` in place k, q and v of each times its factor, tau its sign.

        A factor is a direction, and a unit. A law of friction that is met badly may be met better at other speeds, which
        says nothing of a unit: its columns keep their shapes.
        """
        table, r, signs = self.table, self.base.count, np.sign(factors)
        q, v, vdot = (factors * x[:, order] for x in (table.motion.q, table.motion.v, table.motion.vdot))
        motion = replace(table.motion, q=q, v=v, vdot=vdot)
        columns = np.zeros_like(table.columns)
        columns[:, :, :r] = self.base.columns(self.arm, motion)
        for j, source in enumerate(order):
            own, its = (slice(r + 3 * k, r + 3 * k + 3) for k in (j, source))
            columns[:, j, own] = table.columns[:, source, its] * [signs[j], signs[j], 1.0]
        tau, moving = torque_signs * table.tau[:, order], table.moving[:, order]
        read = replace(table, columns=columns, tau=tau, moving=moving, motion=motion)
        return replace(self, table=read, postures=factors * self.postures[:, order])

    def under(self, down: Array) -> Self:
        """The same with gravity in another direction (3,), a unit vector in the base frame."""
        arm = replace(self.arm, gravity=float(np.linalg.norm(STANDARD_GRAVITY)) * down)
        still, *along = self._by_gravity
        x, y, z = (g * columns for g, columns in zip(arm.gravity, along, strict=True))
        return self._with(arm, still + x + y + z)

    def as_of(self, arm: Arm) -> Self:
        """The same record as that of another arm of as many joints."""
        return self._with(arm, full_columns(arm, self.table.motion, rotors=True))

    def _with(self, arm: Arm, full: Array) -> Self:
        """The same as that of an arm with these columns (N, n, P) of its full parameters."""
        base, table = BaseParameters.of_arm(arm, rotors=True), self.table
        columns = np.concatenate([full[:, :, base.kept], table.columns[:, :, self.base.count :]], axis=2)
        return replace(self, arm=arm, base=base, table=replace(table, columns=columns))

    def of_weight_alone(self) -> Self:
        """The same record as that of links at rest on joints without friction."""
        motion, table, r = self.table.motion, self.table, self.base.count
        still = replace(motion, v=np.zeros_like(motion.v), vdot=np.zeros_like(motion.vdot))
        columns = np.zeros_like(table.columns)
        columns[:, :, :r] = self.base.columns(self.arm, still)
        return replace(self, table=replace(table, columns=columns))

    @cached_property
    def _by_gravity(self) -> list[Array]:
        """Columns (N, n, P) of the full parameters without gravity, and what 1 m/s² of it along each axis adds to them."""
        arms = [replace(self.arm, gravity=g) for g in (np.zeros(3), *np.eye(3))]
        still, *each = (full_columns(arm, self.table.motion, rotors=True) for arm in arms)
        return [still, *(columns - still for columns in each)]

    def every(self, step: int) -> Self:
        """The same at every so manieth instant."""
        return replace(self, table=self.table.every(step))

    def sprung(self) -> Self:
        """The same with a spring at every joint, and between any two."""
        return self.beside(spring_columns(self.table.motion.q))

    def beside(self, columns: Array) -> Self:
        """The same with more columns (N, n, p), after the others."""
        both = np.concatenate([self.table.columns, columns], axis=2)
        return replace(self, table=replace(self.table, columns=both))

    def solved(self, tau: Array, rows: Mask) -> tuple[Array, Array]:
        """Coefficients (p,) of torques (N, n) at these rows (N, n), and what they leave of each joint (n,), RMS."""
        table = self.table
        error = table.sizes(tau, rows)
        for _ in range(2):  # joints weigh by their torques first, then by what is left of them
            X, y, _ = table.weighed(tau, rows, error)
            theta = determined_solution(X, y)
            error = table.sizes(tau - table.columns @ theta, rows)
        return theta, error

    def left(self) -> Fit:
        """The relative errors alone, of the record as it stands: power and inertia are taken to be as they must."""
        table = self.table
        _, error = self.solved(table.tau, table.moving)
        scale = np.maximum(table.sizes(table.tau, table.moving), LEAST)
        return Fit(error / scale, np.ones(len(scale)), np.ones(len(scale)))

    def fit(
        self, signs: Array | float = 1.0, order: Index | slice = slice(None), half: int | None = None
    ) -> Fit:
        """Regress the torques, as recorded or with these signs in this order, of all blocks or of every other one."""
        table, n, r = self.table, self.arm.n, self.base.count
        tau = signs * table.tau[:, order]
        rows = table.moving if half is None else table.moving & (table.blocks % 2 == half)[:, None]
        scale = table.sizes(tau, rows)
        theta, error = self.solved(tau, rows)
        power = np.zeros(n)
        for j, own in enumerate(rows.T):
            columns = table.columns[own, j, r + 3 * j : r + 3 * j + 2]
            parts = columns * theta[r + 3 * j : r + 3 * j + 2]
            v = columns[:, 1]
            if root_mean_square(parts.sum(axis=1)) > _FRICTION * scale[j]:
                power[j] = float((parts.sum(axis=1) * v).sum() / np.abs(parts * v[:, None]).sum())
        inertia = np.einsum("pjjr,r->j", self.mass, theta[:r]) / len(self.mass)
        return Fit(error / np.maximum(scale, LEAST), power, inertia)
