"""M(q) is proven positive definite by bounds that hold, and a small corner where it is not is met."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from exact_parts import ARMS, energies, model_of
from synthetic import three_axis

from armloop.dynamics import definite, physics
from armloop.dynamics.definite import MassTerms, prove_definite
from armloop.dynamics.physics import BOXES, check_physics
from armloop.features.lagrangian import EnergyTerms
from armloop.model.components import Lagrangian


def random_terms(rng: np.random.Generator, prismatic: int | None) -> MassTerms:
    """Forty terms of four joints, of which the first changes nothing, beside a constant."""
    n, T = 4, 40
    revolute = np.arange(n) != prismatic
    degrees = rng.integers(-2, 3, (T, n)) * (np.arange(n) > 0)
    degrees[:, ~revolute] = np.abs(degrees[:, ~revolute])
    speeds = np.sort(rng.integers(0, n, (T, 2)), axis=1)
    energy = EnergyTerms(revolute, degrees, rng.random(T) < 0.5, speeds)
    scale = 10.0 ** -np.arange(n)  # a shoulder's inertia is a thousand of a wrist's
    coefficients = rng.normal(size=T) * np.sqrt(scale[speeds[:, 0]] * scale[speeds[:, 1]])
    return MassTerms.of(energy, 0.02 * coefficients, np.diag(scale))


@pytest.mark.parametrize("prismatic", [None, 2])
@pytest.mark.parametrize("width", [1e-6, 0.03, 0.3, 3.0])
def test_margins_hold_at_every_posture_of_a_box(width: float, prismatic: int | None) -> None:
    rng = np.random.default_rng(3)
    terms = random_terms(rng, prismatic)
    centre, half = rng.uniform(-1, 1, (30, 4)), width * rng.random((30, 4))
    half[:, 0] = 0.0
    M = terms.at(centre)
    kept = np.linalg.eigvalsh(M)[:, 0] > 0
    assert kept.sum() > 20
    centre, half, M = centre[kept], half[kept], M[kept]
    margin, weights = terms.margins(centre, half, M)
    assert weights.shape == (len(centre), 3)
    root = np.linalg.inv(np.linalg.cholesky(M))
    relative = np.full(len(centre), np.inf)
    for _ in range(300):
        # corners, where the bounds are met, and what lies between
        d = half * np.clip(rng.uniform(-2, 2, half.shape), -1, 1)
        turned = root @ terms.at(centre + d) @ root.swapaxes(1, 2)
        relative = np.minimum(relative, np.linalg.eigvalsh(turned)[:, 0])
    assert (relative >= margin - 1e-12).all()
    if width < 1e-3:  # to first order they are met
        np.testing.assert_allclose(1 - relative, 1 - margin, rtol=0.02, atol=1e-11)


@pytest.mark.parametrize("sine", [False, True])
@pytest.mark.parametrize("power", [0, 1, 2, 3])
def test_what_a_tangent_leaves_of_a_term_is_bounded_and_the_bound_is_met(power: int, sine: bool) -> None:
    """f(3 q1) q2^a, for changes of the phase up to two turns: each bound is below and above what it bounds."""
    terms = MassTerms(
        np.array([[3.0, 0.0]]), np.array([[0, power]]), np.array([sine]), np.ones((1, 1, 1)), np.eye(1)
    )
    for width in (0.0, 1e-3, 0.1, 0.5, 1.0, 2.0, 4.0):
        for q1 in (-1.3, 0.2, 0.7):
            centre, half = np.array([[q1, 0.4]]), np.array([[width, 0.3 * (power > 0)]])
            tangents, rest, _ = terms._changes(centre, half)
            across = np.linspace(-1, 1, 801)
            d = np.stack(np.meshgrid(across * half[0, 0], across[::20] * half[0, 1]), axis=-1).reshape(-1, 2)
            steps = tangents[0, :, 0, 0] / np.where(half > 0, half, 1.0)[0, terms.joints]
            change = (terms.at(centre + d) - terms.at(centre))[:, 0, 0]
            left = np.abs(change - d[:, terms.joints] @ steps).max()
            assert rest[0, 0, 0] >= left
            if power == 0 and 3 * width <= np.pi:
                assert rest[0, 0, 0] == pytest.approx(left, abs=1e-12)
    # of a box without width what is left is the rounding of the term
    assert (
        terms._changes(np.array([[0.2, 0.4]]), np.zeros((1, 2)))[1][0, 0, 0]
        > np.finfo(float).eps * 0.4**power
    )


@pytest.mark.parametrize("joints", [1, 2])
def test_a_mass_matrix_that_is_the_same_everywhere_is_proven_at_once(joints: int) -> None:
    """Of one joint, or of slides only, no inertia depends on the posture."""
    each = np.arange(joints)
    energy = EnergyTerms(
        np.ones(joints, dtype=bool),
        np.zeros((joints, joints), dtype=int),
        each < 0,
        np.stack([each, each], 1),
    )
    ends = np.full(joints, 3.0)
    terms = MassTerms.of(energy, 0.5 * (1.0 + each), np.zeros((joints, joints)))
    proof = prove_definite(terms, -ends, ends)
    assert proof.complete and proof.boxes == 1 and proof.least == pytest.approx(1.0)
    proof = prove_definite(MassTerms.of(energy, -each - 0.5, np.zeros((joints, joints))), -ends, ends)
    assert proof.indefinite is not None


def corner(depth: float) -> tuple[MassTerms, np.ndarray, np.ndarray]:
    """M_11 = 1 - depth - (cos q2 + cos q3)/2 is least at a corner of the limits: -depth."""
    degrees = np.array([[0, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0], [0, 0, 0]])
    speeds = np.array([[0, 0], [0, 0], [0, 0], [1, 1], [2, 2]])
    energy = EnergyTerms(np.ones(3, dtype=bool), degrees, np.zeros(5, dtype=bool), speeds)
    coefficients = 0.5 * np.array([1 - depth, -0.5, -0.5, 1.0, 1.0])
    return MassTerms.of(energy, coefficients, np.zeros((3, 3))), np.array([-3.0, 0, 0]), np.array([3.0, 2, 2])


def test_a_corner_that_random_postures_miss_is_met() -> None:
    terms, low, high = corner(1e-5)
    q = np.random.default_rng(0).uniform(low, high, (20_000, 3))
    assert np.linalg.eigvalsh(terms.at(q))[:, 0].min() > 0
    proof = prove_definite(terms, low, high)
    assert not proof.complete and proof.indefinite is not None
    assert (proof.indefinite >= low).all() and (proof.indefinite <= high).all()
    assert np.linalg.eigvalsh(terms.at(proof.indefinite[None]))[0, 0] <= 0


def test_a_corner_that_is_only_just_definite_is_proven() -> None:
    terms, low, high = corner(-1e-5)
    proof = prove_definite(terms, low, high)
    assert proof.complete and proof.indefinite is None and 0 < proof.least <= 1e-5


def test_a_prismatic_joint_is_bounded_by_powers() -> None:
    """M_11 = 1/10 + (q2 - 1/2)² is least, 1/10, within the limits."""
    degrees = np.array([[0, 0], [0, 1], [0, 2], [0, 0]])
    energy = EnergyTerms(
        np.array([True, False]), degrees, np.zeros(4, dtype=bool), np.array([[0, 0]] * 3 + [[1, 1]])
    )
    for least in (0.1, -1e-4):
        half = 0.5 * np.array([least + 0.25, -1.0, 1.0, 2.0])
        terms = MassTerms.of(energy, half, np.zeros((2, 2)))
        q = np.array([[0.3, 0.5], [0.0, -2.0]])
        np.testing.assert_allclose(terms.at(q)[:, 0, 0], least + (q[:, 1] - 0.5) ** 2)
        proof = prove_definite(terms, np.array([-3.0, -1.3]), np.array([3.0, 1.9]))
        assert proof.complete == (least > 0)
        if proof.complete:
            assert 0 < proof.least <= least
        else:
            assert proof.indefinite is not None and abs(proof.indefinite[1] - 0.5) <= 0.01


@pytest.mark.parametrize("arm", ["three_axis", "scara"])
def test_the_energies_of_an_arm_are_proven(arm: str) -> None:
    body = energies(ARMS[arm])
    drives = tuple(("rotor_inertia", j + 1, {"inertia": 0.05}) for j in range(ARMS[arm].n))
    checks = check_physics(model_of(ARMS[arm], body, effects=drives))
    assert checks.certificate == BOXES and checks.proven == 1 and checks.definite
    found = checks.to_dict()["mass_matrix"]
    assert found["certificate"] == BOXES and found["share_proven"] == 1
    # the drives count: what they take away may be more than a link has
    taken = tuple((name, j, {"inertia": -x["inertia"]}) for name, j, x in drives)
    assert not check_physics(model_of(ARMS[arm], body, effects=taken)).certificate


def test_what_the_search_misses_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    arm = ARMS["three_axis"]
    terms, low, high = corner(1e-5)
    body = Lagrangian(
        EnergyTerms(
            np.ones(3, dtype=bool),
            terms.waves.astype(int),
            terms.sine,
            np.array([[0, 0], [0, 0], [0, 0], [1, 1], [2, 2]]),
        ),
        0.5 * np.array([1 - 1e-5, -0.5, -0.5, 1.0, 1.0]),
    )
    monkeypatch.setattr(physics, "joint_limits", lambda *_: (low, high))
    search = physics.lowest
    monkeypatch.setattr(
        physics,
        "lowest",
        lambda mass, low, high, q, values, rng: (
            search(mass, low, high, q, values, rng)
            if len(q) == 1
            else (np.sort(values), q[np.argsort(values)])
        ),
    )
    checks = check_physics(model_of(arm, body))
    assert not checks.definite and checks.negative == 0 and checks.certificate == ""
    assert checks.least == pytest.approx(-1e-5, rel=1e-3)
    assert "not positive definite" in checks.faults()[0]


def test_what_the_budget_does_not_reach_is_only_searched(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(definite, "_BOXES", 20)
    monkeypatch.setattr(definite, "_TOGETHER", 1)
    terms, low, high = corner(-1e-5)
    proof = prove_definite(terms, low, high)
    assert 0 < proof.share < 1 and not proof.complete and proof.indefinite is None and proof.boxes == 20
    monkeypatch.setattr(definite, "_BOXES", 100)
    arm = ARMS["three_axis"]
    drives = tuple(("rotor_inertia", j + 1, {"inertia": 0.05}) for j in range(arm.n))
    checks = check_physics(model_of(arm, energies(arm), effects=drives))
    assert checks.definite and checks.certificate == "" and 0 < checks.proven < 1
    assert checks.to_dict()["mass_matrix"]["certificate"] is None


def test_a_joint_with_one_limit_is_tried_as_far_from_that_as_one_with_none() -> None:
    arm = three_axis()
    ends = [(0.5, np.inf), (-np.inf, -1.0), (-np.inf, np.inf)]
    joints = tuple(replace(j, lower=low, upper=up) for j, (low, up) in zip(arm.joints, ends, strict=True))
    low, high = physics.joint_limits(replace(arm, joints=joints))
    np.testing.assert_allclose(low, [0.5, -1.0 - 2 * np.pi, -np.pi])
    np.testing.assert_allclose(high, [0.5 + 2 * np.pi, -1.0, np.pi])
