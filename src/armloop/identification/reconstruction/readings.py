"""Other readings of a record: joints in another order or direction, angles in another unit, an arm mounted otherwise.

An arm whose columns were numbered from the tip, whose elbow counts down where the URDF's counts up, whose angles are
revolutions or that hangs from a ceiling moves as smoothly as any: nothing but gravity and inertia at the angles as they
were meant shows it. Rigid bodies with Coulomb and viscous friction are regressed on the torques as recorded and once more
for every other reading; a log is refused only where one of them explains all torques far better, and no less physically.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, permutations
from typing import NamedTuple

import numpy as np

from armloop.identification.reconstruction.mounting import SECOND, other_mounting
from armloop.identification.reconstruction.plain_fits import (
    AS_GOOD,
    GOOD,
    PROMISING,
    SCREENED,
    Fit,
    PlainFits,
)
from armloop.identification.reconstruction.stances import Stance
from armloop.identification.reconstruction.zero_offsets import other_zero
from armloop.robot.arm import Arm
from armloop.util.arrays import Array, Index

#: Mean relative error below which a record is taken as it stands; of a joint that is met so well, better says nothing.
_GOOD_ENOUGH = 0.02
#: Relative error of a joint from which on the reading that explains all others better is doubtful itself.
_POOR = 0.25
#: Another order must lower the relative error by this factor (geometric mean of all joints), another unit by this one,
#: every joint's to a good one: orders are many, and springs as strong as all the rest on all joints made one of them twice
#: as good; units are two, and no law made one better than by a fifth.
_ORDER, _UNIT = 3.0, 1.5
#: Of two joints that are exchanged the others may tell nothing, as a wrist's beside a shoulder's: then these two must be
#: explained twice as well (geometric mean), none worse by more than a fifth, and all better than with springs. Any two
#: joints of 130 records that were read rightly, of 13 arms with laws, loads and pushes, came to 1.2 at the most.
_TWO, _UNHARMED = 2.0, 0.8
#: Joints that count in the other direction, and gravity in another: the best joint must be explained so many times as well,
#: all of them (geometric mean) and the worst by these, and more than with springs at all joints, which look like both. A
#: direction that the record cannot tell (of a first joint that is upright, of a flange whose load lies on its axis) changes
#: nothing. Measured arms that were read rightly came to 1.04, 1.00 and 0.98; with laws of another kind, as strong as
#: gravity, simulated ones to 1.5, 1.1 and 0.7.
_SENSE = (2.0, 1.2, 0.8)
#: Arms of so many joints are tried with every set of them counting the other way; larger ones with any one or two.
_EVERY_SENSE = 7
#: Arms of so many joints are tried in every order; larger ones with any two in exchange, turned round and moved on by one.
_EVERY_ORDER = 4
#: … but of arms of more joints than these neighbours alone, and one that counts the other way: of pairs there are too many.
_EVERY_PAIR = 10
#: Units of an angle that are not the radian, in rad.
_ANGLES = {"revolutions": 2 * np.pi, "degrees": np.pi / 180}


class Reading(NamedTuple):
    """What a record may mean.

    Attributes:
        order: (n,) which columns are those of joint k.
        unit: that of angles, radians if empty.
        turned: joints whose q, v and tau count in the other direction.
        stance: how the arm stands otherwise than its URDF says.
        against: whether those are joints whose q and v do so, and tau does not.
    """

    order: Index
    unit: str = ""
    turned: tuple[int, ...] = ()
    stance: Stance | None = None
    against: bool = False

    def scale(self, arm: Arm) -> Array:
        """(n,) rad (m) of a joint's unit."""
        return np.where(arm.revolute, _ANGLES.get(self.unit, 1.0), 1.0)

    @property
    def signs(self) -> Array:
        """(n,) -1 for joints that count in the other direction, else 1."""
        return np.where(np.isin(np.arange(len(self.order)), self.turned), -1.0, 1.0)

    @property
    def torque_signs(self) -> Array:
        """(n,) the same of tau."""
        return np.ones(len(self.order)) if self.against else self.signs

    def read(self, plain: PlainFits) -> PlainFits:
        """What is regressed of the record, read so."""
        if self.stance is not None:
            return plain.as_of(self.stance.of(plain.arm))
        return plain.read(self.order, self.scale(plain.arm) * self.signs, self.torque_signs)

    def far_better(self, plain: Fit, other: Fit, sprung: Fit) -> bool:
        """Whether a record explained so, read so, is not meant as it stands; springs at its joints may explain as much."""
        if other.faults.sum() > plain.faults.sum() or other.relative.max() >= GOOD:
            return False
        if self.turned or self.stance:
            each = [plain.over(other, [j], _GOOD_ENOUGH) for j in range(len(self.order))]
            best, mean, worst = _SENSE
            better = max(each) > best and plain.over(other, least=_GOOD_ENOUGH) > mean and min(each) > worst
            alone = not self.turned and min(sorted(each)[-2:]) < SECOND
            return better and not alone and sprung.over(other) > 1
        if self.unit:
            return plain.over(other) > _UNIT
        return plain.over(other) > _ORDER or self._two_better(plain, other, sprung)

    def _two_better(self, plain: Fit, other: Fit, sprung: Fit) -> bool:
        """Whether two of more joints, which are exchanged, are explained far better, whatever of the others."""
        if not len(self.moved) == 2 < len(self.order):
            return False
        each = [plain.over(other, [j], _GOOD_ENOUGH) for j in range(len(self.order))]
        better = plain.over(other, self.moved, _GOOD_ENOUGH) > _TWO
        return better and min(each) > _UNHARMED and sprung.over(other, least=_GOOD_ENOUGH) > 1

    @property
    def moved(self) -> list[int]:
        """Joints whose columns are another's."""
        return [k for k, source in enumerate(self.order) if source != k]

    @property
    def slight(self) -> bool:
        """Whether the arm stands only slightly otherwise, which is no fault of the record."""
        return self.stance is not None and self.stance.slight

    def which(self) -> str:
        """The joints that count in the other direction, with the verb."""
        which = ", ".join(str(j + 1) for j in self.turned)
        return f"joints {which} count" if len(self.turned) > 1 else f"joint {which} counts"

    def words(self, times: float) -> str:
        """What is wrong with a record that is explained so many times as well when read so, and what would be right."""
        better = f"all torques are explained {times:.2g} times as well"
        if self.unit:
            return f"angles seem to be in {self.unit}: read so {better}; give q in rad and v in rad/s"
        if self.stance is not None:
            return self.stance.otherwise(better)
        if self.against:
            q, v, tau = (f"{kind}{self.turned[0] + 1}" for kind in ("q", "v", "tau"))
            return (
                f"{q} counts against {tau}: with {q} and {v} of the other sign {better}; give them so, or {tau} of the "
                "other sign with an axis that is turned in the URDF"
            )
        if self.turned:
            return (
                f"{self.which()} in the direction against the URDF's axis: with q, v and tau of the other sign {better}; "
                "give them so, or turn the axis in the URDF"
            )
        given = [str(k + 1) for k in self.order]
        if len(self.moved) == 2:
            first, second = (k + 1 for k in self.moved)
            wrong = f"joints {first} and {second} are exchanged: with q, v and tau the other way round"
        else:
            wrong = f"joints are in another order: taken as {', '.join(given)}, base to tip,"
        return f"{wrong} {better}; number the joints from the base to the tip"


def readings(arm: Arm) -> Iterator[Reading]:
    """Every other reading of a record of an arm."""
    as_given = np.arange(arm.n)
    if arm.revolute.any():
        yield from (Reading(as_given, unit) for unit in _ANGLES)
    for order in _orders(arm.n):
        if order != tuple(range(arm.n)) and (arm.revolute[list(order)] == arm.revolute).all():
            yield Reading(np.array(order, dtype=np.intp))
    for size in range(1, arm.n + 1):
        if size <= (2 if arm.n <= _EVERY_PAIR else 1) or arm.n <= _EVERY_SENSE:
            yield from (Reading(as_given, turned=some) for some in combinations(range(arm.n), size))
    yield from (Reading(as_given, turned=(j,), against=True) for j in range(arm.n))


def _orders(n: int) -> Iterator[tuple[int, ...]]:
    if n <= _EVERY_ORDER:
        yield from permutations(range(n))
        return
    for i, j in combinations(range(n), 2):
        if n <= _EVERY_PAIR or j == i + 1:
            yield tuple({i: j, j: i}.get(k, k) for k in range(n))
    yield tuple(reversed(range(n)))
    for step in (1, -1):
        yield tuple((k + step) % n for k in range(n))


def meant(problem: PlainFits, plain: Fit) -> tuple[str, Stance | None]:
    """What is wrong with a record that another reading explains far better, the simplest of the best; or is slightly off.

    Args:
        problem: what is regressed of the record as it stands.
        plain: what is left of it.

    Returns:
        Empty words if no reading does; and how the base leans, or a joint's zero is off, if that explains most.
    """
    if float(np.mean(plain.relative)) < _GOOD_ENOUGH:
        return "", None
    n = len(plain.relative)
    found: list[tuple[Reading, float]] = []
    poorly: dict[int, str] = {}
    few = problem.every(SCREENED)
    first = few.left()
    sprung = problem.sprung().fit()
    stances = [other for other in (other_mounting(problem, plain), other_zero(problem, plain)) if other]
    stood = (Reading(np.arange(n), stance=stance) for stance in stances)
    for reading in (*stood, *readings(problem.arm)):
        if (reading.turned or reading.unit) and first.over(reading.read(few).left()) < PROMISING:
            continue
        other = reading.read(problem).fit()
        if reading.slight or reading.far_better(plain, other, sprung):
            found.append((reading, plain.over(other)))
            poorly[id(reading)] = _another_arm(other)
    best = max((times for _, times in found), default=0.0)
    near = sorted((pair for pair in found if pair[1] >= AS_GOOD * best), key=lambda pair: len(pair[0].turned))
    if not near:
        return "", None
    reading, times = near[0]
    if reading.slight:
        return "", reading.stance
    # an arm that hangs is its own mirror image, whose joints turn the other way
    mirrored = (other for other, _ in near if other.turned and not other.against)
    others = [f"; or {other.which()} against the URDF's axes" for other in mirrored]
    hangs = reading.stance is not None and reading.stance.kind == "leaning"
    return reading.words(times) + "".join(others[:1] if hangs else []) + poorly[id(reading)], None


def _another_arm(fit: Fit) -> str:
    """What a reading may still be wrong about, where it leaves much of some joint."""
    worst = int(np.argmax(fit.relative))
    if fit.relative[worst] < _POOR:
        return ""
    return f"; joint {worst + 1} is still off by {fit.relative[worst]:.0%}: or the URDF is of another arm"
