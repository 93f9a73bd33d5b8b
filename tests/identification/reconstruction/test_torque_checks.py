"""Torques that cannot be the arm's are refused with the likely cause; honest ones never are."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import fourier_motion, friction, measured, rigid_torque, standing, three_axis

from armloop.data.log import MotionLog, read_log, unchecked_log
from armloop.identification.reconstruction import reconstruct, torque_checks
from armloop.identification.reconstruction.bandwidth import Table
from armloop.identification.reconstruction.torque_checks import check_torques
from armloop.robot.arm import load_arm
from armloop.util.errors import LogError


def run(seed: int = 1, dry: float = 1.0, seconds: float = 40.0) -> MotionLog:
    motion = fourier_motion(seconds, 100.0, seed)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + dry * friction(motion.v)
    return measured(motion, tau, seed)


def exchanged(log: MotionLog, i: int, j: int, *keys: str) -> MotionLog:
    order = np.arange(log.joints)
    order[[i, j]] = order[[j, i]]
    return unchecked_log(**{**vars(log), **{key: getattr(log, key)[:, order] for key in keys}})


@pytest.mark.parametrize("seed", [1, *(pytest.param(k, marks=pytest.mark.long) for k in (2, 3, 4))])
@pytest.mark.parametrize("dry", [1.0, 0.3])
def test_turned_and_exchanged_columns_are_named(seed: int, dry: float) -> None:
    log = run(seed, dry)
    check_torques([log], three_axis(), 10.0)
    with pytest.raises(LogError, match=r"run: the sign of all joints is turned: .* friction drives"):
        check_torques([replace(log, tau=-log.tau)], three_axis(), 10.0)
    for j in range(3):
        signs = 1.0 - 2.0 * np.eye(3)[j]
        with pytest.raises(LogError, match=rf"the sign of tau{j + 1} is turned"):
            check_torques([replace(log, tau=log.tau * signs)], three_axis(), 10.0)
    for i, j in ((0, 1), (1, 2), (0, 2)):
        with pytest.raises(LogError, match=rf"columns tau{i + 1} and tau{j + 1} are exchanged"):
            check_torques([exchanged(log, i, j, "tau")], three_axis(), 10.0)


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.long)])
@pytest.mark.parametrize("dry", [1.0, 0.3])
@pytest.mark.parametrize("factor", [10.0, 100.0])
def test_a_gain_far_off_is_named(seed: int, dry: float, factor: float) -> None:
    log = run(seed, dry)
    for j in range(3):
        gains = np.where(np.arange(3) == j, factor, 1.0)
        with pytest.raises(
            LogError, match=rf"run: the torques do not fit one another: tau{j + 1} is"
        ) as found:
            check_torques([replace(log, tau=log.tau * gains)], three_axis(), 10.0)
        said = re.search(r"about (\S+) times", str(found.value))
        assert said is not None and float(said[1]) == pytest.approx(factor, rel=0.15)


def test_no_law_that_is_not_listed_passes_for_a_gain() -> None:
    """A spring, a drag and a coupling, each as strong as what the joints need anyway, and a gain that is off by half."""
    log = run(1)
    size = np.std(log.tau, axis=0)
    beside = {
        "spring": size * (log.q - 0.3),
        "drag": size * log.v * np.abs(log.v),
        "coupling": np.outer(log.v[:, 1] + log.v[:, 2], [0, 1, 1]) * size,
        "half": 0.5 * log.tau * [0, 1, 0],
    }
    for name, more in beside.items():
        check_torques([replace(log, tau=log.tau + more, name=name)], three_axis(), 10.0)


def test_reconstruct_asks_for_the_check() -> None:
    for library in (None, "rigid-body"):
        with pytest.raises(LogError, match="the sign of all joints is turned"):
            reconstruct([replace(run(), tau=-run().tau)], three_axis(), library=library)


def test_an_arm_without_friction_is_not_accused() -> None:
    for seed in (1, 2, 3):
        check_torques([run(seed, dry=0.0)], three_axis(), 10.0)


@pytest.mark.measured
@pytest.mark.parametrize(("every", "joints"), [(20, (1,)), pytest.param(3, range(6), marks=pytest.mark.long)])
def test_measured_arms_are_not_accused_and_their_faults_are_found(
    every: int, joints: Sequence[int], measured: Path
) -> None:
    ur5 = [12.5, 12.5, 12.5, 9.2, 9.2, 9.2]
    arms = {"ur10e": None, "ur5": ur5, "panda": None, "double_pendulum": None}
    for folder, gains in arms.items():
        arm = load_arm(measured / folder / f"{folder}.urdf")
        for path in sorted(measured.glob(f"{folder}/*.csv"))[::every]:
            if not path.name.endswith(".truth.csv"):
                check_torques([read_log(path, drive_gains=gains, quiet=True)], arm, 8.0)
    arm = load_arm(measured / "ur10e" / "ur10e.urdf")
    log = read_log(measured / "ur10e" / "noload_20_01_31-unload.csv")
    for j in joints:
        with pytest.raises(LogError, match=rf"the sign of tau{j + 1} is turned"):
            check_torques([replace(log, tau=log.tau * (1.0 - 2.0 * np.eye(6)[j]))], arm, 8.0)
        if j % 2:
            with pytest.raises(LogError, match=rf"columns tau{j} and tau{j + 1} are exchanged"):
                check_torques([exchanged(log, j - 1, j, "tau")], arm, 8.0)


class Fits(torque_checks.Problem):
    """Fits that are given: by the joints whose sign is turned, by their order, and by the half of the blocks."""

    def __init__(self, **fits: torque_checks.Fit) -> None:
        object.__setattr__(self, "fits", fits)

    def fit(self, signs: Any = (1.0, 1.0), order: Any = (0, 1), half: int | None = None) -> torque_checks.Fit:
        assert set(np.abs(signs)) == {1.0}
        turned = "".join(str(j + 1) for j in np.flatnonzero(np.array(signs) < 0))
        name = f"half_{half}" if half is not None else f"turned_{turned}"
        if (order != np.arange(len(order))).any():
            name = "order_" + "".join(str(j + 1) for j in order)
        return self.fits.get(name, fit_of([0.5, 0.5], [-1.0, -1.0], [-1.0, -1.0]))  # type: ignore[attr-defined]


def fit_of(relative: list[float], power: list[float], inertia: list[float]) -> torque_checks.Fit:
    return torque_checks.Fit(np.array(relative), np.array(power), np.array(inertia))


GOOD = [1.0, 1.0]


class TestTurnedSigns:
    PLAIN = fit_of([0.5, 0.5], [-0.1, 0.1], [-1.0, 1.0])

    @pytest.mark.parametrize(
        ("error", "power", "halves", "turned"),
        [
            # the joint alone explains its torque twice as well, and its friction brakes
            (0.249, 0.51, False, True),
            (0.251, 0.51, False, False),
            (0.249, 0.49, True, False),
            # or both halves of the blocks say that it drives, and nothing is worse than by a hundredth
            (0.4, 0.51, True, True),
            (0.4, 0.51, False, False),
            (0.509, 0.51, True, True),
            (0.511, 0.51, True, False),
        ],
    )
    def test_a_joint_whose_sign_is_turned(
        self, error: float, power: float, halves: bool, turned: bool
    ) -> None:
        other = fit_of([error, 0.5], [power, 0.1], GOOD)
        half = self.PLAIN if halves else fit_of([0.5, 0.5], [0.1, 0.1], [-1.0, 1.0])
        fits = Fits(turned_1=other, half_0=self.PLAIN, half_1=half)
        assert fits.turned(self.PLAIN) == ([0] if turned else [])
        assert Fits(half_0=self.PLAIN, half_1=self.PLAIN).turned(self.PLAIN) == []

    def test_a_fit_that_is_good_for_nothing_accuses_nobody(self) -> None:
        for error, turned in ((0.59, [0]), (0.6, [])):
            plain = fit_of([2.0, 2.0], [-0.1, 0.1], [-1.0, 1.0])
            fits = Fits(turned_1=fit_of([error, 2.0], [0.6, 0.1], GOOD), half_0=fit_of([2.0] * 2, GOOD, GOOD))
            assert fits.turned(plain) == turned

    def test_what_gains_most_is_turned(self) -> None:
        plain = fit_of([0.5, 0.5], [-0.1, -0.1], [-1.0, -1.0])
        one, both = fit_of([0.2, 0.5], [0.6, 0.1], GOOD), fit_of([0.2, 0.4], [0.6, 0.6], GOOD)
        assert Fits(turned_1=one, turned_12=both, half_0=plain, half_1=plain).turned(plain) == [0, 1]
        both = fit_of([0.3, 0.4], [0.6, 0.6], GOOD)
        assert Fits(turned_1=one, turned_12=both, half_0=plain, half_1=plain).turned(plain) == [0]

    def test_what_is_physical_as_recorded_is_not_accused_however_much_better_it_were_turned(self) -> None:
        plain = fit_of([0.5, 0.5], GOOD, GOOD)
        assert Fits(turned_1=fit_of([0.1, 0.5], GOOD, GOOD), half_0=plain, half_1=plain).turned(plain) == []

    def test_of_several_one_that_brakes_is_enough(self) -> None:
        plain = fit_of([0.5, 0.5], [-0.1, -0.1], [-1.0, -1.0])
        for power, turned in ((0.51, [0, 1]), (0.49, [])):
            both = fit_of([0.4, 0.4], [0.1, power], GOOD)
            assert Fits(turned_12=both, half_0=plain, half_1=plain).turned(plain) == turned

    def test_no_friction_neither_brakenor_drives_and_no_inertia_is_none(self) -> None:
        none = fit_of([0.1, 0.1], [0.0, 0.0], [1.0, 0.0])
        assert none.physical([0]) and not none.physical([0, 1]) and not none.driven([1])
        assert fit_of([0.1], [0.0], [-1.0]).driven([0]) and not fit_of([0.1], [0.1], [-1.0]).driven([0])

    def test_several_are_driven_if_each_is(self) -> None:
        assert fit_of([0.1] * 2, [-1.0, 0.0], [-1.0, -2.0]).driven([0, 1])
        assert not fit_of([0.1] * 2, [-1.0, 0.1], [-1.0, -2.0]).driven([0, 1])
        assert not fit_of([0.1] * 2, [-1.0, 0.0], [-1.0, 0.0]).driven([0, 1])


class Scaled(Fits):
    """Fits that are given, with the factor that each half of the blocks says of each joint."""

    def __init__(self, factors: list[tuple[float, float]], **fits: torque_checks.Fit) -> None:
        super().__init__(**fits)
        object.__setattr__(self, "factors", factors)

    def fit(self, signs: Any, order: Any = None, half: int | None = None) -> torque_checks.Fit:
        (changed,) = np.flatnonzero(signs != 1)
        return self.fits[f"scaled_{changed + 1}"]  # type: ignore[attr-defined, no-any-return]

    def _factor(self, joint: int, half: int) -> float:
        return self.factors[joint][half]  # type: ignore[attr-defined, no-any-return]


class TestGains:
    PLAIN = fit_of([0.4, 0.4], GOOD, GOOD)

    @pytest.mark.parametrize(
        ("halves", "relative", "power", "found"),
        [
            ((0.1, 0.1), [0.19, 0.4], GOOD, True),
            ((0.1, 0.1), [0.21, 0.4], GOOD, False),  # not twice as well
            ((0.3, 0.36), [0.19, 0.4], GOOD, True),  # 3.04 in the geometric mean
            ((0.32, 0.36), [0.19, 0.4], GOOD, False),  # 2.95: no gain is that little off
            ((0.1, 0.149), [0.19, 0.4], GOOD, True),
            ((0.1, 0.151), [0.19, 0.4], GOOD, False),  # the halves contradict each other
            ((10.0, 10.0), [0.19, 0.4], GOOD, True),  # too small is a fault, too
            ((-0.1, -0.1), [0.19, 0.4], GOOD, False),  # a sign is no gain
            ((0.1, -0.1), [0.19, 0.4], GOOD, False),
            ((0.0, 0.0), [0.19, 0.4], GOOD, False),  # nor is nothing
            ((0.1, 0.1), [0.19, 0.4], [1.0, -1.0], False),  # friction would drive
            ((0.1, 0.1), [0.19, 0.9], GOOD, False),  # what the joint gains the others lose
        ],
    )
    def test_a_joint_whose_gain_is_off(
        self, halves: tuple[float, float], relative: list[float], power: list[float], found: bool
    ) -> None:
        fits = Scaled([halves, (1.0, 1.0)], scaled_1=fit_of(relative, power, GOOD))
        expected = pytest.approx(np.sqrt(np.prod(halves))) if found else None
        assert fits.better_scaled(self.PLAIN) == ([(0, expected)] if found else [])

    def test_what_stays_poor_is_no_gain(self) -> None:
        plain = fit_of([1.3, 1.3], GOOD, GOOD)
        for error, found in ((0.59, [(0, pytest.approx(0.1))]), (0.6, [])):
            fits = Scaled([(0.1, 0.1), (1.0, 1.0)], scaled_1=fit_of([error, 1.3], GOOD, GOOD))
            assert fits.better_scaled(plain) == found

    def test_of_several_the_one_that_explains_most(self) -> None:
        fits = Scaled(
            [(0.1, 0.1), (0.2, 0.2)],
            scaled_1=fit_of([0.1, 0.4], GOOD, GOOD),
            scaled_2=fit_of([0.3, 0.1], GOOD, GOOD),
        )
        assert fits.better_scaled(self.PLAIN) == [(1, pytest.approx(0.2))]

    def test_one_that_spoils_the_rest_does_not_excuse_one_that_does_not(self) -> None:
        fits = Scaled(
            [(0.1, 0.1), (0.2, 0.2)],
            scaled_1=fit_of([0.1, 0.4], GOOD, GOOD),
            scaled_2=fit_of([2.0, 0.1], GOOD, GOOD),
        )
        assert fits.better_scaled(self.PLAIN) == [(0, pytest.approx(0.1))]

    def test_a_single_joint_has_nothing_to_be_compared_with(self) -> None:
        assert Scaled([(0.1, 0.1)]).better_scaled(fit_of([0.4], [1.0], [1.0])) == []

    def test_each_half_has_a_factor_of_its_own(self) -> None:
        """A gain that changes from block to block, to and fro: two factors, which contradict each other."""
        log = run(1)
        problem = torque_checks.Problem.of([log], three_axis(), 10.0)
        assert problem is not None
        for half, factor in enumerate((2.0, 5.0)):
            problem.table.tau[problem.table.blocks % 2 == half, 1] *= factor
        assert [1 / problem._factor(1, half) for half in (0, 1)] == pytest.approx([2.0, 5.0], rel=0.15)


class TestExchanges:
    def test_columns_are_exchanged_if_the_other_way_is_twice_as_good(self) -> None:
        plain = fit_of([0.9, 0.4], GOOD, GOOD)
        for relative, power, found in (
            ([0.55, 0.16], GOOD, [(0, 1)]),  # by a factor of 2.02 in the geometric mean
            ([0.55, 0.17], GOOD, []),
            ([0.6, 0.1], GOOD, []),
            ([0.55, 0.1], [1.0, -1.0], []),
        ):
            assert Fits(order_21=fit_of(relative, power, GOOD)).better_exchanged(plain) == found
        # what is met exactly is met to a part in a billion
        exact = fit_of([0.0, 0.0], GOOD, GOOD)
        assert plain.over(exact) == plain.over(exact, [0, 1]) == pytest.approx(np.sqrt(0.9 * 0.4) / 1e-9)

    def test_of_several_pairs_the_best(self) -> None:
        three = [1.0] * 3
        plain = fit_of([0.5] * 3, three, three)
        fits = Fits(
            order_213=fit_of([0.2, 0.2, 0.5], three, three),
            order_132=fit_of([0.5, 0.1, 0.1], three, three),
            order_321=plain,
        )
        assert fits.better_exchanged(plain) == [(1, 2)]


def small_problem() -> torque_checks.Problem:
    """Two joints with two shared parameters and the friction of each; neither is explained but for noise."""
    rng = np.random.default_rng(7)
    N = 60
    columns = np.zeros((N, 2, 8))
    columns[:, :, :2] = rng.normal(size=(N, 2, 2)) * [1.0, 1e-3]
    for j in range(2):
        v = rng.normal(size=N)
        columns[:, j, 2 + 3 * j : 5 + 3 * j] = np.column_stack([np.sign(v), v, np.ones(N)])
    tau = columns @ np.arange(1.0, 9.0) + rng.normal(size=(N, 2)) * [0.5, 5.0]
    table = Table(columns, tau, np.arange(N) // 5, rng.random((N, 2)) > 0.2, standing(N, 2), 1)
    arm, base = SimpleNamespace(n=2), SimpleNamespace(count=2)
    problem: Any = torque_checks.Problem(arm, base, table, np.zeros((1, 2)))  # type: ignore[arg-type]
    problem.__dict__["mass"] = np.ones((1, 2, 2, 2))
    return problem


@pytest.mark.parametrize("half", [None, 0, 1])
def test_joints_weigh_by_their_torques_first_then_by_what_is_left(half: int | None) -> None:
    problem = small_problem()
    table, signs, order = problem.table, np.array([1.0, -2.0]), np.array([1, 0])
    tau = table.tau[:, order] * signs
    rows = table.moving & (half is None or (table.blocks % 2 == half)[:, None])
    left = tau
    for _ in range(2):
        size = np.sqrt((left**2).sum(axis=0, where=rows) / rows.sum(axis=0))
        weights = (1 / size * np.ones_like(tau))[rows]
        theta = np.linalg.lstsq(table.columns[rows] * weights[:, None], tau[rows] * weights)[0]
        left = tau - table.columns @ theta
    error, torque = (np.sqrt((x**2).sum(axis=0, where=rows) / rows.sum(axis=0)) for x in (left, tau))
    found = problem.fit(signs, order, half)
    np.testing.assert_allclose(found.relative, error / torque, rtol=1e-5)
    np.testing.assert_allclose(found.inertia, theta[:2].sum(), rtol=1e-5)
    for j in range(2):
        own = table.columns[rows[:, j], j, 2 + 3 * j : 4 + 3 * j]
        parts = own * theta[2 + 3 * j : 4 + 3 * j] * own[:, 1:]
        assert found.power[j] == pytest.approx(parts.sum() / np.abs(parts).sum(), rel=1e-5)


@pytest.mark.parametrize("joint", [0, 1])
@pytest.mark.parametrize("half", [0, 1])
def test_the_factor_of_a_torque_is_that_with_which_all_are_explained_best(joint: int, half: int) -> None:
    problem = small_problem()
    table = problem.table
    rows = table.moving & (table.blocks % 2 == half)[:, None]
    size = np.sqrt((table.tau**2).sum(axis=0, where=rows) / rows.sum(axis=0))
    X = (table.columns / size[:, None])[rows]

    def left(factor: float) -> float:
        tau = table.tau / size * np.where(np.arange(2) == joint, factor, 1.0)
        return float(np.linalg.lstsq(X, tau[rows])[1][0])

    # a parabola, whose vertex three of its values tell
    below, at, above = (left(factor) for factor in (0.0, 1.0, 2.0))
    vertex = 1 - (above - below) / (2 * (above - 2 * at + below))
    assert problem._factor(joint, half) == pytest.approx(vertex, rel=1e-4)
