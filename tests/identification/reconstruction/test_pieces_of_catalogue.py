"""What the laws of the catalogue add to the mass matrix, which columns are constant, and what is filtered once."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import fourier_motion, three_axis

from armloop.data.motion import Motion, Samples
from armloop.features.rigid_body import BaseParameters
from armloop.identification.reconstruction import catalogue
from armloop.identification.reconstruction.catalogue import Law, Laws, permanent
from armloop.identification.reconstruction.rigid_body import body_of
from armloop.robot.arm import load_arm

RNG = np.random.default_rng(4)
#: Two laws' parts of M at cos(q1) = 1, not symmetric, so that rows and columns cannot be taken for each other.
INERTIAS = RNG.normal(size=(3, 3, 2))


def effect(inertias: Any, **of: Any) -> Any:
    """Torque cos(q1) A v̇ and a weight, per coefficient; the shape multiplies it."""

    def columns(context: Any, shape: float) -> Any:
        motion = context.motion
        torque = np.einsum("ijp,nj->nip", inertias, motion.vdot) * np.cos(motion.q[:, :1, None])
        return shape * (torque + 5.0 + motion.q[:, :, None])

    flags = {"needs_model": False, "memory": False, "load": False, "passive": False} | of
    return SimpleNamespace(fixed_columns=columns, **flags)


def test_the_mass_matrix_is_what_an_acceleration_of_one_adds() -> None:
    arm = three_axis()
    q = RNG.normal(size=(4, 3))
    laws = Laws([Law(effect(INERTIAS), 2.0, 2), Law(effect(np.zeros((3, 3, 1))), 1.0, 1)])
    found = laws.mass(arm, q)
    np.testing.assert_allclose(
        found[..., :2], 2.0 * np.cos(q[:, 0])[:, None, None, None] * INERTIAS, atol=1e-12
    )
    assert found.shape == (4, 3, 3, 3) and laws.inertial(arm, q) == [True, True, False]
    # one entry is inertia enough
    one = np.zeros((3, 3, 1))
    one[2, 2] = 0.1
    assert Laws([Law(effect(one), 1.0, 1)]).inertial(arm, q) == [True]
    # what knows the model, or the past, is asked for nothing
    for flag in ("needs_model", "memory"):
        silent = Laws([Law(effect(INERTIAS, **{flag: True}), 2.0, 2)])
        assert silent.inertial(arm, q) == [False, False] and silent.mass(arm, q).shape == (4, 3, 3, 2)
    assert Laws().mass(arm, q).shape == (4, 3, 3, 0)


def test_the_mass_matrix_of_bodies_and_laws_is_what_its_columns_add_up_to() -> None:
    arm, q = three_axis(), RNG.normal(size=(5, 3))
    base, laws = BaseParameters.of_arm(arm, rotors=True), Laws([Law(effect(INERTIAS), 2.0, 2)])
    body = body_of(arm, base, laws, fourier_motion(2.0, 100.0, 1))
    theta = RNG.normal(size=base.count + 2)
    np.testing.assert_allclose(body.mass(theta, q), body.columns(q) @ theta, atol=1e-9)
    assert body.positive.tolist() == [*base.positive.tolist(), False, False]
    mixed = Laws([Law(effect(INERTIAS), 2.0, 2), Law(effect(INERTIAS, passive=True), 2.0, 2)])
    body = body_of(arm, base, mixed, fourier_motion(2.0, 100.0, 1))
    assert body.positive.tolist() == [*base.positive.tolist(), False, False, True, True]


def test_a_column_that_is_constant_at_a_joint_and_not_zero_there() -> None:
    columns = np.zeros((6, 3, 2))
    columns[:, 0, 1], columns[:, 1, 0], columns[:, 2, 1] = 0.5, np.arange(6.0), [0.0, 0, 0, 0, 0, 0.9]
    nothing: Any = None
    assert Law.found(nothing, 1.0, columns, 0.5).constant == (0,)
    assert Law.found(nothing, 1.0, columns[:, 1:], 0.5).constant == ()
    columns[:, 2, 0] = -0.25
    assert Law.found(nothing, 1.0, columns, 0.5).constant == (0, 2)
    assert Law(nothing, 1.0, 2).constant == () and Law(nothing, 1.0, 2).gain == 0.0


def test_laws_that_an_arm_may_have_had_all_along() -> None:
    names = {law.name for law in permanent(load_arm("scara"))}
    assert names == {
        *("encoder_offset", "gravity_tilt", "joint_spring", "rotor_inertia", "time_delay"),
        *("torque_delay", "torque_gain", "torque_offset", "torque_ripple", "transmission_coupling"),
        *("upper_end_stop", "lower_end_stop", "coupling_spring", "spring_balancer"),
    }


@pytest.mark.parametrize(
    ("signs", "filtered"),
    [
        ((1.0, 1.0, 1.0), 1),
        ((1.0, -1.0, 1.0), 1),
        ((0.0, 1.0, -1.0), 1),
        ((1.0, 0.0, 2.0), 2),
        ((2.0, 1.0, 1.0), 3),
    ],
)
def test_what_acts_alike_on_several_joints_is_filtered_once(
    signs: tuple[float, ...], filtered: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = []

    def smooth(samples: Any, x: Any) -> Any:
        calls.append(x.shape)
        return 0.5 * x + np.roll(x, 1, axis=0)

    monkeypatch.setattr(catalogue, "smooth", smooth)
    motion = Motion(np.arange(8.0), *np.zeros((3, 8, 3)), np.array([0]))
    samples = Samples(motion, np.zeros((8, 3)), np.ones((8, 3), dtype=bool), 1.0)
    wave = RNG.normal(size=(8, 2))
    columns = np.stack([sign * wave for sign in signs], axis=1)
    found = catalogue._smoothed(samples, 3.0 * columns)
    expected = np.stack([3.0 * sign * (0.5 * wave + np.roll(wave, 1, axis=0)) for sign in signs], axis=1)
    np.testing.assert_allclose(found, expected, atol=1e-12)
    assert calls == [(8, 2)] * filtered


def test_two_motors_are_taken_only_where_one_does_not_do_nearly_as_well() -> None:
    def tried(shapes: int, removed: float) -> Any:
        return (
            SimpleNamespace(complexity=3),
            dict.fromkeys(range(shapes)),
            SimpleNamespace(removed=removed),
            1,
        )

    one, two = tried(1, 0.96), tried(2, 1.0)
    assert catalogue._simplest([two, one]) is one
    assert catalogue._simplest([two, tried(1, 0.5)]) is two


@pytest.mark.parametrize(("passive", "shapes", "asked"), [(True, 2, 1), (False, 2, 0), (True, 3, 0)])
def test_of_two_motors_each_has_friction_and_inertia_of_its_own(
    passive: bool, shapes: int, asked: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another law of two shapes is one of them."""
    calls: list[Any] = []
    monkeypatch.setattr(catalogue, "_smoothed", lambda samples, columns: columns)
    monkeypatch.setattr(catalogue.differential, "both", lambda own, columns, *_: calls.append(columns))
    law: Any = SimpleNamespace(passive=passive, fixed_columns=lambda context, shape: shape)
    nothing: Any = None
    assert catalogue._two_motors(nothing, law, [1.0, -1.0, 2.0][:shapes], nothing, nothing) is None
    assert calls == [[1.0, -1.0]] * asked


@pytest.mark.parametrize(("shapes", "best"), [([1.0, 2.0], 2.0), ([1.0], 4.0)])
def test_a_shape_is_refined_within_those_tried_or_freely_from_one(shapes: list[float], best: float) -> None:
    """Whatever shape was fitted, the better one is 4, and what is removed grows with it."""
    law: Any = SimpleNamespace(
        fixed_columns=lambda context, shape: np.full((1, 1, 1), shape), fixed_refined=lambda x, shape: 4.0
    )
    own: Any = SimpleNamespace(
        trial=lambda columns, new, worth: SimpleNamespace(removed=float(columns[0, 0, 0]), coefficients=None)
    )
    still = Motion(np.zeros(1), *np.zeros((3, 1, 1)), np.array([0]))
    samples = Samples(still, np.zeros((1, 1)), np.ones((1, 1), dtype=bool), 0.0)
    nothing: Any = None
    found = catalogue._best_shape(own, law, shapes, nothing, samples)
    assert found is not None and found[0] == best
