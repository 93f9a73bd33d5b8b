"""No two columns of a regression are one function: friction's own stand for themselves, of look-alikes one is kept."""

import numpy as np
from synthetic import fourier_motion, three_axis

from armloop.data.motion import Motion, Samples
from armloop.features.angle_sums import AngleSums
from armloop.identification.reconstruction.data import Data
from armloop.identification.reconstruction.distinct import repeated, twins
from armloop.identification.reconstruction.options import Options
from armloop.identification.reconstruction.stepwise import stepwise_on
from armloop.laws.friction import FrictionTerm
from armloop.model.components import SparseTerms
from armloop.util.progress import silent

REVOLUTE = (True, True, True)


def test_a_candidate_that_is_frictions_own_function_is_known_by_what_it_means() -> None:
    library = AngleSums(REVOLUTE, 1, 2, "velocity")
    law = [FrictionTerm("sign"), FrictionTerm("viscous"), FrictionTerm("stribeck", parameter=0.1)]
    same = twins(library.factors, library.index, law, 2)
    assert [library.names[k] for k in np.flatnonzero(same)] == ["v3"]
    assert not twins(library.factors, library.index, law[:1], 2).any()
    offset = twins(library.factors, library.index, [FrictionTerm("offset")], 0)
    assert [library.names[k] for k in np.flatnonzero(offset)] == ["1"]


def test_of_columns_that_are_one_function_on_the_data_the_first_is_kept() -> None:
    rng = np.random.default_rng(0)
    a, b, c = rng.normal(size=(3, 200))
    # friction's column, itself again, another, its negative with a trace of c, nothing at all, a sum that is its own
    X = np.column_stack([a, 3 * a, b, -b + 1e-4 * c, 0 * a, a + b])
    first, others = np.array([0]), np.arange(1, 6)
    assert repeated(X.T @ X, first, others).tolist() == [True, False, True, False, False]
    # whatever the columns' units
    scale = np.array([1e-3, 1e3, 1e-6, 1e-5, 1.0, 1e-4])
    assert repeated((X * scale).T @ (X * scale), first, others).tolist() == [True, False, True, False, False]
    apart = np.column_stack([a, a + 0.01 * c])
    assert not repeated(apart.T @ apart, first, np.array([1])).any()


def test_columns_are_one_where_they_differ_by_less_than_a_thousandth() -> None:
    for square, same in ((0.9e-6, True), (1.1e-6, False)):
        cosine = np.sqrt(1 - square)
        G = np.array([[4.0, -6 * cosine], [-6 * cosine, 9.0]])
        assert repeated(G, np.zeros(0, dtype=int), np.arange(2)).tolist() == [False, same]


def test_viscous_friction_stands_once_where_all_steps_are_regressed_together() -> None:
    # The torque follows a velocity that was not filtered a second time, as the library's v does, and friction's not.
    motion = fourier_motion(15.0, 100.0, 1)
    v = motion.v + 0.2 * np.random.default_rng(1).normal(size=motion.v.shape)
    motion = Motion(motion.time, motion.q, v, motion.vdot, motion.starts)
    tau = 0.5 * v + 0.3 * np.sign(v)
    samples = Samples(motion, tau, np.abs(v) > 0.05, 0.01, cutoff_hz=10.0)
    nothing = np.zeros(len(v), dtype=bool)
    options = Options(max_order=1)
    found = stepwise_on(three_axis(), Data.of(samples, options, nothing), options, silent)
    for j in range(3):
        terms = [t for c in found.components if isinstance(c, SparseTerms) for t in c.terms(three_axis(), j)]
        assert f"v{j + 1}" not in {name for _, _, name in terms}
        assert sum(term.kind == "viscous" for term in found.friction[j]) == 1
