"""The regression beside which laws are tried is least squares on the filtered columns of the window."""

from __future__ import annotations

from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import fourier_motion, friction, measured, rigid_torque, three_axis

from armloop.data.blocks import block_numbers
from armloop.data.motion import Samples
from armloop.data.signals import Conditioning, preprocess, smooth
from armloop.features.rigid_body import BaseParameters
from armloop.identification.reconstruction import design as design_of
from armloop.identification.reconstruction import fitting
from armloop.identification.reconstruction.catalogue import Law, Laws
from armloop.identification.reconstruction.data import Data
from armloop.identification.reconstruction.design import Design
from armloop.identification.reconstruction.fitting import Fitting
from armloop.identification.reconstruction.friction_selection import FrictionSelection
from armloop.identification.reconstruction.inner_folds import inner_folds
from armloop.identification.reconstruction.options import Options
from armloop.identification.reconstruction.pooled import Prior
from armloop.identification.reconstruction.training import Training, fitted_rows
from armloop.laws.effects import Context, hypotheses
from armloop.laws.friction import FrictionTerm
from armloop.robot.kinematics import nominal_parameters

OFFSET, VISCOUS, DIRECTION = FrictionTerm("offset"), FrictionTerm("viscous"), FrictionTerm("sign")


CANDIDATES = [[DIRECTION, VISCOUS, OFFSET], [VISCOUS, DIRECTION, OFFSET], [OFFSET, DIRECTION, VISCOUS]]
ARM = three_axis()
BASE = BaseParameters.of_arm(ARM, rotors=True)
DESIGN = Design(ARM, partial(BASE.columns, ARM), BASE.count)
PRIOR = Prior(np.diag(np.linspace(1.0, 2.0, BASE.count)), np.linspace(-0.1, 0.1, BASE.count))


@pytest.fixture(scope="module")
def training() -> Training:
    """A run whose first joint's drag drives, so that a passive regression has none of it."""
    motion = fourier_motion(30.0, 100.0, 3)
    tau = rigid_torque(ARM, motion.q, motion.v, motion.vdot) + friction(motion.v)
    log = measured(motion, tau - motion.v * [2.8, 0, 0], 3, noise=0.05)
    options = Options()
    return Training.of(Data.of(preprocess([log], Conditioning()), options), DESIGN, options)


def ladder_of(training: Training, laws: list[list[FrictionTerm]], passive: bool) -> FrictionSelection:
    pooled = training.pooled(DESIGN, CANDIDATES, passive)
    return FrictionSelection(laws, PRIOR, [], [], CANDIDATES, pooled)


def rows_of(training: Training, every: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Sample, joint, fold and whether it judges, of all samples that tell something new: by joints, then by folds."""
    chunk = training.window
    usable = fitted_rows(chunk)
    fold, inside = inner_folds(chunk.samples, usable.any(axis=1), training.options)
    sample, joint = (x[::every] for x in np.nonzero(usable & chunk.independent[:, None]))
    order = np.lexsort((sample, fold[sample], joint))
    sample, joint = sample[order], joint[order]
    return sample, joint, fold[sample], inside[sample]


def columns_of(
    samples: Samples,
    shared: np.ndarray,
    which: list[list[FrictionTerm]],
    sample: np.ndarray,
    joint: np.ndarray,
) -> np.ndarray:
    """Shared columns and each joint's friction, filtered as a whole."""
    own = [
        np.where(joint == j, smooth(samples, t.column(samples.motion, j))[sample], 0.0)
        for j, terms in enumerate(which)
        for t in terms
    ]
    return np.column_stack([smooth(samples, shared)[sample, joint], *own])


def alike(found: np.ndarray, expected: np.ndarray) -> None:
    size = np.abs(expected).max(axis=0)
    np.testing.assert_allclose(found / size, expected / size, atol=1e-8)


@pytest.mark.parametrize("every", [1, 3])
def test_rows_beside_which_laws_are_tried(
    training: Training, every: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    laws = [[VISCOUS], [DIRECTION, VISCOUS], [OFFSET]]
    ladder, samples = ladder_of(training, laws, passive=False), training.window.samples
    sample, joint, fold, inside = rows_of(training, every)
    monkeypatch.setattr(design_of, "_SAMPLES", 700)
    monkeypatch.setattr(fitting, "_ROWS", len(rows_of(training, 1)[0]) // every)
    bench = Fitting(ARM, training, DESIGN, {}, training.options, print)._bench(ladder)([])
    rows = bench._rows
    assert (rows.sample == sample).all() and (rows.joint == joint).all()
    assert (rows.fold == fold).all() and (rows.inside == inside).all()
    numbers = block_numbers(samples.motion, 1.5)[sample]
    # two rows are of one block where they are of one fold and within one and a half seconds
    blocks = np.unique(np.column_stack([rows.block, rows.fold, numbers]), axis=0)
    assert len(blocks) == len(np.unique(rows.block)) == len(np.unique(blocks[:, 1:], axis=0))
    noise = np.sqrt(1 / ladder.solved().weights)[joint]
    np.testing.assert_allclose(rows.weight * noise, 1.0)
    shared = BASE.columns(ARM, samples.motion)
    for found, which in ((bench._X, laws), (bench._sayable, CANDIDATES)):
        alike(found, columns_of(samples, shared, which, sample, joint) / noise[:, None])
    np.testing.assert_allclose(bench._y, samples.tau[sample, joint] / noise)
    precision, toward = bench._prior
    np.testing.assert_array_equal(precision, np.pad(PRIOR.precision, (0, 4)))
    np.testing.assert_array_equal(toward, np.pad(PRIOR.precision @ PRIOR.centre, (0, 4)))


def test_rows_beside_which_laws_are_tried_with_one_that_was_found(training: Training) -> None:
    """The joints weigh by what is left beside it, and friction that a passive regression has none of is no column."""
    laws = [[DIRECTION, VISCOUS], [DIRECTION, VISCOUS], [DIRECTION, VISCOUS]]
    ladder, samples = ladder_of(training, laws, passive=True), training.window.samples
    spring = next(e for e in hypotheses(ARM) if e.name == "joint_spring" and e.joint == 2)
    raw = spring.full_columns(Context(ARM, samples.motion), 0.0)
    law = Law.found(spring, 0.0, raw, 0.1)
    bench = Fitting(ARM, training, DESIGN, {}, training.options, print)._bench(ladder)([law])
    beside = training.window_pooled(DESIGN.with_laws(Laws([law])), laws, True)
    solution = beside.solve(beside.everything, fitting.padded(PRIOR, law.size))
    friction_of = solution.theta[BASE.count + law.size :]
    assert np.flatnonzero(friction_of == 0).tolist() == [1]
    sample, joint, *_ = rows_of(training, 1)
    noise = np.sqrt(1 / solution.weights)[joint]
    np.testing.assert_allclose(bench._rows.weight * noise, 1.0)
    shared = np.concatenate([BASE.columns(ARM, samples.motion), raw], axis=2)
    active = [[DIRECTION], [VISCOUS, DIRECTION], [DIRECTION, VISCOUS]]
    expected = columns_of(samples, shared, active, sample, joint) / noise[:, None]
    # in the order of the laws that were chosen
    swapped = BASE.count + law.size + np.array([0, 2, 1, 3, 4])
    expected = expected[:, [*range(BASE.count + law.size), *swapped]]
    alike(bench._X, expected)
    # the same of friction that was chosen beside the law, where it is asked how the model is without
    pooled = training.pooled(DESIGN.with_laws(Laws([law])), CANDIDATES, True)
    ladder = FrictionSelection(laws, fitting.padded(PRIOR, law.size), [], [], CANDIDATES, pooled)
    bench = Fitting(ARM, training, DESIGN, {}, training.options, print)._bench(ladder)([])
    alone = training.window_pooled(DESIGN, laws, True)
    np.testing.assert_allclose(
        bench._rows.weight, np.sqrt(alone.solve(alone.everything, PRIOR).weights)[joint], rtol=1e-9
    )


def test_laws_that_cannot_be_with_all_data_are_left_out(
    training: Training, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of two springs the first pushes away from its rest once all data are fitted: no file could be read that holds it."""
    springs = [e for e in hypotheses(ARM) if e.name == "joint_spring" and e.joint in (1, 2)]
    laws = Laws([Law(spring, 0.0, 2) for spring in springs], tried=7)
    ours = Fitting(ARM, training, DESIGN, {}, training.options, print)

    def bench(selection: Any) -> Any:
        return lambda laws: SimpleNamespace(
            trial=lambda columns: SimpleNamespace(covariance=np.eye(columns.shape[2]))
        )

    def selection(*coefficients: float) -> Any:
        theta = np.concatenate([np.full(BASE.count, 9.0), coefficients, [5.0]])
        return SimpleNamespace(solved=lambda held_out: SimpleNamespace(theta=theta if held_out else None))

    again = selection(2.0, 0.2)
    monkeypatch.setattr(ours, "_bench", bench)
    monkeypatch.setattr(ours, "_beside", lambda laws, before: again)
    chosen, left = ours._possible(selection(-1.0, 0.1, 2.0, 0.2), laws)
    assert chosen is again and [law.effect for law in left.chosen] == springs[1:] and left.tried == 7
    assert ours.covariance.shape == (2, 2)
    both = selection(1.0, 0.1, 2.0, 0.2)
    assert ours._possible(both, laws) == (both, laws) and ours.covariance.shape == (4, 4)


def test_friction_by_load_is_chosen_anew_where_its_load_was_another(
    training: Training, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Only if some friction grows with a load that the coefficients beside it put a tenth or more elsewhere."""
    theta = BASE.from_full(np.append(nominal_parameters(ARM), np.zeros(3)))
    by_load, plain = FrictionTerm("load_smooth_sign", parameter=0.01), FrictionTerm("viscous")
    columns = DESIGN.library(training.window.samples.motion)
    rms = np.sqrt(np.mean((columns @ theta) ** 2, axis=0))
    # what turns about the first axis loads joint 1 alone
    heavier = theta + 0.5 * theta[0] * np.eye(BASE.count)[0]
    off = np.sqrt(np.mean((columns @ (heavier - theta)) ** 2, axis=0)) / rms
    assert off[2] == 0 and off[0] > 0.1
    for load, laws, misjudged in (
        (theta, [[by_load], [by_load], [by_load]], False),
        (heavier, [[by_load], [plain], [plain]], True),
        (heavier, [[plain], [by_load], [by_load]], False),
        (heavier, [[plain], [plain], [plain]], False),
    ):
        ours = Fitting(ARM, training, DESIGN.loaded(load), {}, training.options, print)
        solved = SimpleNamespace(theta=np.concatenate([theta, np.zeros(3)]))
        monkeypatch.setattr(ours, "_window_solution", lambda design, selection, solved=solved: solved)
        selection: Any = SimpleNamespace(laws=laws)
        assert ours._misjudges_load(selection) is misjudged
    assert not Fitting(ARM, training, DESIGN, {}, training.options, print)._misjudges_load(selection)


@pytest.mark.parametrize("misjudged", [True, False])
def test_friction_is_chosen_anew_before_laws_are_sought(
    misjudged: bool, training: Training, monkeypatch: pytest.MonkeyPatch
) -> None:
    ours, beside = Fitting(ARM, training, DESIGN, {}, training.options, print), list[Any]()
    monkeypatch.setattr(ours, "_selected", lambda: "first")
    monkeypatch.setattr(ours, "_misjudges_load", lambda selection: misjudged)
    monkeypatch.setattr(
        ours, "_beside", lambda laws, selection: beside.append((laws.chosen, selection)) or "anew"
    )
    monkeypatch.setattr(ours, "_bench", lambda selection: selection)
    monkeypatch.setattr(fitting, "search", lambda arm, samples, bench, progress: Laws())
    selection, _ = ours.chosen()
    assert selection == ("anew" if misjudged else "first")
    assert beside == ([([], "first")] if misjudged else [])
