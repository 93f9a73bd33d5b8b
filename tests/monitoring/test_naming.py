"""What is named from sums must be more than rounding errors, and must not be how warm the arm is."""

from dataclasses import replace

import numpy as np
import pytest
from operation import healthy_model

from armloop.laws.effects.listed import EFFECTS
from armloop.monitoring.catalogue import Column, stays_nonlinear, watched
from armloop.monitoring.naming import Normal, name_change, usual
from armloop.monitoring.warmth import warms, without_warmth


def test_only_a_body_needs_all_of_its_columns() -> None:
    model = healthy_model()
    coefficients = {"payload": 10, "gravity_tilt": 8}
    curved = {e.name for e, _ in watched(model) if stays_nonlinear(e, coefficients.get(e.name, 2))}
    assert curved == {"payload"}


def test_a_column_of_rounding_errors_explains_nothing() -> None:
    # what an encoder's offset at a vertical first axis does to the weight is zero but for rounding
    columns = (Column("encoder_offset", 1, None, 0), Column("coulomb_friction", 2, None, 0))
    rng = np.random.default_rng(0)
    X = rng.standard_normal((8, 100, 2)) * [1e-13, 1.0]
    u = 0.5 * X[:, :, 1] + 0.2 * rng.standard_normal((8, 100)) + 3e12 * X[:, :, 0]
    normal = Normal(
        np.einsum("unp,unq->upq", X, X), np.einsum("unp,un->up", X, u), np.einsum("un,un->u", u, u)
    )
    named = name_change(healthy_model().arm, columns, None, normal)
    assert [one.place[0] for one in named] == ["coulomb_friction"]


def test_a_coordinate_that_shows_nowhere_is_not_stated() -> None:
    """A base that leans about the only axis that turns: of that angle nothing is known."""
    columns = tuple(Column("gravity_tilt", None, None, k) for k in range(4))
    rng = np.random.default_rng(0)
    X = rng.standard_normal((8, 100, 4)) * [1.0, 0.0, 1.0, 1.0]
    u = 0.05 * X[:, :, 0] + 0.02 * rng.standard_normal((8, 100))
    normal = Normal(
        np.einsum("unp,unq->upq", X, X), np.einsum("unp,un->up", X, u), np.einsum("un,un->u", u, u)
    )
    (named,) = name_change(healthy_model().arm, columns, None, normal)
    roll, pitch = (named.parameters[key] for key in ("roll", "pitch"))
    assert (
        roll.value == pytest.approx(0.05, abs=4 * float(roll.std_error)) and 0 < float(roll.std_error) < 0.01
    )
    assert np.isnan(pitch.std_error)
    assert "pitched by what the motion does not show about y" in named.words


def test_what_warmth_makes_of_friction_is_taken_out_of_the_sums() -> None:
    rng = np.random.default_rng(0)
    columns = (
        Column("viscous_friction", 1, None, 0),
        Column("coulomb_friction", 1, None, 0),
        Column("joint_spring", 1, None, 0),
    )
    warmth = rng.uniform(-1, 1, (24, 1))
    level, slope = np.array([1.0, 0.5, 2.0]), np.array([-0.3, -0.1, 0.0])
    X = rng.standard_normal((24, 200, 3))
    u = np.einsum("unp,up->un", X, level + slope * warmth)
    whole = Normal(
        np.einsum("unp,unq->upq", X, X), np.einsum("unp,un->up", X, u), np.einsum("un,un->u", u, u)
    )
    healthy = replace(whole, gram=whole.gram[:12], moment=whole.moment[:12], energy=whole.energy[:12])
    later = replace(whole, gram=whole.gram[12:], moment=whole.moment[12:], energy=whole.energy[12:])
    cleared = without_warmth(columns, healthy, warmth[:12], later, warmth[12:])
    # without the dependence every unit has the same coefficients; the ridge leaves a thousandth of it
    for gram, moment, energy in zip(cleared.gram, cleared.moment, cleared.energy, strict=True):
        found = np.linalg.solve(gram, moment)
        assert found == pytest.approx(level, abs=2e-3)
        assert energy == pytest.approx(found @ gram @ found, rel=1e-3)
    same = without_warmth(columns, healthy, 0 * warmth[:12], later, warmth[12:])
    assert same is later


def test_every_friction_follows_the_warmth_and_what_it_leaks_into() -> None:
    """A joint's drag by direction gets less with the warmth as its viscous friction does; a load does not."""
    leaks = {"rotor_inertia", "torque_gain", "residual_energy"}
    followed = {name for name in [*EFFECTS, "residual_energy", "of_nobody"] if warms(name)}
    assert followed == leaks | {name for name, kind in EFFECTS.items() if kind.rubs}
    assert "viscous_asymmetry" in followed and "payload" not in followed


class TestUsual:
    """Twenty columns and ten healthy units of a motion that hardly turns most of them."""

    @staticmethod
    def normal(level: float, units: int = 10) -> Normal:
        """White noise, and a coefficient of the first column."""
        rng = np.random.default_rng(2)
        X = rng.standard_normal((units, 30, 20)) * np.geomspace(1.0, 1e-2, 20)
        u = level * X[:, :, 0] + rng.standard_normal((units, 30))
        return Normal(
            np.einsum("unp,unq->upq", X, X), np.einsum("unp,un->up", X, u), np.einsum("un,un->u", u, u)
        )

    def test_noise_is_nothing_usual(self) -> None:
        assert not usual(self.normal(0.0)).any()

    def test_what_comes_back_in_every_unit_is(self) -> None:
        found = usual(self.normal(2.0))
        # 300 samples determine it to a twentieth; a ridge shrinks it by no more than its part
        assert found[0] == pytest.approx(2.0, abs=0.25)
        # what the motion hardly shows is not made up: its torque is small beside the noise
        assert (np.abs(found[1:]) * np.geomspace(1.0, 1e-2, 20)[1:] < 0.25).all()

    def test_of_one_unit_nothing_can_be_left_out(self) -> None:
        one = self.normal(2.0, units=1)
        assert usual(one)[0] == pytest.approx(2.0, abs=0.8)

    def test_what_was_usual_is_no_change(self) -> None:
        """A bias of the first column that was there before, and one of the second that was not."""
        rng = np.random.default_rng(3)
        columns = (Column("viscous_friction", 1, None, 0), Column("viscous_friction", 2, None, 0))
        X = rng.standard_normal((16, 100, 2))
        u = X[:, :, 0] + 0.1 * rng.standard_normal((16, 100))
        u[8:] += 0.5 * X[8:, :, 1]
        G, b, energy = (
            np.einsum("unp,unq->upq", X, X),
            np.einsum("unp,un->up", X, u),
            np.einsum("un,un->u", u, u),
        )
        healthy, window = (Normal(G[part], b[part], energy[part]) for part in (slice(8), slice(8, 16)))
        (named,) = name_change(healthy_model().arm, columns, healthy, window)
        assert named.place[:2] == ("viscous_friction", 2)
        both = name_change(healthy_model().arm, columns, None, window)
        assert {one.place[1] for one in both} == {1, 2}
