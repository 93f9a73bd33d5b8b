"""Rigid bodies with plain friction, regressed on a record at few instants: errors, power of friction and inertia."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import fourier_motion, measured, rigid_torque, standing, three_axis

from armloop.identification.reconstruction import plain_fits
from armloop.identification.reconstruction.bandwidth import Table
from armloop.identification.reconstruction.plain_fits import PlainFits


def test_errors_friction_and_inertia_of_a_fit() -> None:
    """Two joints, one base parameter that is an inertia of both, and the friction of each."""
    rng = np.random.default_rng(0)
    N = 400
    v, vdot = rng.normal(size=(2, N, 2))
    columns = np.zeros((N, 2, 7))
    for j in range(2):
        columns[:, j, 0] = vdot[:, j]
        columns[:, j, 1 + 3 * j : 4 + 3 * j] = np.stack([np.sign(v[:, j]), v[:, j], np.ones(N)], axis=1)
    noise = 0.1 * rng.normal(size=(N, 2))
    tau = 2.0 * vdot + noise
    tau[:, 0] += 0.5 * np.sign(v[:, 0]) - 0.2 * v[:, 0]
    moving = np.ones((N, 2), dtype=bool)
    moving[:50, 1] = False
    table = Table(columns, tau, np.arange(N) // 10, moving, standing(N, 2), 1)
    mass = np.zeros((3, 2, 2, 1))
    mass[:, 0, 0, 0], mass[:, 1, 1, 0] = [1.0, 2.0, 3.0], 5.0
    arm, base = SimpleNamespace(n=2), SimpleNamespace(count=1)
    problem: Any = PlainFits(arm, base, table, np.zeros((3, 2)))  # type: ignore[arg-type]
    problem.__dict__["mass"] = mass
    found = problem.fit()
    sizes = [np.sqrt(np.mean(tau[rows, j] ** 2)) for j, rows in enumerate(moving.T)]
    np.testing.assert_allclose(found.relative, 0.1 / np.array(sizes), rtol=0.08)
    np.testing.assert_allclose(found.inertia, [4.0, 10.0], rtol=0.01)
    # of Coulomb friction's power against that of the drag that drives
    brakes, drives = 0.5 * np.abs(v[:, 0]).sum(), 0.2 * (v[:, 0] ** 2).sum()
    assert found.power[0] == pytest.approx((brakes - drives) / (brakes + drives), abs=0.03)
    assert found.power[1] == 0.0  # friction of less than a fiftieth of the torque says nothing
    assert problem.fit(np.full(2, 10.0), np.arange(2)).power.tolist() == pytest.approx(found.power.tolist())
    for level, brake in ((0.015, 0.0), (0.03, 1.0)):
        tau[:, 1] += level * sizes[1] * np.sign(v[:, 1])
        assert problem.fit(np.ones(2), np.arange(2)).power[1] == pytest.approx(brake, abs=0.2)
        tau[:, 1] -= level * sizes[1] * np.sign(v[:, 1])
    turned = problem.fit(-np.ones(2), np.arange(2))
    np.testing.assert_allclose(turned.power, -found.power)
    np.testing.assert_allclose(turned.inertia, -found.inertia)
    exchanged = problem.fit(np.ones(2), np.array([1, 0]))
    assert (exchanged.relative > 0.9).all()
    # a half of the blocks alone
    own = table.blocks % 2 == 0
    tau[~own] = 0.0
    half = problem.fit(np.ones(2), np.arange(2), 0)
    for j in range(2):
        rows = own & moving[:, j]
        expected = np.linalg.norm(noise[rows, j]) / np.linalg.norm(tau[rows, j])
        assert half.relative[j] == pytest.approx(expected, rel=0.05)
    assert problem.fit(np.ones(2), np.arange(2), 1).relative.tolist() == pytest.approx([0.0, 0.0], abs=1e-6)


@pytest.mark.parametrize(("counts", "enough"), [((200, 300), True), ((300, 199), False), ((199, 199), False)])
def test_each_joint_has_two_hundred_instants(
    counts: tuple[int, int], enough: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    moving = np.arange(300)[:, None] < np.array(counts)
    table = Table(
        np.zeros((300, 2, 8)), np.zeros((300, 2)), np.zeros(300, np.intp), moving, standing(300, 2), 1
    )
    monkeypatch.setattr(plain_fits, "table_at", lambda *_, **how: table)
    motion = fourier_motion(2.0, 100.0, 1)
    log = measured(motion, rigid_torque(three_axis(), motion.q, motion.v, motion.vdot), 1)
    problem = PlainFits.of([log], three_axis(), 10.0)
    assert (problem is not None) == enough
    if problem is not None:
        assert len(problem.table.tau) == 100 and len(problem.mass) == 67  # every third of 200 postures


def test_columns_under_another_gravity_are_those_of_the_arm_that_stands_so() -> None:
    """Torques are linear in gravity, so its direction is changed without going through the chain again."""
    arm, motion = three_axis(), fourier_motion(20.0, 100.0, 1)
    log = measured(motion, rigid_torque(arm, motion.q, motion.v, motion.vdot), 1)
    problem = PlainFits.of([log], arm, 10.0)
    assert problem is not None
    for down in (np.array([0.6, 0.0, -0.8]), np.array([0.0, 0.0, 1.0])):
        under, as_of = problem.under(down), problem.as_of(replace(arm, gravity=9.81 * down))
        assert under.arm.gravity.tolist() == as_of.arm.gravity.tolist()
        np.testing.assert_allclose(under.table.columns, as_of.table.columns, atol=1e-9)
