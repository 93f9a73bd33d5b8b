"""A record whose joints stand in another order, or whose angles are in another unit, is told by what it explains."""

from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from leaning_arm import upright_axes
from synthetic import fourier_motion, friction, measured, rigid_torque, three_axis

from armloop.data.log import MotionLog, read_log, unchecked_log
from armloop.identification.reconstruction import readings as readings_module
from armloop.identification.reconstruction.plain_fits import Fit, PlainFits
from armloop.identification.reconstruction.readings import Reading, meant, readings
from armloop.identification.reconstruction.torque_checks import check_torques
from armloop.identification.reconstruction.zero_offsets import ZeroOffset
from armloop.robot.arm import load_arm
from armloop.util.arrays import Array, Index, Mask
from armloop.util.errors import LogError

#: What takes long in sum, of many like it.
LONG = pytest.mark.long


def run(seed: int, dry: float) -> MotionLog:
    motion = fourier_motion(30.0, 100.0, seed)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + dry * friction(motion.v)
    return measured(motion, tau, seed)


def misread(log: MotionLog, order: list[int], factor: float = 1.0) -> MotionLog:
    """A record with the columns of joint ``order[k]`` in place k, and angles times a factor."""
    q, v, tau = (getattr(log, name)[:, order] for name in ("q", "v", "tau"))
    return unchecked_log(time=log.time, q=factor * q, v=factor * v, tau=tau, name=log.name)


@dataclass
class Kinds:
    """A weightless arm that is known by the kinds of its joints, and how it stands otherwise."""

    n: int
    revolute: Mask
    gravity: Array
    zeros: tuple[tuple[int, float], ...] = ()

    def with_zero(self, joint: int, angle: float) -> "Kinds":
        return replace(self, zeros=(*self.zeros, (joint, angle)))


def arm_of(kinds: str) -> Any:
    """Of joints R or P."""
    return Kinds(len(kinds), np.array([kind == "R" for kind in kinds]), np.zeros(3))


def orders(kinds: str) -> list[list[int]]:
    return [
        reading.order.tolist() for reading in readings(arm_of(kinds)) if not (reading.unit or reading.turned)
    ]


def turned(log: MotionLog, joints: tuple[int, ...], tau: bool = True) -> MotionLog:
    """A record whose joints count in the other direction, their torques too."""
    signs = np.where(np.isin(np.arange(log.joints), joints), -1.0, 1.0)
    return unchecked_log(
        time=log.time, q=signs * log.q, v=signs * log.v, tau=(signs if tau else 1) * log.tau, name=log.name
    )


@pytest.mark.parametrize(
    ("seed", "dry"),
    [(2, 1.0), *(pytest.param(*each, marks=LONG) for each in ((1, 0.3), (1, 1.0), (2, 0.3)))],
)
def test_orders_and_units_are_named(seed: int, dry: float) -> None:
    log, arm = run(seed, dry), three_axis()
    check_torques([log], arm, 10.0)
    for order, words in (
        ([2, 1, 0], r"joints 1 and 3 are exchanged"),
        ([2, 0, 1], r"in another order: taken as 2, 3, 1, base to tip"),
        ([1, 2, 0], r"in another order: taken as 3, 1, 2, base to tip"),
    ):
        with pytest.raises(LogError, match=words):
            check_torques([misread(log, order)], arm, 10.0)
    for factor, unit in ((1 / (2 * np.pi), "revolutions"), (180 / np.pi, "degrees")):
        with pytest.raises(LogError, match=rf"angles seem to be in {unit}: .* times as well; give q in rad"):
            check_torques([misread(log, [0, 1, 2], factor)], arm, 10.0)


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=LONG)])
@pytest.mark.parametrize(
    ("joints", "words"),
    [
        ((1,), r"joint 2 counts in the direction against the URDF's axis: .* times as well; give them so"),
        ((2,), r"joint 3 counts in the direction against"),
        # the first joint is upright: which way it counts is nothing that its torques tell
        ((0,), ""),
        ((0, 2), r"joint 3 counts in the direction against"),
        # its mirror image
        (
            (1, 2),
            r"mounted otherwise .* gravity along \(-?0\.0., -?0\.0., 1\.00\) .*; or joints 2, 3 count against",
        ),
    ],
)
def test_joints_that_count_the_other_way_are_named(seed: int, joints: tuple[int, ...], words: str) -> None:
    log = turned(run(seed, 1.0), joints)
    if not words:
        assert check_torques([log], three_axis(), 10.0) == []
        return
    with pytest.raises(LogError, match=words):
        check_torques([log], three_axis(), 10.0)


@pytest.mark.parametrize("joint", [1, 2, 3])
def test_angles_that_count_against_their_torque_are_named(joint: int) -> None:
    """Of the first joint, which is upright, it is the same as a torque that counts against its angle."""
    log, signs = run(2, 1.0), np.where(np.arange(3) == joint - 1, -1.0, 1.0)
    log = unchecked_log(time=log.time, q=signs * log.q, v=signs * log.v, tau=log.tau, name="run")
    words = rf"run: q{joint} counts against tau{joint}: with q{joint} and v{joint} of the other sign all torques are"
    words = "run: the sign of tau1 is turned" if joint == 1 else words
    with pytest.raises(LogError, match=words):
        check_torques([log], three_axis(), 10.0)


@pytest.mark.parametrize(
    ("seed", "down"),
    [
        (2, (1.0, 0.0, 0.0)),
        (1, (0.5, 0.3, -0.81)),
        *(pytest.param(*each, marks=LONG) for each in ((1, (0.0, 0.0, 1.0)), (2, (0.0, 0.8, 0.6)))),
    ],
)
def test_the_direction_of_gravity_is_found(seed: int, down: tuple[float, float, float]) -> None:
    motion = fourier_motion(30.0, 100.0, seed)
    mounted = replace(three_axis(), gravity=9.81 * np.array(down) / np.linalg.norm(down))
    log = measured(motion, rigid_torque(mounted, motion.q, motion.v, motion.vdot) + friction(motion.v), seed)
    check_torques([log], mounted, 10.0)
    with pytest.raises(LogError, match="the arm seems to be mounted otherwise than its URDF says") as said:
        check_torques([log], three_axis(), 10.0)
    found = np.array([float(x) for x in str(said.value).split("along (")[1].split(")")[0].split(", ")])
    np.testing.assert_allclose(found, np.array(down) / np.linalg.norm(down), atol=0.03)


def test_a_joint_that_is_explained_well_says_nothing_of_another_that_is_not() -> None:
    """Slow joints of little friction: joint 2's noise hid its inertia, and joint 4's fit rose from 2 to .8 %."""
    check_torques([upright_axes(2, 0.0, slower=4.0, rubbing=0.1)], load_arm("scara"), 10.0)


@pytest.mark.parametrize("seed", [1, *(pytest.param(k, marks=pytest.mark.long) for k in (2, 3))])
def test_laws_as_strong_as_gravity_are_no_other_reading(seed: int) -> None:
    """Ripple, a spring between joints, a coupled wrist's friction, and one joint's speed as another's friction."""
    motion = fourier_motion(30.0, 100.0, seed)
    q, v, arm = motion.q, motion.v, three_axis()
    tau = rigid_torque(arm, q, v, motion.vdot) + friction(v)
    size = np.sqrt(np.mean(tau**2, axis=0))
    wrist = np.tanh(10 * (v[:, 1] + v[:, 2]))
    for law in (
        np.sin(3 * q),
        np.column_stack([np.sin(q[:, 1] - q[:, 2]), 0 * wrist, 0 * wrist]),
        np.column_stack([0 * wrist, wrist, wrist]),
        q[:, [1, 2, 0]] * v,
    ):
        check_torques([measured(motion, tau + size * law, seed)], arm, 10.0)


@pytest.mark.parametrize("seed", [1, 2])
def test_friction_that_is_met_better_at_other_speeds_says_nothing_of_a_unit(seed: int) -> None:
    """Joints that slide slower than the plain fit's Coulomb friction fades in: read as revolutions, it would be there."""
    motion = fourier_motion(60.0, 300.0, seed)
    slow = replace(motion, time=30.0 * motion.time, v=motion.v / 30.0, vdot=motion.vdot / 900.0)
    tau = rigid_torque(three_axis(), slow.q, slow.v, slow.vdot) + 8 * np.sign(slow.v)
    check_torques([measured(slow, tau, seed, 0.0)], three_axis(), 1.0)


@pytest.mark.long
@pytest.mark.measured
@pytest.mark.parametrize(
    ("folder", "path", "misreadings"),
    [
        (
            "ur10e",
            "noload_20_02_10-20sec_7harm",
            [([5, 0, 1, 2, 3, 4], 1.0, "in another order: taken as 2, 3")],
        ),
        (
            "panda",
            "exciting_1a",
            [
                ([*range(6, -1, -1)], 1.0, "in another order: taken as 7, 6, 5, 4, 3, 2, 1"),
                ([*range(7)], 0.5 / np.pi, "in revolutions"),
            ],
        ),
    ],
)
def test_measured_records_are_taken_as_they_stand_and_misread_ones_are_not(
    folder: str, path: str, misreadings: list[tuple[list[int], float, str]], measured: Path
) -> None:
    arm = load_arm(measured / folder / f"{folder}.urdf")
    log = read_log(measured / folder / f"{path}.csv", quiet=True)
    check_torques([log], arm, 8.0)
    for order, factor, words in misreadings:
        with pytest.raises(LogError, match=words):
            check_torques([misread(log, order, factor)], arm, 8.0)
    if folder == "ur10e":
        with pytest.raises(LogError, match="joint 2 counts in the direction against"):
            check_torques([turned(log, (1,))], arm, 8.0)
    else:
        with pytest.raises(LogError, match=r"gravity along \(-?0\.0., -?0\.0., -1\.00\)"):
            check_torques([log], replace(arm, gravity=np.array([9.81, 0.0, 0.0])), 8.0)


def test_small_arms_are_read_in_every_order_of_the_same_kinds_and_larger_ones_in_likely_orders() -> None:
    assert orders("RR") == [[1, 0]]
    assert len(orders("RRRR")) == 23 and [3, 2, 1, 0] in orders("RRRR") and [1, 2, 3, 0] in orders("RRRR")
    assert orders("RRP") == [[1, 0, 2]] and orders("RP") == []
    five = orders("RRRRR")
    assert len(five) == 10 + 1 + 2 and len({tuple(order) for order in five}) == 13
    assert (
        [4, 3, 2, 1, 0] in five
        and [1, 2, 3, 4, 0] in five
        and [4, 0, 1, 2, 3] in five
        and [3, 1, 2, 0, 4] in five
    )
    assert len(orders("R" * 10)) == 45 + 3
    many = orders("R" * 11)
    assert len(many) == 10 + 3 and [1, 0, *range(2, 11)] in many and [2, 1, 0, *range(3, 11)] not in many
    assert orders("RRPRR") == [[1, 0, 2, 3, 4], [3, 1, 2, 0, 4], [4, 1, 2, 3, 0], [0, 3, 2, 1, 4], [0, 4, 2, 3, 1],
                               [0, 1, 2, 4, 3], [4, 3, 2, 1, 0]]  # fmt: skip


def test_units_are_asked_of_where_there_are_angles_and_scale_these_alone() -> None:
    assert [reading.unit for reading in readings(arm_of("PP")) if reading.unit] == []
    turns, degrees = [reading for reading in readings(arm_of("RP")) if reading.unit]
    assert turns.scale(arm_of("RP")).tolist() == [2 * np.pi, 1.0]
    assert degrees.scale(arm_of("PR")).tolist() == [1.0, np.pi / 180]


def fit_of(relative: list[float], faults: int = 0) -> Fit:
    inertia = np.where(np.arange(len(relative)) < faults, -1.0, 1.0)
    return Fit(np.array(relative), np.ones(len(relative)), inertia)


class Given:
    """A record whose other readings leave what is given, by what they are."""

    def __init__(self, plain: Fit, others: dict[str, Fit]) -> None:
        self.plain, self.others = plain, others
        self.arm = arm_of("R" * len(plain.relative))

    def read(self, order: Index, factors: Array, torque_signs: Array) -> Any:
        if abs(factors[0]) != 1:
            return self._left("turns" if factors[0] > 1 else "degrees") or self._left("plain")
        turned = ", ".join(str(j + 1) for j in np.flatnonzero(factors < 0))
        if (torque_signs != factors).any():
            turned = f"{turned} against tau"
        return self._left(turned or "order") or self._left("plain")

    def every(self, step: int) -> Any:
        return self

    def fit(self) -> Fit:
        return self.plain

    def left(self) -> Fit:
        return self.plain

    def sprung(self) -> Any:
        return self._left("springs") or self._left("plain")

    def as_of(self, arm: Kinds) -> Any:
        turned = self._left("zero") if arm.zeros else None
        return turned or self.under(arm.gravity / np.linalg.norm(arm.gravity))

    def under(self, down: Array) -> Any:
        return (self._left("up") if down[2] > 0.99 else None) or self._left("plain")

    def _left(self, reading: str) -> Any:
        fit = self.plain if reading == "plain" else self.others.get(reading)
        return None if fit is None else SimpleNamespace(fit=lambda: fit, left=lambda: fit)


def chosen(plain: Fit, others: dict[str, Fit], monkeypatch: pytest.MonkeyPatch) -> str:
    """What is said of a record of two joints."""
    given: Any = Given(plain, others)
    zero = ZeroOffset(0, np.pi / 2, 0.01) if "zero" in others else None
    monkeypatch.setattr(readings_module, "other_zero", lambda problem, plain: zero)
    return meant(given, plain)[0]


@pytest.mark.parametrize(
    ("plain", "others", "said"),
    [
        # an order must be three times as good in the geometric mean; a unit by half
        (fit_of([0.3, 0.2]), {"order": fit_of([0.1, 0.066])}, "joints 1 and 2 are exchanged"),
        (fit_of([0.3, 0.2]), {"order": fit_of([0.1, 0.067])}, ""),
        # of two joints of several these must be twice as good, none worse by more than a fifth, and better than with springs
        (fit_of([0.03, 0.3, 0.1]), {"order": fit_of([0.03, 0.14, 0.05])}, "joints 2 and 3 are exchanged"),
        (fit_of([0.03, 0.3, 0.1]), {"order": fit_of([0.03, 0.16, 0.05])}, ""),
        (fit_of([0.03, 0.3, 0.1]), {"order": fit_of([0.037, 0.12, 0.04])}, "joints 2 and 3 are exchanged"),
        (fit_of([0.03, 0.3, 0.1]), {"order": fit_of([0.038, 0.12, 0.04])}, ""),
        (fit_of([0.03, 0.3, 0.03]), {"order": fit_of([0.03, 0.14, 0.01])}, ""),
        (fit_of([0.03, 0.3, 0.1]), {"order": fit_of([0.03, 0.14, 0.05]), "springs": fit_of([0.03, 0.15, 0.05])}, "joints 2"),
        (fit_of([0.03, 0.3, 0.1]), {"order": fit_of([0.03, 0.14, 0.05]), "springs": fit_of([0.03, 0.13, 0.05])}, ""),
        (fit_of([0.3, 0.2]), {"turns": fit_of([0.2, 0.13])}, "revolutions: read so all torques are explained 1.5 times"),
        (fit_of([0.3, 0.2]), {"degrees": fit_of([0.2, 0.134])}, ""),
        # a direction: the best joint twice, all by a fifth, none worse by more than a fifth
        (fit_of([0.3, 0.2]), {"2": fit_of([0.3, 0.099])}, "joint 2 counts"),
        (fit_of([0.3, 0.2]), {"2": fit_of([0.3, 0.101])}, ""),
        (fit_of([0.3, 0.2]), {"2": fit_of([0.37, 0.06])}, "joint 2 counts"),
        (fit_of([0.3, 0.2]), {"2": fit_of([0.38, 0.06])}, ""),
        (fit_of([0.2] * 8), {"2": fit_of([0.2] * 7 + [0.04])}, "joint 2 counts"),
        (fit_of([0.2] * 8), {"2": fit_of([0.2] * 7 + [0.05])}, ""),
        # of a joint that is met within two hundredths, better says nothing
        (fit_of([0.05, 0.3]), {"2": fit_of([0.001, 0.2])}, "joint 2 counts"),
        (fit_of([0.03, 0.3]), {"2": fit_of([0.001, 0.2])}, ""),
        (fit_of([0.3, 0.02, 0.02, 0.02]), {"2": fit_of([0.149, 0.001, 0.001, 0.001])}, ""),
        # and better than with springs
        (fit_of([0.3, 0.2]), {"2": fit_of([0.1, 0.1]), "springs": fit_of([0.1, 0.101])}, "joint 2 counts"),
        (fit_of([0.3, 0.2]), {"2": fit_of([0.1, 0.1]), "springs": fit_of([0.1, 0.099])}, ""),
        (fit_of([0.3, 0.2]), {"turns": fit_of([0.1, 0.1]), "springs": fit_of([0.1, 0.099])}, "revolutions"),
        # of several the best, of those that are as good the simplest
        (fit_of([0.3, 0.2]), {"turns": fit_of([0.1, 0.1]), "degrees": fit_of([0.05, 0.1])}, "degrees"),
        (fit_of([0.3, 0.2]), {"2": fit_of([0.1, 0.1]), "1, 2": fit_of([0.1, 0.096])}, "joint 2 counts"),
        (fit_of([0.3, 0.2]), {"2": fit_of([0.1, 0.1]), "1, 2": fit_of([0.1, 0.088])}, "joints 1, 2 count"),
        # it may not be less physical than the record as it stands, and must be good for something
        (fit_of([0.3, 0.2], 1), {"turns": fit_of([0.1, 0.1], 1)}, "revolutions"),
        (fit_of([0.3, 0.2], 1), {"turns": fit_of([0.1, 0.1], 2)}, ""),
        (fit_of([1.9, 1.9]), {"turns": fit_of([0.59, 0.1])}, "revolutions"),
        (fit_of([1.9, 1.9]), {"turns": fit_of([0.61, 0.1])}, ""),
    ],
)  # fmt: skip
def test_a_reading_must_explain_far_more(
    plain: Fit, others: dict[str, Fit], said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = chosen(plain, others, monkeypatch)
    assert said in found and bool(said) == bool(found)


def test_what_is_explained_well_is_not_asked_of(monkeypatch: pytest.MonkeyPatch) -> None:
    better = {"turns": fit_of([0.001, 0.001])}
    assert chosen(fit_of([0.01, 0.029]), better, monkeypatch) == ""
    assert "revolutions" in chosen(fit_of([0.01, 0.031]), better, monkeypatch)


def test_a_reading_that_leaves_much_of_a_joint_may_be_of_another_arm(monkeypatch: pytest.MonkeyPatch) -> None:
    plain, words = fit_of([0.9, 0.2, 0.31]), "; joint 3 is still off by 30%: or the URDF is of another arm"
    assert chosen(plain, {"1": fit_of([0.1, 0.1, 0.3])}, monkeypatch).endswith(words)
    assert "another arm" not in chosen(plain, {"1": fit_of([0.1, 0.1, 0.24])}, monkeypatch)


def test_an_arm_that_hangs_may_be_its_mirror_image(monkeypatch: pytest.MonkeyPatch) -> None:
    plain, hangs = fit_of([0.3, 0.2]), fit_of([0.1, 0.1])
    said = chosen(plain, {"up": hangs, "1, 2": fit_of([0.1, 0.1])}, monkeypatch)
    assert "gravity along (0.00, 0.00, 1.00)" in said and said.endswith(
        "; or joints 1, 2 count against the URDF's axes"
    )
    assert said.count("; or") == 1
    assert "; or" not in chosen(plain, {"up": hangs}, monkeypatch)
    # angles that count against their torques are no mirror image
    assert "; or" not in chosen(plain, {"up": hangs, "2 against tau": fit_of([0.1, 0.1])}, monkeypatch)
    # a joint with another zero is not
    said = chosen(plain, {"zero": hangs, "1, 2": fit_of([0.1, 0.1])}, monkeypatch)
    assert "joint 1 counts from another zero" in said and "; or" not in said


@pytest.mark.parametrize(
    ("joints", "sets"), [(2, 3), (6, 63), (7, 127), (8, 8 + 28), (10, 10 + 45), (11, 11)]
)
def test_small_arms_are_read_with_every_set_of_joints_turned(joints: int, sets: int) -> None:
    every = list(readings(arm_of("R" * joints)))
    found = [reading.turned for reading in every if reading.turned and not reading.against]
    assert len(set(found)) == len(found) == sets
    assert [reading.turned for reading in every if reading.against] == [(j,) for j in range(joints)]


def test_columns_read_otherwise_are_those_of_the_log_read_so() -> None:
    arm, log, steady, given = three_axis(), run(3, 1.0), np.ones(3), np.arange(3)
    order = [2, 0, 1]
    for reading, as_read in (
        (Reading(np.array(order)), misread(log, order)),
        (Reading(given, turned=(0, 2)), turned(log, (0, 2))),
        (Reading(given, turned=(1,), against=True), turned(log, (1,), tau=False)),
        (Reading(given, "degrees"), misread(log, [0, 1, 2], np.pi / 180)),
    ):
        whole, plain = (PlainFits.of([one], arm, 10.0) for one in (as_read, log))
        assert whole is not None and plain is not None
        read = reading.read(plain)
        # of another unit friction keeps its shapes, whatever the speeds
        r = read.base.count if reading.unit else read.table.columns.shape[2]
        np.testing.assert_allclose(read.table.columns[..., :r], whole.table.columns[..., :r], atol=1e-9)
        np.testing.assert_allclose(read.table.columns[..., r:], plain.table.columns[..., r:])
        for part in ("tau", "moving"):
            np.testing.assert_allclose(getattr(read.table, part), getattr(whole.table, part), atol=1e-9)
        np.testing.assert_allclose(read.mass, whole.mass, atol=1e-9)
        if not reading.unit:
            mine, other = (one.fit(steady, given) for one in (read, whole))
            np.testing.assert_allclose(mine.relative, other.relative, rtol=1e-6)
            np.testing.assert_allclose(mine.inertia, other.inertia, rtol=1e-6)
