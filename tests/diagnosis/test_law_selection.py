"""Stability selection of a law: which functions every fold of a run chooses, and what they leave."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

from armloop.data.motion import Motion, Samples
from armloop.diagnosis import law_selection
from armloop.diagnosis.evidence import FOLDS, Stacked
from armloop.diagnosis.law_selection import law_left, library_of, names_of


def test_a_richer_library_for_fewer_joints() -> None:
    """Waves of so many times an angle in all, of so many joints at most, and products of two speeds."""
    chosen = [library_of((True,) * n) for n in range(1, 9)]
    assert [(each.N1, each.together, each.posture) for each in chosen] == [
        *[(3, None, 0)] * 3,
        (3, 2, 0),
        *[(3, 1, 2)] * 2,
        (2, 1, 2),
        (2, 1, 0),
    ]
    # what pulls between two joints, and is damped by neither
    names = [set(each.names) for each in chosen[1:7]]
    assert all("sin(q1-q2)" in each for each in names)
    assert ["sin(q1-q2)*v1" in each for each in names] == [True] * 3 + [False] * 3
    assert {(each.N2, each.second) for each in chosen} == {(2, "velocity")}


def _moving(N: int = 3000, seven: bool = False) -> tuple[Any, Any, np.ndarray]:
    """Evidence of two (seven) joints of which every other sample of joint 2 counts; its rows, weighed by 1/4 N·m."""
    rng, n = np.random.default_rng(3), 7 if seven else 2
    given = Motion(np.arange(float(N)), *rng.uniform(-2, 2, (3, N, n)), np.array([0]))
    rows = np.ones((N, n), dtype=bool)
    rows[1::2, 1] = False
    # one of seven slides
    arm = SimpleNamespace(revolute=np.array([True, True, *(k > 0 for k in range(n - 2))]), n=n)
    evidence = SimpleNamespace(
        rows=rows,
        samples=Samples(given, np.zeros((N, n)), rows, 1.0),
        model=SimpleNamespace(arm=arm),
        scale=np.full(n, 0.25),
    )
    joint = np.nonzero(rows)[1]
    sample = np.nonzero(rows)[0]
    block = sample // 30
    none, fold = np.zeros((len(joint), 0)), block % FOLDS
    stacked = Stacked(none, np.zeros(len(joint)), block, fold, joint, rows.shape[1], block, none)
    after = SimpleNamespace(stacked=stacked, held_out=np.full(len(joint), 99.0))
    return evidence, after, rng.standard_normal(N // 2)


def test_a_law_is_what_every_fold_chooses_with_what_it_leaves_on_the_others() -> None:
    evidence, after, noise = _moving()
    motion, mine = evidence.samples.motion, after.stacked.joint == 1
    q, v = motion.q[::2].T, motion.v[::2].T
    told = 3.0 * v[1] ** 3 - 2.0 * np.cos(2 * q[0]) * np.sign(v[1])
    after.held_out[mine] = told + 0.1 * noise
    law = law_left(evidence, after, 1)
    found = {name: (b, error) for (b, name), error in zip(law.terms, law.errors, strict=True)}
    assert set(found) == {"v2^3", "cos(2*q1)*sign(v2)"}
    X = np.stack([v[1] ** 3, np.cos(2 * q[0]) * np.sign(v[1])], axis=1)
    # blocks and cells, which are the same here, count once
    errors = 0.1 * np.sqrt(np.diag(np.linalg.inv(X.T @ X)))
    for name, value, error in zip(("v2^3", "cos(2*q1)*sign(v2)"), (3.0, -2.0), errors, strict=True):
        assert abs(found[name][0] - value) < 4 * error
        assert found[name][1] == pytest.approx(error, rel=0.2)
    # what is left is what was not fitted there: more than if it had been, and hardly more
    fitted = float(np.linalg.lstsq(X, after.held_out[mine], rcond=None)[1][0])
    assert fitted < law.score.error < 1.01 * fitted
    assert law_left(evidence, after, 1).form(0.25).count("*v2^3") == 1
    # half of the energy must go
    for part, is_law in ((0.9, True), (1.1, False)):
        after.held_out[mine] = told + part * np.sqrt(np.mean(told**2) / np.mean(noise**2)) * noise
        law = law_left(evidence, after, 1)
        assert bool(law.terms) == is_law
    assert law.left.tolist() == after.held_out[mine].tolist() and len(law.errors) == 0


def test_a_cam_that_rubs_on_the_way_up_alone_is_a_law_of_the_joint_and_its_direction() -> None:
    evidence, after, noise = _moving()
    motion, mine = evidence.samples.motion, after.stacked.joint == 1
    q, v = motion.q[::2].T, motion.v[::2].T
    after.held_out[mine] = 2.0 * np.sin(3 * q[1]) * (v[1] > 0) + 0.1 * noise
    found = {name: b for b, name in law_left(evidence, after, 1).terms}
    assert found == pytest.approx({"sin(3*q2)": 1.0, "sin(3*q2)*sign(v2)": 1.0}, abs=0.02)
    # of other joints' waves, or its own with a speed, far more functions would have to be told apart
    names = names_of(library_of((True,) * 2), 1)
    assert not {"sin(3*q1)*sign(v2)", "sin(3*q2)*v2*sign(v2)"} & set(names)
    # an arm of many joints has a smaller library, and these waves all the same
    for joints in (2, 7):
        names = names_of(library_of((True,) * joints), 1)
        assert len(set(names)) == len(names) and {"sin(3*q2)", "cos(3*q2)*sign(v2)"} <= set(names)
        assert ("sin(3*q1)" in names) == (joints == 2)
    assert "sin(3*q2)" not in names_of(library_of((True, False, *(True,) * 5)), 1)


def test_the_columns_of_many_joints_are_those_of_their_names(monkeypatch: pytest.MonkeyPatch) -> None:
    """As filtered ones are, which are made of the names."""
    evidence, after, _ = _moving(seven=True)
    made = law_selection.LawSelection(evidence, after, 1)
    monkeypatch.setattr(law_selection, "smooth", lambda samples, x: x)
    some = [
        k for k, name in enumerate(made.names) if name in ("sin(3*q2)", "cos(3*q2)*sign(v2)", "q3*v2", "v2^3")
    ]
    named = law_selection._filtered(evidence, 1, [made.names[k] for k in some])
    folds = after.stacked.fold[after.stacked.joint == 1]
    for k in range(FOLDS):
        np.testing.assert_allclose(made._X[k][:, some], named[folds == k], atol=1e-12)


def test_of_functions_that_no_two_folds_share_those_that_hold_across_them_are_the_law(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What is left of a fold is still what the functions leave there that were chosen on the others."""
    evidence, after, noise = _moving()
    motion, mine = evidence.samples.motion, after.stacked.joint == 1
    q, v = motion.q[::2].T, motion.v[::2].T
    names = names_of(library_of((True, True)), 1)
    both = ["v2", "cos(2*q1)*v2"], ["cos(q1)*v2", "v2^3"]
    true, near = (np.sort([names.index(name) for name in own]) for own in both)
    after.held_out[mine] = (1 - np.cos(2 * q[0])) * v[1] + 0.1 * noise
    for k, chosen in enumerate(([true, near], [near, true])):
        found = SimpleNamespace(support=Mock(side_effect=chosen))
        monkeypatch.setattr(law_selection, "Sparse", lambda found=found, **_: found)
        law = law_left(evidence, after, 1)
        assert {name: b for b, name in law.terms} == pytest.approx(
            dict(zip(both[0], (1, -1), strict=True)), abs=0.02
        )
        left, fold = np.abs(law.left), after.stacked.fold[mine]
        assert left[fold == k].mean() < 0.1 and left[fold != k].mean() > 0.3


@pytest.mark.parametrize(("part", "is_law"), [(0.2, True), (0.42, False)])
def test_twenty_samples_count_for_one(part: float, is_law: bool) -> None:
    """Each half has 250 samples, worth 12.5: of p functions a term must bring log 12.5 + 2 log p.

    12.5 log(before/after) is that at a part of about 0.3 left; were the samples worth half as many, at 0.1.
    """
    evidence, after, noise = _moving(1000)
    motion, mine = evidence.samples.motion, after.stacked.joint == 1
    p = len(names_of(library_of((True, True)), 1))
    cost = np.log(12.5) + 2 * np.log(p)
    assert 0.28 < np.exp(-cost / 12.5) < 0.36
    told = np.sin(motion.q[::2, 0])
    size = np.sqrt(part / (1 - part) * np.mean(told**2) / np.mean(noise**2))
    after.held_out[mine] = told + size * noise
    assert bool(law_left(evidence, after, 1).terms) == is_law


@pytest.mark.parametrize(("error", "is_law"), [(0.33, True), (0.34, False)])
def test_a_coefficient_of_a_law_is_three_of_its_stated_errors_from_zero(
    error: float, is_law: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    evidence, after, noise = _moving()
    mine = after.stacked.joint == 1
    after.held_out[mine] = evidence.samples.motion.v[::2, 1] + 0.01 * noise
    monkeypatch.setattr(law_selection, "covariance", lambda X, left, rows: error**2 * np.eye(X.shape[1]))
    assert bool(law_left(evidence, after, 1).terms) == is_law


def test_at_most_four_functions_make_a_law() -> None:
    evidence, after, noise = _moving()
    motion, mine = evidence.samples.motion, after.stacked.joint == 1
    q, v = motion.q[::2].T, motion.v[::2].T
    five = [4 * v[1], 4 * v[0], 4 * np.sin(q[0]), 4 * np.cos(2 * q[1]), 0.3 * v[0] * v[1]]
    after.held_out[mine] = sum(five) + 0.01 * noise
    law = law_left(evidence, after, 1)
    assert {name for _, name in law.terms} == {"v1", "v2", "sin(q1)", "cos(2*q2)"}
