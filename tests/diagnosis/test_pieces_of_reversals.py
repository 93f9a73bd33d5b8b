"""What is plain at reversals, and which of several effects is named, on numbers one can see through."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import t

from armloop.data.motion import Motion, Samples
from armloop.diagnosis import reversals
from armloop.diagnosis.fit import Shape
from armloop.diagnosis.reversals import _Gain, _Gains, _positive, _View, judge_reversals
from armloop.laws.effects import Estimate
from armloop.laws.effects import effect as listed
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import AddedEffect


@dataclass(frozen=True)
class Effect:
    """An effect of a joint, or of a pair of them, or of none."""

    name: str
    joint: int | None = None
    other_joint: int | None = None
    complexity: int = 1
    sensor: bool = False
    rubs: bool = False

    @property
    def place(self) -> tuple[Any, ...]:
        return self.name, self.joint, self.other_joint

    @property
    def indices(self) -> tuple[int, ...]:
        return tuple(joint - 1 for joint in (self.joint, self.other_joint) if joint is not None)

    @property
    def pair_wise(self) -> bool:
        return self.other_joint is not None

    def label(self) -> str:
        return self.name


#: Ratios per block that are sure, and others that are not.
SURE, UNSURE = np.array([1.0, 1.1, 0.9, 1.0, 1.05]), np.array([1.0, -0.9, 0.8, -0.7, 0.9])


def gain(share: float, ratios: Any = SURE) -> _Gain:
    return _Gain(share, ratios)


def taken(*gains: tuple[Effect, dict[int, _Gain]], found: tuple[str, ...] = ()) -> _Gains:
    made: Any = _Gains({}, {}, set(found))
    for effect, own in gains:
        made.take(effect, own)
    return made


def fitted(joint: Any, block: Any, held_out: Any, joints: int = 3) -> Any:
    stacked = SimpleNamespace(joint=np.array(joint), block=np.array(block), joints=joints)
    return SimpleNamespace(stacked=stacked, held_out=np.array(held_out, dtype=float))


class TestView:
    """Nine rows of two joints, of which the first and the last are not at reversals."""

    JOINT = np.array([0, 0, 0, 0, 0, 1, 1, 1, 1])
    BLOCK = np.array([1, 1, 2, 3, 4, 1, 2, 3, 9])
    ROWS = np.array([0, 1, 1, 1, 1, 1, 1, 1, 0], dtype=bool)

    def view(self, noticeable: float = 0.0, block: Any = BLOCK, usual: float = 0.0) -> _View:
        return _View(self.ROWS, self.JOINT, np.array(block), np.full(3, noticeable), np.full(3, usual))

    def fit(self, held_out: Any) -> Any:
        return fitted(self.JOINT, self.BLOCK, held_out)

    def test_mean_squares_at_reversals_by_joint(self) -> None:
        found = self.view().mean_squares(self.fit([99.0, 1, 2, 3, 4, 1, 1, 2, 99]))
        np.testing.assert_allclose(found, [30 / 4, 6 / 3, np.nan])

    def test_a_suspect_has_four_blocks_and_a_noticeable_error(self) -> None:
        fit = self.fit([99.0, 1, 2, 3, 4, 1, 1, 2, 99])
        # rows at reversals of the first joint lie in blocks 1 to 4, of the second in three
        assert self.view(7.4).suspects(fit) == [0] and self.view(7.5).suspects(fit) == []
        block = np.array([1, 2, 2, 3, 4, 1, 2, 3, 9])
        assert self.view(0.0, block).suspects(fit) == []

    def test_what_a_trial_gains_at_suspects_if_the_whole_run_gains(self) -> None:
        before = self.fit([9.0, 2, 2, 2, 2, 3, 3, 3, 9])
        better = self.fit([9.0, 1, 1, 2, 0.5, 3, 3, 3, 9])
        view = self.view(1.0)
        assert view.gains(before, None) == {} and view.gains(before, before) == {}
        (worse,) = [self.fit([9.6, 1, 1, 2, 0.5, 3, 3, 3, 9])]
        assert view.gains(before, worse) == {}
        found = view.gains(before, better)
        assert list(found) == [0]
        # of 16 there are 6.25 left: a gain of 9.75 in four rows
        assert found[0].share == pytest.approx(9.75 / 16)
        # errors beside the least noticeable one, so that a row with nothing to remove tells nothing
        np.testing.assert_allclose(found[0].ratios, np.log([5 / 2, 5 / 2, 1.0, 5 / 1.25]))
        (small,) = [view._gain(self.fit([9.0, 2, 2, 2, 0.01, 3, 3, 3, 9]), better, 0)]
        assert -0.25 < small.ratios[3] < 0.0
        assert self.view(9.74 / 4).gains(before, better)[0].share > 0
        assert self.view(9.76 / 4).gains(before, better)[0].share == 0.0
        # half of it the model leaves at the reversals of its training logs, too, or less
        assert self.view(usual=4.876 / 4).gains(before, better)[0].always
        assert not self.view(usual=4.874 / 4).gains(before, better)[0].always
        # of nothing left there is still a number
        nothing = self.view()._gain(before, self.fit([9.0, 0, 1, 1, 1, 0, 0, 0, 0]), 0)
        assert np.isfinite(nothing.ratios).all() and nothing.ratios[0] > 100


class TestGains:
    def test_three_quarters_are_plain_and_a_half_where_the_kind_was_found(self) -> None:
        for share, found, named in (
            (0.75, (), True),
            (0.74, (), False),
            (0.5, ("a",), True),
            (0.49, ("a",), False),
        ):
            best = taken((Effect("a", 1), {0: gain(share)}), found=found).best()
            assert (best is not None) == named
        assert taken((Effect("a", 1), {0: gain(0.6)}), found=("b",)).best() is None
        assert taken().best() is None and taken((Effect("a", 1), {})).best() is None

    def test_what_the_training_logs_show_too_was_always_there(self) -> None:
        for always, rubs in ((True, True), (False, True), (True, False)):
            best = taken((Effect("a", 1, rubs=rubs), {0: _Gain(0.9, SURE, always)})).best()
            assert best is not None and best.always == (always and rubs)

    def test_the_largest_decides_the_joint_and_the_simplest_of_equals_is_named(self) -> None:
        simple, other, more = (
            Effect("s", 1, complexity=1),
            Effect("o", 1, complexity=2),
            Effect("m", 1, complexity=3),
        )
        found = taken((more, {0: gain(0.95)}), (simple, {0: gain(0.86)}), (other, {0: gain(0.9)})).best()
        assert found is not None and found.effect is simple and found.share == 0.86  # type: ignore[comparison-overlap]
        assert found.shape == Shape.fixed(0.0)
        # alternatives explain 0.94 of what it explains
        assert dict(found.rivals) == {other: 0.9, more: 0.95}  # type: ignore[comparison-overlap]
        found = taken((more, {0: gain(0.95)}), (simple, {0: gain(0.84)}), (other, {0: gain(0.9)})).best()
        assert found is not None and found.effect is other  # type: ignore[comparison-overlap]
        assert dict(found.rivals) == {more: 0.95}  # type: ignore[comparison-overlap]
        found = taken((simple, {0: gain(0.9)}), (other, {0: gain(0.9 * 0.941)})).best()
        assert found is not None and len(found.rivals) == 1
        found = taken((simple, {0: gain(0.9)}), (other, {0: gain(0.9 * 0.939)})).best()
        assert found is not None and len(found.rivals) == 0

    def test_of_equals_as_simple_the_one_that_removes_more_and_of_joints_the_one_that_gains_most(
        self,
    ) -> None:
        one, two = Effect("a", 1), Effect("b", 1)
        found = taken((one, {0: gain(0.85)}), (two, {0: gain(0.9)})).best()
        assert found is not None and found.effect is two  # type: ignore[comparison-overlap]
        # what gains at another joint is no rival here
        away = Effect("c", 2)
        found = taken((one, {0: gain(0.9)}), (away, {1: gain(0.95)})).best()
        assert found is not None and found.effect is away and found.share == 0.95  # type: ignore[comparison-overlap]
        assert found.rivals == []

    def test_chance_is_ruled_out_at_the_joint_or_at_all_that_are_alike(self) -> None:
        few = np.array([0.5, 1.5])
        assert not _positive(few)
        a1, a2 = Effect("a", 1), Effect("a", 2)
        assert taken((a1, {0: gain(0.9, few)})).best() is None
        assert taken((a1, {0: gain(0.9, few)}), (Effect("b", 2), {1: gain(0.1, SURE)})).best() is None
        # the same kind at another joint says so
        both = taken((a1, {0: gain(0.9, few)}), (a2, {1: gain(0.1, np.linspace(0.9, 1.1, 20))}))
        best = both.best()
        assert best is not None and best.effect is a1  # type: ignore[comparison-overlap]
        assert taken((a1, {0: gain(0.9, UNSURE)}), (a2, {1: gain(0.9, UNSURE)})).best() is None

    def test_a_kind_is_known_by_its_own_joints(self) -> None:
        made = taken(
            (Effect("a", 2), {0: gain(0.1), 1: gain(0.2)}),
            (Effect("a", 1, 2), {0: gain(0.3), 1: gain(0.4)}),
            (Effect("a"), {0: gain(0.5)}),
            (Effect("b", 1), {1: gain(0.6)}),
        )
        assert {kind: {j: g.share for j, g in own.items()} for kind, own in made.by_kind.items()} == {
            "a": {1: 0.2}
        }
        assert len(made.by_effect) == 4

    def test_what_depends_on_joints_where_something_was_found_is_forgotten(self) -> None:
        everywhere, found, there, elsewhere = Effect("w"), Effect("a", 1), Effect("b", 1), Effect("c", 2)
        pair, apart = Effect("p", 2, 1), Effect("p", 2, 3)
        made = taken(*((effect, {}) for effect in (everywhere, found, there, elsewhere, pair, apart)))
        made.forget(found, {0})  # type: ignore[arg-type]
        assert set(made.by_effect) == {elsewhere, apart} and made.found == {"a"}
        # of what was found nothing is left, wherever something changed
        made = taken((found, {}), (elsewhere, {}))
        made.forget(found, {2})  # type: ignore[arg-type]
        assert set(made.by_effect) == {elsewhere}


@pytest.mark.parametrize("count", [2, 5, 30])
def test_positive_is_three_standard_errors_by_students_t(count: int) -> None:
    spread = np.where(np.arange(count) % 2 == 0, 1.0, -1.0)
    spread = spread - spread.mean()
    edge = t.isf(0.00135, count - 1) * spread.std(ddof=1) / np.sqrt(count)
    assert _positive(spread + 1.01 * edge) and not _positive(spread + 0.99 * edge)
    assert not _positive(spread - 9 * edge)


#: To which share each effect lowers the error of its joint.
LEFT = {"memory 1": 0.3, "memory 2": 0.4, "weak 1": 0.9, "other 2": 0.48}


def of(effects: tuple[Any, ...]) -> Any:
    """The fit of some effects: six rows of two joints, each in a block of its own."""
    left = np.repeat([1.0, 1.0], 6)
    for effect in effects:
        left[6 * (effect.joint - 1) : 6 * effect.joint] *= LEFT[f"{effect.name} {effect.joint}"]
    fit = fitted(np.repeat([0, 1], 6), np.tile(np.arange(6), 2), left, 2)
    fit.effects, fit.shapes = effects, tuple(f"shape of {e.name} {e.joint}" for e in effects)
    return fit


@dataclass(frozen=True)
class Known:
    """Stands for what is known already."""

    fit: Any

    def trial(self, effect: Any) -> Any:
        return of((*self.fit.effects, effect))


def test_memory_that_the_model_has_is_not_lacked_all_along() -> None:
    friction = FrictionLaw(((FrictionTerm("hysteresis", 1.0, 0.002),), (FrictionTerm("sign", 1.0),)))
    changed, always = _Gain(0.9, SURE), _Gain(0.9, SURE, always=True)
    for name, joint, kept in (
        ("presliding_hysteresis", 1, {1: changed}),
        ("presliding_hysteresis", 2, {0: always, 1: changed}),
        ("stribeck_friction", 1, {0: always, 1: changed}),
        ("joint_spring", 1, {0: always, 1: changed}),
    ):
        assert reversals._news(friction, listed(name, joint), {0: always, 1: changed}) == kept


def test_effects_are_found_one_after_the_other_until_nothing_plain_is_left(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    every = [Effect("memory", 1), Effect("memory", 2), Effect("weak", 1)]
    monkeypatch.setattr(
        reversals, "Known", SimpleNamespace(of=lambda own, effects=(), shapes=(): Known(of(tuple(effects))))
    )
    monkeypatch.setattr(
        reversals,
        "_concerned",
        lambda arm, joints, fit: [e for e in every if e not in fit.effects and e.joint - 1 in joints],
    )
    monkeypatch.setattr(reversals, "hypotheses", lambda arm: every)
    monkeypatch.setattr(reversals, "independent_rows", lambda samples: np.ones(6, dtype=bool))
    monkeypatch.setattr(reversals, "Outcome", lambda *of: of)
    unclear: set[tuple[str, int]] = set()

    def clear(own: Any, every: Any, settled: int, alike: bool) -> Any:
        assert own.rows.all() and settled == 1 and alike
        found = [one for one in every[0][1:] if (one.effect.name, one.effect.joint) not in unclear]
        left = of(tuple(one.effect for one in found))
        return SimpleNamespace(found=[*every[0][:1], *found], after=left, every=every)

    monkeypatch.setattr(reversals, "clear", clear)
    turns = np.ones((6, 2), dtype=bool)
    monkeypatch.setattr(reversals, "passing", lambda samples: turns)
    motion = Motion(np.arange(6.0), *np.zeros((3, 6, 2)), np.array([0]))
    samples = Samples(motion, np.ones((6, 2)), ~turns, 1.0)

    def run(rows: Any) -> Any:
        scale = np.array([2.0, 3.0])
        return SimpleNamespace(
            samples=samples,
            rows=rows,
            scale=scale,
            model=SimpleNamespace(arm=None, baseline={}, friction=FrictionLaw(((), ())), history={}),
            only=lambda own: run(own),
        )

    told: list[str] = []
    after = SimpleNamespace(effects=(), shapes=())
    outcome: Any = SimpleNamespace(found=["slide"], after=after, added=list, masked=("hidden",))
    found = judge_reversals(
        run(np.zeros((6, 2), dtype=bool)), outcome, np.ones((6, 2), dtype=bool), told.append
    )
    assert found is not None
    # shares 1 - 0.3² and 1 - 0.4² of the squares; a tenth of the torque less is no halving
    assert [(one.effect.name, one.effect.joint, one.share) for one in found.found] == [
        ("memory", 1, pytest.approx(0.91)),
        ("memory", 2, pytest.approx(0.84)),
    ]
    assert [one.shape for one in found.found] == ["shape of memory 1", "shape of memory 2"]
    assert found.before.tolist() == [2.0, 3.0] and found.after == pytest.approx([0.6, 1.2])
    whole: Any = found.outcome.every  # type: ignore[attr-defined]
    assert whole[0][0] == "slide" and len(whole[0]) == 3
    assert whole[1].effects == () and [e.joint for e in whole[2].effects] == [1, 2]
    assert whole[3] == ("hidden",)
    assert found.evidence.rows.all() and len(told) == 2
    # what is not clear of its stated error goes, and if nothing is left there is nothing to say
    nobody, everybody = np.zeros((6, 2), dtype=bool), np.ones((6, 2), dtype=bool)
    unclear.add(("memory", 2))
    found = judge_reversals(run(nobody), outcome, everybody, told.append)
    assert found is not None and [one.effect.joint for one in found.found] == [1]
    assert found.after == pytest.approx([0.6, 3.0])
    unclear.add(("memory", 1))
    assert judge_reversals(run(nobody), outcome, everybody, told.append) is None
    # what is none beside another that was found since makes way for the next
    unclear.clear()
    every.append(Effect("other", 2))
    trial = Known.trial
    monkeypatch.setattr(Known, "trial", lambda k, e: None if e == every[1] and k.fit.effects else trial(k, e))
    found = judge_reversals(run(nobody), outcome, everybody, told.append)
    assert found is not None and [one.effect.name for one in found.found] == ["memory", "other"]
    # nothing at all where nothing may count
    none = np.zeros((6, 2), dtype=bool)
    assert judge_reversals(run(none), outcome, none, told.append) is None


def test_what_is_judged_is_a_tenth_of_a_second_around_a_turn_of_what_may_count(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    N = 30
    turns, kept, rows = (
        np.zeros((N, 2), dtype=bool),
        np.ones((N, 2), dtype=bool),
        np.zeros((N, 2), dtype=bool),
    )
    turns[[5, 8], 0] = turns[[15, 25], 1] = True
    kept[[3, 25], [0, 1]] = False
    rows[:7, 0] = rows[10:16, 1] = True
    independent = np.arange(N) != 8
    wide: Any = "with the dead zones of training"
    monkeypatch.setattr(reversals, "_as_in_training", lambda evidence: wide)
    monkeypatch.setattr(reversals, "passing", lambda given: turns & (given is wide))
    monkeypatch.setattr(reversals, "independent_rows", lambda samples: independent)
    monkeypatch.setattr(reversals, "Known", SimpleNamespace(of=lambda *_: SimpleNamespace(fit=None)))
    asked: list[Any] = []

    def view(own: Any, fit: Any, judged: Any) -> Any:
        asked.append((own.rows, judged))
        return SimpleNamespace(suspects=lambda fit: [])

    monkeypatch.setattr(_View, "of", view)
    motion = SimpleNamespace(runs=lambda: [slice(0, N)])
    samples = SimpleNamespace(motion=motion, moving=None, period=0.05)
    baseline: dict[str, Any] = {}
    evidence: Any = SimpleNamespace(
        model=SimpleNamespace(baseline=baseline, friction=FrictionLaw(((), ())), history={}),
        samples=samples,
        rows=rows,
        only=lambda own: SimpleNamespace(rows=own, samples=samples),
    )
    added: list[AddedEffect] = []
    outcome: Any = SimpleNamespace(after=SimpleNamespace(effects=(), shapes=()), added=lambda: added)
    assert judge_reversals(evidence, outcome, kept, lambda text: None) is None
    ((own, judged),) = asked
    # of four turns one is not kept and one not independent; two samples, of a twentieth of a second, to either side
    expected = rows.copy()
    expected[[5, 15], [0, 1]] = True
    assert own.tolist() == expected.tolist()
    assert np.argwhere(judged).tolist() == [[4, 0], [5, 0], [6, 0], [13, 1], [14, 1], [15, 1]]
    # nor one of a joint that never turned round in the training logs
    baseline["reversals"] = [0.5, None]
    assert judge_reversals(evidence, outcome, kept, lambda text: None) is None
    assert np.argwhere(asked[1][1]).tolist() == [[4, 0], [5, 0], [6, 0]]
    baseline.clear()
    # nor one whose friction has memory in the model, where dry friction was found beside it
    memory = (FrictionTerm("smooth_sign", 2.0, 0.01), FrictionTerm("hysteresis", 1.0, 0.002))
    for name, law, joints in (
        ("coulomb_friction", memory, {0}),
        ("coulomb_friction", memory[:1], {0, 1}),
        ("viscous_friction", memory, {0, 1}),
        ("rotor_inertia", memory, {0, 1}),
        ("presliding_hysteresis", memory, {0}),
    ):
        kind = listed(name, 2)
        added[:] = [AddedEffect(kind, {p.name: Estimate(1.0, 0.1, "") for p in kind.parameters})]
        evidence.model.friction = FrictionLaw((memory, law))
        assert judge_reversals(evidence, outcome, kept, lambda text: None) is None
        assert set(np.argwhere(asked[-1][1])[:, 1].tolist()) == joints


def test_what_rested_by_the_dead_zones_of_training_does_not_turn_round() -> None:
    """Joint 1 turns round at 2, 6 and 10 s, joint 2 as often and ten times as slowly."""
    time = np.arange(0, 12, 0.01)
    v = np.cos(np.pi / 4 * time)[:, None] * np.array([1.0, 0.1])
    slow = np.abs(v) < 0.002
    samples = Samples(Motion(time, v, v, v, np.array([0])), 0 * v, ~slow, 0.01, 10.0)

    def turned(**history: list[float]) -> list[int]:
        model = SimpleNamespace(history=history, conditioning=SimpleNamespace(dead_zone=4.0, smear=0.5))
        evidence: Any = SimpleNamespace(samples=samples, model=model)
        return reversals.passing(reversals._as_in_training(evidence)).sum(axis=0).tolist()

    quick = turned()
    assert min(quick) > 0
    # 0.008 rad/s either way: of joint 2 that takes longer than turning round may
    wide = turned(velocity_noise=[0.002, 0.002])
    assert wide[0] > quick[0] and wide[1] == 0
    assert turned(velocity_noise=[0.002, 1e-6])[1] > 0


class TestNamed:
    """Which of the listed effects is named."""

    SURE = np.full(5, 1.0) + 0.01 * np.arange(5)

    def best(self, *given: tuple[str, int | None, float], **of: Any) -> Any:
        gains = _Gains({}, {}, set(of.get("found", ())))
        for name, joint, share in given:
            gains.take(listed(name, joint), {(joint or 1) - 1: _Gain(share, of.get("ratios", self.SURE))})
        return gains.best()

    def test_the_best_is_plain_and_sure_and_the_simplest_of_equals(self) -> None:
        level, spring = "presliding_hysteresis", "joint_spring"
        assert self.best() is None
        assert self.best((level, 1, 0.749)) is None and self.best((level, 1, 0.75)).share == 0.75
        assert self.best((level, 1, 0.5), found=[level]).share == 0.5
        assert self.best((level, 1, 0.49), found=[level]) is None
        assert self.best((level, 1, 0.9), ratios=np.array([1.0, -1.0, 1.0, -1.0, 0.5])) is None
        simple, rich = sorted((level, spring), key=lambda name: listed(name, 1).complexity)
        assert listed(simple, 1).complexity < listed(rich, 1).complexity
        best = self.best((simple, 1, 0.80), (rich, 1, 0.89))
        assert (best.effect.name, best.share) == (simple, 0.80)
        assert [(e.name, share) for e, share in best.rivals] == [(rich, 0.89)]
        best = self.best((simple, 1, 0.78), (rich, 1, 0.89))
        assert (best.effect.name, best.rivals) == (rich, [])
        assert self.best((rich, 1, 0.80), (rich, 2, 0.9)).effect.joint == 2

    def test_a_kind_is_sure_at_one_joint_alone_only_there(self) -> None:
        gains, chance = _Gains({}, {}, set()), np.array([1.0, -1.0, 1.0, -1.0, 0.5])
        spring = listed("joint_spring", 1)
        gains.take(spring, {0: _Gain(0.9, self.SURE), 1: _Gain(0.9, chance)})
        assert gains._sure(spring, 0) and not gains._sure(spring, 1)

    def test_drives_are_alike(self) -> None:
        # few reversals of one joint tell little, those of two together tell enough
        few = np.array([0.6, 1.0, 1.4])
        name = "presliding_hysteresis"
        assert self.best((name, 1, 0.9), ratios=few) is None
        assert self.best((name, 1, 0.9), (name, 2, 0.8), ratios=few).effect.joint == 1
        assert self.best((name, 1, 0.9), ("joint_spring", 2, 0.8), ratios=few) is None
