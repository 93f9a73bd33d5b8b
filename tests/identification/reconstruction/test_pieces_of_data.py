"""Which samples judge, which lie near others, which library is taken: each rule on numbers one can see through."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import three_axis

from armloop.data.motion import Motion, Samples
from armloop.identification.reconstruction import catalogue, data
from armloop.identification.reconstruction.data import Chunk, Data
from armloop.identification.reconstruction.excitation import check_excitation, check_recorded
from armloop.identification.reconstruction.fitting import cut, padded, without_offsets
from armloop.identification.reconstruction.friction_selection import FrictionSelection
from armloop.identification.reconstruction.held_out import within
from armloop.identification.reconstruction.libraries import Contender, choose
from armloop.identification.reconstruction.pooled import Prior
from armloop.laws.friction import FrictionTerm
from armloop.util.errors import ExcitationError, InputError


def samples(lengths: tuple[int, ...], joints: int = 1) -> Samples:
    """Runs of so many samples a second apart, 100 s between them; no time series for the filter."""
    N, starts = sum(lengths), np.cumsum([0, *lengths[:-1]])
    time = np.arange(float(N)) + 100.0 * (np.searchsorted(starts, np.arange(N), side="right") - 1)
    motion = Motion(time, *np.zeros((3, N, joints)), starts)
    return Samples(motion, np.zeros((N, joints)), np.ones((N, joints), dtype=bool), 1.0, 0.0)


class TestChunks:
    def chunk(self, lengths: tuple[int, ...] = (40,), seconds: float = 2.0) -> Chunk:
        options: Any = SimpleNamespace(block_seconds=seconds, folds=5)
        return Chunk.of(samples(lengths), options)

    def test_blocks_are_dealt_into_folds(self) -> None:
        chunk = self.chunk()
        assert chunk.blocks.tolist() == [k // 2 for k in range(40)]
        assert np.flatnonzero(chunk.held_out).tolist() == [0, 1, 10, 11, 20, 21, 30, 31]
        assert np.flatnonzero(chunk.validation).tolist() == [2, 3, 12, 13, 22, 23, 32, 33]
        later = Chunk.of(chunk.samples, SimpleNamespace(block_seconds=2.0, folds=5), first=4)  # type: ignore[arg-type]
        assert np.flatnonzero(later.held_out).tolist()[:2] == [2, 3] and later.blocks[0] == 4

    def test_every_other_held_out_block_chooses_the_library_and_the_others_judge(self) -> None:
        chunk = self.chunk()
        parts = {part: np.flatnonzero(chunk.judging(part)).tolist() for part in ("all", "selection", "test")}
        assert parts["selection"] == [0, 1, 20, 21] and parts["test"] == [10, 11, 30, 31]
        assert parts["all"] == [0, 1, 10, 11, 20, 21, 30, 31]
        nested = chunk.nested()
        assert np.flatnonzero(nested.judging("selection")).tolist() == [4, 5, 14, 15, 24, 25, 34, 35]
        assert nested.judging("test").tolist() == chunk.held_out.tolist()
        assert nested.held_out.sum() == 16

    def test_what_lies_near_another_part_does_not_judge(self) -> None:
        chunk = self.chunk(seconds=4.0)
        # the first block is 0 to 3, the sixth 20 to 23
        assert np.flatnonzero(chunk.judging("all", 1.0)).tolist() == [0, 1, 2, 21, 22]
        assert np.flatnonzero(chunk.judging("all", 1.5)).tolist() == [0, 1, 2, 21, 22]
        assert np.flatnonzero(chunk.judging("all", 2.0)).tolist() == [0, 1]
        assert np.flatnonzero(chunk.judging("selection", 1.0)).tolist() == [0, 1, 2]

    def test_near_is_of_the_same_run(self) -> None:
        given = samples((10, 10)).motion
        rows = np.zeros(20, dtype=bool)
        rows[[2, 6, 9]] = True
        assert np.flatnonzero(data._near(rows, given, 1.0)).tolist() == [1, 2, 3, 5, 6, 7, 8, 9]
        assert np.flatnonzero(data._near(rows, given, 0.9)).tolist() == [2, 6, 9]
        rows[[10, 19]] = True
        assert np.flatnonzero(data._near(rows, given, 200.0)).tolist() == list(range(20))
        assert not data._near(np.zeros(20, dtype=bool), given, 9.0).any()

    def test_stretches_are_even_and_parts_of_parts_play_their_parts(self) -> None:
        chunk = self.chunk((30, 10))
        (whole,) = data._stretches(chunk, 4, 10)
        assert whole is chunk
        pieces = data._stretches(chunk, 4, 5)
        assert [(int(p.blocks[0]), len(p.blocks)) for p in pieces] == [(1, 5), (6, 5), (11, 5), (16, 5)]
        assert [p.samples.motion.time[0] for p in pieces] == [2.0, 12.0, 22.0, 132.0]
        taken = chunk.take(np.array([0, 10, 29, 30, 39]))
        assert taken.samples.motion.starts.tolist() == [0, 3] and taken.blocks.tolist() == [0, 5, 14, 15, 19]
        assert taken.held_out.tolist() == [True, True, False, True, False]
        joined = data._joined([taken, chunk])
        assert joined.samples.motion.starts.tolist() == [0, 3, 5, 35]
        assert joined.blocks.tolist() == [*taken.blocks, *chunk.blocks]

    def test_a_sample_of_chunks_is_even(self) -> None:
        reference: Any = None
        workers: Any = None
        parts: Any = list(range(10))
        found = [Data(parts, reference, workers).sampled(count).parts for count in (3, 5, 10, 20, 1)]
        assert found == [[0, 4, 8], [0, 2, 4, 6, 8], parts, parts, [0]]


def test_instants_within_intervals() -> None:
    time, intervals = np.arange(10.0), np.array([[2.0, 3.0], [3.0, 4.0], [7.0, 7.0]])
    assert np.flatnonzero(within(time, intervals, 0.0)).tolist() == [2, 3, 4, 7]
    assert np.flatnonzero(within(time, intervals, 1.0)).tolist() == [1, 2, 3, 4, 5, 6, 7, 8]
    assert not within(time, np.zeros((0, 2)), 5.0).any()
    assert within(time, np.array([[-5.0, 50.0]]), 0.0).all()


def test_joints_must_move_and_have_torques() -> None:
    arm, given = three_axis(), samples((100,), 3)
    given.tau[:] = 1.0
    given.tau[3:9] = 0.0
    given.motion.q[50:] = 1e-3
    given.moving[30:] = False
    check_excitation(arm, given)
    check_recorded(arm, np.array([1.0, 2e-8, 1.0]))
    with pytest.raises(ExcitationError, match="tau2: zero throughout"):
        check_recorded(arm, np.array([1.0, 0.0, 1.0]))
    given.moving[29, 2] = False
    with pytest.raises(ExcitationError, match=r"q3: of joint .* 29 of 100 filtered samples count as moving"):
        check_excitation(arm, given)
    given.motion.q[50:, 0] = 0.99e-3
    with pytest.raises(ExcitationError, match=r"q1: joint .* hardly moves \(range 0.00099 rad\)"):
        check_excitation(arm, given)


class TestLibraries:
    @staticmethod
    def contender(
        error: float, coefficients: int, passed: bool = True, blocks: list[float] | None = None, **of: Any
    ) -> Contender:
        library: Any = SimpleNamespace(name=f"{error} {coefficients}")
        attempt: Any = object() if of.get("tried", True) else None
        checks: Any = SimpleNamespace(failed=int(not passed))
        own = np.array(blocks) if blocks is not None else None
        return Contender(
            library, attempt, "too short", (error, None), coefficients, coefficients, checks, own
        )

    def taken(self, *tried: Contender) -> list[int]:
        return [k for k, one in enumerate(choose(tried)) if one.chosen]

    def test_the_least_error_of_those_that_obey_physics(self) -> None:
        made = self.contender
        assert self.taken(made(0.2, 5), made(0.1, 9), made(0.3, 1)) == [1]
        assert self.taken(made(0.2, 5), made(0.1, 9, passed=False)) == [0]
        assert self.taken(made(0.2, 5, passed=False), made(0.1, 9, passed=False)) == [1]
        assert self.taken(made(0.1, 5, tried=False), made(0.2, 9)) == [1]
        with pytest.raises(InputError, match=r"^0\.1 5, 0\.2 9: too short; 0\.3 1: still$"):
            still = replace(made(0.3, 1, tried=False), refused="still")
            choose([made(0.1, 5, tried=False), still, made(0.2, 9, tried=False)])
        nothing: Any = None
        assert Contender(nothing, nrmse=(None,)).error == np.inf and self.contender(0.2, 1).error == 0.2

    def test_the_simpler_where_the_difference_is_within_its_standard_error(self) -> None:
        best = self.contender(0.1, 9, blocks=[1.0] * 8)
        spread = np.array([1, -1, 1, -1, 1, -1, 1, -1.0])
        error = float(np.sqrt(8 / 7 / 8))
        for excess, taken in ((error - 0.01, [0]), (error + 0.01, [1])):
            fewer = self.contender(0.2, 5, blocks=(1 + spread + excess).tolist())
            assert self.taken(fewer, best) == taken
        blocks = (1 + spread).tolist()
        assert self.taken(self.contender(0.2, 9, blocks=blocks), best) == [1]  # no fewer
        assert self.taken(self.contender(0.2, 8, blocks=blocks[:7]), best) == [1]
        assert self.taken(self.contender(0.2, 8, blocks=[*blocks[:7], np.nan]), best) == [
            1
        ]  # seven tell nothing
        assert self.taken(self.contender(0.2, 8), best) == [1]
        # of several the one with fewest
        few = (self.contender(0.2, count, blocks=blocks) for count in (7, 6, 8))
        assert self.taken(*few, best) == [1]


def test_priors_are_padded_and_cut_and_offsets_given_to_laws() -> None:
    prior = Prior(np.array([[4.0, 1.0], [1.0, 3.0]]), np.array([5.0, 6.0]))
    more = padded(prior, 1)
    np.testing.assert_allclose(more.precision, [[4, 1, 0], [1, 3, 0], [0, 0, 1e-9]])
    assert more.centre.tolist() == [5, 6, 0]
    one = cut(more, 1)
    assert one.precision.tolist() == [[4.0]] and one.centre.tolist() == [5.0]
    law = [FrictionTerm("viscous"), FrictionTerm("offset")]
    pooled: Any = None
    found = without_offsets(FrictionSelection([law, law], None, [], [], [law, law], pooled), {1})
    assert found.laws == found.candidates == [law, law[:1]]


class TestCatalogue:
    def law(self, size: int, **of: Any) -> catalogue.Law:
        effect: Any = SimpleNamespace(load=of.get("load", False), place=("a", 1, None))
        return catalogue.Law(effect, 0.0, size, of.get("constant", ()))

    def test_coefficients_of_several_laws(self) -> None:
        laws = catalogue.Laws([self.law(1, load=True), self.law(2, constant=(0, 2)), self.law(3)])
        assert laws.count == 6 and laws.loading.tolist() == [1, 0, 0, 0, 0, 0]
        assert [x.tolist() for x in laws.split(np.arange(6.0))] == [[0], [1, 2], [3, 4, 5]]
        assert laws.constant_at() == {0, 2}
        assert catalogue.Laws().split(np.zeros(0)) == [] and catalogue.Laws().count == 0

    def test_a_column_that_is_constant_at_a_joint(self) -> None:
        columns = np.zeros((5, 3, 2))
        columns[:, 0, 1], columns[:, 1, 0] = 2.0, np.arange(5.0)
        effect: Any = None
        law = catalogue.Law.found(effect, 0.5, columns, 0.25)
        assert (law.size, law.constant, law.gain, law.shape) == (2, (0,), 0.25, 0.5)

    def test_of_a_law_that_has_some_of_its_coefficients_the_others_are_zero(self) -> None:
        effect: Any = SimpleNamespace(
            fixed_columns=lambda context, shape: np.tile([1.0, 2.0, shape], (5, 3, 1)),
            estimates=lambda arm, x, covariance, shape: (x.tolist(), covariance.tolist(), shape),
        )
        columns = effect.fixed_columns(None, 3.0)
        law = catalogue.Law.found(effect, 3.0, columns, 0.25, kept=np.array([True, False, True]))
        arm: Any = None
        assert law.size == 2 and law.columns(arm)[0, 0].tolist() == [1.0, 3.0]
        spread = [[4.0, 0.0, 5.0], [0.0, 0.0, 0.0], [5.0, 0.0, 6.0]]
        found = law.estimates(arm, np.array([7.0, 8.0]), np.array([[4.0, 5.0], [5.0, 6.0]]))
        assert found == ([7.0, 0.0, 8.0], spread, 3.0)  # type: ignore[comparison-overlap]
        whole = catalogue.Law.found(effect, 3.0, columns, 0.25, kept=np.ones(3, dtype=bool))
        assert (whole.size, whole.kept) == (3, ())

    def test_columns_and_parameters_of_several_laws_stand_one_after_the_other(self) -> None:
        motion = Motion(np.arange(5.0), *np.zeros((3, 5, 3)), np.array([0]))
        laws = []
        for size in (1, 2, 1):
            law = self.law(size)
            law.effect.fixed_columns = lambda context, shape, size=size: np.full((5, 3, size), float(size))  # type: ignore[attr-defined]
            law.effect.estimates = lambda arm, x, covariance, shape: (x.tolist(), covariance.tolist())  # type: ignore[attr-defined]
            laws.append(law)
        several, nothing = catalogue.Laws(laws), catalogue.Laws()
        assert (nothing.tried, nothing.raw(three_axis(), motion, 1.0).shape) == (0, (5, 3, 0))
        assert several.raw(three_axis(), motion, 1.0)[2, 1].tolist() == [1.0, 2.0, 2.0, 1.0]
        covariance = np.arange(16.0).reshape(4, 4)
        found = several.added(three_axis(), np.array([5.0, 6.0, 7.0, 8.0]), covariance)
        assert [one.parameters for one in found] == [  # type: ignore[comparison-overlap]
            ([5.0], [[0.0]]),
            ([6.0, 7.0], [[5.0, 6.0], [9.0, 10.0]]),
            ([8.0], [[15.0]]),
        ]
        assert [one.when for one in found] == ["always"] * 3
