"""Isolability of rivals and the motion that tells them apart: pieces, by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from armloop.data.motion import Motion, Samples
from armloop.data.signals import independent_rows
from armloop.diagnosis import confounded, isolability, next_run
from armloop.diagnosis.confounded import Law, Rivalry, _share_joints
from armloop.diagnosis.isolability import Part, Stage, left
from armloop.model import AddedEffect


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
        # unit columns at an angle: singular values in the ratio of tan(angle / 2), here 1.5e-6
        near[1, 1] = 3e-6
        assert isolability._fitted(y, [near])[0] == pytest.approx(0.0, abs=1e-3)
        near[1, 1] = 1.6e-6
        assert isolability._fitted(y, [near])[0] == pytest.approx(0.8, abs=1e-3)

    def test_the_units_of_columns_do_not_matter(self) -> None:
        y = np.array([3.0, 4.0])
        part, beta = isolability._fitted(y, [np.array([[-1e-14, 0.0], [0.0, 0.5]])])
        assert part == pytest.approx(0.0, abs=1e-12)
        np.testing.assert_allclose(beta, [-3e14, 8.0])

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
        # a step of more than a thousandth is one, of either sign
        assert left([self.stage()], law, self.rival(lambda beta, shape: 1.0015 * shape))[1] == pytest.approx(
            1.0015**6
        )
        below = self.stage()
        below.torque = lambda law: np.array([1.0, -1.0])
        assert left([below], law, Part(self.rival(lambda beta, shape: -1.0).effect, (1.0,)))[1] == -1.0
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
        opposite.torque = lambda law: np.array([0.0, 1.0])
        assert left([opposite], law, rival) == (pytest.approx(np.sqrt(0.5)), 1.0)
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
        samples.cutoff_hz = 1.0
        assert Stage.of_reference(evidence, reference).samples.period == 0.1
        samples.cutoff_hz = 0.0
        assert Stage.of_reference(evidence, reference).samples.period == 0.01

    def test_a_joint_rests_below_a_hundredth_of_its_own_speed(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(isolability, "context_of", lambda evidence, motion: None)
        v = np.tile([0.0, 4.0], (100, 1))
        v[:, 0] = np.where(np.arange(100) == 50, 0.0199, 0.0201)
        v[90, 0] = 2.0
        v = np.column_stack([v, np.zeros(100)])
        reference: Any = SimpleNamespace(duration=1.0, evaluate=lambda t: (v, v, v))
        samples = SimpleNamespace(period=0.01, cutoff_hz=0.0, reach=0.0)
        evidence: Any = SimpleNamespace(samples=samples, scale=np.ones(3))
        moving = Stage.of_reference(evidence, reference).samples.moving
        # another joint's rest is not its own; one that never moves rests
        assert np.flatnonzero(~moving[:, 0]).tolist() == [50]
        assert moving[:, 1].all() and not moving[:, 2].any()

    @staticmethod
    def filtered(cutoff_hz: float) -> Any:
        """Two joints, 100 Hz; of the second but three samples count."""
        given = Motion(0.01 * np.arange(100), *np.zeros((3, 100, 2)), np.array([0]))
        rows = np.ones((100, 2), dtype=bool)
        rows[:, 1] = np.isin(np.arange(100), [0, 1, 20])
        samples = Samples(given, given.q, rows, 0.01, cutoff_hz)
        return SimpleNamespace(
            samples=samples, rows=rows, scale=np.array([2.0, 4.0]), context="what is known"
        )

    def test_a_run_counts_where_it_is_evidence_and_independent(self) -> None:
        evidence = self.filtered(5.0)
        stage = Stage.of_run(evidence)
        free = independent_rows(evidence.samples)
        assert 1 < free.sum() < 100 and stage.context == "what is known"
        assert stage.rows[:, 0].tolist() == free.tolist()
        assert np.flatnonzero(stage.rows[:, 1]).tolist() == [k for k in (0, 1, 20) if free[k]]

    def test_torques_are_in_baselines_and_the_nearest_shape_leaves_least(self) -> None:
        stage = Stage.of_run(self.filtered(0.0))
        time = np.arange(100.0)
        law: Any = SimpleNamespace(torque=lambda context: np.stack([time, 8 + time], axis=1))
        torque = stage.torque(law)
        # instant by instant, joint 1 first
        assert torque[:5].tolist() == [0.0, 2.0, 0.5, 2.25, 1.0] and len(torque) == 103
        columns = {0.0: np.ones((100, 2)), 1.0: np.stack([time, time], axis=1), 2.0: -np.eye(100, 2)}
        shapes = [0.0, 1.0, 2.0]
        rival: Any = SimpleNamespace(
            full_columns=lambda context, shape: columns[shape][:, :, None], shapes=lambda context: shapes
        )
        assert stage.columns(rival, 0.0).tolist()[:3] == [[0.5], [0.25], [0.5]]
        assert stage.best_shape(law, rival) == 1.0
        shapes.clear()
        assert stage.best_shape(law, rival) is None

    def test_a_model_is_asked_only_where_an_effect_needs_it(self) -> None:
        known = SimpleNamespace(inertial="kept", period=0.02)
        asked = isolability.Context("arm", "motion")  # type: ignore[arg-type]
        evidence: Any = SimpleNamespace(
            context=known, model=SimpleNamespace(arm="arm", context=lambda motion, effects: asked)
        )
        asked = isolability.replace(asked, predicted="asked")  # type: ignore[arg-type]
        plain, needy = SimpleNamespace(needs_model=False), SimpleNamespace(needs_model=True)
        for effects, predicted in (
            (None, "asked"),
            ([], None),
            ([plain], None),
            ([plain, needy], "asked"),
        ):
            found = isolability.context_of(evidence, "motion", effects)  # type: ignore[arg-type]
            assert (found.predicted, found.inertial, found.period) == (predicted, "kept", 0.02)

    def test_effects_share_a_joint_or_are_the_whole_arms(self) -> None:
        def of(*joints: int) -> Any:
            return SimpleNamespace(indices=joints)

        assert _share_joints(of(0), of(0)) and _share_joints(of(), of(0)) and _share_joints(of(1), of(0, 1))
        assert not _share_joints(of(0), of(1)) and not _share_joints(of(2), of(0, 1))

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

    def test_what_is_left_on_several_motions_is_left_of_all_with_the_first_ones_shapes(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        asked: list[Any] = []

        def left(stages: Any, law: Any, rival: Any, beside: Any) -> tuple[float, float]:
            asked.append((len(stages), rival.shapes))
            return 0.25, 3.0

        monkeypatch.setattr(confounded, "left", left)
        rival: Any = SimpleNamespace(shapes=lambda context: [context])
        law = Law(AddedEffect(rival, {}), 7.0)
        stages: Any = [SimpleNamespace(context=1.0), SimpleNamespace(context=2.0)]
        way = Rivalry(law, law, ())
        assert way.left_on_all(stages) == way.left(stages[1]) == 0.25
        assert asked == [(2, (7.0, 1.0)), (1, (7.0, 2.0))]
        assert way.hardest(stages[0]).rival.shape == 3.0

    @staticmethod
    def of(name: str, joint: int | None = 1, shape: float | None = 5.0) -> Any:
        return SimpleNamespace(
            place=(name, joint, None), indices=() if joint is None else (joint - 1,), shape=shape
        )

    @staticmethod
    def law(effect: Any) -> Law:
        return Law(AddedEffect(effect, {}), 1.0)

    def test_what_leaves_little_and_is_not_listed_is_a_lookalike(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        laws = [self.law(self.of("found")), self.law(self.of("other", 2))]
        rivals = {
            "found": (self.of("found"), 0.0),
            "listed": (self.of("listed"), 0.0),
            "like": (self.of("like", None), 0.24),
            "unlike": (self.of("unlike"), 0.26),
            "elsewhere": (self.of("elsewhere", 3), 0.0),
            "nothing": (self.of("nothing", 1, None), 0.0),
        }
        monkeypatch.setattr(confounded, "hypotheses", lambda arm: [effect for effect, _ in rivals.values()])
        monkeypatch.setattr(
            Rivalry, "left_on_all", lambda self, stages: rivals[self.rival.effect.place[0]][1]
        )
        run: Any = SimpleNamespace(best_shape=lambda law, rival: rival.shape)
        diagnosis: Any = SimpleNamespace(model=SimpleNamespace(arm=None))
        listed = confounded.Rivalry(laws[0], self.law(rivals["listed"][0]), ())
        found = confounded.lookalikes(diagnosis, laws, [listed], run)
        names = [(way.law, way.rival.effect.place[0], way.rival.shape, way.others) for way in found]
        assert names == [(laws[0], "like", 5.0, (laws[1],)), (laws[1], "like", 5.0, (laws[0],))]

    def test_a_rival_is_fitted_last_beside_the_others(self, monkeypatch: pytest.MonkeyPatch) -> None:
        asked: list[Any] = []

        def fit(evidence: Any, residual: Any, effects: Any, shapes: Any) -> Any:
            asked.append(([e.place[0] for e in effects], [shape.final for shape in shapes], residual))
            return SimpleNamespace(parameters=["of the first", "of the rival"][-len(effects) :])

        monkeypatch.setattr(confounded, "fit", fit)
        effects = [self.of("first"), self.of("second", 2), self.of("third", 3)]
        laws = [self.law(effect) for effect in effects]
        rivals = [
            [(self.of("rival"), 0.1), (self.of("second", 2), 0.1), (self.of("none", 1, None), 0.1)],
            [],
            [],
        ]
        outcome = SimpleNamespace(
            found=[SimpleNamespace(rivals=each, effect=SimpleNamespace(event=False)) for each in rivals]
        )
        evidence = SimpleNamespace(residual=lambda known: "all of it")
        diagnosis: Any = SimpleNamespace(outcome=outcome, evidence=evidence)
        run: Any = SimpleNamespace(best_shape=lambda law, rival: rival.shape)
        (pair,) = confounded.pairs(diagnosis, laws, run)
        assert asked == [(["second", "third", "rival"], [1.0, 1.0, 5.0], "all of it")]
        assert (pair.law, pair.others) == (laws[0], (laws[1], laws[2]))
        assert (pair.rival.effect.place[0], pair.rival.shape) == ("rival", 5.0)
        assert pair.rival.added.parameters == "of the rival"


class TestNextRun:
    def test_standard_errors_fall_with_size_and_with_what_tells_columns_apart(self) -> None:
        def stage(*columns: Any) -> Any:
            return SimpleNamespace(columns=lambda effect, shape: np.array(columns[effect]).T)

        laws: Any = [SimpleNamespace(effect=k, shape=0.0) for k in (0, 1)]
        run = stage([[3.0, 0.0, 0.0], [0.0, 4.0, 0.0]], [[0.0, 0.0, -2.0]])
        then = stage([[12.0, 0.0, 0.0], [0.0, 4.0, 0.0]], [[0.0, 0.0, 6.0]])
        # the geometric mean of 1/4 and 1 of the first; a third
        assert next_run._sharper(run, then, laws) == [(0, pytest.approx(0.5)), (1, pytest.approx(1 / 3))]
        # columns with the correlation c have the errors of 1 / sqrt(1 - c^2)
        run, then = stage([[1.0, 0.0]], [[0.6, 0.8]]), stage([[1.0, 0.0]], [[0.0, 1.0]])
        assert [x for _, x in next_run._sharper(run, then, laws)] == pytest.approx([0.8, 0.8])
        # eigenvalues 1 ± c in a ratio of more than 1e-9 still tell them apart
        for gap, told in ((1.5e-9, True), (0.7e-9, False)):
            angle = np.sqrt(4 * gap)
            then = stage([[1.0, 0.0]], [[np.cos(angle), np.sin(angle)]])
            expected = 0.8 / angle if told else 0.8 / 2
            assert [x for _, x in next_run._sharper(run, then, laws)] == pytest.approx(
                [expected] * 2, rel=1e-3
            )

    @staticmethod
    def designed(
        monkeypatch: pytest.MonkeyPatch,
        ways: list[list[Any]],
        possible: bool = True,
        joint: int | None = None,
    ) -> Any:
        """Pairs with so much left on the run and on the motion then, each way."""
        names = iter("abc")
        pairs = []
        for both in ways:
            made = tuple(SimpleNamespace(left=lambda stage, of=of: of[stage]) for of in both)
            name = next(names)
            side: Any = SimpleNamespace(effect=name)
            pairs.append(SimpleNamespace(law=side, rival=side, both_ways=lambda made=made: made))
        design = SimpleNamespace(reference="made")
        planner = SimpleNamespace(
            possible=lambda ways: [way for way in ways if possible and way.left(1) is not None],
            alternatives=lambda ways: design,
            unlisted=lambda joint: design,
            precision=lambda laws: design,
            whole=lambda made: "whole",
            limits=SimpleNamespace(use=lambda sampled: sampled),
            fine_step=0.5,
        )
        monkeypatch.setattr(next_run.Planner, "of", staticmethod(lambda *_: planner))
        monkeypatch.setattr(next_run, "found_laws", lambda diagnosis: ["a law"])
        monkeypatch.setattr(next_run, "pairs", lambda *_: pairs)
        monkeypatch.setattr(next_run, "lookalikes", lambda *_: [])
        monkeypatch.setattr(next_run, "_sharper", lambda *_: ["sharper"])
        monkeypatch.setattr(next_run, "sampled", lambda reference, step: (reference, step))
        monkeypatch.setattr(Stage, "of_run", staticmethod(lambda evidence: 0))
        monkeypatch.setattr(Stage, "of_reference", staticmethod(lambda evidence, reference: 1))
        unlisted = None if joint is None else SimpleNamespace(joint=joint)
        diagnosis: Any = SimpleNamespace(
            outcome=SimpleNamespace(found=["a"]), unlisted=unlisted, evidence=None
        )
        made = next_run.next_run(diagnosis)
        assert made is not None and made.reference == "whole" and made.use == ("made", 0.5)  # type: ignore[comparison-overlap]
        return made

    def test_the_worst_told_alternative_comes_first_and_those_never_told_last(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        ways = [[(0.1, None), (0.2, None)], [(0.4, 0.9), (0.3, 0.8)], [(0.05, None), (0.2, 0.7)]]
        made = self.designed(monkeypatch, ways)
        # of a way that no motion opens nothing is said where another is open
        assert [(t.found, t.now, t.then) for t in made.told] == [
            ("c", 0.2, 0.7),
            ("b", 0.3, 0.8),
            ("a", 0.1, None),
        ]
        assert (made.purpose, made.sharper, made.joint) == ("alternatives", [], None)

    def test_without_alternatives_it_is_for_the_residual_or_for_precision(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        made = self.designed(monkeypatch, [[(0.1, 0.2)]], possible=False, joint=2)
        assert (made.purpose, made.sharper, made.joint, made.told[0].then) == ("unlisted", [], 2, None)
        made = self.designed(monkeypatch, [])
        assert (made.purpose, made.sharper, made.joint) == ("precision", ["sharper"], None)
