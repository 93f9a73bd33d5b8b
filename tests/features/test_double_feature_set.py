"""The double feature set has the paper's sizes, spans what it should, and names its candidates readably."""

import numpy as np
import pytest

from armloop.data.motion import Motion
from armloop.features.double_feature_set import SECOND_SETS, DoubleFeatureSet, Factors, product_name, products

SCARA = (True, True, False, True)
THREE_AXIS = (True, True, True)


def random_motion(n, samples, seed=0):
    q, v, vdot = np.random.default_rng(seed).uniform(-1.5, 1.5, (3, samples, n))
    return Motion(np.arange(float(samples)), q, v, vdot, np.array([0]))


@pytest.mark.parametrize(
    ("revolute", "orders", "second", "size"),
    [
        (SCARA, (1, 2), "both", 360),  # Sect. 4.1, SINDy
        (SCARA, (1, 0), "none", 8),
        (SCARA, (1, 2), "velocity", 120),
        (SCARA, (1, 1), "acceleration", 40),
        (THREE_AXIS, (4, 2), "both", 5880),  # Sect. 4.2, SINDy
        (THREE_AXIS, (2, 0), "none", 28),
        (THREE_AXIS, (4, 2), "velocity", 2100),
        (THREE_AXIS, (4, 1), "acceleration", 840),
    ],
)
def test_the_papers_numbers_of_candidates(revolute, orders, second, size):
    assert DoubleFeatureSet(revolute, *orders, second, independent=False).size == size


@pytest.mark.parametrize(
    ("orders", "second", "size"),
    [((2, 0), "none", 25), ((4, 2), "velocity", 1290), ((4, 1), "acceleration", 516), ((4, 2), "both", 3612)],
)
def test_numbers_of_independent_candidates(orders, second, size):
    assert DoubleFeatureSet(THREE_AXIS, *orders, second).size == size


@pytest.mark.parametrize(
    ("revolute", "orders", "second"),
    [
        (THREE_AXIS, (2, 0), "none"),
        (THREE_AXIS, (3, 1), "velocity"),
        (THREE_AXIS, (2, 1), "both"),
        (SCARA, (2, 1), "acceleration"),
    ],
)
def test_the_independent_basis_has_full_rank_and_spans_the_papers_library(revolute, orders, second):
    motion = random_motion(len(revolute), 1200)
    basis = DoubleFeatureSet(revolute, *orders, second).columns(motion)
    full = DoubleFeatureSet(revolute, *orders, second, independent=False).columns(motion)
    assert basis.shape[1] < full.shape[1]
    assert np.linalg.matrix_rank(basis) == basis.shape[1]
    assert np.linalg.matrix_rank(full) == basis.shape[1]
    assert np.linalg.matrix_rank(np.hstack([basis, full])) == basis.shape[1]


def test_the_largest_independent_basis_has_full_rank():
    library = DoubleFeatureSet(THREE_AXIS, 4, 1, "acceleration")
    columns = library.columns(random_motion(3, 1500))
    assert np.linalg.matrix_rank(columns / np.linalg.norm(columns, axis=0)) == 516


@pytest.mark.parametrize("second", SECOND_SETS)
def test_no_candidate_occurs_twice(second):
    for independent in (False, True):
        library = DoubleFeatureSet(SCARA, 2, 2, second, independent)
        assert len(set(library.names)) == library.size


def test_names_say_what_the_columns_are():
    library = DoubleFeatureSet(SCARA, 2, 2, "velocity", independent=False)
    motion = random_motion(4, 5)
    q, v = motion.q.T, motion.v.T
    columns = library.columns(motion)
    for name, expected in {
        "1": np.ones(5),
        "cos(q2)": np.cos(q[1]),
        "q3": q[2],
        "q3^2": q[2] ** 2,
        "sin(q1)*cos(q4)": np.sin(q[0]) * np.cos(q[3]),
        "cos(q1)^2*v2^2": np.cos(q[0]) ** 2 * v[1] ** 2,
        "sin(q2)*q3*v1*v4": np.sin(q[1]) * q[2] * v[0] * v[3],
    }.items():
        np.testing.assert_allclose(columns[:, library.names.index(name)], expected, err_msg=name)
    # a sliding coordinate has no sine
    assert not any("sin(q3)" in name or "cos(q3)" in name for name in library.names)
    assert DoubleFeatureSet(SCARA, 1, 1, "acceleration").names.count("sin(q1)*vdot3") == 1


def test_each_second_set_holds_its_own_rates_only():
    names = {second: " ".join(DoubleFeatureSet(THREE_AXIS, 1, 1, second).names) for second in SECOND_SETS}
    assert "v" not in names["none"]
    assert "v1" in names["velocity"] and "vdot" not in names["velocity"]
    assert "vdot1" in names["acceleration"] and "*v1" not in names["acceleration"]
    assert "vdot1" in names["both"] and "*v1" in names["both"]


@pytest.mark.parametrize("revolute", [THREE_AXIS, SCARA])
@pytest.mark.parametrize("independent", [False, True])
def test_orders_are_nested(independent, revolute):
    large = DoubleFeatureSet(revolute, 3, 2, "velocity", independent)
    order = large.order()
    for N1 in (1, 2, 3):
        small = DoubleFeatureSet(revolute, N1, 2, "velocity", independent)
        assert set(small.names) == {name for name, k in zip(large.names, order, strict=True) if k <= N1}


def test_products_in_chunks_are_the_plain_products():
    motion = random_motion(3, 2500)  # more than two chunks
    library = DoubleFeatureSet(THREE_AXIS, 2, 2, "both", independent=False)
    values = Factors(3).evaluate(motion)
    np.testing.assert_allclose(
        products(values, library.index), np.prod(values[:, library.index], axis=2), atol=1e-14
    )


def test_names_of_products():
    names = Factors(2).names
    row = np.array([0, names.index("sin(q1)"), names.index("sin(q1)"), names.index("v2")])
    assert product_name(row, names) == "sin(q1)^2*v2"
    assert product_name(np.array([0, 0]), names) == "1"
