"""The ladder takes the friction that is there and leaves out what is not."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from synthetic import fourier_motion, friction, measured, three_axis

from armloop.data.log import MotionLog
from armloop.data.motion import Motion
from armloop.data.signals import Conditioning, preprocess
from armloop.identification.reconstruction import Options, reconstruct
from armloop.identification.reconstruction.friction_selection import (
    Comparison,
    _notes,
    _State,
    extensions,
    restricted,
)
from armloop.identification.reconstruction.inner_folds import inner_folds
from armloop.laws.friction import FRICTION_LAWS as LAWS
from armloop.robot.kinematics import nominal_parameters, regressor

#: Without what takes longest, and nobody looks at here.
PLAIN = Options(parts=False, standard_errors=False)


def a_run(seed: int, by_load: float) -> MotionLog:
    motion = fourier_motion(40.0, 100.0, seed)
    rigid = regressor(three_axis(), motion.q, motion.v, motion.vdot) @ nominal_parameters(three_axis())
    tau = rigid + friction(motion.v) + by_load * np.abs(rigid) * np.tanh(motion.v / 0.01)
    return measured(motion, tau, seed, noise=0.005)


def test_friction_by_load_is_found_where_it_is():
    logs = [a_run(1, 0.1), a_run(2, 0.1)]
    result = reconstruct(logs, three_axis(), library="rigid-body", options=PLAIN)
    ladder = {rung["rung"]: rung for rung in result.model.history["friction_ladder"]}
    rung = ladder["Coulomb by load"]
    assert rung["joints"] and rung["after"] < 0.9 * rung["before"]
    kept = [sum(t.coefficient for t in joint if t.by_load) for joint in result.model.friction.terms]
    assert 0.08 < max(kept) < 0.12


def test_without_physics_coefficients_may_have_any_sign():
    logs = [a_run(1, 0.0)]
    free = reconstruct(logs, three_axis(), library="rigid-body", options=replace(PLAIN, physical=False))
    assert "constraints" not in free.model.history
    assert max(free.held_out.moving["nrmse"]) < 0.05


@pytest.mark.parametrize("library", ["rigid-body", pytest.param("lagrangian", marks=pytest.mark.long)])
def test_only_the_laws_that_are_named_are_chosen(library: str) -> None:
    def kinds(*names: str) -> set[str]:
        options = replace(PLAIN, friction=names)
        model = reconstruct([a_run(1, 0.1)], three_axis(), library=library, options=options).model
        assert f"friction: nothing but {', '.join(names)} was allowed" in model.history["notes"]
        return {term.kind for joint in model.friction.terms for term in joint}

    assert kinds("viscous", "coulomb") == {"smooth_sign", "viscous"}
    assert kinds("viscous") == {"viscous"}


def test_every_element_of_the_ladder_belongs_to_a_law_with_a_name() -> None:
    motion = fourier_motion(5.0, 100.0, 1)
    ladder = extensions(three_axis(), motion)
    elements = {term.kind for rung in ladder for own in rung.elements for term in own}
    assert elements == {kind for law in LAWS.values() for kind in law}
    assert restricted(ladder, tuple(LAWS)) == restricted(ladder, None) == ladder
    assert [rung.name for rung in restricted(ladder, ("presliding", "coulomb"))] == ["coulomb", "presliding"]
    (sharp,), (least, fading) = (restricted(ladder, (name,)) for name in ("coulomb", "coulomb_fading"))
    assert sharp.elements == least.elements and all(len(own) == 1 for own in sharp.elements)
    assert sharp.elements[0][0].parameter < min(term.parameter for term in fading.elements[0])


def test_folds_are_runs_where_there_are_enough_and_blocks_else():
    many = preprocess([a_run(seed, 0.0) for seed in range(1, 6)], Conditioning(cutoff_hz=9.5))
    used = np.ones(many.motion.samples, dtype=bool)
    fold, judged = inner_folds(many, used, Options())
    assert judged.all()
    assert [set(fold[run]) for run in many.motion.runs()] == [{0}, {1}, {2}, {3}, {4}]

    one = preprocess([a_run(1, 0.0)], Conditioning(cutoff_hz=9.5))
    fold, judged = inner_folds(one, np.ones(one.motion.samples, dtype=bool), Options())
    assert set(fold) == set(range(10)) and 0.8 < judged.mean() < 1.0
    borders = np.flatnonzero(np.diff(fold))
    assert not judged[borders].any() and not judged[borders + 1].any()


def test_samples_that_are_no_time_series_have_no_borders():
    part = preprocess([a_run(1, 0.0)], Conditioning(cutoff_hz=9.5))
    motion = part.motion
    apart = Motion(np.arange(float(motion.samples)), motion.q, motion.v, motion.vdot, motion.starts)
    _, judged = inner_folds(
        replace(part, motion=apart, period=1.0, cutoff_hz=0.0), np.ones(motion.samples, dtype=bool), Options()
    )
    assert judged.all()


def test_the_ladder_reaches_down_to_the_slowest_motion() -> None:
    arm, motion = three_axis(), fourier_motion(5.0, 100.0, 1)
    usual = extensions(arm, motion)
    assert extensions(arm, motion, np.full(3, 0.01)) == usual
    creeping = extensions(arm, motion, np.array([0.01, 0.002, 0.01]))
    assert creeping[0].elements[1][0].parameter < 0.001
    assert all(len(own) == len(usual[3].elements[0]) + 1 for own in creeping[3].elements)


def test_what_a_law_brought_is_said_to_the_digit_that_decided():
    taken = Comparison("Stribeck", 0.00421, 0.00408, None, [0, 2])
    refused = Comparison("offset", 0.004213, 0.004213, 0.004216, [])
    assert _notes([taken, refused]) == [
        "friction, Stribeck: joints 1, 3; held-out nRMSE 0.00421 → 0.00408",
        "friction, offset: no joint; held-out nRMSE 0.004213, with it 0.004216",
    ]


@pytest.mark.parametrize(
    ("samples", "joints", "sure"),
    [(1000, None, False), (1030, None, True), (2290, [1], False), (2330, [1], True)],
)
def test_a_rung_must_be_likelier_than_chance_makes_one_of_all_rungs_and_joints(
    samples: int, joints: list[int] | None, sure: bool
) -> None:
    """Squared errors that fall by 1 % on each of five folds, of samples of which ten neighbours tell as much as one.

    Half of 1 % of the 5 x 2 x samples / 10 values exceeds ln(8 / 0.05) from 1,015 on; of one joint's half as many values
    ln(16 / 0.05) from 2,307 on.
    """
    state = object.__new__(_State)
    state.pooled = SimpleNamespace(repeats=10.0)  # type: ignore[assignment]
    state._counts, state._errors = np.full((5, 2), float(samples)), np.ones((5, 2))
    state._places, state.taken = [[0]] * 8, [[], []]
    after = np.exp(np.full((5, 2), -0.01) * ([1, 1] if joints is None else [0, 1]))
    gain, found = state._gain(after, 1.0, joints)
    assert gain == pytest.approx(0.01) and found is sure
