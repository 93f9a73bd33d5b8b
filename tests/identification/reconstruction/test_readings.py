"""A record whose joints stand in another order, or whose angles are in another unit, is told by what it explains."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import fourier_motion, friction, measured, rigid_torque, three_axis

from armloop.data.log import MotionLog, read_log, unchecked_log
from armloop.identification.reconstruction.plain_fits import Fit, PlainFits
from armloop.identification.reconstruction.readings import Reading, meant, readings
from armloop.identification.reconstruction.torque_checks import check_torques
from armloop.robot.arm import load_arm
from armloop.util.errors import LogError


def run(seed: int, dry: float) -> MotionLog:
    motion = fourier_motion(30.0, 100.0, seed)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + dry * friction(motion.v)
    return measured(motion, tau, seed)


def misread(log: MotionLog, order: list[int], factor: float = 1.0) -> MotionLog:
    """A record with the columns of joint ``order[k]`` in place k, and angles times a factor."""
    q, v, tau = (getattr(log, name)[:, order] for name in ("q", "v", "tau"))
    return unchecked_log(time=log.time, q=factor * q, v=factor * v, tau=tau, name=log.name)


def arm_of(kinds: str) -> Any:
    """An arm that is known by the kinds of its joints, R or P."""
    return SimpleNamespace(n=len(kinds), revolute=np.array([kind == "R" for kind in kinds]))


def orders(kinds: str) -> list[list[int]]:
    return [reading.order.tolist() for reading in readings(arm_of(kinds)) if not reading.unit]


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("dry", [1.0, 0.3])
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


@pytest.mark.parametrize("seed", [1, 2])
def test_friction_that_is_met_better_at_other_speeds_says_nothing_of_a_unit(seed: int) -> None:
    """Joints that slide slower than the plain fit's Coulomb friction fades in: read as revolutions, it would be there."""
    motion = fourier_motion(60.0, 300.0, seed)
    slow = replace(motion, time=30.0 * motion.time, v=motion.v / 30.0, vdot=motion.vdot / 900.0)
    tau = rigid_torque(three_axis(), slow.q, slow.v, slow.vdot) + 8 * np.sign(slow.v)
    check_torques([measured(slow, tau, seed, 0.0)], three_axis(), 1.0)


@pytest.mark.measured
def test_measured_records_are_taken_as_they_stand_and_misread_ones_are_not(measured: Path) -> None:
    backward = "in another order: taken as " + ", ".join(str(k) for k in range(7, 0, -1))
    for folder, path, misreadings in (
        (
            "ur10e",
            "noload_20_02_10-20sec_7harm",
            [([5, 0, 1, 2, 3, 4], 1.0, "in another order: taken as 2, 3")],
        ),
        (
            "panda",
            "exciting_1a",
            [([*range(6, -1, -1)], 1.0, backward), ([*range(7)], 0.5 / np.pi, "in revolutions")],
        ),
    ):
        arm = load_arm(measured / folder / f"{folder}.urdf")
        log = read_log(measured / folder / f"{path}.csv", quiet=True)
        check_torques([log], arm, 8.0)
        for order, factor, words in misreadings:
            with pytest.raises(LogError, match=words):
                check_torques([misread(log, order, factor)], arm, 8.0)


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
    assert orders("RRPRR") == [[1, 0, 2, 3, 4], [3, 1, 2, 0, 4], [4, 1, 2, 3, 0], [0, 3, 2, 1, 4], [0, 4, 2, 3, 1],
                               [0, 1, 2, 4, 3], [4, 3, 2, 1, 0]]  # fmt: skip


def test_units_are_asked_of_where_there_are_angles_and_scale_these_alone() -> None:
    assert [reading.unit for reading in readings(arm_of("PP")) if reading.unit] == []
    turns, degrees = [reading for reading in readings(arm_of("RP")) if reading.unit]
    q = np.arange(8.0).reshape(4, 2)
    log = unchecked_log(time=np.arange(4.0), q=q, v=q + 10, tau=q + 20, name="run")
    for reading, factor in ((turns, 2 * np.pi), (degrees, np.pi / 180)):
        read = reading.of(log, arm_of("RP"))
        np.testing.assert_allclose(read.q, q * [factor, 1.0])
        np.testing.assert_allclose(read.v, (q + 10) * [factor, 1.0])
        assert (read.tau == q + 20).all() and (read.time == log.time).all() and read.name == "run"
    read = Reading(np.array([1, 0])).of(log, arm_of("RR"))
    assert (read.q == q[:, ::-1]).all() and (read.v == (q + 10)[:, ::-1]).all()
    assert (read.tau == (q + 20)[:, ::-1]).all()


def fit_of(relative: list[float], faults: int = 0) -> Fit:
    inertia = np.where(np.arange(len(relative)) < faults, -1.0, 1.0)
    return Fit(np.array(relative), np.ones(len(relative)), inertia)


class Given:
    """Fits that are given, in the order in which they are asked for."""

    def __init__(self, fits: list[Fit | None]) -> None:
        self.fits = iter(fits)

    def of(self, logs: list[MotionLog], arm: object, cutoff_hz: float, unit: Any) -> Any:
        fit = next(self.fits)
        return None if fit is None else SimpleNamespace(fit=lambda signs, order: fit)


def chosen(plain: Fit, others: list[Fit | None], monkeypatch: pytest.MonkeyPatch) -> Any:
    """What of revolutions, degrees and the other order of two joints is meant."""
    monkeypatch.setattr(PlainFits, "of", Given(others).of)
    q = np.zeros((3, 2))
    log = unchecked_log(time=np.arange(3.0), q=q, v=q, tau=q, name="run")
    found = meant([log], arm_of("RR"), 10.0, plain)
    return None if found is None else (found[0].unit or found[0].order.tolist(), pytest.approx(found[1]))


@pytest.mark.parametrize(
    ("plain", "others", "found"),
    [
        # an order must be three times as good in the geometric mean; a unit by half
        (fit_of([0.3, 0.2]), [None, None, fit_of([0.1, 0.066])], ([1, 0], np.sqrt(0.06 / 0.0066))),
        (fit_of([0.3, 0.2]), [None, None, fit_of([0.1, 0.067])], None),
        (fit_of([0.3, 0.2]), [fit_of([0.2, 0.13]), None, None], ("revolutions", np.sqrt(0.06 / 0.026))),
        (fit_of([0.3, 0.2]), [None, fit_of([0.2, 0.134]), None], None),
        # of several the best
        (fit_of([0.3, 0.2]), [fit_of([0.1, 0.1]), fit_of([0.05, 0.1]), fit_of([0.1, 0.1])],
         ("degrees", np.sqrt(0.06 / 0.005))),
        # it may not be less physical than the record as it stands, and must be good for something
        (fit_of([0.3, 0.2], 1), [fit_of([0.1, 0.1], 1), None, None], ("revolutions", np.sqrt(6.0))),
        (fit_of([0.3, 0.2], 1), [fit_of([0.1, 0.1], 2), None, None], None),
        (fit_of([1.9, 1.9]), [fit_of([0.59, 0.1]), None, None], ("revolutions", np.sqrt(1.9**2 / 0.059))),
        (fit_of([1.9, 1.9]), [fit_of([0.61, 0.1]), None, None], None),
    ],
)  # fmt: skip
def test_a_reading_must_explain_far_more(
    plain: Fit, others: list[Fit | None], found: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert chosen(plain, others, monkeypatch) == found


def test_what_is_explained_well_is_not_asked_of(monkeypatch: pytest.MonkeyPatch) -> None:
    better = [fit_of([0.001, 0.001])] * 3
    assert chosen(fit_of([0.01, 0.029]), better, monkeypatch) is None
    assert chosen(fit_of([0.01, 0.031]), better, monkeypatch) is not None
