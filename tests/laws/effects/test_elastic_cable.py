"""A cable from a fixed point to a link: the gradient of its energy, slack where it is short, and what of it is possible."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from effect_arm import an_arm

from armloop.data.motion import Motion
from armloop.laws.effects import EFFECTS, Context, Estimate, effect
from armloop.laws.effects.elastic_cable import Cable, ElasticCable
from armloop.robot.arm import Arm, load_arm
from armloop.robot.kinematics import LinkPoses

RNG = np.random.default_rng(4)
CABLE = Cable(2, (0.4, 0.5, 0.6), (0.1, -0.05, 0.02), 0.55, False, tuple(0.01 * np.arange(1, 10)))
P = {
    "stiffness": 40.0,
    "slack_length": 0.55,
    "anchor": [0.4, 0.5, 0.6],
    "attached": [0.1, -0.05, 0.02],
    "link": 2.0,
    "pushes": 0.0,
}


def context(arm: Arm, q: np.ndarray) -> Context:
    still = np.zeros_like(q)
    return Context(arm, Motion(np.arange(float(len(q))), q, still, still, np.array([0])))


@pytest.mark.parametrize("arm", [an_arm(), load_arm("scara")], ids=lambda arm: str(arm.name))
@pytest.mark.parametrize(("link", "pushes"), [(1, 0.0), (3, 0.0), (3, 1.0)])
def test_the_torque_is_the_gradient_of_the_energy_of_its_stretch(arm: Arm, link: int, pushes: float) -> None:
    """The third joint of a SCARA slides."""
    q = RNG.uniform(-0.5, 0.5, (40, arm.n))

    def length(q: np.ndarray) -> np.ndarray:
        poses = LinkPoses.of(arm, q)
        point = poses.p[link - 1] + poses.R[link - 1] @ np.array([0.1, -0.05, 0.02])
        return np.asarray(np.linalg.norm(point - [0.4, 0.5, 0.6], axis=1))

    slack = float(np.median(length(q)))
    given = {**P, "slack_length": slack, "link": float(link), "pushes": pushes}
    tau = ElasticCable().torque(context(arm, q), given)
    steps = 1e-6 * np.eye(arm.n)
    least = -np.inf if pushes else 0.0
    energy = [[20.0 * np.maximum(length(q + s * h) - slack, least) ** 2 for s in (1, -1)] for h in steps]
    gradient = np.stack([(up - down) / 2e-6 for up, down in energy], axis=1)
    np.testing.assert_allclose(tau, gradient, atol=1e-6)
    taut = length(q) > slack
    assert tau[taut].any() and tau[~taut].any() == bool(pushes) and not tau[:, link:].any()


def test_its_column_is_the_torque_of_a_unit_stiffness_where_it_was_found_to_run() -> None:
    other = replace(CABLE, slack_length=0.2, pushes=True)
    kind, here = ElasticCable(cables=[CABLE, other]), context(an_arm(), RNG.uniform(-1, 1, (6, 3)))
    assert kind.shapes(here) == (CABLE.key, other.key)
    assert len({CABLE.key, other.key, replace(CABLE, pushes=True).key, replace(CABLE, link=1).key}) == 4
    for cable in (CABLE, other):
        given = {**P, "slack_length": cable.slack_length, "pushes": float(cable.pushes)}
        expected = kind.torque(here, given) / 40.0
        np.testing.assert_allclose(kind.columns(here, cable.key)[:, :, 0], expected, atol=1e-12)


def test_it_is_stated_with_the_errors_of_where_it_runs() -> None:
    kind = ElasticCable(cables=[CABLE])
    found = kind.estimates(an_arm(), np.array([40.0]), np.zeros((1, 1)), CABLE.key)
    assert {**{key: e.value for key, e in found.items()}, "pushes": 0.0} == P and "pushes" not in found
    errors = np.hstack([e.std_error for e in found.values()])
    np.testing.assert_allclose(errors, 0.01 * np.arange(1, 10))
    pushing = ElasticCable(cables=[replace(CABLE, pushes=True)])
    (key,) = pushing.cables
    stated = pushing.estimates(an_arm(), np.array([40.0]), np.zeros((1, 1)), key)
    assert (stated["pushes"].value, stated["pushes"].std_error) == (1.0, 0.0)
    assert (
        "pulls link 2 ± 0.1 at (0.100 ± 0.060, -0.050 ± 0.070, 0.020 ± 0.080) m in its frame towards (0.400 ± 0.030, "
        "0.500 ± 0.040, 0.600 ± 0.050) m in the base frame with 40.000 ± 0.010 N/m, once it is longer than 0.550 ± 0.020 m"
    ) in kind.sentence(found)
    spring = {**found, "pushes": Estimate(1.0, 0.0, "1")}
    assert "a spring holds link 2 ± 0.1 at" in kind.sentence(spring)
    assert "at 0.550 ± 0.020 m from (" in kind.sentence(spring) and kind.sentence(spring).endswith(
        "pulls and pushes"
    )
    sure = {**found, "link": Estimate(2.0, 0.01, "1"), "anchor": Estimate([0.4, 0.5, 0.6], float("nan"), "m")}
    assert "pulls link 2 at" in kind.sentence(sure) and "towards (0.400, 0.500, 0.600) m" in kind.sentence(
        sure
    )

    for error, told in ((19.9, True), (20.0, False), (float("nan"), False)):
        vague = {**found, "stiffness": Estimate(40.0, error, "N/m")}
        assert kind.sentence(vague).startswith(
            "an elastic cable" if told else "something elastic pulls at link 2 ± 0.1,"
        )
        assert ("this run does not tell: 40 N/m from (0.4" in kind.sentence(vague)) != told


@pytest.mark.parametrize(
    ("of", "possible"),
    [({}, True), ({"stiffness": -1.0}, False), ({"link": 3.0}, True), ({"link": 4.0}, False)],
)
def test_it_pulls_at_a_link_that_is_there(of: dict[str, float], possible: bool) -> None:
    estimates = {key: Estimate(value, 0.0, "") for key, value in {**P, **of}.items()}
    assert effect("elastic_cable", None).plausible(an_arm(), estimates) == possible


@pytest.mark.parametrize(("link", "right"), [(1.0, True), (3.0, True), (0.5, False), (2.5, False)])
def test_links_are_whole_and_counted_from_one(link: float, right: bool) -> None:
    assert (ElasticCable.fault({**P, "link": link}) == "") == right


@pytest.mark.parametrize(("pushes", "right"), [(0.0, True), (1.0, True), (0.5, False)])
def test_it_pushes_or_it_does_not(pushes: float, right: bool) -> None:
    assert (ElasticCable.fault({**P, "pushes": pushes}) == "") == right
    said = {key: value for key, value in P.items() if key != "pushes"}
    assert ElasticCable.fault(said) == "" and EFFECTS["elastic_cable"].parameters[-1].default == 0.0


def test_where_the_point_is_at_the_anchor_there_is_no_torque_and_no_fault() -> None:
    q = np.zeros((1, 3))
    poses = LinkPoses.of(an_arm(), q)
    at = (poses.p[1] + poses.R[1] @ np.array([0.1, -0.05, 0.02]))[0].tolist()
    tau = ElasticCable().torque(context(an_arm(), q), {**P, "slack_length": 0.0, "anchor": at})
    np.testing.assert_allclose(tau, 0.0, atol=1e-6)
