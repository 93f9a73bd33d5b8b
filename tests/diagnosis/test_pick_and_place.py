"""Runs that go from point to point, over and over: folds of a cycle, creep before a stop, pushes while joints rest."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import fourier_motion, measured, rigid_torque, three_axis

from armloop.data.creep import held_speed
from armloop.data.motion import Motion
from armloop.data.signals import preprocess
from armloop.diagnosis import account as accounts
from armloop.diagnosis import diagnose, unlisted
from armloop.diagnosis.account import Account
from armloop.diagnosis.evidence import FOLDS, Evidence
from armloop.diagnosis.score import Score
from armloop.identification.scoring import score, too_slow
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import ReconstructedModel
from armloop.model.components import RigidBody
from armloop.robot.kinematics import nominal_parameters

COULOMB, VISCOUS = (0.3, 0.4, 0.2), (0.8, 1.0, 0.5)


@pytest.mark.parametrize("cycle", range(1, 9))
def test_each_fold_sees_every_part_of_a_cyclic_motion(cycle: int) -> None:
    """Blocks in turn would put every other part of a cycle of even length into one fold, all the time."""
    nothing: Any = None
    blocks = np.repeat(np.arange(120), 3)
    fold = Evidence(nothing, nothing, nothing, nothing, nothing, blocks, nothing).fold
    assert (fold.reshape(120, 3) == fold[::3, None]).all()  # a block is of one fold
    assert (fold[::3].reshape(60, 2).sum(axis=1) == 1).all()  # of every two one each
    shares = [fold[blocks % cycle == part].mean() for part in range(cycle)]
    # by chance 120 / cycle blocks are further from a half than three standard deviations once in 370
    assert np.abs(np.array(shares) - 0.5).max() <= 3 * 0.5 / np.sqrt(120 / cycle)
    # what follows later changes nothing of what is before it
    few = Evidence(nothing, nothing, nothing, nothing, nothing, blocks[:30], nothing).fold
    assert (few == fold[:30]).all() and set(fold.tolist()) == set(range(FOLDS))


class TestSlowerThanTrained:
    """A model whose friction is too low at 0.03 rad/s and known from 0.3 rad/s on, on a run that creeps."""

    @pytest.fixture(scope="class")
    @classmethod
    def model(cls) -> ReconstructedModel:
        terms = tuple(
            (
                FrictionTerm("sign", f),
                FrictionTerm("stribeck_peak", -0.3 * f, 0.03),
                FrictionTerm("viscous", c),
            )
            for f, c in zip(COULOMB, VISCOUS, strict=True)
        )
        body = RigidBody(nominal_parameters(three_axis()), (), np.zeros(0))
        bare = ReconstructedModel(three_axis(), (body,), FrictionLaw(terms))
        samples = preprocess([cls.run(90, 40.0, 0.0)], bare.conditioning)
        motion = samples.motion
        half, centre = np.ptp(motion.q, axis=0) / 2, (motion.q.max(axis=0) + motion.q.min(axis=0)) / 2
        rates = [np.abs(x).max(axis=0).tolist() for x in (motion.v, motion.vdot)]
        history = {"range": [half.tolist(), *rates, centre.tolist()], "slowest": [0.3, 0.3, 0.3]}
        return replace(bare, baseline=score(bare, samples).moving, history=history)

    @staticmethod
    def run(seed: int, seconds: float, slow: float) -> Any:
        """A part of the time, all goes so much slower that the joints creep."""
        motion = fourier_motion(seconds, 125.0, seed)
        wave = np.clip(4 * (np.cos(2 * np.pi * motion.time / 7.0) - np.cos(np.pi * slow)) + 0.5, 0.0, 1.0)
        pace = 1 - 0.98 * wave if slow else np.ones(len(wave))
        course = np.cumsum(pace) * 0.008
        q = np.column_stack([np.interp(course, motion.time, x) for x in motion.q.T])
        v = np.gradient(q, 0.008, axis=0)
        vdot = np.gradient(v, 0.008, axis=0)
        moved = Motion(motion.time, q, v, vdot, motion.starts)
        tau = rigid_torque(three_axis(), q, v, vdot) + v * VISCOUS + np.tanh(v / 1e-4) * COULOMB
        return measured(moved, tau, seed, 0.01)

    def test_is_not_judged(self, model: ReconstructedModel) -> None:
        samples = preprocess([self.run(3, 30.0, 0.3)], model.conditioning)
        rows = Evidence.of(model, samples, []).rows
        assert rows.any(axis=0).all() and (held_speed(samples)[rows] >= 0.3).all()
        unaware = replace(model, history={"range": model.history["range"]})
        assert (held_speed(samples)[Evidence.of(unaware, samples, []).rows] < 0.3).any()
        assert not too_slow(unaware, samples).any()

    def test_is_no_friction_that_came_and_the_reader_is_told(self, model: ReconstructedModel) -> None:
        run = self.run(3, 30.0, 0.3)
        unaware = replace(model, history={"range": model.history["range"]})
        assert diagnose(unaware, [run], jobs=1).verdict == "effects_found"
        found = diagnose(model, [run], jobs=1)
        assert found.verdict == "no_effect", found.named
        (told,) = (reason for reason in found.reasons if "slides slower than it was trained at" in reason)
        assert all(f"of joint {j}'s (below 0.3 rad/s)" in told for j in (1, 2, 3))


@pytest.mark.parametrize(
    ("energy", "parameters", "lead", "simpler"),
    [
        # of 400 that effects leave beyond the baseline's 100, the law leaves half
        (500.0, 2, 9.0, True),
        (498.0, 2, 9.0, False),
        # surely, or not
        (500.0, 2, 2.9, False),
        # with fewer parameters it need but be likelier: its two terms cost 2 log (2 50), that there is one log 3, the
        # effect 8
        (533.0, 3, 0.0, False),
        (537.0, 3, 0.0, True),
        # with more it is not simpler
        (900.0, 1, 9.0, False),
    ],
)
def test_a_law_leaves_far_less_beyond_the_baseline(
    energy: float, parameters: int, lead: float, simpler: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows, law = 100, 300.0
    joint, block = np.zeros(rows, dtype=np.intp), np.arange(rows) // 10

    def outcome(*effects: Any) -> Any:
        score = Score.of(0, np.full(rows, np.sqrt(energy / rows)), joint, block, 1)
        found = [SimpleNamespace(effect=effect) for effect in effects]
        return SimpleNamespace(found=found, after=SimpleNamespace(score=score))

    monkeypatch.setattr(unlisted, "lead", lambda worse, better: lead)
    monkeypatch.setattr(unlisted, "log_prior", lambda evidence, effects: -8.0 * len(effects))
    monkeypatch.setattr(unlisted, "library_of", lambda revolute: None)
    monkeypatch.setattr(unlisted, "names_of", lambda library, j: ["q1"] * 50 + ["q2"] * 50)
    monkeypatch.setattr(unlisted, "hypotheses", lambda arm: [None] * 3)
    arm = SimpleNamespace(revolute=np.array([True]))
    evidence: Any = SimpleNamespace(variation=np.array([1.0]), model=SimpleNamespace(arm=arm))
    found = unlisted.Law([(1.0, "v1"), (2.0, "q1")], np.full(rows, np.sqrt(law / rows)), block)
    named, bare = outcome(SimpleNamespace(complexity=parameters)), outcome()
    assert unlisted._is_simpler(evidence, found, named, bare, 0) is simpler


class TestListedEffectsBeforeALaw:
    """A first search took a spring of joint 1; another one, without it, finds an offset and a tilt."""

    @staticmethod
    def chosen(monkeypatch: pytest.MonkeyPatch, left: float, **of: Any) -> tuple[str, Any]:
        """What is kept, and what was barred: effects leave ``left``, a law or the first search ``first`` (one baseline)."""
        blocks, first_left = np.repeat(np.arange(10), 4), of.get("first", 1.0)
        joint = np.zeros(40, dtype=int)

        def outcome(name: str, held_out: float, *found: str) -> Any:
            wavy = held_out * (1 + 0.2 * np.sin(np.arange(40)))
            score = SimpleNamespace(energy=np.array([(wavy**2).sum(), 0.0]), rows=np.array([40, 0]))
            stacked = SimpleNamespace(block=blocks, joint=joint, joints=1)
            return SimpleNamespace(
                name=name, found=found, after=SimpleNamespace(stacked=stacked, held_out=wavy, score=score)
            )

        def effect(name: str, joint: int) -> Any:
            place = (name, joint, None)
            return SimpleNamespace(effect=SimpleNamespace(place=place, label=lambda: f"{name} {joint}"))

        spring, offset = effect("joint_spring", 1), effect("torque_offset", 2)
        found: Any = SimpleNamespace(found=[offset, spring] if of.get("there", True) else [offset])
        asked: list[Any] = []

        def search(evidence: Any, progress: Any, panel: Any, barred: Any, most: int, worth: Any) -> Any:
            asked.append((barred, most))
            others = outcome("listed", left, "offset", "tilt")
            found = worth(Score.of(1, others.after.held_out, joint, blocks, 1))
            return others if found else outcome("nothing", of.get("nothing", 9.0))

        monkeypatch.setattr(accounts, "search", search)
        monkeypatch.setattr(
            accounts,
            "find_law",
            lambda evidence, again, progress: (
                of.get("law"),
                outcome("fewer", of["fewer"], "offset") if "fewer" in of else again,
            ),
        )
        monkeypatch.setattr(
            accounts, "without_effects_at", lambda evidence, first, j: SimpleNamespace(found=[offset])
        )
        own: Any = outcome("first", first_left)
        nothing: Any = None
        stated: Any = SimpleNamespace(joint=1, left=own.after.held_out) if of.get("stated", True) else None
        evidence: Any = SimpleNamespace(rows=np.ones((40, 1), dtype=bool))
        account = Account(nothing, [], evidence, own, stated)
        kept: Any = account._or_listed(found, lambda text: None, None)
        return kept.outcome.name, asked

    def test_they_are_named_if_they_leave_no_more(self, monkeypatch: pytest.MonkeyPatch) -> None:
        assert self.chosen(monkeypatch, 1.0) == ("listed", [([("joint_spring", 1, None)], 4)])
        assert self.chosen(monkeypatch, 1.3)[0] == "first"

    def test_not_where_what_a_law_leaves_of_them_is_more(self, monkeypatch: pytest.MonkeyPatch) -> None:
        assert self.chosen(monkeypatch, 1.0, fewer=1.0)[0] == "fewer"
        assert self.chosen(monkeypatch, 1.0, fewer=1.3)[0] == "first"

    def test_nothing_in_their_place_takes_nothing_away(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """A residual without a law leaves as much as nothing does."""
        assert self.chosen(monkeypatch, 1.3, nothing=1.0)[0] == "first"

    def test_not_if_they_too_need_a_law(self, monkeypatch: pytest.MonkeyPatch) -> None:
        assert self.chosen(monkeypatch, 1.0, law=SimpleNamespace(joint=1, left=np.ones(40)))[0] == "first"

    def test_nothing_is_asked_where_no_effect_was_found_there(self, monkeypatch: pytest.MonkeyPatch) -> None:
        assert self.chosen(monkeypatch, 1.0, there=False) == ("first", [])

    def test_what_leaves_twice_the_baseline_gives_way_to_what_leaves_half_of_that(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Of each sample 10 baselines' energies are left, or 5.5: half of what there is beyond the baseline."""
        # 1 + 0.2 sin has a mean square near 1.02
        first = np.sqrt(10 / 1.02)
        assert self.chosen(monkeypatch, np.sqrt(5.4 / 1.02), first=first, stated=False)[0] == "listed"
        assert self.chosen(monkeypatch, np.sqrt(5.6 / 1.02), first=first, stated=False)[0] == "first"
        assert self.chosen(monkeypatch, 0.5, first=1.9, stated=False) == ("first", [])
        assert self.chosen(monkeypatch, 0.5, first=2.1, stated=False)[1][0][1] == 3
        assert self.chosen(monkeypatch, 0.5, first=2.1, stated=False)[0] == "listed"


@pytest.mark.parametrize(("left", "as_well"), [(1.0, True), (1.2, False)])
def test_a_law_is_not_stated_where_a_less_simple_effect_does_as_well(
    left: float, as_well: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A spring over a small range is nearly an offset, the simplest of equals, and as nearly a wave of the angle."""
    joint, block = np.array([0, 1] * 20), np.arange(40) // 4
    bare: Any = SimpleNamespace(after=SimpleNamespace(effects=[], shapes=[]))
    wavy = 1 + 0.2 * np.sin(np.arange(20))
    spring = Score.of(1, np.repeat(left * wavy, 2), joint, block, 2)
    fits = {"none": None, "spring": SimpleNamespace(score=spring)}
    known = SimpleNamespace(of=lambda *given: SimpleNamespace(trial=lambda effect: fits[effect]))
    monkeypatch.setattr(unlisted, "Known", known)
    nothing: Any = None
    law = unlisted.Law([(1.0, "sin(3*q2)")], wavy, block[joint == 1])
    rivals: Any = [("none", 1.0), ("spring", 0.97)]
    assert unlisted._does_as_well(nothing, bare, rivals, law, 1) is as_well
    assert not unlisted._does_as_well(nothing, bare, rivals[:1], law, 1)
