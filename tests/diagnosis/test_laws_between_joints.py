"""What acts between two joints acts on both: a tendon's spring is one effect, and of a law that is not listed both halves
are told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from exact_parts import as_it_was
from synthetic import fourier_motion, three_axis
from written_laws import on_joint, run

from armloop.data.motion import Motion
from armloop.diagnosis import Diagnosis, diagnose
from armloop.laws.effects.found import RANGE
from armloop.model import ReconstructedModel
from armloop.reports.diagnosis_tables import effects_table
from armloop.reports.findings import findings, headline


@pytest.fixture(scope="module")
def model() -> ReconstructedModel:
    return as_it_was(run(None, seed=90))


def between(motion: Motion, by: float, torque: np.ndarray) -> np.ndarray:
    """A torque on joint 2, and so many times as much on joint 3."""
    return on_joint(motion, 2, torque) + by * on_joint(motion, 3, torque)


def test_a_spring_over_two_joints_is_named_with_its_ratio(model: ReconstructedModel) -> None:
    def tendon(motion: Motion) -> np.ndarray:
        return between(motion, -0.5, 0.9 * (motion.q[:, 1] - 0.5 * motion.q[:, 2] - 0.2))

    (effect,) = diagnose(model, [run(tendon, seed=7)]).to_dict()["effects"]
    assert (effect["effect"], effect["joint"], effect["other_joint"]) == ("coupling_spring", 2, 3)
    for name, truth in {"stiffness": 0.9, "rest": 0.2, "ratio": -0.5}.items():
        found = effect["parameters"][name]
        assert abs(found["value"] - truth) < 3 * found["std_error"] < 0.1


@pytest.fixture(scope="module")
def waved(model: ReconstructedModel) -> Diagnosis:
    """1.2 sin(2 q2 − q3) is the gradient of a potential, to joint 3 half as much and the other way."""
    return diagnose(model, [run(lambda m: between(m, -0.5, 1.2 * np.sin(2 * m.q[:, 1] - m.q[:, 2])), seed=7)])


def test_a_law_that_is_not_listed_is_told_of_both_joints(waved: Diagnosis) -> None:
    laws = {law.joint: {k: e for k, e in law.parameters.items() if k not in RANGE} for law in waved.laws}
    assert waved.verdict == "unlisted_effect" and list(laws) == [2, 3]
    for joint, size in ((2, 1.2), (3, -0.6)):
        ((name, found),) = laws[joint].items()
        assert name == "sin(2*q2-q3)" and abs(found.value - size) < 4 * found.std_error < 0.1
    entries = waved.to_dict()["effects"]
    assert [(e["effect"], e["joint"], e["adopted"]) for e in entries] == [
        ("unlisted", 2, False),
        ("unlisted", 3, False),
    ]
    errors = waved.errors()
    assert [law.rmse for law in waved.laws] == pytest.approx([errors["after"][1], errors["after"][2]])
    assert waved.standing.left == ()
    # what the laws account for is left to nobody, adopted or not
    assert all(joint["explained"] > 0.999 for joint in waved.standing.joints)


def test_both_are_said_and_adopted(waved: Diagnosis, model: ReconstructedModel) -> None:
    said = findings(waved)
    assert [words.split(" keeps")[0] for words in said[:2]] == ["Joint 2", "Joint 3"]
    assert said[2] == "--adopt puts the laws into the augmented model and its feedforward." and len(said) == 3
    assert headline(waved) == "unlisted effect, joints 2, 3"
    first, second = waved.laws
    assert headline(replace(waved, unlisted=second, further=[first])) == "unlisted effect, joints 2, 3"
    rows = effects_table(waved).rows
    assert [row[0] for row in rows] == ["unlisted, joint 2", "unlisted, joint 3"]
    adopted = waved.adopt()
    assert "The laws are adopted" in findings(adopted)[2]
    after, floor = (np.array(adopted.errors()[key]) for key in ("after", "noise_floor"))
    assert (after < 1.5 * floor).all()
    motion = fourier_motion(5.0, 100.0, 11, three_axis(), size=0.5)
    more = adopted.model.predict(motion) - model.predict(motion)
    truth = between(motion, -0.5, 1.2 * np.sin(2 * motion.q[:, 1] - motion.q[:, 2]))
    np.testing.assert_allclose(more, truth, atol=0.05)
