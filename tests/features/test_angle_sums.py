"""Angle sums span what the double feature set spans, without redundancy, and survive the model file."""

import numpy as np
import pytest

from armloop.data.motion import Motion
from armloop.features.angle_sums import AngleSums
from armloop.features.double_feature_set import DoubleFeatureSet
from armloop.laws.friction import FrictionLaw
from armloop.model import ReconstructedModel, load_model
from armloop.model.components import SparseTerms
from armloop.robot.arm import load_arm

SCARA = (True, True, False, True)
THREE_AXIS = (True, True, True)


def random_motion(n, samples, seed=0):
    q, v, vdot = np.random.default_rng(seed).uniform(-1.5, 1.5, (3, samples, n))
    return Motion(np.arange(float(samples)), q, v, vdot, np.array([0]))


@pytest.mark.parametrize(
    ("revolute", "orders", "second"),
    [
        (THREE_AXIS, (2, 0), "none"),
        (THREE_AXIS, (3, 1), "velocity"),
        (THREE_AXIS, (2, 1), "both"),
        (SCARA, (1, 2), "velocity"),
        (SCARA, (2, 1), "acceleration"),
        ((False, False), (2, 1), "velocity"),
    ],
)
def test_angle_sums_span_the_double_feature_set(revolute, orders, second):
    motion = random_motion(len(revolute), 1500)
    waves = AngleSums(revolute, *orders, second)
    basis = DoubleFeatureSet(revolute, *orders, second)
    assert waves.size == basis.size == np.linalg.matrix_rank(waves.columns(motion))
    both = np.hstack([waves.columns(motion), basis.columns(motion)])
    assert np.linalg.matrix_rank(both) == waves.size


@pytest.mark.parametrize("size", [((2, 0), "none", 25), ((4, 2), "velocity", 1290), ((4, 2), "both", 3612)])
def test_numbers_of_angle_sums(size):
    orders, second, count = size
    assert AngleSums(THREE_AXIS, *orders, second).size == count


def test_smaller_orders_are_nested():
    large, small = AngleSums(THREE_AXIS, 3, 1, "velocity"), AngleSums(THREE_AXIS, 2, 1, "velocity")
    inside = [name for name, order in zip(large.names, large.order(), strict=True) if order <= 2]
    assert sorted(inside) == sorted(small.names)


def test_names_are_readable():
    names = AngleSums(SCARA, 3, 1, "velocity").names
    assert {"1", "cos(q1)", "sin(q1-q2)*v3", "cos(2*q1)*q3", "cos(q1+q2+q4)*v1"} <= set(names)


def test_terms_survive_the_model_file_and_are_evaluated_alike_one_by_one(tmp_path):
    arm, rng = load_arm("three_axis"), np.random.default_rng(3)
    library = AngleSums(THREE_AXIS, 4, 2, "velocity")
    chosen = rng.choice(library.size, 12, replace=False)
    plain = DoubleFeatureSet(THREE_AXIS, 2, 1, "acceleration")
    few = rng.choice(plain.size, 6, replace=False)
    model = ReconstructedModel(
        arm,
        (
            SparseTerms(2, library.index[chosen], rng.normal(size=(12, 3)), library.factors.waves),
            SparseTerms(3, plain.index[few], rng.normal(size=(6, 3))),
        ),
        FrictionLaw(((), (), ())),
    )
    motion = random_motion(3, 20)
    expected = library.columns(motion)[:, chosen] @ model.components[0].coefficients
    expected += plain.columns(motion)[:, few] @ model.components[1].coefficients
    np.testing.assert_allclose(model.predict(motion), expected, atol=1e-12)
    model.save(tmp_path / "model.json")
    again = load_model(tmp_path / "model.json")
    np.testing.assert_allclose(again.predict(motion), expected, atol=1e-12)
    one_by_one = [model.feedforward(motion.q[k], motion.v[k], motion.vdot[k]) for k in range(20)]
    np.testing.assert_allclose(one_by_one, expected, atol=1e-12)


@pytest.mark.parametrize("together", [1, 2, None])
def test_fewer_angles_together_are_a_part_of_all(together):
    revolute = (True, True, False, True)
    whole, part = (AngleSums(revolute, 3, 2, "velocity", few) for few in (None, together))
    mixed = [sum(f"{s}{j}" in name.split("*v")[0] for j in range(1, 5) for s in "q") for name in part.names]
    assert set(part.names) <= set(whole.names) and max(mixed) == (together or 3)
    kept = [name for name in whole.names if together is None or name in set(part.names)]
    assert kept == part.names  # in the same order
    left_out = set(whole.names) - set(part.names)
    assert all(sum(f"q{j}" in name for j in range(1, 5)) > (together or 9) for name in left_out)
