"""The rigid-body library: base parameters shared by all joints, with friction that has memory and feels load.

It scales to seven joints: 40 shared parameters and seven friction columns a joint where the double feature
set would need tens of thousands. The regression is weighted by what each joint's residual turns out to be.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armloop.arm import Arm
from armloop.components import RigidBody
from armloop.kinematics import nominal_parameters
from armloop.library.rigid_body import BaseParameters
from armloop.motion import Motion, Samples
from armloop.progress import Progress
from armloop.reconstruction.found import Found
from armloop.reconstruction.options import Options, StepReport
from armloop.reconstruction.physical import physical_cuts, physical_solution, postures
from armloop.reconstruction.shared import (
    FRICTION,
    LOAD_FRICTION,
    check_moves,
    check_rank,
    found_friction,
    sliding_rows,
    solve_weighted,
)
from armloop.signals import smooth

Array = NDArray[np.float64]


def rigid_body(
    arm: Arm, samples: Samples, held_out: NDArray[np.bool_], options: Options, progress: Progress
) -> Found:
    """Regress base parameters and friction on all moving samples at once.

    Two passes: the torque that passes a joint, on which its friction depends, is known after the first.

    Raises:
        ExcitationError: a joint does not move, or the motion leaves base parameters undetermined.

    What physics demands (M(q) positive definite, friction that never drives) is kept as constraints.
    """
    motion = samples.motion
    rows = sliding_rows(samples) & ~held_out[:, None]
    check_moves(arm, rows)
    base = BaseParameters.of_arm(arm, rotors=True)
    progress(f"rigid body: {base.count} base parameters, {len(FRICTION) + 1} friction columns a joint")
    columns = smooth(samples, base.columns(arm, motion))
    check_rank(columns, rows, base)
    laws = [list(FRICTION) for _ in arm.joints]
    first = solve_weighted(samples, columns, laws, rows, None).theta
    nominal = np.concatenate([nominal_parameters(arm), np.zeros(arm.n)])
    load = base.columns(arm, motion) @ first[: base.count]
    laws = [[*law, LOAD_FRICTION] for law in laws]
    solution = solve_weighted(samples, columns, laws, rows, load)
    cuts = physical_cuts(motion, _mass_columns(arm, base, postures(motion)), laws)
    theta, active = physical_solution(solution, cuts)
    friction = found_friction(laws, theta[base.count :])
    values = theta[: base.count]
    body = RigidBody(base.to_full(values, nominal), tuple(base.names), values)
    samples_per_joint = [int(rows[:, j].sum()) for j in range(arm.n)]
    reports = []
    for step in (1, 2, 3):
        counts = [len(body.terms(arm, j)) + sum(t.step <= step for t in friction[j]) for j in range(arm.n)]
        reports.append(StepReport(step, None, len(theta), base.count, counts, samples_per_joint))
    notes = [
        "the steps share one set of parameters: they were regressed together and are told apart on prediction"
    ]
    if active:
        notes.append(
            f"{active} constraints were needed to keep M(q) positive definite and friction from driving"
        )
    return Found(arm, [body], friction, reports, notes, {"inertial": body.parameters[: 10 * arm.n].tolist()})


def _mass_columns(arm: Arm, base: BaseParameters, q: Array) -> Array:
    """(P, n, n, r) mass matrices at postures q (P, n) per unit of each base parameter."""
    repeated = np.repeat(q, arm.n, axis=0)
    still, unit = np.zeros_like(repeated), np.tile(np.eye(arm.n), (len(q), 1))
    weightless = replace(arm, gravity=np.zeros(3))
    accelerated = Motion(np.arange(float(len(repeated))), repeated, still, unit, np.array([0]))
    columns = base.columns(weightless, accelerated).reshape(len(q), arm.n, arm.n, base.count)
    return columns.transpose(0, 2, 1, 3)
