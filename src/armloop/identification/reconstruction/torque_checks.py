"""Physical plausibility of recorded torques: passivity of friction, positive inertia, and exchanged or turned columns.

Rigid bodies with Coulomb and viscous friction are regressed on the torques as recorded and on what they would be had a
column been turned in sign or exchanged with another. A log is refused only where physics or the error speak plainly: a
joint whose friction drives *and* whose inertia is negative, in both halves of the data, and neither once its sign is
turned; two joints whose torques are explained twice as well, and physically, once they are exchanged; or one that is, once
it is multiplied by a number far from one, for the links that it carries show in the others' torques, too. Nothing is
compared with the masses of the URDF, which may be dummies.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from armloop.data.log import MotionLog, unchecked_log
from armloop.data.pieces import LogSource
from armloop.data.plausibility import is_time_series
from armloop.data.signals import Conditioning
from armloop.features.rigid_body import BaseParameters
from armloop.identification.reconstruction.bandwidth import (
    LEAST,
    Table,
    determined_solution,
    even_selection,
    root_mean_square,
    table_at,
)
from armloop.identification.reconstruction.rigid_body import mass_columns
from armloop.robot.arm import Arm
from armloop.util.arrays import Array
from armloop.util.errors import LogError

#: Share of friction's power that must be of one sign, and the least part of the torque that friction must be, to count.
_DRIVES, _FRICTION = 0.5, 0.02
#: An exchange must lower the relative error of the two joints by this factor (geometric mean), to below this.
_BETTER, _GOOD = 2.0, 0.6
#: A gain is far off from this factor on; in two halves of the data it must be the same but for this one.
_FAR, _ALIKE = 3.0, 1.5
#: Mean relative error from which on whole joints are tried in exchange where the fit is unphysical; rows a joint must have.
_POOR, _FEWEST = 0.12, 200
#: Of the instants at which corners are compared, every so manieth is used.
_EVERY = 3
#: A relative error is at least this: what is met exactly is met to round-off.
_EXACT = 1e-9
#: Postures at which inertia is looked at.
_POSTURES = 60


def check_torques(logs: Sequence[LogSource], arm: Arm, cutoff_hz: float) -> None:
    """Raise `LogError`, with the likely cause, where the torques cannot be those of this arm in this motion."""
    chosen = even_selection(logs)
    if cutoff_hz <= 0 or not all(is_time_series(log.q, log.runs()) for log in chosen):
        return
    problem = _Problem.of(chosen, arm, cutoff_hz)
    if problem is None:
        return
    names = ", ".join(dict.fromkeys(log.name for log in chosen[:3])) + (", ..." if len(chosen) > 3 else "")
    plain = problem.fit(np.ones(arm.n), np.arange(arm.n))
    turned = problem.turned(plain)
    if turned:
        which = "all joints" if len(turned) == arm.n else ", ".join(f"tau{j + 1}" for j in turned)
        raise LogError(
            f"{names}: the sign of {which} is turned: as recorded, friction drives and inertia is negative; "
            "torque must be what the drive does on the joint in the direction of q"
        )
    for i, j in problem.better_exchanged(plain):
        raise LogError(
            f"{names}: columns tau{i + 1} and tau{j + 1} are exchanged: the other way round they are explained "
            "at least twice as well; put the columns in the order of the joints, base to tip"
        )
    for j, factor in problem.better_scaled(plain):
        raise LogError(
            f"{names}: the torques do not fit one another: tau{j + 1} is about {float(f'{1 / factor:.2g}'):g} times what "
            "the links give that explain the other joints; check the units and drive gains of all joints"
        )
    if float(np.mean(plain.relative)) > _POOR and not plain.physical(range(arm.n)):
        for i, j in combinations(range(arm.n), 2):
            if arm.joints[i].kind == arm.joints[j].kind and _whole_joints(
                chosen, arm, cutoff_hz, plain, i, j
            ):
                raise LogError(
                    f"{names}: joints {i + 1} and {j + 1} are exchanged: with q, v and tau the other way round all "
                    "torques are explained far better; number the joints from the base to the tip"
                )


@dataclass(frozen=True, eq=False)
class _Fit:
    """Relative errors (n,), the share of friction's power that dissipates (n,) from -1 to 1, and mean inertias (n,)."""

    relative: Array
    power: Array
    inertia: Array

    def over(self, other: _Fit, joints: Sequence[int] | None = None) -> float:
        """Relative errors of joints, all by default, over the other's, in the geometric mean."""
        mine, others = (np.maximum(fit.relative, _EXACT) for fit in (self, other))
        ratio = np.log(mine / others)
        return float(np.exp(np.mean(ratio if joints is None else ratio[list(joints)])))

    def physical(self, joints: Sequence[int]) -> bool:
        """Whether these joints have friction that brakes and positive inertia."""
        own = list(joints)
        return bool((self.power[own] >= 0).all() and (self.inertia[own] > 0).all())

    def driven(self, joints: Sequence[int]) -> bool:
        """Whether these joints have negative inertia and friction that drives, as far as they have any."""
        own = list(joints)
        return bool((self.power[own] <= 0).all() and (self.inertia[own] < 0).all())


@dataclass(frozen=True, eq=False)
class _Problem:
    """Columns and torques at a few instants, and mass matrices per unit of each parameter (P, n, n, r)."""

    table: Table
    mass: Array
    shared: int

    @staticmethod
    def of(logs: list[MotionLog], arm: Arm, cutoff_hz: float) -> _Problem | None:
        """None where there is too little motion to judge."""
        base = BaseParameters.of_arm(arm, rotors=True)
        table = table_at(logs, arm, base, Conditioning(), cutoff_hz, [cutoff_hz])
        if table is None or (table.moving.sum(axis=0) < _FEWEST).any():
            return None
        q = np.concatenate([log.q for log in logs])
        q = q[:: max(1, len(q) // _POSTURES)]
        return _Problem(table.every(_EVERY), mass_columns(arm, base, q), base.count)

    def fit(self, signs: Array, order: NDArray[np.intp], half: int | None = None) -> _Fit:
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
        return _Fit(error / np.maximum(scale, LEAST), power, inertia)

    def turned(self, plain: _Fit) -> list[int]:
        """Joints whose sign is turned: alone, or all those whose friction drives."""
        n = len(plain.power)
        driving = [j for j in range(n) if plain.driven([j])]
        groups = [driving, *([j] for j in range(n)), list(range(n))]
        suspects = []
        for group in groups:
            if not group or plain.physical(group):
                continue
            signs = np.ones(n)
            signs[group] = -1.0
            order = np.arange(n)
            other = self.fit(signs, order)
            gain = plain.over(other)
            if not other.physical(range(n)) or gain < 0.99:
                continue
            plainly = (
                len(group) == 1 and plain.over(other, group) > _BETTER and other.relative[group].max() < _GOOD
            )
            halves = (self.fit(np.ones(n), order, half) for half in (0, 1))
            if other.power[group].max() > _DRIVES and (plainly or all(one.driven(group) for one in halves)):
                suspects.append((gain, group))
        return max(suspects)[1] if suspects else []

    def better_exchanged(self, plain: _Fit) -> list[tuple[int, int]]:
        """Pairs whose torques are explained far better the other way round."""
        found = []
        for i, j in combinations(range(len(plain.power)), 2):
            order = np.arange(len(plain.power))
            order[[i, j]] = order[[j, i]]
            other = self.fit(np.ones(len(order)), order)
            gain = plain.over(other, [i, j])
            if gain > _BETTER and other.physical([i, j]) and other.relative[[i, j]].max() < _GOOD:
                found.append((gain, (i, j)))
        return [max(found)[1]] if found else []

    def better_scaled(self, plain: _Fit) -> list[tuple[int, float]]:
        """The joint whose torque is explained far better times a factor far from one, with the factor."""
        n, found = len(plain.power), []
        for j in range(n) if n > 1 else ():
            first, second = (self._factor(j, half) for half in (0, 1))
            if min(first, second) <= 0 or abs(np.log(first / second)) > np.log(_ALIKE):
                continue
            factor = float(np.sqrt(first * second))
            if abs(np.log(factor)) < np.log(_FAR):
                continue
            factors = np.ones(n)
            factors[j] = factor
            other = self.fit(factors, np.arange(n))
            if plain.over(other, [j]) > _BETTER and other.physical(range(n)) and other.relative[j] < _GOOD:
                found.append((plain.over(other), (j, factor)))
        return [max(found)[1]] if found and max(found)[0] > 1 else []

    def _factor(self, joint: int, half: int) -> float:
        """The factor of a joint's torque that is regressed together with all parameters, on every other block."""
        table = self.table
        rows = table.moving & (table.blocks % 2 == half)[:, None]
        X, y, joints = table.weighed(table.tau, rows, table.sizes(table.tau, rows))
        own = y * (joints == joint)
        found = determined_solution(np.column_stack([X, -own]), y - own)
        return float(found[-1])


def _whole_joints(logs: list[MotionLog], arm: Arm, cutoff_hz: float, plain: _Fit, i: int, j: int) -> bool:
    """Whether q, v and tau of two joints explain one another far better the other way round."""
    order = np.arange(arm.n)
    order[[i, j]] = order[[j, i]]
    exchanged = [
        unchecked_log(
            time=log.time, q=log.q[:, order], v=log.v[:, order], tau=log.tau[:, order], name=log.name
        )
        for log in logs
    ]
    problem = _Problem.of(exchanged, arm, cutoff_hz)
    if problem is None:
        return False
    other = problem.fit(np.ones(arm.n), np.arange(arm.n))
    return plain.over(other) > _BETTER and other.physical(range(arm.n)) and bool(other.relative.max() < _GOOD)
