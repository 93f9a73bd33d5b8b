"""Cost and gain of physical-consistency constraints: held-out error, constraints, and the mass matrix."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from armloop.data.log import MotionLog
from armloop.data.signals import preprocess
from armloop.dynamics.physics import mass_matrix
from armloop.identification.reconstruction import Options
from armloop.identification.validation.crossvalidate import CrossValidation, crossvalidate
from armloop.model import ReconstructedModel
from armloop.robot.arm import Arm
from armloop.util.arrays import Array
from armloop.util.progress import Progress, silent

#: Postures drawn within the range of the training data, and as many beyond it.
POSTURES = 500
#: Degrees of physical consistency that are compared.
DEGREES = ("physical", "insisted", "free")


@dataclass(frozen=True)
class MassMatrixCheck:
    """The mass matrix at random postures: its least eigenvalue, and the share of postures where that is negative."""

    least: float
    share_negative: float


@dataclass(frozen=True, eq=False)
class PhysicalComparison:
    """Cross-validations with physical consistency, to different degrees.

    Attributes:
        runs: by degree: ``"physical"`` (the default: M(q) positive definite unless the data contradict it),
            ``"insisted"`` (even then) and ``"free"``.
        within, beyond: the worst of the mass matrices over the splits, at postures within the range of the
            motion and over half a turn around its middle.
        constraints: conditions on M(q) that bind, mean over the splits.
    """

    runs: dict[str, CrossValidation]
    within: dict[str, MassMatrixCheck]
    beyond: dict[str, MassMatrixCheck]
    constraints: dict[str, float]

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready values of each degree."""
        return {
            degree: {
                "nrmse": run.mean,
                "nrmse_per_joint": run.per_joint,
                "constraints": self.constraints[degree],
                "mass_matrix_within": vars(self.within[degree]),
                "mass_matrix_beyond": vars(self.beyond[degree]),
            }
            for degree, run in self.runs.items()
        }


def compare_physical(
    logs: Sequence[MotionLog],
    arm: Arm,
    *,
    options: Options | None = None,
    progress: Progress = silent,
    seed: int = 0,
    **how: Any,
) -> PhysicalComparison:
    """Cross-validate with different degrees of physical consistency.

    Args:
        options: what else to choose; their ``physical`` and ``insist`` are overruled.
        seed: of the postures at which M(q) is tried.
        how: further arguments of :func:`crossvalidate`.

    Raises:
        InputError: as :func:`crossvalidate`.
    """
    runs, constraints = {}, {}
    for degree in DEGREES:
        progress(f"coefficients: {degree}")
        chosen = replace(options or Options(), physical=degree != "free", insist=degree == "insisted")
        run = runs[degree] = crossvalidate(logs, arm, options=chosen, progress=progress, **how)
        counts = [
            0 if fit.model.history.get("contradicted") else fit.model.history.get("constraints", 0)
            for _, fit in run.results
        ]
        constraints[degree] = float(np.mean(counts))
    q = preprocess(logs, runs["physical"].results[0][1].model.conditioning).motion.q
    near, far = _postures(arm, q, seed)
    within, beyond = (
        {key: check_mass_matrix([result.model for _, result in run.results], at) for key, run in runs.items()}
        for at in (near, far)
    )
    return PhysicalComparison(runs, within, beyond, constraints)


def check_mass_matrix(models: Sequence[ReconstructedModel], q: Array) -> MassMatrixCheck:
    """The symmetric part of mass matrices at postures q (P, n), of several models the worst."""
    M = np.array([mass_matrix(model, q) for model in models])
    least = np.linalg.eigvalsh(0.5 * (M + M.swapaxes(2, 3)))[:, :, 0]
    return MassMatrixCheck(float(least.min()), float(np.mean(least <= 0, axis=1).max()))


def _postures(arm: Arm, q: Array, seed: int) -> tuple[Array, Array]:
    """Random postures (P, n) within the range of the motion q (N, n), and over half a turn (or twice the range)."""
    rng = np.random.default_rng(seed)
    low, high = q.min(axis=0), q.max(axis=0)
    half = np.where(arm.revolute, np.pi, high - low)
    middle = 0.5 * (low + high)
    near = rng.uniform(low, high, (POSTURES, arm.n))
    return near, rng.uniform(middle - half, middle + half, (POSTURES, arm.n))
