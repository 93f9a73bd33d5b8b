"""Do the intervals cover? Simulated logs with known coefficients, errors as measured torques have them.

For every kind of coefficient: the part of nominal 95 % intervals that contain the truth, from blocks and, beside
it, from the textbook formula that takes samples as independent; and how far the estimates are off on average,
in units of their spread, because noise in the motion biases least squares and no standard error tells.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from armloop.data.motion import Samples
from armloop.data.signals import independent_rows, preprocess
from armloop.identification.uncertainty.solving import solve_given_terms
from armloop.identification.uncertainty.standard_errors import Fitted
from armloop.identification.uncertainty.unknowns import STRIBECK_VELOCITY, Unknown, problems
from armloop.model import ReconstructedModel
from armloop.util.arrays import Array
from armloop.util.finite import finite
from armloop.util.progress import Progress, silent
from armloop_paper.simulated import Collection, Disturbance, collection, true_model

NOMINAL = 0.95

DISTURBANCES = (
    Disturbance("white torque noise", white=0.02),
    Disturbance("coloured torque noise (0.2 s)", coloured=0.02),
    Disturbance("drifting friction level (1 s)", drift=0.1),
    Disturbance("coloured noise; little noise in q, v", coloured=0.02, q_noise=1e-4, v_noise=2e-4),
    Disturbance("coloured noise; much noise in q, v", coloured=0.02, q_noise=3e-3, v_noise=1e-2),
    Disturbance("torque ripple in q", ripple=0.1),
)


@dataclass(frozen=True)
class Covered:
    """One disturbance, by kind of coefficient."""

    disturbance: str
    coefficients: dict[str, int]  # how many
    blocks: dict[str, float]  # part of the intervals from blocks that cover
    independent: dict[str, float]  # the same with samples taken as independent
    bias: dict[str, float | None]  # RMS of mean error over standard deviation of the estimates
    width: dict[
        str, float | None
    ]  # median ratio of stated standard error to the estimates' standard deviation
    block_count: float  # mean number of blocks


def coverage_study(
    simulations: int,
    seed: int = 0,
    disturbances: Sequence[Disturbance] = DISTURBANCES,
    jointly: bool = False,
    design: Collection | None = None,
    progress: Progress = silent,
) -> list[Covered]:
    """Regress the true terms of a three-axis arm from simulated logs, again and again.

    So many ``simulations`` per disturbance: the motion of ``design`` is the same in all, the errors are fresh. ``jointly``
    regresses all terms on all samples at once instead of step by step: the level of Step I is that at creeping speed,
    viscous friction included, the joint one that of Eq. (34).
    """
    design = design or collection(seed)
    truth = true_model()
    results = []
    for disturbance in disturbances:
        progress(f"coverage: {disturbance.name}, {simulations} logs")
        runs = [_one(truth, design, disturbance, jointly, 1000 * seed + k) for k in range(simulations)]
        results.append(_summary(disturbance.name, runs))
    return results


@dataclass(frozen=True, eq=False)
class _Run:
    kinds: list[str]
    error: Array
    block: Array
    independent: Array
    half: Array
    blocks: int


def _one(
    truth: ReconstructedModel, design: Collection, disturbance: Disturbance, jointly: bool, seed: int
) -> _Run:
    samples = preprocess(design.logs(disturbance, seed), truth.conditioning)
    fitted = _fitted(samples, len(design.motions[0].starts), len(design.motions[1].starts), jointly)
    _, parts = solve_given_terms(truth, samples, fitted, 3)
    true_values = {_key(u): u.value for problem in problems(truth) for u in problem.unknowns}
    unknowns = [unknown for part in parts for unknown in part.unknowns]
    block = np.concatenate([part.std_error for part in parts])
    freedom = np.concatenate([part.freedom for part in parts])
    return _Run(
        [_kind(unknown) for unknown in unknowns],
        np.array([unknown.value - true_values[_key(unknown)] for unknown in unknowns]),
        block,
        np.concatenate([np.sqrt(np.diag(part.equations.independent_covariance())) for part in parts]),
        block * student.ppf(0.5 + NOMINAL / 2, freedom),
        max(part.equations.blocks for part in parts),
    )


def _key(unknown: Unknown) -> tuple[str, int | None, str]:
    # a friction term's name may contain v_s, which is estimated
    name = "stribeck" if unknown.name.startswith("(1-exp") else unknown.name
    return unknown.kind, unknown.joint, name


def _kind(unknown: Unknown) -> str:
    if unknown.kind == "friction":
        if unknown.name == STRIBECK_VELOCITY:
            return "v_s"
        name = unknown.name
        return "f_c - f_s" if name.startswith("(1-exp") else ("f_s" if name.startswith("sign") else "f_v")
    return ("gravity", "velocity terms", "acceleration terms")[unknown.step - 1]


def _fitted(samples: Samples, static: int, steady: int, jointly: bool) -> list[Fitted]:
    """The three regressions: the first runs creep, then come those of constant velocity; or one of all."""
    edges = [*samples.motion.starts, samples.motion.samples]
    stage = np.full(samples.motion.samples, 2)
    stage[: edges[static + steady]] = 1
    stage[: edges[static]] = 0
    # where the velocity is constant no direction reverses, however noisy it looks
    usable = (samples.moving | (stage < 2)[:, None]) & independent_rows(samples)[:, None]
    if jointly:
        return [Fitted((1, 2, 3), usable)]
    return [Fitted((s + 1,), usable & (stage == s)[:, None]) for s in range(3)]


def _summary(name: str, runs: Sequence[_Run]) -> Covered:
    kinds = np.array(runs[0].kinds)
    error = np.array([run.error for run in runs])
    half = np.array([run.half for run in runs])
    plain = 1.959964 * np.array([run.independent for run in runs])
    # a coefficient that ran away in every run has no spread to compare with
    spread = error.std(axis=0, ddof=1)
    spread[~(spread > 1e-12)] = np.nan
    off = error.mean(axis=0) / spread
    wide = np.median(np.array([run.block for run in runs]), axis=0) / spread
    names = list(dict.fromkeys(runs[0].kinds))
    return Covered(
        disturbance=name,
        coefficients={k: int((kinds == k).sum()) for k in names},
        blocks={k: float(np.mean(np.abs(error) <= half, axis=0)[kinds == k].mean()) for k in names},
        independent={k: float(np.mean(np.abs(error) <= plain, axis=0)[kinds == k].mean()) for k in names},
        bias={k: finite(np.sqrt(np.nanmean(off[kinds == k] ** 2))) for k in names},
        width={k: finite(np.nanmedian(wide[kinds == k])) for k in names},
        block_count=float(np.mean([run.blocks for run in runs])),
    )
