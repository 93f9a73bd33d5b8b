"""Direction of a carried load's force: what hangs pulls straight down, what pushes mostly does not (score test).

Beside the load a constant horizontal force on its centre is regressed, from the time it is picked up until it is put down.
"""

from __future__ import annotations

import numpy as np

from armloop.data.signals import smooth
from armloop.diagnosis.fit import deviate, wald_statistic
from armloop.diagnosis.judgement import SIGNIFICANCE
from armloop.diagnosis.trials import Known
from armloop.laws.effects.base import number
from armloop.regression.clustered import clustered_covariance
from armloop.regression.embedded import ridge
from armloop.robot.kinematics import tool_jacobian
from armloop.util.arrays import TINY, Mask

#: Part of a weight that a horizontal force beside it may be: by so much, rad, gravity's direction is known.
_UPRIGHT = 0.1


def pulls_down(known: Known, carried: Mask) -> bool:
    """Whether the force of a load, the first of the effects known, is a weight's: no horizontal part is real and large.

    Args:
        known: the run, and the load fitted to it.
        carried: (N,) samples in which it is there.
    """
    evidence, rows, mass = known.evidence, known.fit.stacked, known.fit.parameters[0]
    arm, q = evidence.model.arm, evidence.samples.motion.q
    g = float(np.linalg.norm(arm.gravity))
    level = np.linalg.svd(arm.gravity[None] / max(g, TINY))[2][1:]
    torque = (
        np.einsum("hx,nxj->njh", level, tool_jacobian(arm.with_tool_at(mass["com"].value), q))
        * carried[:, None, None]
    )
    samples, _, joint = evidence.stacking
    horizontal = smooth(evidence.samples, torque)[samples, joint] / evidence.scale[joint, None]
    beta, _, J, _ = known.fit.solution
    X, left = np.hstack([rows.X @ J, horizontal]), rows.y - rows.X @ beta
    more = ridge(X.T @ X, X.T @ left)
    force, spread = more[-2:], clustered_covariance(X, left - X @ more, rows.block)[-2:, -2:]
    real = deviate(*wald_statistic(force, spread)) > SIGNIFICANCE
    return not (real and np.linalg.norm(force) > _UPRIGHT * abs(number(mass["mass"].value)) * g)
