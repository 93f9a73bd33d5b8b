"""Laws that were fitted beside base parameters: what one takes of the other is an error of both."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from exact_parts import ARMS, model_of

from armloop.data.motion import Motion, Samples
from armloop.features.rigid_body import BaseParameters
from armloop.identification.uncertainty.propagated import torque_errors
from armloop.identification.uncertainty.standard_errors import Fitted, covariances, standard_errors
from armloop.identification.uncertainty.unknowns import Problem, problems
from armloop.laws.effects import effect
from armloop.laws.effects.base import Estimate
from armloop.laws.friction import FrictionTerm
from armloop.model import AddedEffect, ReconstructedModel, load_model
from armloop.model.components import RigidBody
from armloop.robot.kinematics import nominal_parameters

NOISE = 0.05
SPRING = AddedEffect(
    effect("joint_spring", 2),
    {"stiffness": Estimate(30.0, 2.0, "N*m/rad"), "rest": Estimate(0.1, 0.02, "rad")},
    "always",
)


def bare() -> ReconstructedModel:
    arm = ARMS["three_axis"]
    base = BaseParameters.of_arm(arm, rotors=False)
    own = base.from_full(nominal_parameters(arm))
    body = RigidBody(base.to_full(own, nominal_parameters(arm)), tuple(base.names), own)
    return model_of(
        arm,
        body,
        friction=(FrictionTerm("sign", 0.7), FrictionTerm("viscous", 2.0)),
    )


def samples(model: ReconstructedModel, N: int, seed: int, noise: float) -> Samples:
    """Motion in which a spring looks much like a weight; torque without that of the laws."""
    rng = np.random.default_rng(seed)
    q, v, vdot = rng.uniform(-1, 1, (3, N, 3)) * [[[0.6]], [[2.0]], [[4.0]]]
    motion = Motion(np.arange(N) * 0.01, q, v, vdot, np.array([0]))
    tau = replace(model, effects=()).predict(motion) + noise * rng.normal(size=q.shape)
    return Samples(motion, tau, np.ones(q.shape, dtype=bool), 0.01)


def columns(problem: Problem, data: Samples) -> np.ndarray:
    """(3 N, p) of all joints."""
    N, n = data.tau.shape
    X = np.zeros((n, N, len(problem.unknowns)))
    for design in problem.designs(data):
        X[design.joint][:, design.where] = design.X
    return X.reshape(n * N, -1)


def fitted(data: Samples) -> list[Fitted]:
    return [Fitted((1, 2, 3), np.ones(data.tau.shape, dtype=bool))]


def test_a_laws_parameters_are_unknowns_with_the_derivatives_of_its_torque() -> None:
    model = replace(bare(), effects=(SPRING,))
    (problem,), data = problems(model), samples(model, 300, 1, 0.0)
    names = [unknown.name for unknown in problem.unknowns[-2:]]
    assert names == [f"{key} of {SPRING.effect.label()}" for key in ("stiffness", "rest")]
    X = columns(problem, data).reshape(3, 300, -1)[:, :, -2:]
    assert not X[[0, 2]].any()
    q = data.motion.q[:, 1]
    np.testing.assert_allclose(X[1], np.column_stack([q - 0.1, np.full(300, -30.0)]), atol=1e-6)


@pytest.mark.parametrize("when", [None, "always"])
def test_weights_have_the_errors_of_a_regression_with_the_spring(when: str | None) -> None:
    """Ordinary least squares of all columns; a spring that a diagnosis added was no part of the regression."""
    model = replace(bare(), effects=(replace(SPRING, when=when),))
    data = samples(model, 4000, 2, NOISE)
    (problem,) = problems(model)
    X = columns(problem, data)
    expected = NOISE * np.sqrt(np.diag(np.linalg.inv(X.T @ X)))
    (part,) = covariances(model, data, fitted(data))[0]
    np.testing.assert_allclose(np.sqrt(np.diag(part.covariance)), expected, rtol=0.4)
    without = columns(problems(bare())[0], data)
    alone = NOISE * np.sqrt(np.diag(np.linalg.inv(without.T @ without)))
    more = (expected[: len(alone)] / alone).max()
    assert more > 3 if when else more == 1.0
    # their own errors stand beside them
    shared = standard_errors(model, data, fitted(data))["shared"]
    assert set(shared) == {u.name for u in problem.unknowns if u.kind == "shared"}


def test_a_later_run_feels_the_sum_of_weight_and_spring(tmp_path: Path) -> None:
    model = replace(bare(), effects=(SPRING,))
    data, other = samples(model, 4000, 3, NOISE), samples(model, 200, 4, 0.0)
    replace(model, uncertainty=standard_errors(model, data, fitted(data))).save(tmp_path / "model.json")
    kept = load_model(tmp_path / "model.json")
    errors = torque_errors(kept, other)
    alone = replace(bare(), uncertainty=standard_errors(bare(), data, fitted(data)))
    few = torque_errors(alone, other)
    size = np.sqrt((errors**2).sum(axis=2).mean(axis=0) / (few**2).sum(axis=2).mean(axis=0))
    # on motion of the same kind the sum is known, though neither is
    assert (size < 1.5).all()
    # what a diagnosis adds does not change that, nor that the spring is gone
    drag = AddedEffect(effect("viscous_friction", 1), {"coefficient": Estimate(1.0, 0.1, "N*m*s/rad")})
    np.testing.assert_allclose(torque_errors(kept.with_effects([drag]), other), errors)
    assert torque_errors(replace(kept, effects=()), other).shape == errors.shape
    # a file from before the spring was an unknown
    old = replace(kept, uncertainty=alone.uncertainty)
    np.testing.assert_allclose(torque_errors(old, other), few)


def test_a_joint_whose_directions_a_file_lacks_has_no_errors_of_another() -> None:
    """Terms of joints may have one name, a constant for example."""
    model = replace(bare(), effects=())
    data = samples(model, 1000, 5, NOISE)
    found = standard_errors(model, data, fitted(data))
    (whole,) = found["torque"]
    few = [k for k, name in enumerate(whole["unknowns"]) if name.startswith("sign")]
    other = {"unknowns": [whole["unknowns"][few[0]], "v9", "1"], "directions": ["1", "0 1", "0 0 1"]}
    lost = replace(model, uncertainty={**found, "torque": [other]})
    assert torque_errors(lost, data)[:, :, :0].shape == torque_errors(lost, data).shape
