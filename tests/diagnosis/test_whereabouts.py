"""A residual is found in its stretch of time, or under its condition, and nowhere else."""

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import fourier_motion, measured, rigid_torque, three_axis

from armloop.data.motion import Motion
from armloop.data.signals import preprocess
from armloop.diagnosis import whereabouts as places
from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.fit import fit
from armloop.diagnosis.whereabouts import Whereabouts, localised, whereabouts
from armloop.laws.friction import FrictionLaw
from armloop.model import ReconstructedModel
from armloop.model.components import RigidBody
from armloop.robot.kinematics import nominal_parameters


def found(law: Callable[[Motion], np.ndarray], seed: int) -> Whereabouts:
    """Where what a law adds at joint 2 sits in a run of 60 s."""
    body = RigidBody(nominal_parameters(three_axis()), (), np.zeros(0))
    model = ReconstructedModel(three_axis(), (body,), FrictionLaw(((),) * 3), baseline={"rmse": [0.01] * 3})
    motion = fourier_motion(60.0, 100.0, seed)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot)
    tau[:, 1] += law(motion)
    samples = preprocess([measured(motion, tau, seed, noise=0.001)], model.conditioning)
    evidence = Evidence.of(model, samples, [])
    return whereabouts(evidence, fit(evidence, evidence.residual([]), [], []), 1)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_residual_is_localised(seed: int) -> None:
    late = found(lambda m: np.where(m.time > 42.0, np.sin(5 * m.time), 0.0), seed)
    assert late.time is not None
    assert 41.0 < late.time[0] < 47.0 < 54.0 < late.time[1] <= 60.0
    forward = found(lambda m: np.where(m.v[:, 1] > 0, 0.5, 0.0), seed)
    assert forward.time is None
    assert forward.condition == "joint 2 moves in the positive direction" and forward.share > 0.9
    beside = found(lambda m: 0.3 * m.v[:, 2] ** 3, seed)
    assert beside.condition.startswith("joint 3 moves faster than ")
    assert beside.condition.endswith(" rad/s")


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_what_is_everywhere_is_said_to_be_everywhere(seed: int) -> None:
    everywhere = found(lambda m: 0.5 * np.sin(7 * m.time), seed)
    assert everywhere.time is None and everywhere.condition == ""
    assert everywhere.words() == "it is found all over the run, under no condition above all"
    assert everywhere.to_dict() == {"time": None, "condition": "", "share": None}


@pytest.mark.parametrize(("low", "share"), [(1.99, 0.801), (2.01, 0.799)])
def test_energy_beyond_the_baselines_is_what_is_localised(
    low: float, share: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of joint 2, ten rows: 3 and -3 baselines, of less than one, and of as much as leaves about a fifth."""
    left = np.zeros(12)
    left[1:11] = [3.0, -3.0, 0.9, -0.9, 0.0, 0.0, 0.0, 0.0, 1.0, low]
    left[[0, 11]] = 99.0
    joint = np.array([0, *[1] * 10, 2])
    stacked = SimpleNamespace(joint=joint, block=np.arange(12))
    first, second = np.arange(10) < 4, np.arange(10) >= 4
    conditions = [("none", np.zeros(10, dtype=bool)), ("first", first), ("second", second)]
    monkeypatch.setattr(places, "_halves", lambda evidence, rows, joint: conditions)
    seen: list = []
    monkeypatch.setattr(places, "_stretch", lambda *of: seen.append(of))
    rows = np.ones((12, 3), dtype=bool)
    rows[[0, 11], 1] = False
    evidence: Any = SimpleNamespace(
        rows=rows, samples=SimpleNamespace(motion=SimpleNamespace(time=np.arange(12.0)))
    )
    fitted: Any = SimpleNamespace(held_out=left, stacked=stacked)
    given = whereabouts(evidence, fitted, 1)
    energy = [8, 8, 0, 0, 0, 0, 0, 0, 0, low**2 - 1]
    time, block, found = seen[0]
    np.testing.assert_allclose(found, energy)
    assert time.tolist() == block.tolist() == list(range(1, 11))
    assert given.share == pytest.approx(16 / sum(energy))
    left[9:11] = 0.0, np.sqrt(1 + 16 * (1 - share) / share)
    given = whereabouts(evidence, fitted, 1)
    assert given.share == pytest.approx(share) and given.condition == ("first" if share > 0.8 else "")
    left[:] = 0.5
    assert whereabouts(evidence, fitted, 1).share == 0.0


@pytest.mark.parametrize(
    ("own", "other", "told"),
    [
        (0.9, 0.94, "joint 2"),
        (0.9, 0.96, "joint 1"),
        (0.7, 0.85, "joint 1"),
        (0.95, 0.6, "joint 2"),
        (0.6, 0.7, ""),
    ],
)
def test_a_joints_own_condition_comes_before_one_of_another_that_is_hardly_better(
    own: float, other: float, told: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of 100 rows of joint 2 with the energy 1 each, above the baseline."""
    number = np.arange(100)
    conditions = [
        ("joint 1 moves slower than 1", number < round(100 * other)),
        ("joint 2 moves slower than 1", number >= 100 - round(100 * own)),
    ]
    monkeypatch.setattr(places, "_halves", lambda evidence, rows, joint: conditions)
    monkeypatch.setattr(places, "_stretch", lambda *of: None)
    samples = SimpleNamespace(motion=SimpleNamespace(time=np.arange(100.0)))
    evidence: Any = SimpleNamespace(rows=np.ones((100, 2), dtype=bool), samples=samples)
    stacked = SimpleNamespace(joint=np.ones(100), block=number)
    fitted: Any = SimpleNamespace(held_out=np.full(100, np.sqrt(2.0)), stacked=stacked)
    found = whereabouts(evidence, fitted, 1)
    assert found.condition == (f"{told} moves slower than 1" if told else "")


@pytest.mark.parametrize("blocks", [2, 5, 12])
@pytest.mark.parametrize("seed", range(4))
def test_the_stretch_is_the_shortest_of_all_runs_of_blocks(seed: int, blocks: int) -> None:
    rng = np.random.default_rng(seed)
    block = np.repeat(3 + np.arange(blocks), rng.integers(2, 6, blocks))
    time, energy = 0.1 * np.arange(len(block)), 1e-3 * rng.exponential(size=len(block))
    first = int(rng.integers(0, blocks))
    energy[(block >= 3 + first) & (block < 3 + first + max(1, blocks // 4))] *= 50.0
    stretches = (
        (length, (block >= 3 + k) & (block < 3 + k + length))
        for length in range(1, blocks + 1)
        for k in range(blocks - length + 1)
    )
    length, inside = next(
        one for one in stretches if energy[one[1]].sum() >= places.NEARLY_ALL * energy.sum()
    )
    short = length <= places.MOSTLY * blocks
    expected = (time[inside][0], time[inside][-1]) if short else None
    assert places._stretch(time, block, energy) == expected


def test_the_words_name_both() -> None:
    where = Whereabouts((3.0, 9.5), "joint 2 carries more than 5 N*m", 0.93)
    words = "nearly all of it is found from 3.0 to 9.5 s, 93 % of it where joint 2 carries more than 5 N*m"
    assert where.words() == words
    assert replace(where, time=None).words().startswith("it is found all over the run, 93 % of it")


def of_ten_rows(monkeypatch: pytest.MonkeyPatch, conditions: list[tuple[str, list[int]]]) -> tuple[Any, Any]:
    """Evidence and an outcome that leaves as much on each of ten rows of joint 2, in each its own block."""
    masks = [(words, np.isin(np.arange(10), rows)) for words, rows in conditions]
    monkeypatch.setattr(places, "_halves", lambda evidence, rows, joint: masks)
    motion = SimpleNamespace(time=np.arange(10.0))
    rows = np.repeat([[False, True, False]], 10, axis=0)
    evidence = SimpleNamespace(rows=rows, samples=SimpleNamespace(motion=motion), scale=np.full(3, 0.5))
    stacked = SimpleNamespace(joint=np.ones(10), block=np.arange(10))
    return evidence, SimpleNamespace(after=SimpleNamespace(held_out=np.full(10, 2.0), stacked=stacked))


def test_of_a_multiple_of_the_baseline_it_is_said_where_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    slow = ("joint 2 moves slower than 0.2 rad/s", list(range(9)))
    evidence, outcome = of_ten_rows(monkeypatch, [slow])
    said = ["joint 2: 90 % of what is left there is found where joint 2 moves slower than 0.2 rad/s"]
    assert localised(evidence, outcome, [np.nan, 1.0, 0.0], []) == said
    assert localised(evidence, outcome, [np.nan, 0.99, 0.0], []) == []
    assert localised(evidence, outcome, [np.nan, 1.0, 0.0], [2]) == []
    evidence, outcome = of_ten_rows(monkeypatch, [(slow[0], [0, 1, 2])])
    assert localised(evidence, outcome, [np.nan, 1.0, 0.0], []) == []
