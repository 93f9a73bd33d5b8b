"""One noise draw of an estimator study: every estimator on the same data, against the true terms."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from armloop.data.log import MotionLog
from armloop.data.motion import Motion, Samples
from armloop.drake.experiments.scenarios import load_plant
from armloop.experiment.excitation import MotionRanges
from armloop.experiment.sampling import CONDITIONS, inverse_dynamics_samples
from armloop.features.wave_moments import WaveProducts
from armloop.identification.reconstruction.data import Data
from armloop.identification.reconstruction.found import Found
from armloop.identification.reconstruction.options import Options
from armloop.identification.reconstruction.stepwise import add_step, steps
from armloop.model.components import SparseTerms
from armloop.regression.moments import Moments, total
from armloop.regression.sparse import ESTIMATORS, Sparse
from armloop.util.arrays import Array, Index
from armloop.util.errors import InputError
from armloop_paper.experiments import EXPERIMENTS, STEPS, Experiment, as_motion

#: Per step and joint, the columns of the step's library that are in use, and their coefficients.
Fitted = list[list[tuple[Index, Array]]]

ORACLE = "oracle"
#: The default's selection without knowledge of the noise levels, at the paper's orders as the others.
UNCORRECTED = "evidence, noise unknown"
#: Solvers that take seconds on a thousand columns see the first draws only.
_SLOW = ("stlsq", "sr3")
_DRAWS_OF_SLOW = 1
_PARTS = 10
_NONE = np.zeros(0, dtype=np.intp)
#: Coefficients of noise-free data below this are round-off.
_ROUND_OFF = 1e-6


@dataclass(frozen=True)
class Case:
    """One experiment under noise."""

    arm: str  # a key of EXPERIMENTS
    name: str
    snr: tuple[float, float, float]  # dB, of q, v and v̇
    widened: bool = False  # joint 2 turns within ±90°
    slow: bool = True  # whether the slow solvers take part


@dataclass(frozen=True)
class Trial:
    """One estimator on one noise draw; terms over all steps and joints."""

    estimator: str
    draw: int
    terms: int
    false: int
    missed: int
    error: list[float]  # (n,) RMSE on the trajectory outside the range, N·m or N


def _ranges(case: Case) -> MotionRanges:
    ranges = load_plant(case.arm).config.ranges
    if not case.widened:
        return ranges
    lower, upper = ranges.lower.copy(), ranges.upper.copy()
    lower[1], upper[1] = -np.pi / 2, np.pi / 2
    return replace(ranges, lower=lower, upper=upper)


def true_terms(experiment: Experiment) -> Fitted:
    """The true terms: what the default finds without noise."""
    arm = experiment.arm
    logs = inverse_dynamics_samples(arm, load_plant(arm.name).config.ranges, experiment.counts, 0)
    fitted = _by_steps(experiment, logs, Sparse(ESTIMATORS[0]))
    return [[_significant(*joint) for joint in step] for step in fitted]


def _significant(columns: Index, beta: Array) -> tuple[Index, Array]:
    large = np.abs(beta) > _ROUND_OFF
    return columns[large], beta[large]


def draw_trials(seed: int, case: Case, truth: Fitted, estimators: tuple[str, ...]) -> list[Trial]:
    """Every estimator on one draw."""
    experiment = EXPERIMENTS[case.arm]
    logs = inverse_dynamics_samples(experiment.arm, _ranges(case), experiment.counts, seed, case.snr)
    names = _names(experiment)
    trials = []
    beyond = experiment.beyond_range()
    exact = experiment.torque(beyond)

    def terms(fitted: Fitted) -> set[tuple[int, int, str]]:
        return {
            (step + 1, joint, names[step][column])
            for step, joints in enumerate(fitted)
            for joint, (columns, beta) in enumerate(joints)
            for column in columns[beta != 0]
        }

    true = terms(truth)

    def add(name: str, found: set[tuple[int, int, str]], tau: Array) -> None:
        error = np.sqrt(np.mean((tau - exact) ** 2, axis=0)).tolist()
        trials.append(Trial(name, seed, len(found), len(found - true), len(true - found), error))

    for name in (ORACLE, *estimators):
        if name in _SLOW and experiment.arm.n == 3 and not (case.slow and seed < _DRAWS_OF_SLOW):
            continue
        if name == ESTIMATORS[0]:
            model = _default(experiment, logs, case.snr)
            add(name, _terms_of(model), model.torque(beyond))
            name = UNCORRECTED
        try:
            fitted = _by_steps(
                experiment, logs, None if name == ORACLE else Sparse(name.split(",")[0]), truth
            )
        except ArithmeticError as error:
            raise InputError(f"{case.name}, {name}: {error}") from error
        add(name, terms(fitted), _sum(experiment, fitted, beyond))
    return trials


def _default(
    experiment: Experiment, logs: dict[str, MotionLog], snr: tuple[float, float, float] | None
) -> Found:
    """The default stepwise reconstruction; that the data of each step are labelled saves sorting them."""
    arm, options = experiment.arm, Options(snr=snr)
    found = Found(arm, friction=[[] for _ in arm.joints])
    for plan, condition in zip(steps(experiment.revolute, options), CONDITIONS, strict=True):
        motion, tau = as_motion(logs[condition])
        samples = Samples(motion, tau, np.ones_like(tau, dtype=bool), 1.0)
        data = Data.of(samples, options, np.zeros(len(tau), dtype=bool))
        add_step(found, data, None, plan, options)
    return found


def _terms_of(found: Found) -> set[tuple[int, int, str]]:
    joints = range(found.arm.n)
    rigid = {
        (step, joint, name)
        for component in found.components
        if isinstance(component, SparseTerms)
        for joint in joints
        for step, _, name in component.terms(found.arm, joint)
    }
    return rigid | {(0, joint, term.kind) for joint in joints for term in found.friction[joint]}


def _library(experiment: Experiment, step: int) -> WaveProducts:
    """The candidates of a step at the paper's orders; what depends on the position alone is Step I's."""
    waves = experiment.waves(STEPS[step])
    factors = waves.factors
    rates = [*factors.block("v"), *factors.block("a")]
    kept = np.isin(waves.index, rates).any(axis=1) if step else np.ones(waves.size, dtype=bool)
    return WaveProducts(factors, waves.index[kept])


def _names(experiment: Experiment) -> list[list[str]]:
    found = []
    for step in range(len(STEPS)):
        library, waves = _library(experiment, step), experiment.waves(STEPS[step])
        places = {tuple(row): name for row, name in zip(waves.index.tolist(), waves.names, strict=True)}
        found.append([places[tuple(row)] for row in library.index.tolist()])
    return found


def _sum(experiment: Experiment, fitted: Fitted, motion: Motion) -> Array:
    """(N, n) torques of the steps fitted so far."""
    tau = np.zeros_like(motion.q)
    for step, joints in enumerate(fitted):
        library = _library(experiment, step)
        coefficients = np.zeros((library.size, len(joints)))
        for joint, (columns, beta) in enumerate(joints):
            coefficients[columns, joint] = beta
        tau += library.apply(motion, coefficients)
    return tau


def _by_steps(
    experiment: Experiment, logs: dict[str, MotionLog], sparse: Sparse | None, truth: Fitted | None = None
) -> Fitted:
    """The three steps at the paper's orders with one estimator, or with the true terms where there is none."""
    fitted: Fitted = []
    for step, condition in enumerate(CONDITIONS):
        motion, tau = as_motion(logs[condition])
        rest = tau - _sum(experiment, fitted, motion)
        if sparse is None:
            assert truth is not None
            fitted.append(
                [_oracle(experiment, step, motion, y, t) for y, t in zip(rest.T, truth[step], strict=True)]
            )
            continue
        parts = _moments(_library(experiment, step), motion, rest)
        power = np.mean(tau**2, axis=0)
        fitted.append(
            [sparse.fit(total(mine), _NONE, float(p), mine) for mine, p in zip(parts, power, strict=True)]
        )
    return fitted


def _oracle(
    experiment: Experiment, step: int, motion: Motion, y: Array, truth: tuple[Index, Array]
) -> tuple[Index, Array]:
    library, columns = _library(experiment, step), truth[0]
    X = WaveProducts(library.factors, library.index[columns]).columns(motion)
    return columns, Moments.of(X, y).solve()


def _moments(library: WaveProducts, motion: Motion, rest: Array) -> list[list[Moments]]:
    """Per joint, the moments of ten parts of the samples."""
    joints: list[list[Moments]] = [[] for _ in rest.T]
    for k in range(_PARTS):
        rows = slice(k, None, _PARTS)
        sums = library.sums(motion.take(rows), rest[rows])
        G = library.gram(sums)
        for j, mine in enumerate(joints):
            mine.append(Moments(G, sums.cross[:, j], float(sums.given[j, j]), float(sums.count)))
    return joints
