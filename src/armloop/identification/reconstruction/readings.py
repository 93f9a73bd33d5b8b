"""Other readings of a record: joints in another order, angles in another unit, told by the torques that they explain.

An arm whose columns were numbered from the tip, or whose angles are revolutions, moves as smoothly as any: nothing but
gravity and inertia at the angles as they were meant shows it. Rigid bodies with Coulomb and viscous friction are regressed
on the torques as recorded and once more for every other reading; a log is refused only where one of them explains all
torques far better, and no less physically.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations, permutations
from typing import NamedTuple

import numpy as np

from armloop.data.log import MotionLog, unchecked_log
from armloop.identification.reconstruction.plain_fits import GOOD, Fit, PlainFits
from armloop.robot.arm import Arm
from armloop.util.arrays import Array, Index

#: Mean relative error below which a record is taken as it stands.
_GOOD_ENOUGH = 0.02
#: Another order must lower the relative error by this factor (geometric mean of all joints), another unit by this one,
#: every joint's to a good one: orders are many, and springs as strong as all the rest on all joints made one of them twice
#: as good; units are two, and no law made one better than by a fifth.
_ORDER, _UNIT = 3.0, 1.5
#: Arms of so many joints are tried in every order; larger ones with any two in exchange, turned round and moved on by one.
_EVERY_ORDER = 4
#: Units of an angle that are not the radian, in rad.
_ANGLES = {"revolutions": 2 * np.pi, "degrees": np.pi / 180}


class Reading(NamedTuple):
    """What a record may mean: its columns ``order[k]`` are those of joint k, angles are in ``unit`` (radians if empty)."""

    order: Index
    unit: str = ""

    def of(self, log: MotionLog, arm: Arm) -> MotionLog:
        """The log as it would be, read so."""
        scale = self.scale(arm)
        signals = {name: getattr(log, name)[:, self.order] for name in ("q", "v", "tau")}
        signals |= {name: scale * signals[name] for name in ("q", "v")}
        return unchecked_log(time=log.time, name=log.name, **signals)

    def scale(self, arm: Arm) -> Array:
        """(n,) rad (m) of a joint's unit."""
        return np.where(arm.revolute, _ANGLES.get(self.unit, 1.0), 1.0)

    def words(self, times: float) -> str:
        """What is wrong with a record that is explained so many times as well when read so, and what would be right."""
        better = f"all torques are explained {times:.2g} times as well"
        if self.unit:
            return f"angles seem to be in {self.unit}: read so {better}; give q in rad and v in rad/s"
        given = [str(k + 1) for k in self.order]
        moved = [k for k in range(len(given)) if self.order[k] != k]
        if len(moved) == 2:
            wrong = f"joints {moved[0] + 1} and {moved[1] + 1} are exchanged: with q, v and tau the other way round"
        else:
            wrong = f"joints are in another order: taken as {', '.join(given)}, base to tip,"
        return f"{wrong} {better}; number the joints from the base to the tip"


def readings(arm: Arm) -> Iterator[Reading]:
    """Every other reading of a record of an arm."""
    if arm.revolute.any():
        yield from (Reading(np.arange(arm.n), unit) for unit in _ANGLES)
    for order in _orders(arm.n):
        if order != tuple(range(arm.n)) and (arm.revolute[list(order)] == arm.revolute).all():
            yield Reading(np.array(order, dtype=np.intp))


def _orders(n: int) -> Iterator[tuple[int, ...]]:
    if n <= _EVERY_ORDER:
        yield from permutations(range(n))
        return
    for i, j in combinations(range(n), 2):
        yield tuple({i: j, j: i}.get(k, k) for k in range(n))
    yield tuple(reversed(range(n)))
    for step in (1, -1):
        yield tuple((k + step) % n for k in range(n))


def meant(logs: Sequence[MotionLog], arm: Arm, cutoff_hz: float, plain: Fit) -> tuple[Reading, float] | None:
    """The reading that explains all torques far better than the record as it stands, and how many times; None if none does.

    Args:
        plain: what is left of the record as it stands.
    """
    if float(np.mean(plain.relative)) < _GOOD_ENOUGH:
        return None
    found: list[tuple[float, int, Reading]] = []
    for number, reading in enumerate(readings(arm)):
        read = [reading.of(log, arm) for log in logs]
        # a law of friction that is met badly may be met better at other speeds, and says nothing of a unit
        problem = PlainFits.of(read, arm, cutoff_hz, reading.scale(arm))
        if problem is None:
            continue
        other = problem.fit(np.ones(arm.n), np.arange(arm.n))
        better = plain.over(other)
        far = better > (_UNIT if reading.unit else _ORDER)
        if far and other.faults.sum() <= plain.faults.sum() and other.relative.max() < GOOD:
            found.append((better, -number, reading))
    if not found:
        return None
    times, _, reading = max(found)
    return reading, times
