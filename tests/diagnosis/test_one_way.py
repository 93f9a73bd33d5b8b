"""An offset as large as more friction of the same joint is friction that grew one way; one that differs is a sensor's."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rubbing_arm import model_with_baseline, motion_of, torque
from synthetic import measured

from armloop.diagnosis import diagnose, search
from armloop.diagnosis.fit import Shape
from armloop.diagnosis.one_way import one_way
from armloop.diagnosis.outcomes import Found
from armloop.laws.effects import effect
from armloop.laws.effects.base import Estimate
from armloop.model import AddedEffect


def told(*each: tuple[str, int, float, float]) -> list[tuple[str, int | None]]:
    """What is found of effects with their joints, values and errors."""
    added = [
        AddedEffect(kind := effect(name, joint), {kind.parameters[0].name: Estimate(value, error, "N*m")})
        for name, joint, value, error in each
    ]
    fit: Any = SimpleNamespace(added=lambda: added)
    shape = Shape.fixed(0.0)
    return [
        (f.effect.name, f.effect.joint) for f in one_way([Found(a.effect, shape, 0.5) for a in added], fit)
    ]


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize(
    ("joint", "level", "error", "one"),
    [
        (1, 1.74, 0.41, True),
        (1, 1.74, 0.5, False),  # what is known so poorly agrees with much
        (1, 2.40, 0.3, True),
        (1, 2.50, 0.3, False),
        (2, 1.74, 0.41, False),
        (1, -1.74, 0.41, False),
    ],
)
def test_two_that_agree_have_one_cause(sign: int, joint: int, level: float, error: float, one: bool) -> None:
    found = told(("torque_offset", 1, sign * 1.84, 0.05), ("coulomb_friction", joint, level, error))
    assert found == [("friction_asymmetry" if one else "torque_offset", 1), ("coulomb_friction", joint)]


def test_an_offset_by_itself_and_beside_other_laws_stays() -> None:
    assert told(("torque_offset", 2, 1.0, 0.1)) == [("torque_offset", 2)]
    assert told(("torque_offset", 2, 1.0, 0.1), ("viscous_friction", 2, 1.0, 0.1))[0] == ("torque_offset", 2)
    assert told() == []


@pytest.mark.parametrize("way", [1, -1])
def test_friction_that_grew_one_way_is_told_with_the_sensor_as_its_alternative(way: int) -> None:
    """0.5 N·m more at joint 2 in one direction: half of it as friction of both, and half as a constant."""
    motion = motion_of(7, 40.0)
    grown = 0.25 * (np.tanh(motion.v / 1e-4) + way) * np.eye(3)[1]
    found = diagnose(model_with_baseline(), [measured(motion, torque(motion) + grown, 7, 0.01)], jobs=1)
    assert sorted(found.named) == [("coulomb_friction", 2), ("friction_asymmetry", 2)]
    told = {effect["effect"]: effect for effect in found.to_dict()["effects"]}
    for name, sign in (("coulomb_friction", 1), ("friction_asymmetry", way)):
        level = told[name]["parameters"]["level"]
        assert abs(level["value"] - sign * 0.25) < 4 * level["std_error"]
    alternatives = [(one["effect"], one["joint"]) for one in told["friction_asymmetry"]["alternatives"]]
    assert ("torque_offset", 2) in alternatives


@pytest.mark.parametrize("stays", [True, False])
def test_one_cause_is_told_where_it_is_stated_as_the_two_were(
    stays: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And what is masked by the model's own errors stays so."""
    told_again: Any = SimpleNamespace(place="both")
    monkeypatch.setattr(search, "one_way", lambda found, fit: [told_again, *found[1:]])
    monkeypatch.setattr(search, "replace", lambda outcome, masked: (outcome.found, masked))
    settled: Any = SimpleNamespace(
        _settled=lambda found: SimpleNamespace(found=found if stays else found[1:], masked=())
    )
    before: Any = SimpleNamespace(found=["offset", "friction"], after=None, masked=("hidden",))
    made: Any = search._Search.of_one_cause(settled, before)
    assert made == (([told_again, "friction"], ("hidden",)) if stays else before)
    monkeypatch.setattr(search, "one_way", lambda found, fit: [*found])
    assert search._Search.of_one_cause(settled, before) is before
