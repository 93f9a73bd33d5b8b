"""One-shot SINDy through pysindy: the reference method that the stepwise one has to beat on the same data.

All candidates of the one library (velocities and accelerations together) are regressed on all samples at
once by sequentially thresholded least squares (Brunton, Proctor and Kutz 2016).
"""

from __future__ import annotations

import warnings

import numpy as np
import pysindy

from armloop.data.blocks import folds
from armloop.data.motion import Samples
from armloop.features.double_feature_set import DoubleFeatureSet
from armloop.identification.reconstruction.excitation import check_excitation
from armloop.identification.reconstruction.found import Found
from armloop.identification.reconstruction.options import Options, StepReport
from armloop.laws.friction import FrictionTerm
from armloop.model.components import SparseTerms
from armloop.robot.arm import Arm
from armloop.util.arrays import Array, Mask
from armloop.util.errors import ExcitationError, InputError
from armloop.util.progress import Progress

#: Thresholds as a share of each joint's torque; ridges as a share of the columns' squared size.
_SETTINGS = [(threshold, ridge) for ridge in (1e-4, 1e-2) for threshold in (3e-3, 1e-2, 3e-2)]
#: pysindy holds the library and its normal equations several times over: 4,000 rows keep it in memory.
_MOST_SAMPLES = 4000
#: Of the lowest order, whatever the options allow of others.
_MOST_CANDIDATES = 4000
_FEWEST_SAMPLES = 100


def sindy(arm: Arm, samples: Samples, held_out: Mask, options: Options, progress: Progress) -> Found:
    """Regress the one-shot library with pysindy's STLSQ; threshold and order N1 by held-out error.

    The joints' own friction columns, sign(v) and v, are offered to it as they are to the stepwise method.

    Raises:
        ExcitationError: a joint hardly moves, or the joints never move together.
    """
    check_excitation(arm, samples)
    revolute = tuple(arm.revolute.tolist())
    rows = np.flatnonzero(samples.moving.all(axis=1) & ~held_out)
    if len(rows) < _FEWEST_SAMPLES:
        raise ExcitationError(
            f"all joints move at once in {len(rows)} samples, at least {_FEWEST_SAMPLES} are needed for one-shot "
            "regression; log runs in which every joint moves"
        )
    rows = rows[:: max(1, len(rows) // _MOST_SAMPLES)]
    validation = folds(samples, options.folds, options.block_seconds)[rows] == 1
    tau = samples.tau[rows]
    scale = np.sqrt(np.mean(tau**2, axis=0))
    trials: list[tuple[list[int], float]] = []
    best: tuple[float, DoubleFeatureSet, Array] | None = None
    for N1 in range(1, options.max_order + 1):
        library = DoubleFeatureSet(revolute, N1, 2, "both")
        if library.size > (options.max_candidates if N1 > 1 else _MOST_CANDIDATES):
            break
        progress(f"sindy: {library.size} candidates of order ({N1}, 2)")
        X, signs = library.columns(samples.motion.take(rows)), np.sign(samples.motion.v[rows])
        X = np.hstack([X, signs])
        names = [*library.names, *(f"sign(v{j + 1})" for j in range(arm.n))]
        errors = []
        for threshold, ridge in _SETTINGS:
            shares = _stlsq(X[~validation], tau[~validation] / scale, names, threshold, ridge)
            coefficients = shares * scale[:, None]
            error = (tau[validation] - X[validation] @ coefficients.T) / scale
            errors.append(float(np.sqrt(np.mean(error**2))))
            if best is None or errors[-1] < best[0]:
                best = (errors[-1], library, coefficients)
        trials.append(([N1, 2], min(errors)))
    if best is None:
        raise InputError(
            f"one-shot regression of {arm.n} joints has {library.size} candidates at its lowest order, more than the "
            f"{_MOST_CANDIDATES} that it can be given; use --method stepwise, whose libraries scale"
        )
    _, library, coefficients = best
    full = DoubleFeatureSet(revolute, library.N1, 2, "both", independent=False).size
    kept = coefficients[:, : library.size].any(axis=0)
    terms = SparseTerms(3, library.index[kept], coefficients[:, : library.size][:, kept].T)
    friction = [[FrictionTerm("sign", float(coefficients[j, library.size + j]))] for j in range(arm.n)]
    counts = [int(np.count_nonzero(row)) for row in coefficients]
    report = StepReport(3, [library.N1, 2], full, library.size, counts, [len(rows)] * arm.n, trials)
    return Found(arm, [terms], friction, [report], [])


def _stlsq(X: Array, tau: Array, names: list[str], threshold: float, ridge: float) -> Array:
    """(n, T) coefficients; columns are scaled to unit size so that the threshold is a share of the torque."""
    size = np.sqrt(np.mean(X**2, axis=0))
    size[size == 0] = 1.0
    model = pysindy.SINDy(
        optimizer=pysindy.STLSQ(threshold=threshold, alpha=ridge * len(X), max_iter=10),
        feature_library=pysindy.IdentityLibrary(),
    )
    with warnings.catch_warnings():
        # An ill-conditioned library is the reference method's own trouble and shows in its held-out error.
        warnings.simplefilter("ignore")
        model.fit(X / size, t=1.0, x_dot=tau, feature_names=names)
    return np.asarray(model.coefficients()) / size
