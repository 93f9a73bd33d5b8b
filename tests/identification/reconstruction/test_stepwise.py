"""The stepwise method finds the paper's orders, hands on what it found, and never sees what is held out."""

from types import SimpleNamespace

import numpy as np
import pytest
from synthetic import COULOMB, STATIC, STRIBECK_VELOCITY, VISCOUS, conditioned_samples, three_axis

from armloop.data.blocks import folds
from armloop.data.motion import Motion, Samples
from armloop.data.regimes import Clusters, Condition
from armloop.identification.reconstruction.data import Data
from armloop.identification.reconstruction.found import Found
from armloop.identification.reconstruction.options import Options
from armloop.identification.reconstruction.step import PARTS
from armloop.identification.reconstruction.stepwise import (
    DoubleFeatureSetLibrary,
    _impure,
    _together,
    steps,
    stepwise_on,
)
from armloop.identification.reconstruction.trials import HeldOut
from armloop.model import ReconstructedModel
from armloop.regression.sparse import Sparse
from armloop.util.errors import ExcitationError
from armloop.util.progress import silent

# the synthetic states are independent of one another: no correlation between samples
INDEPENDENT = Sparse(correlation=1.0)
COUNTS = (600, 1500, 1500)


def held_out(samples: Samples) -> np.ndarray:
    return folds(samples, 5, 1.0) == 0


def found_on(samples: Samples, max_order: int, held: np.ndarray | None = None) -> Found:
    options = Options(sparse=INDEPENDENT, max_order=max_order)
    held = held_out(samples) if held is None else held
    return stepwise_on(three_axis(), Data.of(samples, options, held), options, silent)


def model_of(found: Found) -> ReconstructedModel:
    return ReconstructedModel(three_axis(), tuple(found.components), found.law)


def errors(found: Found, samples: Samples) -> np.ndarray:
    """(3, n) held-out RMSE over RMS of the torque, per condition."""
    miss, held = found.torque(samples.motion) - samples.tau, held_out(samples)
    rows = []
    for run in samples.motion.runs():
        e, tau = miss[run][held[run]], samples.tau[run][held[run]]
        rows.append(np.sqrt((e**2).mean(axis=0) / np.maximum((tau**2).mean(axis=0), 1e-30)))
    return np.array(rows)


@pytest.fixture(scope="module")
def noisy() -> Samples:
    return conditioned_samples(COUNTS, noise=0.01, with_friction=True)


@pytest.fixture(scope="module")
def found(noisy: Samples) -> Found:
    return found_on(noisy, max_order=2)


def test_each_step_looks_at_its_condition_for_powers_of_its_own():
    """No powers of velocities in gravity, one or two beside constant velocities, one beside accelerations."""
    options = Options(max_order=2)
    plans = steps((True, True), options)
    assert [plan.parts for plan in plans] == [(part,) for part in PARTS]
    assert [plan.conditions for plan in plans] == [(1,), (2,), (3,)]
    assert [plan.friction for plan in plans] == [("sign",), ("viscous", "stribeck"), ()]
    powers = ((0,), (1, 2), (1,))
    for plan, own in zip(plans, powers, strict=True):
        assert sorted(plan.orders) == [(N1, N2) for N1 in (1, 2) for N2 in own]
    (whole,) = _together((True, True), options)
    assert (whole.parts, whole.conditions) == (PARTS, (1, 2, 3))
    assert whole.friction == ("sign", "viscous", "stribeck") and whole.orders == ((1, 2), (2, 2))
    # smallest library first, and only that if none is as small as allowed
    assert plans[1].orders[0] == (1, 1)
    assert [plan.orders for plan in steps((True, True), Options(max_order=2, max_candidates=0))] == [
        *(((1, 0),), ((1, 1),), ((1, 1),))
    ]


def test_libraries_may_be_as_large_as_allowed_and_arms_have_four_joints():
    """A joint's velocities beside one angle: 6 candidates of the orders 1 and 1, 9 of 1 and 2, 10 of 2 and 1, 15."""
    for most, orders in ((8, ((1, 1),)), (9, ((1, 1), (1, 2))), (10, ((1, 1), (1, 2), (2, 1)))):
        assert steps((True,), Options(max_order=2, max_candidates=most))[1].orders == orders
    library = DoubleFeatureSetLibrary()
    assert [library.suits(SimpleNamespace(n=n)) for n in (1, 4, 5)] == [True, True, False]
    assert not library.shared


@pytest.mark.slow
def test_the_papers_orders_come_out_of_exact_data():
    samples = conditioned_samples((400, 2500, 2500))
    found = found_on(samples, max_order=4)
    assert found.notes == []
    assert [report.orders for report in found.reports] == [[2, 0], [4, 2], [4, 1]]
    assert [report.candidates for report in found.reports] == [28, 2100, 840]
    assert [report.independent for report in found.reports] == [
        25,
        1290 - 129,
        516 - 129,
    ]  # positions: Step I
    assert [report.step for report in found.reports] == [1, 2, 3]
    miss = np.abs(found.torque(samples.motion) - samples.tau)[held_out(samples)]
    assert miss.max() < 1e-11
    # not one term too many: those of the equations of motion in angle sums
    assert np.sum([report.terms for report in found.reports], axis=0).tolist() == [11, 11, 8]
    # the gravity of Eq. (23)'s arm: joint 1 has none, joints 2 and 3 two and one terms
    assert found.reports[0].terms == [0, 2, 1]


def test_gravity_has_the_terms_of_the_arm(found: Found):
    gravity = found.components[0]
    assert gravity.step == 1
    terms = [{name: c for _, c, name in gravity.terms(three_axis(), j)} for j in range(3)]
    assert terms[0] == {}
    # g (m2 l2/2 + (m_motor3 + m3) l2) and g m3 l3/2, by hand: 0.83, 0.72 and 0.43 kg; 0.4 and 0.35 m
    upper, fore = 9.81 * (0.83 * 0.2 + (0.72 + 0.43) * 0.4), 9.81 * 0.72 * 0.175
    assert terms[1] == pytest.approx({"cos(q2)": upper, "cos(q2+q3)": fore}, rel=0.01)
    assert terms[2] == pytest.approx({"cos(q2+q3)": fore}, rel=0.01)


def test_friction_is_found_beside_the_rigid_body(found: Found):
    for j in range(3):
        law = found.law.stribeck_parameters(j)
        assert law["static"] == pytest.approx(STATIC[j], rel=0.02)
        assert law["coulomb"] == pytest.approx(COULOMB[j], rel=0.02)
        assert law["viscous"] == pytest.approx(VISCOUS[j], rel=0.02)
        assert law["stribeck_velocity"] == pytest.approx(STRIBECK_VELOCITY, rel=0.15)


def test_held_out_errors_are_those_of_the_noise(found: Found, noisy: Samples):
    assert (errors(found, noisy) < 0.025).all()


def test_each_step_is_the_one_before_and_more(found: Found, noisy: Samples):
    model = model_of(found)
    steps = [c.step for c in found.components]
    assert steps == [1, 2, 3]
    for step in (1, 2):
        kept = tuple(c for c in found.components if c.step <= step)
        friction = [[t for t in law if t.step <= step] for law in found.friction]
        part = model_of(Found(three_axis(), list(kept), friction))
        np.testing.assert_allclose(model.predict(noisy.motion, step), part.predict(noisy.motion), atol=1e-12)
    # at rest there is nothing but the first step
    rest = Motion(
        noisy.motion.time,
        noisy.motion.q,
        *np.zeros((2, *noisy.motion.q.shape)),
        noisy.motion.starts,
    )
    np.testing.assert_allclose(model.predict(rest, 3), model.predict(rest, 1), atol=1e-12)


def test_earlier_steps_do_not_look_at_later_data(found: Found, noisy: Samples):
    # spoil the torque of the varying data: what the first two steps found stays bit for bit, the third changes
    tau = noisy.tau.copy()
    tau[noisy.motion.runs()[2]] *= 3
    again = found_on(Samples(noisy.motion, tau, noisy.moving, noisy.period), max_order=2)
    for step in (1, 2):
        np.testing.assert_array_equal(again.components[step - 1].index, found.components[step - 1].index)
        np.testing.assert_array_equal(
            again.components[step - 1].coefficients, found.components[step - 1].coefficients
        )
    assert again.friction == found.friction
    assert again.components[2].to_dict() != found.components[2].to_dict()


def test_held_out_samples_are_really_not_fitted(found: Found, noisy: Samples):
    tau = noisy.tau.copy()
    tau[held_out(noisy)] = 1e3
    again = found_on(Samples(noisy.motion, tau, noisy.moving, noisy.period), max_order=2)
    assert [c.to_dict() for c in again.components] == [c.to_dict() for c in found.components]
    assert again.friction == found.friction
    assert [r.to_dict() for r in again.reports] == [r.to_dict() for r in found.reports]


def test_orders_are_chosen_on_samples_the_trial_did_not_fit(noisy: Samples):
    # in the validation fold (and nowhere else) the torque has a second harmonic: only then are orders worth it
    samples = conditioned_samples((400, 600, 600))
    linear = Samples(
        samples.motion,
        np.column_stack([np.sin(samples.motion.q[:, 0])] * 3),
        samples.moving,
        samples.period,
    )
    assert found_on(linear, max_order=2).reports[0].orders == [1, 0]
    trials = found_on(noisy, max_order=2).reports[0].trials
    assert [orders for orders, _ in trials] == [[1, 0], [2, 0]]
    assert trials[0][1] > 10 * trials[1][1]


@pytest.mark.parametrize(
    ("small", "chosen"),
    [
        ([1.1, 0.9, 1.2, 1.0], 0),  # worse by less than its spread over the blocks: the smaller library
        ([1.5, 1.4, 1.6, 1.5], 1),  # clearly worse: the larger one
    ],
)
def test_the_smallest_library_within_a_standard_error_of_the_best_is_chosen(
    small: list[float], chosen: int
) -> None:
    # two chunks of two blocks each, one joint
    parts = []
    for blocks in (slice(0, 2), slice(2, 4)):
        errors = np.array([small[blocks], [1.0, 1.0]])
        squares = ((errors[:, None] - errors[None, :]) ** 2).sum(axis=2)
        parts.append(HeldOut(errors.sum(axis=1, keepdims=True), squares, 2))
    assert (parts[0] + parts[1]).smallest() == chosen


def test_a_joint_that_never_moves_is_named(noisy: Samples):
    motion = noisy.motion
    still = Motion(motion.time, motion.q * [1, 0, 1], motion.v * [1, 0, 1], motion.vdot, motion.starts)
    with pytest.raises(ExcitationError, match=r"^q2: joint 'joint_2' hardly moves"):
        found_on(Samples(still, noisy.tau, noisy.moving, noisy.period), max_order=1)


def test_samples_of_a_joint_at_rest_are_not_used(noisy: Samples):
    # where a joint sticks its torque is anything: spoil it there, and nothing changes for the other samples
    moving = noisy.moving.copy()
    moving[::3, 1] = False
    tau = np.where(moving, noisy.tau, 500.0)
    spoilt = found_on(Samples(noisy.motion, tau, moving, noisy.period), max_order=1)
    clean = found_on(Samples(noisy.motion, noisy.tau, moving, noisy.period), max_order=1)
    assert [c.to_dict() for c in spoilt.components] == [c.to_dict() for c in clean.components]


def conditions(counts: tuple[int, int, int], **of: float) -> tuple[Motion, Clusters]:
    """Two joints: so many samples at rest, at a constant velocity of 1 rad/s each, and accelerating by 1 rad/s^2 each."""
    kind = np.repeat([Condition.STATIC, Condition.CONSTANT_VELOCITY, Condition.VARYING_VELOCITY], counts)
    N = len(kind)
    q = np.tile(np.linspace(-1.0, 1.0, N)[:, None], 2)
    still = kind == Condition.STATIC
    for j in (0, 1):
        q[still, j] = np.linspace(0.0, 2 * of.get(f"cover{j + 1}", 1.0), still.sum()) - 1.0
    v, vdot = np.ones((N, 2)), np.ones((N, 2))
    v[still] = of.get("slow", 0.0)
    vdot[kind == Condition.CONSTANT_VELOCITY] = of.get("steady", 0.0)
    motion = Motion(np.arange(float(N)), q, v, vdot, np.array([0]))
    return motion, Clusters(kind, np.zeros((N, 2)), np.zeros((3, 2)), [], 3, 1)


@pytest.mark.parametrize(
    ("counts", "of", "told"),
    [
        ((100, 100, 100), {}, ""),
        ((99, 200, 200), {}, "too few samples in one"),
        ((200, 200, 99), {}, "too few samples in one"),
        ((100, 100, 100), {"slow": 0.09, "steady": 0.09}, ""),
        ((100, 100, 100), {"slow": 0.11}, "static data move with 0.22 (constant-velocity 2)"),
        ((100, 100, 100), {"steady": 0.11}, "constant-velocity data accelerate with 0.22 (varying 2)"),
        ((100, 100, 100), {"cover1": 0.31}, ""),
        ((100, 100, 100), {"cover1": 0.29}, "static data cover 29% of the range of q1"),
        ((100, 100, 100), {"cover1": 0.29, "cover2": 0.25}, "static data cover 25% of the range of q2"),
    ],
)
def test_steps_are_regressed_one_by_one_where_the_conditions_are_really_there(
    counts: tuple[int, int, int], of: dict[str, float], told: str
) -> None:
    note = _impure(*conditions(counts, **of))
    assert told in note and bool(note) == bool(told)
    assert not note or note.endswith("so all three steps are regressed together")
