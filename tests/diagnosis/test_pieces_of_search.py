"""The rules of search, comparison and design of a diagnosis, each on numbers small enough to see through."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import three_axis

from armloop.data.motion import Motion
from armloop.data.signals import independent_rows
from armloop.diagnosis import isolability, judgement, planning, unlisted
from armloop.diagnosis import search as searching
from armloop.diagnosis.confounded import Law, Rivalry, _share_joints
from armloop.diagnosis.isolability import Part, Stage, left
from armloop.diagnosis.score import Score
from armloop.experiment.excitation import MotionRanges
from armloop.laws.effects import effect
from armloop.model import AddedEffect
from armloop.util.errors import InputError


def score(*energy: float, rows: tuple[int, ...] = (), **of: Any) -> Score:
    n = len(energy)
    counts = np.array(rows or [100] * n)
    blocks = np.array(of.get("blocks", energy), dtype=float)
    return Score(
        of.get("complexity", 1),
        np.array(energy),
        counts,
        np.array(of.get("seen", counts)),
        blocks,
        np.ones(len(blocks)),
    )


class TestJudgement:
    def test_standard_errors_of_a_difference_over_blocks(self) -> None:
        assert judgement._standard_errors(np.array([3.0, 1.0])) == pytest.approx(2.0)
        # of the sums [3, 1], or of the parts [3/8, 1/6] of each block's own error
        found = judgement.lead_of(np.array([5.0, 3.0]), np.array([2.0, 2.0]), np.ones(2))
        assert found == pytest.approx((3 / 8 + 1 / 6) / (3 / 8 - 1 / 6))
        found = judgement.lead_of(np.array([3.0, 11.0]), np.array([0.0, 10.0]), np.ones(2))
        assert found == pytest.approx(2.0)

    def test_a_likelihood_ratio_as_standard_errors(self) -> None:
        worse, better = (score(e, 8.0, rows=(10, 0), seen=[4, 3]) for e in (30.0, 10.0))
        assert judgement._likelier(worse, better) == pytest.approx(np.sqrt(4 * np.log(2)))
        assert judgement._likelier(better, worse) == pytest.approx(-np.sqrt(4 * np.log(2)))

    def test_enough_is_the_baselines_worst_and_parts_of_it_add_up(self) -> None:
        evidence: Any = SimpleNamespace(variation=np.array([2.0, 4.0]))
        current, trial = score(50.0, 6.0, rows=(10, 0)), score(20.0, 4.0, rows=(10, 0))
        np.testing.assert_allclose(judgement.enough(evidence, current), [20.0, 4.0])
        assert judgement.times_enough(evidence, current, trial) == pytest.approx(1.5 + 0.5)

    @pytest.mark.parametrize(
        ("lead", "trial", "behind"),
        [
            (2.0, (300.0, 300.0), False),
            (2.1, (140.0, 140.0), False),
            (2.1, (140.0, 141.0), True),
            (2.0, (325.0, 325.0), False),
            (2.0, (326.0, 325.0), True),
        ],
    )
    def test_behind_by_more_than_chance_and_the_models_shortcomings(
        self, lead: float, trial: tuple[float, float], behind: bool, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(judgement, "lead", lambda worse, better: lead)
        # three quarters of the best one's 1800 are 1350
        current = score(1000.0, 1000.0)
        assert judgement.is_behind(current, score(*trial), score(100.0, 100.0)) == behind

    def test_a_part_of_what_the_best_removes_is_soaked_up(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(judgement, "lead", lambda worse, better: 9.0)
        current, best = score(100_100.0, 1000.0), score(100.0, 100.0)
        assert not judgement.is_behind(current, score(400.0, 140.0), best)
        assert judgement.is_behind(current, score(401.0, 140.0), best)

    def test_the_simplest_of_equals_and_of_those_the_best(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(judgement, "is_behind", lambda current, trial, best: trial.error > 30)
        trials = [score(e, complexity=c) for e, c in ((20.0, 3), (30.0, 2), (25.0, 2), (31.0, 1))]
        assert judgement.simplest_of_equals(score(100.0), trials) == 2
        monkeypatch.setattr(judgement, "is_behind", lambda current, trial, best: True)
        assert judgement.simplest_of_equals(score(100.0), trials) == 0

    def test_sums_of_what_is_left(self) -> None:
        held_out, joint = np.array([1.0, 2.0, 3.0, 4.0]), np.array([0, 0, 2, 2])
        found = Score.of(5, held_out, joint, np.array([7, 9, 9, 9]), 3)
        assert found.complexity == 5 and found.error == 30.0
        assert found.energy.tolist() == [5.0, 0.0, 25.0] and found.rows.tolist() == [2, 0, 2]
        assert found.seen.tolist() == [2, 0, 1]
        assert found.block_errors.tolist() == [1.0, 29.0] and found.block_rows.tolist() == [1.0, 3.0]


class TestIsolability:
    def test_what_columns_leave_and_their_coefficients(self) -> None:
        y = np.array([3.0, 4.0])
        part, beta = isolability._fitted(y, [np.array([[2.0], [0.0]]), np.zeros((2, 1))])
        assert part == pytest.approx(0.8) and beta.tolist() == pytest.approx([1.5, 0.0])
        # two that round-off alone tells apart are one
        near = np.array([[1.0, 1.0], [0.0, 1e-7]])
        assert isolability._fitted(y, [near])[0] == pytest.approx(0.8, abs=1e-3)
        near[1, 1] = 1e-5
        assert isolability._fitted(y, [near])[0] == pytest.approx(0.0, abs=1e-3)

    @staticmethod
    def stage() -> Any:
        """The law is [1, 2]; a rival's column [1, shape]; that of another effect [0, 1]."""

        def columns(effect: Any, shape: float) -> np.ndarray:
            return np.array([[0.0], [1.0]]) if effect is None else np.array([[1.0], [shape]])

        return SimpleNamespace(torque=lambda law: np.array([1.0, 2.0]), columns=columns)

    @staticmethod
    def rival(refined: Any) -> Part:
        rival: Any = SimpleNamespace(
            start=lambda beta: beta, refined=lambda beta, shape: refined(beta, shape)
        )
        return Part(rival, (0.0, 1.0))

    def test_the_part_that_a_rival_leaves_is_least_at_its_refined_shape(self) -> None:
        law: Any = None
        assert left([self.stage()], law, self.rival(lambda beta, shape: shape)) == (
            pytest.approx(np.sqrt(0.5 / 5)),
            1.0,
        )
        assert left([self.stage()], law, self.rival(lambda beta, shape: 2.0)) == (
            pytest.approx(0.0, abs=1e-12),
            2.0,
        )
        # one that is no better is not taken
        assert left([self.stage()], law, self.rival(lambda beta, shape: 0.5))[1] == 1.0
        # six steps, no more; the coefficient is that of the shape before
        assert left([self.stage()], law, self.rival(lambda beta, shape: shape + 0.1))[1] == pytest.approx(1.6)
        assert left([self.stage()], law, self.rival(lambda beta, shape: shape * beta[0]))[1] > 1.5

    def test_others_are_fitted_beside_it_and_motions_taken_together(self) -> None:
        law: Any = None
        rival, other = self.rival(lambda beta, shape: shape), Part(None, (0.0,))  # type: ignore[arg-type]
        assert left([self.stage()], law, rival, [other])[0] == pytest.approx(0.0, abs=1e-12)
        opposite = self.stage()
        opposite.torque = lambda law: np.array([-1.0, -2.0])
        assert left([self.stage(), opposite], law, rival)[0] == pytest.approx(1.0)
        opposite.torque = lambda law: np.zeros(2)
        assert left([opposite], law, rival) == (0.0, 0.0)

    def test_a_motion_to_be_made_as_it_would_be_logged(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(isolability, "context_of", lambda evidence, motion: None)
        reference: Any = SimpleNamespace(
            duration=10.0,
            evaluate=lambda t: tuple(f(np.pi * t / 2)[:, None] for f in (np.cos, np.sin, np.cos)),
        )
        samples = SimpleNamespace(period=0.01, cutoff_hz=5.0, reach=0.05)
        evidence: Any = SimpleNamespace(samples=samples, scale=np.ones(1))
        stage = Stage.of_reference(evidence, reference)
        # a tenth of the corner's period; at rest at whole multiples of 2 s, and three samples around
        assert stage.samples.period == 0.02 and stage.samples.motion.samples == 500
        still = np.flatnonzero(~stage.samples.moving[:, 0])
        assert still.tolist() == [k for k in range(500) if min(k % 100, 100 - k % 100) <= 3 and k < 497]
        assert np.array_equal(stage.rows, stage.samples.moving & independent_rows(stage.samples)[:, None])
        samples.cutoff_hz = 0.0
        assert Stage.of_reference(evidence, reference).samples.period == 0.01

    def test_effects_share_a_joint_or_are_the_whole_arms(self) -> None:
        def of(joint: int | None, other: int | None = None) -> Any:
            return SimpleNamespace(joint=joint, other_joint=other)

        assert (
            _share_joints(of(1), of(1)) and _share_joints(of(None), of(1)) and _share_joints(of(2), of(1, 2))
        )
        assert not _share_joints(of(1), of(2)) and not _share_joints(of(3), of(1, 2))

    def test_a_rival_is_tried_at_few_shapes_on_several_motions(self) -> None:
        many = 20
        rival: Any = SimpleNamespace(shapes=lambda context: range(many))
        law = Law(AddedEffect(rival, {}), 7.0)
        stage: Any = SimpleNamespace(context=None)
        way = Rivalry(law, law, (law,))
        assert way._rival(stage, 20).shapes == way._rival(stage).shapes == (7.0, *range(20))
        many = 21
        assert way._rival(stage, 20).shapes == (7.0,) and len(way._rival(stage).shapes) == 22
        assert [part.shapes for part in way._beside()] == [(7.0,)]


class TestSearch:
    @staticmethod
    def search(trials: list[Any], monkeypatch: pytest.MonkeyPatch) -> Any:
        monkeypatch.setattr(searching, "is_worth", lambda evidence, current, trial: trial.error < 1008)
        monkeypatch.setattr(
            searching, "simplest_of_equals", lambda current, trials: int(np.argmin([t.error for t in trials]))
        )
        search: Any = object.__new__(searching._Search)
        search.evidence, search.progress = None, lambda text: None
        search.explainable = np.array([1000.0, 10.0])
        search.panel = SimpleNamespace(tried=lambda known, progress: iter(trials))
        return search._tried(SimpleNamespace(fit=SimpleNamespace(score=score(1000.0, 10.0))))

    @staticmethod
    def trial(name: str, *energy: float) -> Any:
        return SimpleNamespace(effect=name, shape=name.upper(), score=score(*energy))

    def test_the_best_with_its_rivals_and_its_share_of_what_could_be_explained(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        trials = [
            self.trial(name, energy, 10.0)
            for name, energy in zip("abcd", (623.9, 600.0, 624.1, 999.0), strict=True)
        ]
        found = self.search(trials, monkeypatch)
        assert (found.effect, found.shape, found.share) == ("b", "B", pytest.approx(400 / 1010))
        assert found.rivals == [("a", pytest.approx(376.1 / 1010))]
        assert self.search([self.trial("a", -1000.0, 0.0)], monkeypatch).share == 1.0
        assert self.search([], monkeypatch) is None

    def test_it_must_remove_a_part_of_what_could_be_explained_of_some_joint(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        assert self.search([self.trial("a", 995.0, 10.0)], monkeypatch) is not None
        assert self.search([self.trial("a", 995.1, 9.96)], monkeypatch) is None
        assert self.search([self.trial("a", 995.1, 9.94)], monkeypatch) is not None

    def test_effects_are_chosen_anew_beside_the_others_until_none_changes(self) -> None:
        def found(name: str, joint: int) -> Any:
            return SimpleNamespace(effect=effect(name, joint), shape=0.0, share=1.0, rivals=[])

        spring, offset, drag = (found(n, 1) for n in ("joint_spring", "torque_offset", "viscous_friction"))
        asked: list[list[str]] = []

        def chosen(answers: dict[str, Any], first: list[Any]) -> list[Any]:
            search: Any = object.__new__(searching._Search)
            search.progress = lambda text: None
            asked.clear()

            def best(others: list[Any]) -> Any:
                asked.append([f.effect.name for f in others])
                return answers[" ".join(asked[-1])]

            search._best = best
            return search._exchanged(first)

        assert chosen({}, [spring]) == [spring] and asked == []
        same = {"joint_spring": offset, "torque_offset": spring}
        assert chosen(same, [spring, offset]) == [spring, offset] and len(asked) == 2
        better = {"joint_spring": drag, "viscous_friction": spring}
        assert chosen(better, [spring, offset]) == [spring, drag] and len(asked) == 4
        # the last first; one that explains nothing beside the others goes
        assert chosen({"joint_spring": None}, [spring, offset]) == [spring] and len(asked) == 1
        assert chosen({"joint_spring": offset, "torque_offset": None}, [spring, offset]) == [offset]
        # no more than two rounds
        swaps = {"joint_spring": drag, "viscous_friction": offset, "torque_offset": spring}
        chosen(swaps, [spring, offset])
        assert len(asked) == 4


class TestLawThatIsNotListed:
    @staticmethod
    def found(monkeypatch: pytest.MonkeyPatch, simpler: float, terms: int, left: float, bare: float) -> Any:
        """What is made of effects that leave ``left``, beside a law in their place that leaves ``simpler``."""

        def outcome(found: int, energy: float, complexity: int) -> Any:
            stacked = SimpleNamespace(joint=np.array([0, 1, 1, 1, 1]), block=np.array([0, 0, 0, 1, 1]))
            held_out = np.array([9.0, *np.full(4, np.sqrt(energy / 4))])
            fit = SimpleNamespace(
                stacked=stacked,
                score=SimpleNamespace(complexity=complexity),
                energy=energy,
                held_out=held_out,
            )
            return SimpleNamespace(found=[None] * found, after=fit)

        with_effects, without = outcome(2, left, 5), outcome(0, bare, 2)
        law = SimpleNamespace(terms=[], energy=0.9 * left, left=None, form=lambda scale: "none")
        of_rows = np.full(4, np.sqrt(simpler / 4))
        instead = SimpleNamespace(
            terms=[(1.0, "v2")] * terms, energy=simpler, left=of_rows, form=lambda scale: "law"
        )
        monkeypatch.setattr(unlisted, "_left_over", lambda evidence, outcome: 1)
        monkeypatch.setattr(unlisted, "without_effects_at", lambda evidence, outcome, joint: without)
        monkeypatch.setattr(unlisted, "pruned", lambda evidence, outcome: outcome)
        monkeypatch.setattr(unlisted, "_energy", lambda fit, joint: fit.energy)
        monkeypatch.setattr(unlisted, "_parameters", lambda evidence, law, joint: {"v2": None})
        monkeypatch.setattr(
            unlisted, "_law", lambda evidence, fit, joint: law if fit is with_effects.after else instead
        )
        evidence: Any = SimpleNamespace(scale=np.array([1.0, 2.0]))
        found, kept = unlisted.find_law(evidence, with_effects, lambda text: None)
        assert found is not None and found.joint == 2 and found.baseline == 2.0
        return found, "effects" if kept is with_effects else "bare"

    def test_a_law_of_no_more_parameters_takes_the_place_of_effects_that_leave_twice_as_much(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        found, kept = self.found(monkeypatch, 50.0, 3, 100.0, 400.0)
        # root mean square over the joint's four rows, in N·m
        assert (kept, found.form, found.rmse_with_form) == ("bare", "law", pytest.approx(2 * np.sqrt(50 / 4)))
        assert found.rmse == pytest.approx(2 * np.sqrt(400 / 4)) and found.parameters
        for simpler, terms in ((51.0, 3), (50.0, 4), (50.0, 0), (99.0, 3)):
            found, kept = self.found(monkeypatch, simpler, terms, 100.0, 400.0)
            assert (kept, found.form, found.parameters) == ("effects", "none", {})
            assert found.rmse == pytest.approx(2 * np.sqrt(100 / 4))

    def test_effects_that_leave_most_are_struck_off(self, monkeypatch: pytest.MonkeyPatch) -> None:
        assert self.found(monkeypatch, 500.0, 1, 119.0, 400.0)[1] == "effects"
        assert self.found(monkeypatch, 500.0, 1, 121.0, 400.0)[1] == "bare"

    def test_of_fewer_parameters_a_law_that_leaves_significantly_less_is_enough(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        leads = iter((3.1, 2.9))
        monkeypatch.setattr(unlisted, "lead_of", lambda *sums: next(leads))
        assert self.found(monkeypatch, 90.0, 2, 100.0, 400.0)[1] == "bare"
        assert self.found(monkeypatch, 90.0, 2, 100.0, 400.0)[1] == "effects"

    def test_what_was_named_at_a_joint_is_asked_even_if_it_leaves_what_the_baseline_does(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Of joint 2 the effects leave ``left`` on 100 rows, the law 55."""
        asked: list[int] = []
        named = [SimpleNamespace(effect=SimpleNamespace(joint=2, other_joint=None)) for _ in range(2)]
        arm = SimpleNamespace(effect=SimpleNamespace(joint=None, other_joint=None))

        def verdict(left: float, found: list[Any], kept: list[Any], form: str = "v2^3") -> str:
            stacked = SimpleNamespace(joint=np.repeat([0, 1], 100), block=np.arange(200) // 10)
            asked.clear()

            def outcome(found: list[Any], energy: float, complexity: int) -> Any:
                fit = SimpleNamespace(
                    stacked=stacked,
                    score=SimpleNamespace(complexity=complexity),
                    held_out=np.repeat([1.0, np.sqrt(energy / 100)], 100),
                )
                return SimpleNamespace(found=found, after=fit)

            with_effects, bare = outcome(found, left, 3), outcome(kept, 900.0, 1)

            def law(evidence: Any, fit: Any, joint: int) -> Any:
                asked.append(joint)
                return unlisted._Law([(1.0, "sign(v2)"), (2.0, form)], np.full(100, np.sqrt(0.55)))

            monkeypatch.setattr(unlisted, "_left_over", lambda evidence, outcome: None)
            monkeypatch.setattr(unlisted, "pruned", lambda evidence, outcome: outcome)
            monkeypatch.setattr(unlisted, "_parameters", lambda evidence, law, joint: {"v2": None})
            monkeypatch.setattr(unlisted, "_law", law)
            monkeypatch.setattr(
                unlisted,
                "without_effects_at",
                lambda evidence, outcome, joint: bare if joint == 1 else outcome,
            )
            evidence: Any = SimpleNamespace(
                scale=np.ones(2), samples=SimpleNamespace(motion=SimpleNamespace(joints=2))
            )
            found_law, after = unlisted.find_law(evidence, with_effects, lambda text: None)  # type: ignore[arg-type]
            assert (found_law is None) == (after is with_effects)
            return "effects" if found_law is None else f"law at joint {found_law.joint}"

        assert verdict(111.0, named, []) == "law at joint 2" and asked == [1]
        assert verdict(109.0, named, []) == "effects" and asked == [1]  # not half of what they leave
        assert verdict(99.0, named, []) == "effects" and asked == []  # less than the baseline
        assert verdict(111.0, named, [], "v2") == "effects"  # dry and viscous friction are listed
        # an effect of the whole arm goes with them: a law of one joint cannot take its place
        assert verdict(111.0, [*named, arm], []) == "effects" and asked == []
        assert verdict(111.0, [*named, arm], [arm]) == "law at joint 2"

    def test_every_function_that_is_sought_can_be_stated(self) -> None:
        names = unlisted._names(unlisted._library((True, True, False)), 1)
        assert len(set(names)) == len(names) and {"sign(v2)", "v2^3", "v2*sign(v2)"} <= set(names)
        ends = np.zeros(3), np.ones(3)
        stated = unlisted.found_law(
            three_axis(), 2, dict.fromkeys(names, (1.0, 0.1)), *zip(ends, ends, strict=True)
        )
        assert set(names) < set(stated)

    def test_none_is_left(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(unlisted, "_left_over", lambda evidence, outcome: None)
        evidence: Any = SimpleNamespace(samples=SimpleNamespace(motion=SimpleNamespace(joints=2)))
        monkeypatch.setattr(unlisted, "without_effects_at", lambda evidence, outcome, joint: outcome)
        after = SimpleNamespace(stacked=SimpleNamespace(joint=np.zeros(0)))
        nothing: Any = SimpleNamespace(found=[], after=after)
        assert unlisted.find_law(evidence, nothing, lambda text: None) == (None, nothing)


class TestDesign:
    def test_a_wish_is_for_whole_periods_within_limits(self) -> None:
        for asked, made in ((12.0, 20.0), (20.0, 20.0), (20.1, 40.0), (60.0, 60.0)):
            wish = planning.Wish(duration=asked)
            wish.check()
            assert wish.whole_duration == made
        planning.Wish(duration=3600.0, reserve=0.0).check()
        for wrong in ({"duration": 11.9}, {"duration": 3601.0}, {"reserve": 1.0}, {"reserve": -0.1}):
            with pytest.raises(InputError, match=r"^(next run of|reserve)"):
                planning.Wish(**wrong).check()

    def test_functions_of_which_a_law_may_be_made(self) -> None:
        ends = np.array([1.0, 2.0])
        ranges = MotionRanges(-ends + 1, ends + 1, np.array([2.0, 4.0]), np.array([5.0, 10.0]))
        columns, names = planning._anything(ranges, 1)
        motion = Motion(
            np.zeros(2),
            np.array([[1.5, 2.0], [9.0, -9.0]]),
            np.array([[1.0, -2.0], [0.0, 0.0]]),
            np.array([[2.5, 5.0]] * 2),
            np.array([0]),
        )
        X = columns(motion)[:, 0]
        assert X.shape == (2, len(names)) == (2, 23)
        x, v = 0.5, -0.5  # of the second joint, in its range; the law's direction fades in at 0.02 * 4 rad/s
        places, speeds = [1, x, 2 * x**2 - 1, 4 * x**3 - 3 * x], [1, v, v**2, np.tanh(-2 / 0.08)]
        own = [a * b for a in places for b in speeds]
        np.testing.assert_allclose(X[0], [*own, 0.5, 0.5, -0.5, 0.5, 0.25, -0.25, 0.5], atol=1e-12)
        # no farther than 1.2 of the range
        assert X[1, 4] == pytest.approx(-1.2) and X[1, 17] == pytest.approx(1.2)

    def test_where_a_model_knows_its_arm(self) -> None:
        arm = three_axis()
        low, high, fastest = (
            np.array([getattr(j, k) for j in arm.joints]) for k in ("lower", "upper", "velocity")
        )
        model: Any = SimpleNamespace(arm=arm, history={})
        assert np.array_equal(planning.training_ranges(model).lower, MotionRanges.of(arm).lower)
        model.history["range"] = [[0.1, 0.0, 99.0], [0.2, 0.0, 99.0], [0.3, 0.0, 4.0], [0.05, 0.0, 0.0]]
        found = planning.training_ranges(model)
        assert found.lower[0] == pytest.approx(-0.05) and found.upper[0] == pytest.approx(0.15)
        assert found.velocity[0] == pytest.approx(0.2) and found.acceleration[[0, 2]] == pytest.approx(
            [0.3, 4.0]
        )
        assert found.lower[2] == low[2] and found.upper[2] == high[2] and found.velocity[2] == fastest[2]
        assert 0 < found.upper[1] - found.lower[1] < 1e-4 and 0 < found.velocity[1] < 1e-4

    @pytest.mark.parametrize(
        ("left", "known", "rounds", "made"),
        [
            ([(0.5, 0.1), (0.5, 0.2)], False, 2, 2),
            ([(0.5, 0.1), (0.5, 0.05)], False, 2, 1),
            ([(0.5, 0.1), (0.31, 0.1)], False, 2, 1),  # what is far enough already counts no more
            ([(0.5, 0.1), (0.29, 0.2)], False, 2, 2),
            ([(0.5, 0.31)], False, 1, 1),
            ([(0.5, 0.1)], True, 1, 1),  # the rival comes no nearer elsewhere
        ],
    )
    def test_a_motion_is_designed_anew_with_what_rivals_turn_out_to_be_able_to(
        self, left: list[Any], known: bool, rounds: int, made: int, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        stages = iter(range(len(left)))
        monkeypatch.setattr(Stage, "of_reference", staticmethod(lambda evidence, reference: next(stages)))
        law: Any = SimpleNamespace()

        def way(k: int, shape: float) -> Any:
            rival = SimpleNamespace(effect=SimpleNamespace(place=("a", k, None)), shape=shape)
            nearer = SimpleNamespace(
                law=law, rival=SimpleNamespace(effect=rival.effect, shape=shape + (not known))
            )
            return SimpleNamespace(
                law=law, rival=rival, left=lambda stage: left[stage][k], hardest=lambda stage: nearer
            )

        asked: list[int] = []

        class Known(planning.Planner):
            def __init__(self) -> None:
                object.__setattr__(self, "progress", lambda text: None)
                object.__setattr__(self, "evidence", None)

            def _regression(self, ways: Any) -> Any:
                asked.append(len(ways))
                return None, []

            def _optimised(self, regression: Any, criterion: Any) -> Any:
                return len(asked)

            def whole(self, design: Any) -> Any:
                return design

        design: Any = Known().alternatives([way(0, 0.0), way(1, 0.0)])
        assert design == made and asked == [2, 3][:rounds]
