"""A listed effect and an unlisted law of one joint are two things, each with its own parameters."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from rubbing_arm import model_with_baseline, run

from armloop.data.signals import smooth
from armloop.diagnosis import Diagnosis, diagnose
from armloop.laws.effects.found import RANGE
from armloop.model import ReconstructedModel
from armloop.util.arrays import Array

Law = Callable[[Array, Array], Array]


@pytest.fixture(scope="module")
def model() -> ReconstructedModel:
    return model_with_baseline()


def told(
    model: ReconstructedModel, seed: int, *laws: Law, part: float = 0.08
) -> tuple[Diagnosis, list[float]]:
    """The diagnosis of a run with laws at joint 2, each of so much of its torque; and their coefficients."""
    log = run(seed, 30.0)
    shapes = [law(log.q, log.v) for law in laws]
    size = np.sqrt(np.mean(log.tau[:, 1] ** 2))
    coefficients = [float(part * size / np.sqrt(np.mean(x**2))) for x in shapes]
    tau = log.tau.copy()
    tau[:, 1] += np.sum([c * x for c, x in zip(coefficients, shapes, strict=True)], axis=0)
    return diagnose(model, [replace(log, tau=tau)]), coefficients


@pytest.mark.parametrize(
    ("seed", "effect", "listed", "key"),
    [
        (1, "viscous_friction", lambda q, v: v[:, 1], "coefficient"),
        pytest.param(2, "torque_offset", lambda q, v: np.ones(len(v)), "offset", marks=pytest.mark.long),
    ],
)
def test_a_listed_effect_beside_a_law_is_named_as_what_it_is(
    model: ReconstructedModel, seed: int, effect: str, listed: Law, key: str
) -> None:
    found, truth = told(model, seed, listed, lambda q, v: np.cos(2 * q[:, 0]) * v[:, 1])
    named = [(f.effect.name, f.effect.joint) for f in found.outcome.found]
    assert (found.verdict, named) == ("effects_found", [(effect, 2)])
    own = found.outcome.added()[0].parameters[key]
    assert float(own.value) == pytest.approx(truth[0], rel=0.02)
    law = found.unlisted
    assert law is not None and set(law.parameters) - set(RANGE) == {"cos(2*q1)*v2"}
    assert float(law.parameters["cos(2*q1)*v2"].value) == pytest.approx(truth[1], rel=0.02)
    # the law is what is left where it is not adopted, and both are the whole where it is
    alone, adopted = (each.errors()["after"][1] for each in (found, found.adopt()))
    assert adopted < 1.5 * found.evidence.scale[1] < alone
    motion = found.samples.motion
    written = (found.samples.tau - smooth(found.samples, found.model.predict(motion)))[found.sliding[:, 1], 1]
    assert law.rmse == pytest.approx(alone) == pytest.approx(np.sqrt(np.mean(written**2)), rel=0.02)
    strength = found.strengths[0]
    assert strength.times > 3 and found.outcome.found[0].share > 0.2


def test_an_effect_that_cancels_with_a_law_is_no_effect_of_its_own(model: ReconstructedModel) -> None:
    """A torque that grows to either side: an offset of a multiple of it beside cosines, which adds up to it."""
    found, _ = told(model, 1, lambda q, v: np.maximum(np.abs(q[:, 1]) - 0.3, 0.0) ** 2)
    assert (found.verdict, found.outcome.found) == ("unlisted_effect", [])


def test_a_stop_stands_in_for_no_law_of_which_it_leaves_much_that_is_none(model: ReconstructedModel) -> None:
    """To one side of a torque that grows to both a stop is near, and what it leaves is no law of the library."""
    found, _ = told(model, 1, lambda q, v: q[:, 1] ** 4)
    assert (found.verdict, found.outcome.found) == ("unlisted_effect", []) and found.unlisted is not None
    assert found.unlisted.rmse_with_form < 0.2 * found.unlisted.rmse and "upper end stop" in found.reasons[0]


def test_a_cable_that_pulls_taut_is_a_stop(model: ReconstructedModel) -> None:
    """The more it is stretched the stiffer it is; a straight line is as near as the model itself is."""
    found, _ = told(model, 1, lambda q, v: np.maximum(q[:, 1], 0.0) ** 2)
    named = [(f.effect.name, f.effect.joint) for f in found.outcome.found]
    assert (found.verdict, named, found.unlisted) == ("effects_found", [("upper_end_stop", 2)], None)


def test_no_listed_effect_stands_in_for_a_part_of_a_law_that_is_not_met(model: ReconstructedModel) -> None:
    """A wave that the library lacks: terms that come near it leave several times the baseline."""
    found, _ = told(model, 1, lambda q, v: np.sin(3 * q[:, 0] - q[:, 1]))
    assert (found.verdict, found.outcome.found) == ("unlisted_effect", [])


def test_dry_friction_that_depends_on_the_posture_is_more_than_its_mean(model: ReconstructedModel) -> None:
    """Of 1 % of the torque: its mean leaves half a baseline more than the law does."""
    found, truth = told(model, 1, lambda q, v: np.cos(q[:, 0]) * np.sign(v[:, 1]), part=0.01)
    law = found.unlisted
    assert (found.verdict, found.outcome.found) == ("unlisted_effect", []) and law is not None
    assert set(law.parameters) - set(RANGE) == {"cos(q1)*sign(v2)"}
    assert float(law.parameters["cos(q1)*sign(v2)"].value) == pytest.approx(truth[0], rel=0.02)
    assert law.rmse_with_form < 1.1 * law.baseline
    assert found.reasons[0].startswith("coulomb friction at joint 2 would explain 8")
