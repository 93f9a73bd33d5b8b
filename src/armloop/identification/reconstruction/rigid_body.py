"""The rigid-body library: base parameters shared by all joints, with friction that has memory and feels load.

It scales to seven joints: some 40 shared parameters and a few friction terms a joint where the double feature
set would need tens of thousands. The regression is weighted by what each joint's residual turns out to be.
What scarce data leave open is filled in from the URDF, as firmly as the data themselves speak for it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any, ClassVar

import numpy as np

from armloop.data.motion import Motion
from armloop.dynamics.physics import joint_limits
from armloop.features.lagrangian import constant_weights
from armloop.features.rigid_body import BaseParameters, rotor_names
from armloop.identification.reconstruction.catalogue import Laws
from armloop.identification.reconstruction.data import Data
from armloop.identification.reconstruction.design import Design
from armloop.identification.reconstruction.fitting import Fitting
from armloop.identification.reconstruction.found import Found
from armloop.identification.reconstruction.library import Find, Library
from armloop.identification.reconstruction.options import Options, StepReport
from armloop.identification.reconstruction.physical import (
    EVERYWHERE,
    Body,
    PhysicalSolution,
    physical_solution,
    physics_notes,
    postures,
)
from armloop.identification.reconstruction.pooled import Prior, Solution
from armloop.identification.reconstruction.realizable import realizable_solution
from armloop.identification.reconstruction.shared import (
    SHARED_CONDITIONING,
    check_moves,
    found_friction,
    motion_range,
    undetermined_notes,
)
from armloop.identification.reconstruction.training import Training
from armloop.laws.friction import FrictionTerm
from armloop.model.components import RigidBody
from armloop.robot.arm import Arm
from armloop.robot.kinematics import nominal_parameters
from armloop.robot.newton_euler import joint_torques
from armloop.util.arrays import Array
from armloop.util.progress import Progress

#: Standard deviations of a link's mass from the URDF's that are tried, kg.
_SPREADS = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0)


def rigid_body(arm: Arm, data: Data, options: Options, progress: Progress) -> Found:
    """Regress base parameters and friction on all moving samples at once.

    Which friction each joint has is a nested model selection (:mod:`reconstruction.friction_selection`). The torque
    that passes a joint, on which its friction may depend, is known after a first pass with plain friction.
    What physics demands (links that can exist or, where the data contradict those, M(q) positive definite; friction that
    never drives) is kept as constraints.

    Raises:
        ExcitationError: a joint does not move.
    """
    motion = data.reference.samples.motion
    base = BaseParameters.of_arm(arm, rotors=True)
    passes = np.array([name not in rotor_names(arm.n) for name in base.names])
    design = Design(arm, partial(base.columns, arm), base.count, passes=passes)
    progress(f"rigid body: {base.count} base parameters, beside plain friction")
    training = Training.of(data, design, options)
    survey = training.survey
    check_moves(arm, survey.fitted)
    unknown = undetermined_notes(survey.products(base.count), base)
    nominal = np.concatenate([nominal_parameters(arm), np.zeros(arm.n)])
    design = design.loaded(survey.load(base.count, constant_weights(arm)))
    fitting = Fitting(arm, training, design, _priors(arm, base, nominal), options, progress)
    selection, laws = fitting.chosen()
    r = base.count + laws.count
    shape = body_of(arm, base, laws, motion)

    def physical(
        solution: Solution, friction: list[list[FrictionTerm]]
    ) -> tuple[Array, Array, dict[str, Any]]:
        """Coefficients of bodies that can exist, or, if the data contradict those, with M positive where it matters."""
        passive = [term.kind != "offset" for law in friction for term in law]
        lawful = laws.passive | np.array(laws.inertial(arm, shape.seen), dtype=bool)
        positive = np.array([*lawful, *passive], dtype=bool)
        bodies = realizable_solution(solution, arm, base, nominal, positive, training.memory)
        if bodies.accepted:
            return bodies.theta, bodies.full, PhysicalSolution(bodies.theta, 0, EVERYWHERE).to_dict()
        found = physical_solution(solution, shape, friction, options.insist, training.memory)
        said = {"bodies": bodies.to_dict(base.names)}
        return found.theta, base.to_full(found.theta[: base.count], nominal), {**found.to_dict(), **said}

    def regressed(held_out: bool) -> Found:
        solution = selection.solved(held_out)
        theta, physics = solution.theta, dict[str, Any]()
        full = base.to_full(theta[: base.count], nominal)
        if options.physical:
            theta, full, physics = physical(solution, selection.laws)
            held = np.flatnonzero(
                base.positive & (solution.theta[: base.count] < 0) & (theta[: base.count] >= 0)
            )
            physics["held"] = {base.names[k]: float(solution.theta[k]) for k in held}
            below = np.flatnonzero(base.positive & (theta[: base.count] < 0))
            physics["negative"] = {base.names[k]: float(theta[k]) for k in below}
        body = RigidBody(full, tuple(base.names), theta[: base.count])
        history = {
            "inertial": full[: 10 * arm.n].tolist(),
            "friction_ladder": [one.to_dict() for one in selection.comparisons],
            **physics,
        }
        effects = tuple(laws.added(arm, theta[base.count : r], fitting.covariance))
        return Found(arm, [body], found_friction(selection.laws, theta[r:]), history=history, effects=effects)

    found = regressed(held_out=False)
    found.final = final = regressed(held_out=True)
    body, samples_per_joint = final.components[0], survey.sliding.tolist()
    size = base.count + sum(len(law) for law in selection.laws)
    for step in (1, 2, 3):
        friction = [sum(term.step <= step for term in terms) for terms in final.friction]
        counts = [len(body.terms(arm, j)) + friction[j] for j in range(arm.n)]
        found.reports.append(StepReport(step, None, size, base.count, counts, samples_per_joint))
    found.notes = [
        "the three steps share one set of parameters, regressed together: a step is a part of that model",
        "errors are of a model fitted without the held-out blocks; the model itself is fitted to all data",
        *unknown,
        *selection.notes,
        *laws.notes(final.effects),
    ]
    found.notes += physics_notes(final.history)
    return found


def body_of(arm: Arm, base: BaseParameters, laws: Laws, motion: Motion) -> Body:
    """The mass matrix of base parameters and of laws that add inertia."""
    return Body(
        lambda q: np.concatenate([mass_columns(arm, base, q), laws.mass(arm, q)], axis=3),
        lambda theta, q: (
            mass_matrix(arm, base, theta[: base.count], q) + laws.mass(arm, q) @ theta[base.count :]
        ),
        postures(motion),
        *joint_limits(arm, motion_range(motion)),
        np.concatenate([base.positive, laws.passive]),
    )


def _priors(arm: Arm, base: BaseParameters, nominal: Array) -> dict[str, Prior]:
    """Beliefs that every link is like the URDF's, by how many kg its mass may well differ.

    Its first moments and inertias may differ as those of so much mass a typical link's length away.
    """
    length = np.linalg.norm(arm.X_PF[1:, :3, 3], axis=1).sum() / max(arm.n - 1, 1)
    length = float(length) if length > 0 else 1.0
    # a slide's motor adds a mass, which nothing measures by lengths
    rotors = np.where(arm.revolute, length**2, 1.0)
    unit = np.concatenate([np.tile([1.0, *[length] * 3, *[length**2] * 6], arm.n), rotors])
    spread = base.grouping * unit
    precision = np.linalg.inv(spread @ spread.T)
    centre = base.from_full(nominal)
    return {f"links as in the URDF ± {kg:g} kg": Prior(precision / kg**2, centre) for kg in _SPREADS}


def mass_columns(arm: Arm, base: BaseParameters, q: Array) -> Array:
    """(P, n, n, r) mass matrices at postures q (P, n) per unit of each base parameter."""
    weightless = replace(arm, gravity=np.zeros(3))
    columns = base.columns(weightless, Motion.accelerated(q)).reshape(len(q), arm.n, arm.n, base.count)
    return columns.transpose(0, 2, 1, 3)


def mass_matrix(arm: Arm, base: BaseParameters, values: Array, q: Array) -> Array:
    """(P, n, n) mass matrix at postures q (P, n) of given base parameters, much sooner than by its columns."""
    n, full, pushed = arm.n, base.to_full(values), Motion.accelerated(q)
    weightless = replace(arm, gravity=np.zeros(3))
    torques = joint_torques(weightless, full[: 10 * n], pushed.q, pushed.v, pushed.vdot)
    return torques.reshape(len(q), n, n).transpose(0, 2, 1) + np.diag(full[10 * n :])


class RigidBodyLibrary(Library):
    """Base parameters of the URDF's chain."""

    name = "rigid-body"
    methods: ClassVar[Mapping[str, Find]] = {"stepwise": rigid_body}
    conditioning = SHARED_CONDITIONING
