"""The mixed model of encoder zeros, on few instants: its equations, what it begins with, what follows from its errors."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from armloop.data.motion import Motion
from armloop.identification.reconstruction import encoder_zeros
from armloop.identification.reconstruction.bandwidth import Table
from armloop.identification.reconstruction.encoder_zeros import _Mixed

Array = np.ndarray[Any, Any]
LOGS, EACH, JOINTS, BASE = 4, 30, 2, 3
N, P = LOGS * EACH, BASE + 2 * JOINTS
SCALE = np.array([0.01, 0.06])


def table(seed: int = 0, spread: tuple[float, float] = (0.04, 0.1)) -> tuple[Table, Array]:
    """Blocks of five instants whose joints mostly slide, and the slopes by which the zeros of each log act."""
    rng = np.random.default_rng(seed)
    columns, slopes = rng.normal(size=(N, JOINTS, P)), rng.normal(size=(JOINTS, N, JOINTS, BASE))
    log = np.repeat(np.arange(LOGS), EACH)
    theta, zeros = rng.normal(size=P), rng.normal(size=(LOGS, JOINTS)) * spread
    acts = np.einsum("knjp,p->njk", slopes, theta[:BASE])
    tau = columns @ theta + np.einsum("njk,nk->nj", acts, zeros[log])
    tau += SCALE * rng.normal(size=tau.shape)
    motion = Motion(np.arange(float(N)), *np.zeros((3, N, JOINTS)), np.arange(0, N, EACH))
    return Table(columns, tau, np.arange(N) // 5, rng.random((N, JOINTS)) < 0.8, motion, 1), slopes


def model(repeats: float, slide: Any = (0, 1), **of: Any) -> _Mixed:
    own, slopes = table(**of)
    log = np.repeat(np.arange(LOGS), EACH)
    judged = [(j, own.moving[:, j]) for j in slide]
    return _Mixed(own, slopes, log, LOGS, repeats, SCALE, judged)


def by_marginals(mixed: _Mixed, kind: str, used: Array) -> tuple[Array, Array, Array, Array]:
    """Expectation maximisation by the marginal covariance of each log's torques instead of the effects' precision."""
    rows = [(i, j) for j, own in mixed.judged for i in np.flatnonzero(used & own)]
    at, joint = np.array(rows).T
    size = SCALE[joint]
    X, y = mixed.table.columns[at, joint] / size[:, None], mixed.table.tau[at, joint] / size
    theta, spread = np.linalg.lstsq(X, y, rcond=None)[0], np.full(JOINTS, 0.05)
    zeros, variance = np.zeros((LOGS, JOINTS)), np.zeros(JOINTS)
    for _ in range(30):
        Z = np.eye(JOINTS)[joint] if kind == "offsets" else (mixed.slopes[:, at, joint] @ theta[:BASE]).T
        Z = Z / size[:, None]
        G, g = np.zeros((P, P)), np.zeros(P)
        covariances, D = [], np.diag(spread**2)
        for k in range(LOGS):
            own = mixed.log[at] == k
            V = np.linalg.inv(mixed.repeats * np.eye(own.sum()) + Z[own] @ D @ Z[own].T)
            G += X[own].T @ V @ X[own]
            g += X[own].T @ V @ y[own]
            covariances.append((own, V))
        theta = np.linalg.solve(G, g)
        zeros = np.array([D @ Z[own].T @ V @ (y[own] - X[own] @ theta) for own, V in covariances])
        left = [np.diag(D - D @ Z[own].T @ V @ Z[own] @ D) for own, V in covariances]
        variance = np.mean(left, axis=0)
        spread = np.sqrt(np.mean(zeros**2, axis=0) + variance)
    return theta, zeros, spread, variance


@pytest.mark.parametrize("repeats", [1.0, 2.5])
@pytest.mark.parametrize("kind", ["zeros", "offsets"])
def test_effects_of_logs_are_those_of_the_marginal_likelihood(kind: str, repeats: float) -> None:
    mixed = model(repeats)
    used = np.random.default_rng(1).random(N) < 0.9
    theta, zeros, spread = mixed.solve(kind, used)
    expected = by_marginals(mixed, kind, used)
    np.testing.assert_allclose(theta, expected[0], rtol=1e-4, atol=1e-5)
    known = expected[3] < 0.5 * expected[2] ** 2
    assert known.any()
    np.testing.assert_allclose(zeros, np.where(known, expected[1], 0.0), rtol=1e-3, atol=1e-5)
    np.testing.assert_allclose(spread, np.where(known, expected[2], 0.0), rtol=1e-3)


def test_a_zero_of_which_the_data_leave_more_than_half_open_is_not_known() -> None:
    """The second joint's zeros differ less and less."""
    open_, used = [], np.ones(N, dtype=bool)
    for size in (0.1, 0.03, 0.01, 0.005, 0.003, 0.001, 0.0):
        mixed = model(1.0, spread=(0.04, size))
        *_, spread, variance = by_marginals(mixed, "zeros", used)
        _, zeros, found = mixed.solve("zeros", used)
        share = variance / spread**2
        assert (found > 0).tolist() == (share < 0.5).tolist() == zeros.any(axis=0).tolist()
        open_.append(float(share[1]))
    assert open_[0] < 0.5 and any(0.5 < share < 0.9 for share in open_)


def test_without_effects_it_is_least_squares_whatever_the_units_of_a_column() -> None:
    mixed = model(1.0)
    used = np.arange(N) < 90
    rows = [(i, j) for j, own in mixed.judged for i in np.flatnonzero(used & own)]
    at, joint = np.array(rows).T
    X, y = mixed.table.columns[at, joint], mixed.table.tau[at, joint]
    expected = np.linalg.lstsq(X / SCALE[joint][:, None], y / SCALE[joint], rcond=None)[0]
    theta, zeros, spread = mixed.solve("", used)
    np.testing.assert_allclose(theta, expected, rtol=1e-5, atol=1e-6)
    assert zeros.shape == (LOGS, JOINTS) and not zeros.any() and spread.shape == (JOINTS,)
    mixed.table.columns[..., 0] *= 1e-5
    np.testing.assert_allclose(mixed.solve("", used)[0][0], 1e5 * expected[0], rtol=1e-4)
    # of two columns that are the same each has half
    mixed.table.columns[..., 1] = mixed.table.columns[..., 0]
    twice = mixed.solve("", used)[0]
    assert twice[0] == pytest.approx(twice[1], rel=1e-4)
    mixed.table.columns[..., 1] = 0.0
    alone = mixed.solve("", used)[0]
    assert twice[0] == pytest.approx(alone[0] / 2, rel=1e-4) and alone[1] == 0.0


@pytest.mark.parametrize("kind", ["", "zeros", "offsets"])
def test_every_other_block_is_met_by_what_the_others_say_of_the_same_logs(kind: str) -> None:
    mixed = model(1.0)
    left = mixed.left_out(kind)
    for parity in (0, 1):
        judged = mixed.table.blocks % 2 == parity
        theta, zeros, _ = mixed.solve(kind, ~judged)
        expected = mixed.table.tau - mixed.table.columns @ theta
        if kind == "offsets":
            expected = expected - zeros[mixed.log]
        elif kind:
            acts = np.einsum("knjp,p->njk", mixed.slopes, theta[:BASE])
            expected = expected - np.einsum("njk,nk->nj", acts, zeros[mixed.log])
        np.testing.assert_allclose(left[judged], expected[judged], atol=1e-12)


def test_it_begins_with_slopes_logs_and_the_scatter_of_a_plain_regression() -> None:
    own, _ = table()
    own.moving[:, 1] &= np.arange(N) % 3 > 0
    q = np.random.default_rng(2).normal(size=(N, JOINTS))
    object.__setattr__(own, "motion", Motion(own.motion.time, q, 0 * q, 0 * q, own.motion.starts))
    arm: Any = SimpleNamespace(n=JOINTS)
    base: Any = SimpleNamespace(
        # of second degree, so that the middle difference is the derivative
        columns=lambda arm, motion: np.stack(
            [motion.q**2, motion.q[:, ::-1] * motion.q, 1 + 0 * motion.q], axis=2
        )
    )
    mixed = _Mixed.of(own, arm, base, 2.0)
    assert (mixed.repeats, mixed.logs) == (2.0, LOGS) and mixed.table is own
    assert mixed.log.tolist() == [k // EACH for k in range(N)]
    expected = np.zeros((JOINTS, N, JOINTS, 3))
    for k in range(JOINTS):
        expected[k, :, k, 0] = -2 * q[:, k]
        expected[k, :, :, 1] = -q[:, [1 - k]]
    np.testing.assert_allclose(mixed.slopes, expected, atol=1e-10)
    assert [j for j, _ in mixed.judged] == [0, 1]
    for j, rows in mixed.judged:
        np.testing.assert_array_equal(rows, own.moving[:, j])

    scale = np.array([np.sqrt(np.mean(own.tau[rows, j] ** 2)) for j, rows in mixed.judged])
    for _ in range(2):
        left = np.zeros_like(own.tau)
        for parity in (0, 1):
            fitted = own.blocks % 2 != parity
            X = np.concatenate([own.columns[fitted & rows, j] / scale[j] for j, rows in mixed.judged])
            y = np.concatenate([own.tau[fitted & rows, j] / scale[j] for j, rows in mixed.judged])
            theta = np.linalg.lstsq(X, y, rcond=None)[0]
            left[~fitted] = (own.tau - own.columns @ theta)[~fitted]
        scale = np.array([np.sqrt(np.mean(left[rows, j] ** 2)) for j, rows in mixed.judged])
    np.testing.assert_allclose(mixed.scale, scale, rtol=1e-5)


def test_a_joint_that_rests_or_has_no_torque_does_not_judge_and_has_a_size() -> None:
    own, _ = table()
    own.moving[:, 0] = False
    arm: Any = SimpleNamespace(n=JOINTS)
    base: Any = SimpleNamespace(columns=lambda arm, motion: np.ones((N, JOINTS, BASE)))
    mixed = _Mixed.of(own, arm, base, 1.0)
    assert [j for j, _ in mixed.judged] == [1] and mixed.scale[0] == 1.0
    own.tau[:] = 0.0
    assert _Mixed.of(own, arm, base, 1.0).scale.tolist() == [1.0, 1e-12]


class TestWholeSearch:
    """What is made of the errors, with the regression faked."""

    @pytest.fixture
    def asked(self, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
        own, _ = table()
        asked: dict[str, Any] = {
            "table": own,
            "clear": True,
            "offsets clear": False,
            "left": {},
            "compared": [],
        }
        zeros, spread = np.arange(8.0).reshape(LOGS, JOINTS), np.array([0.1, 0.2])

        class Faked:
            @staticmethod
            def of(own: Any, arm: Any, base: Any, repeats: float) -> Any:
                asked["repeats"] = repeats
                fake = Faked()
                fake.table, fake.judged = own, [(1, own.moving[:, 1]), (0, own.moving[:, 0])]
                return fake

            table: Any
            judged: Any

            def left_out(self, kind: str) -> Any:
                return asked["left"][kind]

            def solve(self, kind: str, used: Any) -> Any:
                asked["solved"] = kind, used.tolist()
                return np.zeros(P), zeros, spread

        def clearly(model: Any, before: Any, after: Any) -> bool:
            asked["compared"].append((before, after))
            return bool(asked["clear"]) if before is asked["left"][""] else bool(asked["offsets clear"])

        def table_at(logs: Any, *rest: Any) -> Any:
            asked["at"] = rest[3]
            return asked["table"]

        monkeypatch.setattr(
            encoder_zeros, "BaseParameters", SimpleNamespace(of_arm=lambda arm, rotors: rotors)
        )
        monkeypatch.setattr(encoder_zeros, "_Mixed", Faked)
        monkeypatch.setattr(encoder_zeros, "_clearly", clearly)
        monkeypatch.setattr(encoder_zeros, "table_at", table_at)
        return asked

    @staticmethod
    def found(count: int = LOGS, cutoff: float = 10.0, correlation: float = 0.1) -> Any:
        logs: Any = [SimpleNamespace(period=0.01 * (1 + k)) for k in range(count)]
        arm: Any = SimpleNamespace(n=JOINTS)
        return encoder_zeros.encoder_zeros(logs, arm, cutoff, [], correlation)

    def test_three_filtered_logs_are_looked_at_if_all_are_long_enough(self, asked: dict[str, Any]) -> None:
        asked["table"] = None
        for count, cutoff, looked in ((3, 0.5, True), (2, 0.5, False), (3, 0.0, False)):
            asked.pop("at", None)
            found = self.found(count, cutoff)
            assert not found.found and ("at" in asked) == looked and found.zeros.shape == (count, JOINTS)
            assert found.errors == {}
        asked["table"], _ = table()
        assert not self.found(LOGS + 1).found and "repeats" not in asked

    def test_errors_are_geometric_means_over_joints_relative_to_their_torques(
        self, asked: dict[str, Any]
    ) -> None:
        own, rng = asked["table"], np.random.default_rng(5)
        size = {"": 1.0, "zeros": 0.1, "offsets": 0.5, "springs": 0.6}
        asked["left"] = {kind: x * rng.normal(size=own.tau.shape) for kind, x in size.items()}
        found = self.found()
        assert found.found and found.spread.tolist() == [0.1, 0.2] and found.zeros[3].tolist() == [6.0, 7.0]
        assert asked["solved"] == ("zeros", [True] * N)
        (before, after), (zeros, offsets), (same, springs) = asked["compared"]
        assert before is asked["left"][""] and after is zeros is same is asked["left"]["zeros"]
        assert offsets is asked["left"]["offsets"] and springs is asked["left"]["springs"]

        def rms(x: Array, j: int) -> float:
            return float(np.linalg.norm(x[own.moving[:, j], j]))

        others = ["with offsets of the torque instead", "with springs instead"]
        assert list(found.errors) == ["without", "with zeros", *others]
        for value, left in zip(found.errors.values(), asked["left"].values(), strict=True):
            shares = [rms(left, j) / rms(own.tau, j) for j in range(JOINTS)]
            assert value == pytest.approx(np.sqrt(shares[0] * shares[1]))
        asked["offsets clear"] = True
        assert not self.found().found
        asked |= {"offsets clear": False, "clear": False}
        assert not self.found().found

    def test_instants_within_the_memory_of_the_residual_tell_the_same(self, asked: dict[str, Any]) -> None:
        """Of periods of 0.01 to 0.04 s the median is 0.025 s."""
        object.__setattr__(asked["table"], "stride", 4)
        asked["left"] = dict.fromkeys(("", "zeros", "offsets", "springs"), np.ones((N, JOINTS)))
        for correlation, repeats in ((0.5, 5.0), (0.05, 1.0)):
            self.found(correlation=correlation)
            assert asked["repeats"] == pytest.approx(repeats)


def test_a_gain_is_clear_by_three_standard_errors_of_the_blocks_mean() -> None:
    """Of each of eight blocks a joint gains 0.4 (1 ± s) in three instants, another 0.4 in one, relative to their squares."""
    blocks = np.repeat(np.array([0, 1, 2, 5, 6, 7, 8, 20]), 4)
    rows = np.arange(32) % 4 > 0
    table: Any = SimpleNamespace(blocks=blocks)
    fake: Any = SimpleNamespace(table=table, judged=[(0, rows), (1, ~rows)])
    for share, clear in ((0.97, True), (1.03, False)):
        # 1.6 ± 1.2 s has a standard error of 1.2 s / √7
        s = share * 1.6 * np.sqrt(7) / 3.6
        gains = np.column_stack([0.4 * (1 + s * np.repeat([1, -1] * 4, 4)), np.full(32, 0.4)])
        before = np.tile([3.0, 0.1], (32, 1))
        # what does not judge does not count
        before[~rows, 0], before[rows, 1] = 50.0, 50.0
        assert encoder_zeros._clearly(fake, before, before * np.sqrt(1 - gains)) == clear
    nothing = np.zeros((32, 2))
    assert not encoder_zeros._clearly(fake, nothing, nothing)
