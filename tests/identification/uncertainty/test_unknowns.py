"""A model's unknowns times their columns are its torque, whatever it is made of, and a step moves both alike."""

from __future__ import annotations

import json
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from exact_parts import ARMS, energies, model_of, scara_terms

from armloop.data.motion import Motion, Samples
from armloop.features.rigid_body import BaseParameters
from armloop.identification.uncertainty import propagated
from armloop.identification.uncertainty.propagated import leading, torque_errors
from armloop.identification.uncertainty.sandwich import Equations
from armloop.identification.uncertainty.solving import moved, solve, solve_given_terms
from armloop.identification.uncertainty.standard_errors import (
    Assembled,
    Errors,
    Fitted,
    _residuals,
    covariances,
    gauss_newton_steps,
    standard_errors,
)
from armloop.identification.uncertainty.unknowns import STRIBECK_VELOCITY, problems
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import ReconstructedModel, load_model
from armloop.model.components import RigidBody
from armloop.model.model import model_of as model_of_data
from armloop.robot.kinematics import nominal_parameters
from armloop.util.errors import ModelError

FRICTION = (
    FrictionTerm("sign", 0.7),
    FrictionTerm("stribeck", -0.2, 0.4),
    FrictionTerm("viscous", 2.0),
)
LOADED = (*FRICTION, FrictionTerm("load_sign", 0.05), FrictionTerm("offset", -0.3))


def rigid(rotors: bool) -> ReconstructedModel:
    arm = ARMS["three_axis"]
    base = BaseParameters.of_arm(arm, rotors=rotors)
    nominal = np.concatenate([nominal_parameters(arm), np.full(arm.n if rotors else 0, 0.05)])
    own = base.from_full(nominal)
    return model_of(arm, RigidBody(base.to_full(own, nominal), tuple(base.names), own), friction=LOADED)


def terms() -> ReconstructedModel:
    """Sparse terms of three steps, the constant in the first alone."""
    arm = ARMS["scara"]
    first, *others = scara_terms(arm)
    some = [
        replace(c, index=c.index[k], coefficients=c.coefficients[k])
        for c in others
        for k in [c.index.any(axis=1)]
    ]
    return model_of(arm, first, *some, friction=FRICTION)


def models() -> dict[str, ReconstructedModel]:
    scara = ARMS["scara"]
    return {
        "terms": terms(),
        "terms and a load": replace(terms(), friction=FrictionLaw((LOADED,) * ARMS["scara"].n)),
        "bodies": rigid(False),
        "bodies and rotors": rigid(True),
        "energies": model_of(scara, energies(scara), friction=LOADED),
    }


def samples(model: ReconstructedModel, N: int = 400, noise: float = 0.0, seed: int = 0) -> Samples:
    rng = np.random.default_rng(seed)
    q, v, vdot = rng.uniform(-2, 2, (3, N, model.arm.n))
    motion = Motion(np.arange(N) * 0.01, q, v, vdot, np.array([0]))
    tau = model.predict(motion) + noise * rng.normal(size=q.shape)
    return Samples(motion, tau, np.ones(q.shape, dtype=bool), 0.01)


MODELS = models()


@pytest.fixture(params=MODELS)
def model(request: pytest.FixtureRequest) -> ReconstructedModel:
    return MODELS[request.param]


def steps(model: ReconstructedModel, size: float) -> list[tuple[list[Any], np.ndarray]]:
    rng = np.random.default_rng(5)
    return [
        (
            p.unknowns,
            size * rng.normal(size=len(p.unknowns)) * [u.kind == "friction" or 1.0 for u in p.unknowns],
        )
        for p in problems(model)
    ]


def test_values_times_columns_are_the_torque(model: ReconstructedModel) -> None:
    data = samples(model)
    tau = np.zeros_like(data.tau)
    for problem in problems(model):
        values = np.array([u.value if u.linear else 0.0 for u in problem.unknowns])
        for design in problem.designs(data):
            tau[:, design.joint] += design.X @ values[design.where]
        assert problem.weighted == (len(problem.designs(data)) > 1)
    np.testing.assert_allclose(tau, data.tau, atol=1e-8)


def test_a_small_step_moves_the_torque_by_its_columns(model: ReconstructedModel) -> None:
    # friction that grows with the load apart: its column is taken at the estimate
    law = tuple(term for term in model.friction.terms[0] if not term.by_load)
    model = replace(model, friction=replace(model.friction, terms=(law,) * model.arm.n))
    data, change = samples(model), steps(model, 1e-6)
    expected = np.zeros_like(data.tau)
    for problem, (_, step) in zip(problems(model), change, strict=True):
        for design in problem.designs(data):
            expected[:, design.joint] += design.X @ step[design.where]
    found = moved(model, change).predict(data.motion) - data.tau
    np.testing.assert_allclose(found, expected, atol=1e-10)
    assert np.abs(expected).max() > 1e-6


def test_every_unknown_is_named_once_with_its_joint_and_step(model: ReconstructedModel) -> None:
    for problem in problems(model):
        keys = [(u.kind, u.joint, u.name) for u in problem.unknowns]
        assert len(set(keys)) == len(keys)
        assert {u.step for u in problem.unknowns if u.kind == "shared"} <= {1}
        for joint in {u.joint for u in problem.unknowns if u.kind == "friction"}:
            own = [u for u in problem.unknowns if u.kind == "friction" and u.joint == joint]
            law = model.friction.terms[joint]
            assert [u.step for u in own] == [t.step for t in law for _ in range(1 + (t.kind == "stribeck"))]
            assert [(u.value, u.name) for u in own if not u.linear] == [(0.4, STRIBECK_VELOCITY)]


def test_a_stribeck_velocity_moves_by_half_at_most() -> None:
    model = MODELS["terms"]
    for by, becomes in ((-0.1, 0.3), (-0.3, 0.2), (0.5, 0.6), (0.1, 0.5)):
        change = [
            (p.unknowns, np.array([by if u.name == STRIBECK_VELOCITY else 0.0 for u in p.unknowns]))
            for p in problems(model)
        ]
        for law in moved(model, change).friction.terms:
            assert law[1].parameter == pytest.approx(becomes)


@pytest.mark.parametrize("kind", ["terms", "bodies", "energies"])
def test_gauss_newton_comes_back_to_what_made_the_torques(kind: str) -> None:
    model = MODELS[kind]
    data = samples(model)
    every = [Fitted((1, 2, 3), np.ones(data.tau.shape, dtype=bool))]
    away = moved(model, steps(model, 0.01))
    assert np.abs(away.predict(data.motion) - data.tau).max() > 0.01
    back, errors = solve_given_terms(away, data, every, 8)
    np.testing.assert_allclose(back.predict(data.motion), data.tau, atol=1e-5)
    assert all(np.isfinite(part.covariance).all() for part in errors)
    (unknowns, step), *_ = gauss_newton_steps(model, data, every)
    assert len(unknowns) == len(step) and np.abs(step).max() < 1e-5


def test_the_best_of_the_iterates_is_kept() -> None:
    model = MODELS["terms"]
    data = samples(model, noise=0.01)
    every = [Fitted((1, 2, 3), np.ones(data.tau.shape, dtype=bool))]

    def assembled(one: ReconstructedModel) -> Assembled:
        return Assembled.of(one, data, every)

    start = assembled(moved(model, steps(model, 0.05))).misfit()
    found, better = solve(moved(model, steps(model, 0.05)), assembled)
    assert better and assembled(found).misfit() < 1e-2 * start
    again, better = solve(found, assembled)
    assert assembled(again).misfit() <= assembled(found).misfit()

    # iterates that only get worse leave the model as it was
    class Worse:
        misfits = iter([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 9.0, 9.0, 9.0])

        def __init__(self, one: ReconstructedModel) -> None:
            self._misfit = next(self.misfits)

        def misfit(self) -> float:
            return self._misfit

        def steps(self) -> Any:
            return steps(model, 1e-3)

    kept, better = solve(model, Worse)  # type: ignore[arg-type]
    assert kept is model and not better


@pytest.mark.parametrize(
    ("misfits", "looks", "best"),
    [
        ((1000.0, 500.0, 499.0, 498.5, 1.0), 4, 3),  # an iteration must remove a thousandth
        ((5.0, 4.0, 3.0, 2.0, 1.0, 0.5), 5, 4),  # of four iterates at most
        ((5.0, 5.0, 1.0), 2, 0),  # what is as good is no better
    ],
)
def test_it_goes_on_as_long_as_it_is_worth_while(misfits: tuple[float, ...], looks: int, best: int) -> None:
    model, seen = MODELS["terms"], []

    def assembled(one: ReconstructedModel) -> Any:
        seen.append(one)
        return SimpleNamespace(misfit=lambda: misfits[seen.index(one)], steps=lambda: steps(one, 1e-3))

    found, better = solve(model, assembled)
    assert (len(seen), better) == (looks, best > 0) and found is seen[best]


def test_sums_of_equations_add_over_samples_and_say_how_the_model_fits() -> None:
    model = MODELS["terms"]
    data = samples(model, noise=0.1)
    rows = np.random.default_rng(1).uniform(size=data.tau.shape) < 0.7
    whole = Assembled.of(model, data, [Fitted((1, 2, 3), rows)])
    left = (data.tau - model.predict(data.motion)) * rows
    np.testing.assert_allclose(whole.squares, (left**2).sum(axis=0))
    np.testing.assert_allclose(whole.power, (data.tau**2 * rows).sum(axis=0))
    assert whole.misfit() == pytest.approx(((left**2).sum(axis=0) / (data.tau**2 * rows).sum(axis=0)).sum())
    halves = [
        Assembled.of(model, data, [Fitted((1, 2, 3), rows & part[:, None])])
        for part in (np.arange(400) < 100, np.arange(400) >= 100)
    ]
    both = halves[0] + halves[1]
    for one, other in zip([*both.jacobian, *both.score], [*whole.jacobian, *whole.score], strict=True):
        np.testing.assert_allclose(one, other, atol=1e-9)
    assert both.misfit() == pytest.approx(whole.misfit())
    for k, design in enumerate(p.designs(data)[0] for p in problems(model)):
        X = design.X * rows[:, [k]]
        np.testing.assert_allclose(whole.jacobian[k], X.T @ X, atol=1e-9)
        np.testing.assert_allclose(whole.score[k], X.T @ left[:, k], atol=1e-9)
    nothing = Assembled.of(model, data, [Fitted((1, 2, 3), np.zeros_like(rows))])
    assert nothing.misfit() == 0.0 and nothing.jacobian[0].shape == whole.jacobian[0].shape


@pytest.mark.parametrize(("kind", "at_once"), [("terms", 8192), ("bodies", 8192), ("bodies", 150)])
def test_joints_that_share_parameters_weigh_by_what_is_left_of_them(
    kind: str, at_once: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(import_module(_residuals.__module__), "_PIECE", at_once)
    model = MODELS[kind]
    data = samples(model, 400)
    noise = np.random.default_rng(2).normal(size=data.tau.shape) * np.geomspace(0.05, 1.0, model.arm.n)
    data = replace(data, tau=data.tau + noise)
    rows = np.random.default_rng(1).uniform(size=data.tau.shape) < 0.7
    rows[:, -1] &= np.arange(400) < 200
    every = [Fitted((1, 2, 3), rows)]
    residual, spread = _residuals(problems(model), data, every)
    np.testing.assert_allclose(residual, noise * rows, atol=1e-9)
    np.testing.assert_allclose(spread, (noise**2).sum(axis=0, where=rows)[None] / rows.sum(axis=0))
    for problem, (_, step) in zip(problems(model), gauss_newton_steps(model, data, every), strict=True):
        G, b = np.zeros((len(step), len(step))), np.zeros(len(step))
        for design in problem.designs(data):
            own = rows[:, design.joint]
            X = design.X[own] / np.sqrt(spread[0, design.joint])
            G[np.ix_(design.where, design.where)] += X.T @ X
            b[design.where] += X.T @ noise[own, design.joint] / np.sqrt(spread[0, design.joint])
        np.testing.assert_allclose(step, np.linalg.solve(G, b), rtol=1e-5, atol=1e-7)
    nothing, none = _residuals(problems(model), data, [Fitted((1, 2, 3), np.zeros_like(rows))])
    assert not nothing.any() and not none.any()


@pytest.mark.parametrize("kind", ["terms", "bodies"])
def test_white_noise_gives_the_errors_of_least_squares(kind: str) -> None:
    model = MODELS[kind]
    sigma = 0.05
    data = samples(model, 4000, sigma)
    every = [Fitted((1, 2, 3), np.ones(data.tau.shape, dtype=bool))]
    parts, seconds, correlation = covariances(model, data, every)
    assert correlation == pytest.approx(0.01, rel=0.2) and seconds == pytest.approx(0.1, rel=0.2)
    for problem, part in zip(problems(model), parts, strict=True):
        p = len(problem.unknowns)
        G = np.zeros((p, p))
        for design in problem.designs(data):
            G[np.ix_(design.where, design.where)] += design.X.T @ design.X
        exact = sigma * np.sqrt(np.diag(np.linalg.inv(G + 1e-10 * np.diag(np.diag(G)))))
        np.testing.assert_allclose(part.std_error, exact, rtol=0.25)


@pytest.mark.parametrize("kind", MODELS)
def test_the_directions_kept_have_the_torques_errors(kind: str, tmp_path: Path) -> None:
    """On motion of the same kind they have nearly all of the variance that the coefficients' covariance gives the torque."""
    model, data, other = MODELS[kind], samples(MODELS[kind], 4000, 0.05), samples(MODELS[kind], 300, seed=1)
    every = [Fitted((1, 2, 3), np.ones(data.tau.shape, dtype=bool))]
    assert torque_errors(model, other).shape == (300, model.arm.n, 0)  # a model of before there were any
    replace(model, uncertainty=standard_errors(model, data, every)).save(tmp_path / "model.json")
    kept = load_model(tmp_path / "model.json")
    errors = torque_errors(kept, other)
    variance = np.zeros(errors.shape[:2])
    for problem, part in zip(problems(model), covariances(model, data, every)[0], strict=True):
        assert part.covariance.size > 0
        for design in problem.designs(other):
            own = part.covariance[np.ix_(design.where, design.where)]
            variance[:, design.joint] += np.einsum("tk,kl,tl->t", design.X, own, design.X)
    share = (errors**2).sum() / variance.sum()
    assert 0.98 < share < 1.001
    unknowns = sum(len(problem.unknowns) for problem in problems(model))
    assert errors.shape[2] <= unknowns
    data_of = json.loads((tmp_path / "model.json").read_text(encoding="utf-8"))
    data_of["uncertainty"]["torque"][0]["directions"].pop()
    (tmp_path / "broken.json").write_text(json.dumps(data_of), encoding="utf-8")
    with pytest.raises(ModelError, match=r"uncertainty\.torque: directions must be one row for each"):
        load_model(tmp_path / "broken.json")


@pytest.mark.parametrize("kind", MODELS)
def test_terms_in_another_order_keep_the_torques_errors(kind: str) -> None:
    model, data, other = MODELS[kind], samples(MODELS[kind], 2000, 0.05), samples(MODELS[kind], 300, seed=1)
    every = [Fitted((1, 2, 3), np.ones(data.tau.shape, dtype=bool))]
    found = replace(model, uncertainty=standard_errors(model, data, every)).to_dict()
    shuffled = json.loads(json.dumps(found))
    for part in shuffled["components"]:
        if part["kind"] == "terms":
            part["joints"] = [dict(reversed(joint.items())) for joint in part["joints"]]
        elif part["kind"] == "rigid_body":
            part["base_parameters"] = dict(reversed(part["base_parameters"].items()))
        else:
            part["terms"].reverse()
    shuffled["friction"] = [law[::-1] for law in shuffled["friction"]]
    errors = [
        (torque_errors(model_of_data(each, "it"), other) ** 2).sum(axis=2) for each in (found, shuffled)
    ]
    np.testing.assert_allclose(errors[1], errors[0], rtol=1e-6)
    assert (errors[0].max(axis=0) > 0).all()


def test_a_regression_that_is_met_exactly_leaves_the_directions_of_the_others_as_they_are() -> None:
    jacobian = np.array([[[4.0, 0.0], [1.0, 9.0]]] * 3)
    equations = Equations(jacobian, np.zeros((3, 2)), np.ones((3, 2)), np.array([0, 1]), np.array([0.0, 4.0]))
    errors = Errors([], np.diag([0.0, 0.25]), np.ones(2), equations)
    np.testing.assert_array_equal(errors.gram, [[12.0, 0.0], [0.0, 6.75]])
    directions = leading(errors.covariance, errors.gram)
    np.testing.assert_allclose(directions @ directions.T, errors.covariance, atol=1e-15)


def test_of_many_unknowns_the_directions_that_the_torque_feels_most_are_kept(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rng = np.random.default_rng(6)
    X = rng.normal(size=(300, 9)) * np.geomspace(1.0, 1e-3, 9)
    covariance = np.diag(np.geomspace(1.0, 100.0, 9))  # each has less of the torque than the one before
    variance = np.einsum("tk,kl,tl->", X, covariance, X)
    whole = propagated.leading(covariance, X.T @ X)
    np.testing.assert_allclose(whole @ whole.T, covariance, atol=1e-9)
    monkeypatch.setattr(propagated, "_NUMBERS", 17)  # two of nine rows each, less the one that is zero
    few = propagated.leading(covariance, X.T @ X)
    assert few.shape == (9, 2) and few[0, 1] == 0.0
    best = np.sort(np.linalg.eigvalsh(np.sqrt(covariance) @ X.T @ X @ np.sqrt(covariance)))[-2:].sum()
    assert ((X @ few) ** 2).sum() == pytest.approx(best) and best < variance
    monkeypatch.setattr(propagated, "_NUMBERS", 16)
    assert propagated.leading(covariance, X.T @ X).shape == (9, 1)
    # what no sample determined has no direction
    lost = np.array([[1.0, np.nan, 0.5], [np.nan, np.nan, np.nan], [0.5, np.nan, 4.0]])
    found = propagated.leading(lost, np.eye(3))
    np.testing.assert_allclose(
        found @ found.T, [[1.0, 0.0, 0.5], [0.0, 0.0, 0.0], [0.5, 0.0, 4.0]], atol=1e-12
    )


def test_a_models_file_keeps_so_many_numbers_of_so_many_digits() -> None:
    # 41 directions of 81 unknowns would be 2501 numbers, zeros above the diagonal left out
    assert propagated.leading(np.eye(81), np.eye(81)).shape == (81, 40)
    kept = propagated.to_dict([], np.array([[1 / 3, 0.0], [1e6 / 7, -2e-9 / 3]]))["directions"]
    assert kept == ["0.33333", "1.4286e+05 -6.6667e-10"]
    np.testing.assert_array_equal(propagated._directions(kept), [[0.33333, 0.0], [1.4286e5, -6.6667e-10]])
    assert propagated._directions([]).shape == (0, 0)


def test_what_a_later_step_finds_is_not_in_the_residual_of_an_earlier_one() -> None:
    model = MODELS["terms"]
    data = samples(model)
    slow = np.abs(data.motion.v).max(axis=1) < 1.0
    rows = np.repeat(slow[:, None], model.arm.n, axis=1)
    stages = [Fitted((1,), rows), Fitted((2, 3), ~rows)]
    parts, _, _ = covariances(model, data, stages)
    for j, (problem, part) in enumerate(zip(problems(model), parts, strict=True)):
        early = np.array([u.step == 1 for u in problem.unknowns])
        assert early.any() and not early.all()
        J = part.equations.jacobian.sum(axis=0)
        X = problem.designs(data)[0].X
        np.testing.assert_allclose(
            J[np.ix_(early, early)], X[rows[:, j]][:, early].T @ X[rows[:, j]][:, early]
        )
        np.testing.assert_allclose(J[~early], X[~rows[:, j]][:, ~early].T @ X[~rows[:, j]])
        assert not J[np.ix_(early, ~early)].any()
        values = np.array([u.value if u.linear else 0.0 for u in problem.unknowns])
        left = data.tau[rows[:, j], j] - X[rows[:, j]][:, early] @ values[early]
        np.testing.assert_allclose(
            part.equations.score.sum(axis=0)[early], X[rows[:, j]][:, early].T @ left, atol=1e-8
        )
        np.testing.assert_allclose(part.equations.score.sum(axis=0)[~early], 0.0, atol=1e-8)
        assert part.equations.count.sum(axis=0)[early][0] == rows[:, j].sum()
        assert part.equations.count.sum(axis=0)[~early][0] == (~rows[:, j]).sum()


def test_a_friction_law_of_one_joint_is_its_own() -> None:
    model = MODELS["bodies"]
    laws = (LOADED, (), LOADED[:1])
    one = replace(model, friction=replace(model.friction, terms=laws))
    (problem,) = problems(one)
    shared = sum(u.kind == "shared" for u in problem.unknowns)
    designs = problem.designs(samples(one))
    assert [len(d.where) - shared for d in designs] == [6, 0, 1]
    assert designs[2].where[-1] == len(problem.unknowns) - 1 == shared + 6
