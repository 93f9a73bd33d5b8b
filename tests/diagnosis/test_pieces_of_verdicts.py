"""What a verdict rests on, on numbers small enough to see through: pushes, reversals, whereabouts, what is left."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import three_axis

from armloop.data.motion import Motion
from armloop.diagnosis import reasons, unlisted, whereabouts
from armloop.diagnosis.lasting import lasting, much_lasts
from armloop.diagnosis.score import Score
from armloop.identification.goodness import Parts
from armloop.laws.effects import effect


def motion(lengths: tuple[int, ...], joints: int = 1) -> Motion:
    """Runs of so many samples, 0.01 s each, at rest, 5 s apart."""
    N, starts = sum(lengths), np.cumsum([0, *lengths[:-1]])
    time = np.arange(N) * 0.01 + 5.0 * (np.searchsorted(starts, np.arange(N), side="right") - 1)
    return Motion(time, *np.zeros((3, N, joints)), starts)


class TestWhereabouts:
    @pytest.mark.parametrize(
        ("energy", "found"),
        [
            ([0, 0, 1, 8, 1, 0, 0, 0, 0, 0], (3, 3)),
            ([0, 0, 1.5, 7, 1.5, 0, 0, 0, 0, 0], (2, 3)),
            ([0, 0, 0, 0, 1, 1, 1, 1, 1, 1], (4, 8)),
            ([0, 0, 0, 1, 1, 1, 1, 1, 1, 1], None),
            ([1, 0, 0, 0, 0, 0, 0, 0, 0, 0], (0, 0)),
            ([0, 0, 0, 0, 0, 0, 0, 0, 0, 1], (9, 9)),
            ([1, 0, 0, 0, 0, 0, 0, 0, 0, 1], None),
        ],
    )
    def test_the_shortest_stretch_with_four_fifths(
        self, energy: list[float], found: tuple[int, int] | None
    ) -> None:
        # blocks of two samples, numbered with gaps
        block, time = 3 * np.repeat(np.arange(10), 2), np.arange(20.0)
        stretch = whereabouts._stretch(time, block, np.repeat(np.array(energy, dtype=float), 2))
        assert stretch == (None if found is None else (2.0 * found[0], 2.0 * found[1] + 1))
        assert whereabouts._stretch(np.arange(10.0), np.arange(10), np.eye(10)[4]) is None  # an instant

    def test_halves_of_the_motion(self) -> None:
        arm, given = three_axis(), motion((4,), 3)
        given.v[:] = np.array([[1.0, -1.0, 2.0, -3.0]]).T * [1, 2, 3]
        given.vdot[:, 1], given.q[:, 1] = [4.0, -1.0, 2.0, 3.0], [-1.0, 0.0, 1.0, 2.0]
        evidence: Any = SimpleNamespace(
            samples=SimpleNamespace(motion=given),
            model=SimpleNamespace(arm=arm),
            context=SimpleNamespace(load=np.array([[0, x, 0] for x in (1.0, -9.0, 2.0, -3.0)])),
        )
        halves = {name: rows.tolist() for name, rows in whereabouts._halves(evidence, np.arange(4), 1)}
        assert halves == {
            "joint 2 moves in the positive direction": [True, False, True, False],
            "joint 2 moves in the negative direction": [False, True, False, True],
            **{
                f"joint {k} moves {word} than {1.5 * k:.3g} rad/s": rows
                for k in (1, 2, 3)
                for word, rows in (
                    ("faster", [False, False, True, True]),
                    ("slower", [True, True, False, False]),
                )
            },
            "joint 2 accelerates by more than 2.5 rad/s^2": [True, False, False, True],
            "joint 2 accelerates by less than 2.5 rad/s^2": [False, True, True, False],
            "joint 2 stands above 0.5 rad": [False, False, True, True],
            "joint 2 stands below 0.5 rad": [True, True, False, False],
            "joint 2 carries more than 2.5 N*m": [False, True, False, True],
            "joint 2 carries less than 2.5 N*m": [True, False, True, False],
        }


class TestReasons:
    def test_outside_the_trained_range(self) -> None:
        def said(outside: list[float], far: list[float]) -> list[str]:
            return reasons._outside(np.array(outside), np.array(far))

        assert said([0.02, 0.0], [0.0, 0.0]) == []
        start = "samples outside the range the model was trained on: "
        far, judged = "beyond 1.2 times the range", "; what lies beyond 1.2 times the range was not judged"
        assert said([0.02, 0.03], [0.0, 0.0]) == [f"{start}3% of joint 2's"]
        assert said([0.0, 0.03], [0.0, 0.009]) == [f"{start}3% of joint 2's (less than 1% {far}){judged}"]
        several = f"{start}3% of joint 1's, 40% of joint 2's (1% {far}), 50% of joint 3's (30%){judged}"
        assert said([0.03, 0.4, 0.5], [0.0, 0.01, 0.3]) == [several]

    @pytest.mark.parametrize(
        ("labels", "which"),
        [
            (["a"], "a would explain some of what is left there, but is no larger"),
            (["a", "b"], "a and b would explain some of what is left there, but are no larger"),
            (["a", "b", "c"], "a, b and c would explain some of what is left there, but are no larger"),
        ],
    )
    def test_what_the_model_may_err_by_is_told_in_one_sentence(self, labels: list[str], which: str) -> None:
        (said,) = reasons.masked(labels)
        assert said.startswith(which) and reasons.masked([]) == []
        assert said.endswith("it is not stated" if len(labels) == 1 else "they are not stated")

    @pytest.mark.parametrize(
        ("kept", "said"),
        [({"between_logs_known": "assumed"}, True), ({"between_logs_known": "alike"}, False), ({}, False)],
    )
    def test_friction_that_one_log_cannot_tell_from_what_differs_between_runs(
        self, kept: dict[str, str], said: bool
    ) -> None:
        model: Any = SimpleNamespace(uncertainty=kept)
        kinds = [("torque_gain", 1), ("coulomb_friction", 2), ("viscous_friction", 3), ("quadratic_drag", 3)]
        found: Any = [
            SimpleNamespace(effect=effect(*kind), always=kind[0] == "quadratic_drag") for kind in kinds
        ]
        words = reasons.of_too_few_logs(model, found)
        assert len(words) == said
        if said:
            assert "0.5% (dry) and 1.1% (viscous) of it" in words[0]
            assert "and coulomb friction at joint 2, viscous friction at joint 3 may be no more" in words[0]
        assert reasons.of_too_few_logs(model, found[:1]) == []

    def test_slower_than_in_training(self, monkeypatch: pytest.MonkeyPatch) -> None:
        arm = SimpleNamespace(revolute=np.array([True, True, False]))
        model: Any = SimpleNamespace(arm=arm)
        speeds = {"run": np.array([0.0471, 0.3, 0.02])}
        monkeypatch.setattr(reasons, "known_from", lambda model, samples: speeds[samples])
        run: Any = "run"
        assert reasons._slow(model, run, np.array([0.02, 0.0, 0.0])) == []
        assert reasons._slow(model, run, np.array([0.03, 0.0, 0.25])) == [
            "samples in which a joint slides slower than it was trained at, which were not judged: 3% of joint 1's "
            "(below 0.047 rad/s), 25% of joint 3's (below 0.02 m/s)"
        ]

    def test_a_residual_is_real_if_it_can_be_foretold_or_nothing_is_known_of_it(self) -> None:
        def real(
            left: float | None, error: float | None, noise: float | None, apart: bool = True
        ) -> bool | None:
            words, real = reasons._multiple(Parts(1, 0.5, left, noise, error, None, apart), 0, 2.5)
            assert words.startswith("joint 1: the residual is 2.5 times the baseline")
            left_over, _ = reasons._multiple(Parts(1, 0.5, left, noise, error, None, apart), 0, 2.5, True)
            assert left_over == words.replace("the residual", "what is left", 1)
            assert ("something is there" in words) == (left is None or error is None or noise is None)
            assert ("nor a law that is stated accounts for it" in words) == (
                real is True and "something" not in words
            )
            assert ("predicts little of it" in words) == (real is False)
            return real

        assert real(None, 0.1, 0.1) and real(0.1, None, 0.1) and real(0.1, 0.1, None)
        # by more than three standard errors, and than a fifth of what is left
        assert real(0.31, 0.1, 0.1) and real(0.29, 0.1, 0.1) is None
        assert real(0.26, 0.01, 1.0) and real(0.24, 0.01, 1.0) is None
        # noise is what is known to be next to nothing else, of blocks that lie apart
        assert real(0.1, 0.05, 0.9) is False and real(0.1, 0.11, 0.9) is None
        assert real(0.1, 0.05, 0.9, apart=False) is None

    @pytest.mark.parametrize(
        ("moves", "blocks", "still"),
        [(20, 8, ""), (19, 8, "joints 1, 2 hardly slide"), (20, 7, "joint 2 hardly slides")],
    )
    def test_too_little_motion(self, moves: int, blocks: int, still: str) -> None:
        given = motion((100,), 2)
        given.v[:moves, 0], given.v[moves:, 0], given.v[:, 1] = -0.011, 0.01, 0.002
        evidence: Any = SimpleNamespace(
            rows=np.ones((100, 2), dtype=bool),
            samples=SimpleNamespace(motion=given),
            blocks=np.arange(100) * blocks // 100,
            model=SimpleNamespace(
                history=SimpleNamespace(get=lambda _: [[1, 1], [1, 0.2], [1, 1]]),
                baseline={"joints": [{"correlation_time": 0.08}]},
            ),
        )
        words = reasons.too_still(evidence)
        wanted = f"({blocks} blocks of 0.8 s or more; {still}); log at least 7.2 s in which the joints move"
        assert words == (f"too little motion to judge {wanted}" if still else "")
        # what turns, but slower than in training, or elsewhere, is not still
        given.v[:, 0] = 0.5
        evidence.rows[:, 0] = False
        words = reasons.too_still(evidence)
        assert (
            "; joint 2 hardly slides; joint 1 slides hardly where, and as fast as, the model was trained); log"
            in words
        )
        assert words.endswith(" s in which the joints move, as fast as in training")

    def test_too_few_blocks_in_which_all_joints_slide(self) -> None:
        given = motion((100,), 2)
        given.v[:] = 1.0
        evidence: Any = SimpleNamespace(
            rows=np.ones((100, 2), dtype=bool),
            samples=SimpleNamespace(motion=given),
            blocks=np.arange(100) // 20,
            model=SimpleNamespace(history=SimpleNamespace(get=lambda _: [[1, 1]] * 3), baseline={}),
        )
        assert "(5 blocks of 1 s or more); log" in reasons.too_still(evidence)

    @staticmethod
    def standing(monkeypatch: pytest.MonkeyPatch, after: Any, **of: Any) -> Any:
        """Three joints with baselines of 0.5 N·m of which twenty samples slide; the model leaves its own 0.75."""
        turning = SimpleNamespace(v=np.full((50, 3), 0.5))
        moving = np.ones((50, 3), dtype=bool)
        evidence: Any = SimpleNamespace(
            samples=SimpleNamespace(tau=np.ones((50, 3)), motion=turning, moving=moving),
            model=SimpleNamespace(
                history={}, baseline={"nrmse": [of.get("poor"), None]}, arm=SimpleNamespace(name="arm", n=3)
            ),
            context=SimpleNamespace(load=None),
            left_by=lambda model: np.full((50, 3), model),
            rows=np.repeat(np.arange(50) < 20, 3).reshape(50, 3),
            scale=np.full(3, 0.5),
        )
        slides = evidence.rows.copy()
        slides[of.get("slides", 20) :, 1] = evidence.rows[of.get("counts", of.get("slides", 20)) :, 1] = False
        far = np.zeros((50, 3), dtype=bool)
        far[: of.get("far", 0), 2] = True
        seen: list[Any] = []
        monkeypatch.setattr(reasons, "witness", lambda left, samples, load: seen.append(left))
        monkeypatch.setattr(reasons, "parts_of", lambda of: [Parts(j) for j in (1, 2, 3)])
        monkeypatch.setattr(reasons, "outside_trained_range", lambda motion, ranges: far.mean(axis=0))
        monkeypatch.setattr(reasons, "far_outside", lambda motion, ranges: far)
        monkeypatch.setattr(reasons, "too_slow", lambda model, samples: np.zeros((50, 3), dtype=bool))
        monkeypatch.setattr(reasons, "sliding", lambda samples, model: slides)
        monkeypatch.setattr(reasons, "seldom", lambda model, samples, rows: np.arange(3) == of.get("seldom"))
        monkeypatch.setattr(
            reasons, "mixed_in", lambda model, samples, left, scale, rows: np.zeros_like(rows)
        )
        monkeypatch.setattr(reasons, "sharing", lambda model, j: of.get("shares", []))
        monkeypatch.setattr(reasons, "merged", lambda parts, outside: [])
        monkeypatch.setattr(
            reasons,
            "_multiple",
            lambda part, j, ratio, found: (
                f"{part.joint} {ratio:g}{' left' * found}",
                of.get("real", (False, True, None))[j],
            ),
        )
        augmented: Any = 0.75
        found = reasons.standing(evidence, augmented, after, of.get("explained", []), of.get("found", False))
        assert (seen[0] == 0.75).all()
        return (found.reasons, found.unknown) if of.get("left") is None else found.left

    def test_what_is_left_of_something_found_is_said_to_be_that(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        assert self.standing(monkeypatch, [1.0, None, 0.99], found=True) == (["1 2 left"], False)

    def test_twice_the_baseline_is_no_baseline(self, monkeypatch: pytest.MonkeyPatch) -> None:
        assert self.standing(monkeypatch, [1.0, None, 0.99]) == (["1 2"], False)
        assert self.standing(monkeypatch, [0.0, 2.0, np.nan]) == (["2 4"], True)
        # the second joint's can be predicted, the first one's is noise, and of the third nobody knows
        assert self.standing(monkeypatch, [0.0, None, 1.5]) == (["3 3"], True)
        # so much that nobody knows is left, too; of less than twice the baseline, and of noise, nothing is
        assert self.standing(monkeypatch, [0.0, None, 1.5], left=True) == (2,)
        assert self.standing(monkeypatch, [2.0, 2.0, 0.5], left=True) == (1,)
        assert self.standing(monkeypatch, [2.0, None, 0.99], left=True) == ()
        assert self.standing(monkeypatch, [0.0, None, 1.5], left=True, explained=[3]) == ()
        # what is left counts from the baseline on, though less than twice that is not told of
        assert self.standing(monkeypatch, [0.9, 0.51, 0.9], left=True) == (1,)
        assert self.standing(monkeypatch, [0.9, 0.51, 0.9]) == ([], False)
        assert self.standing(monkeypatch, [0.9, 0.5, 0.9], left=True) == ()
        # noise of four times the baseline may be anything; not where the verdict names what is there
        assert self.standing(monkeypatch, [1.99, None, 0.99]) == (["1 3.98"], False)
        assert self.standing(monkeypatch, [2.0, None, 0.99]) == (["1 4"], True)
        assert self.standing(monkeypatch, [2.0, None, 0.99], explained=[1]) == (["1 4"], False)
        words, unknown = self.standing(monkeypatch, [9.0, 9.0, 9.0], explained=[1, 2, 3])
        assert words[1:] == ["1 18", "2 18", "3 18"] and not unknown

    def test_most_joints_far_above_the_baseline_are_another_arm_or_another_record(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        words, _ = self.standing(monkeypatch, [2.0, 0.9, 1.0])
        assert words[0].startswith("2 of 3 joints leave 2 times the baseline or more") and len(words) == 3
        assert "a log of arm with its order of joints, zeros, units and drive gains" in words[0]
        # not of a run that is but faster than those of the baseline
        assert self.standing(monkeypatch, [1.9, 0.9, 1.9])[0] == ["1 3.8", "3 3.8"]
        # most, but of joints that can be judged, and one alone is no arm
        assert self.standing(monkeypatch, [2.0, 0.9, 0.9])[0] == ["1 4"]
        assert self.standing(monkeypatch, [1.0, None, 2.0], slides=19)[0][0].startswith("2 of 2 joints")
        # a stop at the end of the log is felt by all of them, and nothing that the motion tells of
        assert self.standing(monkeypatch, [1.0, 1.0, 1.0], real=(False,) * 3)[0] == ["1 2", "2 2", "3 2"]
        # a residual that the verdict names is left all the same, unless its law removes it
        words, _ = self.standing(monkeypatch, [2.0, 1.0, 0.9], explained=[1])
        assert words[0].startswith("2 of 3 joints leave") and words[1:] == ["1 4", "2 2"]
        assert self.standing(monkeypatch, [0.6, 1.0, 0.9], explained=[1])[0] == ["2 2"]

    def test_a_joint_that_hardly_slides_or_lies_far_outside_cannot_be_judged(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        still = "joint 2 does not slide in this run: nothing can be said of it"
        assert self.standing(monkeypatch, [0.5, 9.0, 0.5], slides=19) == ([still], False)
        for far, unknown in ((40, False), (41, True)):
            words, found = self.standing(monkeypatch, [0.5, None, 0.5], far=far)
            assert len(words) == 1 and "% of joint 3's (8" in words[0] and found is unknown

    def test_why_a_joint_that_turns_all_the_while_is_not_judged(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        words, _ = self.standing(monkeypatch, [0.5, None, 0.5], slides=19, shares=[2])
        assert words == [
            "joint 2 turns, but the motor that it shares with joint 3 stands still in this run, and holds what its friction "
            "may: nothing can be said of it"
        ]
        words, _ = self.standing(monkeypatch, [0.5, None, 0.5], slides=20, counts=19, seldom=1)
        (said,) = words
        assert said.startswith(
            "joint 2 counts in but 20 samples, while it turns in far more: it turns round before"
        )
        words, _ = self.standing(monkeypatch, [0.5, 0.5, None], seldom=2, far=10)
        assert len(words) == 1  # that of what lies outside: enough of the joint counts
        # what slides beyond the trained range alone is said to do that
        every, none = np.ones(40, dtype=bool), np.zeros(40, dtype=bool)
        assert "slides only beyond 1.2 times" in reasons._uncounted(0, every, every, none, few=True)

    def test_a_joint_of_which_next_to_nothing_counts_is_said_to_slide_where_it_does(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        events = "joint 2 slides only within events: nothing else can be said of it"
        assert self.standing(monkeypatch, [0.5, None, 0.5], counts=19) == ([events], False)
        first, none = np.arange(40) < 21, np.zeros(40, dtype=bool)
        every = ~none
        for slides, strays, creeps, words in (
            (none, none, none, "joint 1 does not slide in this run"),
            (every, ~none, none, "joint 1 slides only beyond 1.2 times the range"),
            (every, first, none, "joint 1 slides only beyond 1.2 times the range"),
            (every, none, first, "joint 1 slides only slower than it was trained at, or"),
            (every, none, none, "joint 1 slides only within events"),
        ):
            assert reasons._uncounted(0, slides, strays, creeps).startswith(words)

    def test_a_model_that_leaves_half_of_a_torque_judges_nothing_there(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        words, unknown = self.standing(monkeypatch, [1.9, None, None], poor=0.5)
        assert len(words) == 1 and "leaves 50% of the torque on its own training logs" in words[0] and unknown
        words, unknown = self.standing(monkeypatch, [1.9, None, None], poor=0.49)
        assert (words[0], unknown) == ("1 3.8", False) and len(words) == 2
        # judged, but not what is smaller
        assert words[1].startswith(
            "on its own training logs the model leaves 49% of joint 1's torque: what changes by"
        )
        assert self.standing(monkeypatch, [1.9, None, None], poor=0.19) == (["1 3.8"], False)
        # one that knows what it leaves says that
        own = {"joint": 1, "explained": 0.5, "predictable_left": 0.4, "std_error": 0.1, "noise": 0.1}
        model: Any = SimpleNamespace(baseline={"nrmse": [0.7, 0.7], "joints": [own]})
        assert "a law is missing" in reasons._too_poor(model, 0)
        assert reasons._too_poor(model, 1).startswith("joint 2: the model leaves 70%")
        model.baseline["nrmse"] = [0.7]
        assert reasons._too_poor(model, 1) == ""


class TestWhatIsLeft:
    def evidence(self, cutoff: float = 10.0, N: int = 200) -> Any:
        samples = SimpleNamespace(motion=motion((N,)), period=0.01, cutoff_hz=cutoff)
        return SimpleNamespace(samples=samples, rows=np.ones((N, 1), dtype=bool))

    def test_its_memory_is_the_autocorrelation_a_period_of_the_corner_later(self) -> None:
        wave = np.tile([1.0, 1.0, -1.0, -1.0, 2.0], 40)
        assert lasting(self.evidence(), wave, 0) == pytest.approx(1.0)  # ten samples: two periods
        assert lasting(self.evidence(100 / 11), wave, 0) == pytest.approx(
            np.mean(wave[:-11] * wave[11:]) / np.mean(wave[:-11] ** 2)
        )
        turned = np.tile(np.repeat([1.0, -1.0], 10), 10)
        assert lasting(self.evidence(), turned, 0) == 0.0
        assert lasting(self.evidence(0.0), turned, 0) == 1.0
        # fewer than fifty pairs tell nothing
        assert lasting(self.evidence(N=60), turned[:60], 0) == 0.0
        assert lasting(self.evidence(N=59), turned[:59], 0) == 1.0
        # nor do samples with a gap between them
        gaps = self.evidence()
        gaps.rows[:, 0] = np.arange(200) % 20 < 4
        assert lasting(gaps, turned[gaps.rows[:, 0]], 0) == 1.0

    def test_much_of_it_lasts_where_a_multiple_of_the_baseline_is_no_noise(self) -> None:
        """Of 200 rows a joint, one alternates sample by sample, one by halves of the time, one is still."""
        noise, law = np.tile([1.0, -1.0], 100), np.repeat([1.0, -1.0], 100)
        rows = np.ones((200, 3), dtype=bool)
        samples = SimpleNamespace(motion=motion((200,)), period=0.01, cutoff_hz=100 / 11)
        evidence: Any = SimpleNamespace(samples=samples, rows=rows)
        joint = np.nonzero(rows)[1]
        kept = np.mean(law[:-11] * law[11:])  # what it is eleven samples later

        def lasts(size: tuple[float, float, float]) -> list[bool]:
            held_out = np.stack([noise, law, np.zeros(200)], axis=1).ravel() * np.tile(size, 200)
            scored = Score.of(0, held_out, joint, np.zeros(600, dtype=np.intp), 3)
            fit: Any = SimpleNamespace(held_out=held_out, stacked=SimpleNamespace(joint=joint), score=scored)
            return much_lasts(evidence, fit).tolist()

        least = 2 / np.sqrt(kept)
        assert lasts((9.0, 1.01 * least, 9.0)) == [False, True, False]
        assert lasts((9.0, 0.99 * least, 9.0)) == [False, False, False]

    def test_it_is_real_beyond_twice_the_baselines_spread_without_its_two_worst_blocks(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(unlisted, "lasting", lambda *_: 1.0)
        monkeypatch.setattr(unlisted, "_follows_a_law", lambda *_: False)
        evidence: Any = SimpleNamespace(
            samples=SimpleNamespace(motion=motion((1,), 2)), variation=np.array([1.0, 1.0])
        )

        def fit(*size: np.ndarray) -> Any:
            counts = [len(x) for x in size]
            joint, block = np.repeat([0, 1], counts), np.concatenate([np.arange(c) // 10 for c in counts])
            held_out = np.concatenate(size)
            score = Score.of(0, held_out, joint, block, 2)
            stacked = SimpleNamespace(joint=joint, block=block)
            return SimpleNamespace(stacked=stacked, held_out=held_out, score=score)

        def left(after: Any, before: float = 10.0, **of: Any) -> int | None:
            # a joint's energy before any effect: that of a constant residual
            was = fit(*(np.full((after.stacked.joint == j).sum(), before) for j in (0, 1)))
            outcome: Any = SimpleNamespace(before=was, after=after)
            return unlisted._left_over(evidence, outcome, **of)

        assert left(fit(np.full(50, 2.01), np.full(50, 1.99))) == 0
        assert left(fit(np.full(50, 1.99), np.full(50, 2.5))) == 1
        assert left(fit(np.full(50, 2.1), np.full(50, 2.5))) == 1
        # as large as the baseline's limit is not beyond it; in the units of its spread
        assert left(fit(np.full(50, 2.0), np.full(50, 2.0))) is None
        evidence.variation[:] = 4.0, 0.5
        assert left(fit(np.full(50, 3.9), np.full(50, 1.42)), 5.0) == 1
        assert left(fit(np.full(50, 4.1), np.full(50, 1.41)), 5.0) == 0
        evidence.variation[:] = 1.0
        # what has no memory is noise
        monkeypatch.setattr(unlisted, "lasting", lambda *_: 0.5)
        assert left(fit(np.full(50, 2.7), np.full(50, 2.7))) is None
        assert left(fit(np.full(50, 2.9), np.full(50, 2.7))) == 0
        monkeypatch.setattr(unlisted, "lasting", lambda *_: 1.0)
        assert left(fit(np.full(49, 3.0), np.full(50, 1.0))) is None
        # less than three hundredths of what there was is what effects leave
        assert left(fit(np.full(50, 3.0), np.full(50, 1.0)), np.sqrt(9 / 0.031)) == 0
        assert left(fit(np.full(50, 3.0), np.full(50, 1.0)), np.sqrt(9 / 0.029)) is None
        # but for a joint that is in a law, and one that has its law already
        assert left(fit(np.full(50, 3.0), np.full(50, 1.0)), np.sqrt(9 / 0.029), partners=[0]) == 0
        assert left(fit(np.full(50, 3.0), np.full(50, 1.0)), np.sqrt(9 / 0.029), partners=[1]) is None
        assert left(fit(np.full(50, 2.1), np.full(50, 2.5)), but={1}) == 0
        # one or two blocks are an event
        for high, real in ((20, None), (30, 0)):
            event = np.zeros(50)
            event[:high] = 9.0
            assert left(fit(event, np.zeros(50))) == real
