"""What held-out samples add to a tally, sample by sample."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from armloop.data.motion import Motion, Samples
from armloop.identification import scoring
from armloop.identification.reconstruction import tally
from armloop.identification.reconstruction.data import Chunk
from armloop.identification.reconstruction.tally import Tally

N = 48
RNG = np.random.default_rng(1)
LEFT, TAU = RNG.normal(size=(2, N, 2))
MOVING = RNG.random((N, 2)) < 0.6
BLOCKS = 3 + np.arange(N) // 4
CONDITION = np.arange(N) // 10
#: A model that does not tell its range.
NOBODY: Any = SimpleNamespace(history={})


def chunk(cutoff_hz: float, held_out: Any = None) -> Chunk:
    """Blocks of four samples, the first numbered 3, of which every fifth is held out."""
    motion = Motion(np.arange(float(N)), *np.zeros((3, N, 2)), np.array([0]))
    samples = Samples(motion, TAU, MOVING, 1.0, cutoff_hz)
    nobody = np.zeros(N, dtype=bool)
    return Chunk(samples, BLOCKS, BLOCKS % 5 == 0 if held_out is None else held_out, nobody, ~nobody)


@pytest.mark.parametrize("part", ["all", "selection", "test"])
@pytest.mark.parametrize("sorted_", [True, False])
def test_squares_by_condition_and_by_block(part: Any, sorted_: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tally, "residual", lambda model, samples: LEFT)
    model = NOBODY
    sorter: Any = (lambda motion: CONDITION) if sorted_ else None
    found = Tally.of(chunk(1.0), model, sorter, part)
    # blocks 5 and 10; every other block that is held out chooses the library
    judges = {"all": (5, 10), "selection": (10,), "test": (5,)}[part]
    rows = [k for k in range(N) if BLOCKS[k] in judges]
    sums: dict[int, Any] = {}
    for k in rows:
        own = sums.setdefault(int(CONDITION[k]) if sorted_ else 0, np.zeros((2, 3, 2)))
        for j in range(2):
            own[int(MOVING[k, j]), :, j] += LEFT[k, j] ** 2, TAU[k, j] ** 2, 1
    assert found.sums.keys() == sums.keys() and found.samples == len(rows)
    for label, values in sums.items():
        np.testing.assert_allclose(found.sums[label], values)
    blocks = np.zeros((len(judges), 2, 2))
    for place, block in enumerate(judges):
        for k in np.flatnonzero(BLOCKS == block):
            blocks[place] += np.array([LEFT[k] ** 2, np.ones(2)]) * MOVING[k]
    np.testing.assert_allclose(found.blocks, blocks)
    # samples that are no time series have no blocks
    still = Tally.of(chunk(0.0), model, sorter, part)
    assert still.blocks.shape == (0, 2, 2)
    assert [each.shape for each in still.places.values()] == [(2, 2)] * 2


def test_squares_where_a_joint_turns_round_and_where_it_creeps(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tally, "residual", lambda model, samples: LEFT)
    turns = np.zeros((N, 2), dtype=bool)
    turns[[8, 9, 29, 20], [0, 0, 1, 0]] = True
    near, slow = turns.copy(), np.zeros((N, 2), dtype=bool)
    near[[7, 10], 0] = slow[9:11, 1] = slow[30, 0] = slow[20, 1] = True
    asked: list[Any] = []

    def around(samples: Any, turned: Any, counted: Any) -> Any:
        assert turned is turns and (counted == (MOVING | turns)).all()
        return near & counted

    def creeping(samples: Any, speeds: Any) -> Any:
        asked.append(speeds.tolist())
        return slow

    monkeypatch.setattr(tally, "passing", lambda samples: turns)
    monkeypatch.setattr(tally, "at_reversals", around)
    monkeypatch.setattr(tally, "creeping", creeping)
    model: Any = SimpleNamespace(history={"range": [[9.0, 9.0], [2.0, 3.0], [8.0, 8.0]]})
    found = Tally.of(chunk(1.0), model, None)
    held = (BLOCKS % 5 == 0)[:, None]
    for key, mask in (("reversals", near & (MOVING | turns) & held), ("creeping", slow & held)):
        assert mask.sum() >= 2
        np.testing.assert_allclose(found.places[key], [(LEFT**2 * mask).sum(axis=0), mask.sum(axis=0)])
    # samples that are no time series turn and creep nowhere, and no joint creeps of whose speed nothing is known
    assert not any(sums.any() for sums in Tally.of(chunk(0.0), model, None).places.values())
    Tally.of(chunk(1.0), NOBODY, None)
    assert asked == [[2.0, 3.0], [0.0, 0.0]]


def test_a_baseline_is_of_motion_as_fast_as_the_model_knows(monkeypatch: pytest.MonkeyPatch) -> None:
    """The printed errors are of all motion; blocks and baseline without what is slower than was fitted, sums per joint."""
    monkeypatch.setattr(tally, "residual", lambda model, samples: LEFT)
    speed = np.random.default_rng(5).uniform(0.0, 1.0, (N, 2))
    monkeypatch.setattr(scoring, "held_speed", lambda samples: speed)
    model: Any = SimpleNamespace(history={"slowest": [1.0, 0.0]})
    found, whole = Tally.of(chunk(1.0), model, None), Tally.of(chunk(1.0), NOBODY, None)
    held = (BLOCKS % 5 == 0)[:, None]
    slid = MOVING & held & (speed >= [0.5, 0.0])
    assert 2 <= slid[:, 0].sum() < (MOVING & held)[:, 0].sum()
    np.testing.assert_array_equal(found.sums[0], whole.sums[0])
    np.testing.assert_allclose(found.sliding[0][[0, 2]], [(LEFT**2 * slid).sum(axis=0), slid.sum(axis=0)])
    np.testing.assert_allclose(found.blocks.sum(axis=0), found.sliding[0][[0, 2]])
    rmse = np.sqrt(found.sliding[0][0] / found.sliding[0][2])
    np.testing.assert_allclose(found.baseline()["rmse"], rmse)
    np.testing.assert_allclose(whole.sliding[0], whole.sums[0][1])


def test_a_baseline_is_of_no_sample_near_an_end_of_its_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """A log that ends in a hard stop leaves there what no run is judged by; the printed errors are of all motion."""
    left = LEFT.copy()
    left[[0, -1]] = 1e3
    monkeypatch.setattr(tally, "residual", lambda model, samples: left)
    assert MOVING[[0, -1]].all()
    whole = Tally.fitted(chunk(1.0), NOBODY, None, 8.0)
    rmse = np.sqrt(np.mean(LEFT[1:-1] ** 2, axis=0, where=MOVING[1:-1]))
    np.testing.assert_allclose(whole.baseline()["rmse"], rmse)
    assert min(whole.score().moving["rmse"]) > 100


def test_blocks_told_apart_in_pieces_of_their_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tally, "residual", lambda model, samples: LEFT)
    model = NOBODY
    whole = Tally.of(chunk(1.0), model, None)
    pieces = Tally.of(chunk(1.0), model, None, seconds=2.0)
    assert len(whole.blocks) == 2 and len(pieces.blocks) > 2
    np.testing.assert_allclose(pieces.blocks.sum(axis=0), whole.blocks.sum(axis=0))
    # pieces do not go on from one held-out block into another
    assert len(Tally.of(chunk(1.0), model, None, seconds=1e3).blocks) == 2
    every = Tally.fitted(chunk(1.0), model, None, 8.0)
    assert every.samples == N and every.blocks[:, 1].sum() == MOVING[1:-1].sum()
    none = Tally.of(chunk(1.0, np.zeros(N, dtype=bool)), model, None)
    assert (none.samples, none.sums, none.blocks.shape) == (0, {}, (0, 2, 2))


def test_samples_within_a_margin_of_what_was_fitted_do_not_judge(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tally, "residual", lambda model, samples: LEFT)
    model = NOBODY
    # of a block's four samples the two in its middle are two seconds from the others
    assert Tally.of(chunk(1.0), model, None, margin=1.0).samples == 4


def test_relative_to_the_torque_where_a_joint_has_any() -> None:
    blocks = np.array([[[40.0, 60.0], [20.0, 20.0]]])
    sums = np.zeros((2, 3, 2))
    sums[1] = [[40.0, 60.0], [180.0, 0.0], [20.0, 20.0]]
    # a joint without torque has no relative error: the other one's alone
    found = Tally({0: sums}, blocks, 20, {}, {0: sums[1]})
    np.testing.assert_allclose(found.relative_blocks(), [2.0 / 9.0])
    assert found.baseline()["nrmse"] == [pytest.approx(np.sqrt(2.0) / 3.0), None]
