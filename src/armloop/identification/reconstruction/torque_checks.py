"""Physical plausibility of recorded torques: passivity of friction, positive inertia, and exchanged or turned columns.

Rigid bodies with Coulomb and viscous friction are regressed on the torques as recorded and on what they would be had a
column been turned in sign or exchanged with another. A log is refused only where physics or the error speak plainly: a
joint whose friction drives *and* whose inertia is negative, in both halves of the data, and neither once its sign is
turned; two joints whose torques are explained twice as well, and physically, once they are exchanged; or one that is, once
it is multiplied by a number far from one, for the links that it carries show in the others' torques, too; or a whole
record that is meant otherwise (:mod:`armloop.identification.reconstruction.readings`). Nothing is compared with the masses
of the URDF, which may be dummies.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from armloop.data.log import MotionLog
from armloop.data.pieces import LogSource
from armloop.data.plausibility import is_time_series
from armloop.identification.reconstruction.bandwidth import determined_solution
from armloop.identification.reconstruction.plain_fits import FAR, GOOD, Fit, PlainFits
from armloop.identification.reconstruction.readings import meant
from armloop.identification.reconstruction.stances import Stance, as_it_stands
from armloop.identification.reconstruction.stances_together import together
from armloop.identification.reconstruction.systematic_sample import placed_runs
from armloop.identification.reconstruction.unlike_logs import unlike
from armloop.identification.reconstruction.weightless import (
    WEIGHT_ALONE,
    lighter,
    times_lighter,
    weight_alone,
)
from armloop.robot.arm import Arm
from armloop.util.arrays import Array
from armloop.util.doubts import warn
from armloop.util.errors import LogError

#: Share of friction's power that must be of one sign.
_DRIVES = 0.5
#: An exchange must lower the relative error of the two joints by this factor (geometric mean), to a good one.
_BETTER = 2.0
#: In two halves of the data a gain that is far off must be the same but for this factor.
_ALIKE = 1.5


def check_torques(
    logs: Sequence[LogSource], arm: Arm, cutoff_hz: float, aside: Sequence[Array] | None = None
) -> list[Stance]:
    """By what the arm stands slightly otherwise than its URDF says: how its base leans, and which joints' zeros are off.

    Args:
        aside: per log, (B, 2) intervals, s, of blocks that are held out: they take no part. Where too little is left
            without them, the torques are checked on all, and nothing is said of how the arm stands.

    Raises:
        LogError: the torques cannot be this arm's; with the likely cause.
    """
    placed = placed_runs(logs)
    chosen = [run for _, run in placed]
    if cutoff_hz <= 0 or not all(is_time_series(log.q, log.runs()) for log in chosen):
        return []
    left_out = None if aside is None else [aside[k] for k, _ in placed]
    blind = Problem.of(chosen, arm, cutoff_hz, aside=left_out)
    problem = Problem.of(chosen, arm, cutoff_hz) if blind is None and aside else blind
    if problem is None:
        return []
    named = list(dict.fromkeys(log.name for log in chosen))
    names = ", ".join(named[:3]) + (", ..." if len(named) > 3 else "")
    plain = problem.fit()
    if weight_alone(problem, plain):
        # of joints that carry none there is nothing but noise, which any other sign, order or unit explains as well
        warn(f"{names}: {WEIGHT_ALONE}")
        return []
    turned = problem.turned(plain)
    if turned:
        which = "all joints" if len(turned) == arm.n else ", ".join(f"tau{j + 1}" for j in turned)
        raise LogError(
            f"{names}: the sign of {which} is turned: as recorded, friction drives and inertia is negative; "
            "torque must be what the drive does on the joint in the direction of q"
        )
    faults = list(_one_fault(problem, plain, arm.n))
    for fault, left in faults:
        # a whole record that is read wrongly may look like it, too, but then that explains far more
        if not meant(problem, left)[0]:
            raise LogError(f"{names}: {fault}")
    wrong, found = _otherwise(problem, plain)
    times = times_lighter(problem, plain)
    if wrong:
        raise LogError(f"{names}: {wrong}{f'; or {lighter(times)}' if times else ''}")
    for fault, _ in faults:
        raise LogError(f"{names}: {fault}")
    if times:
        warn(
            f"{names}: {lighter(times)}: energies of the library lagrangian can be of that alone, a rigid body has weight "
            "(add tau_g(q) to tau for one)"
        )
    by_name: dict[str, list[MotionLog]] = {}
    for run in chosen:
        by_name.setdefault(run.name, []).append(run)
    if others := unlike(problem, by_name, arm, cutoff_hz):
        warn(f"{names}: {others}")
    return found if blind is not None else []


def _one_fault(problem: Problem, plain: Fit, n: int) -> Iterator[tuple[str, Fit]]:
    """What is wrong with single columns of the torques, and what is left of the record where that is put right."""
    for i, j in problem.better_exchanged(plain):
        order = np.arange(n)
        order[[i, j]] = order[[j, i]]
        fault = (
            f"columns tau{i + 1} and tau{j + 1} are exchanged: the other way round they are explained "
            "at least twice as well; put the columns in the order of the joints, base to tip"
        )
        yield fault, problem.fit(order=order)
    for j, factor in problem.better_scaled(plain):
        factors = np.ones(n)
        factors[j] = factor
        fault = (
            f"the torques do not fit one another: tau{j + 1} is about {float(f'{1 / factor:.2g}'):g} times what "
            "the links give that explain the other joints; check the units and drive gains of all joints"
        )
        yield fault, problem.fit(factors)


def _otherwise(problem: PlainFits, plain: Fit) -> tuple[str, list[Stance]]:
    """What is wrong with a record that is meant otherwise, if anything is; and by what the arm stands slightly otherwise."""
    wrong, stance = meant(problem, plain)
    found = together(problem, plain) or ([stance] if stance else [])
    if wrong and found:
        stood = problem.as_of(as_it_stands(problem.arm, found))
        wrong, _ = meant(stood, stood.fit())
    return wrong, found


class Problem(PlainFits):
    """Fits with a sign turned, two columns exchanged, or one multiplied."""

    def turned(self, plain: Fit) -> list[int]:
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
            other = self.fit(signs)
            gain = plain.over(other)
            if not other.physical(range(n)) or gain < 0.99:
                continue
            plainly = (
                len(group) == 1 and plain.over(other, group) > _BETTER and other.relative[group].max() < GOOD
            )
            halves = (self.fit(half=half) for half in (0, 1))
            if other.power[group].max() > _DRIVES and (plainly or all(one.driven(group) for one in halves)):
                suspects.append((gain, group))
        return max(suspects)[1] if suspects else []

    def better_exchanged(self, plain: Fit) -> list[tuple[int, int]]:
        """Pairs whose torques are explained far better the other way round."""
        found = []
        for i, j in combinations(range(len(plain.power)), 2):
            order = np.arange(len(plain.power))
            order[[i, j]] = order[[j, i]]
            other = self.fit(order=order)
            gain = plain.over(other, [i, j])
            if gain > _BETTER and other.physical([i, j]) and other.relative[[i, j]].max() < GOOD:
                found.append((gain, (i, j)))
        return [max(found)[1]] if found else []

    def better_scaled(self, plain: Fit) -> list[tuple[int, float]]:
        """The joint whose torque is explained far better times a factor far from one, with the factor."""
        n, found = len(plain.power), []
        for j in range(n) if n > 1 else ():
            first, second = (self._factor(j, half) for half in (0, 1))
            if min(first, second) <= 0 or abs(np.log(first / second)) > np.log(_ALIKE):
                continue
            factor = float(np.sqrt(first * second))
            if abs(np.log(factor)) < np.log(FAR):
                continue
            factors = np.ones(n)
            factors[j] = factor
            other = self.fit(factors)
            if plain.over(other, [j]) > _BETTER and other.physical(range(n)) and other.relative[j] < GOOD:
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
