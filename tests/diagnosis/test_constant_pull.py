"""An offset of the torque of a slide that lifts one weight may be a counterweight, and that is said."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from armloop.diagnosis.reasons import of_a_constant_pull
from armloop.laws.effects import Estimate, effect
from armloop.model import AddedEffect
from armloop.robot.arm import load_arm


@pytest.mark.parametrize(
    ("name", "joint", "told"),
    [("torque_offset", 3, True), ("torque_offset", 1, False), ("coulomb_friction", 3, False)],
)
def test_a_slide_that_lifts_one_weight_may_have_another_counterweight(
    name: str, joint: int, told: bool
) -> None:
    arm = load_arm("scara")
    (quill,) = [j for j, one in enumerate(arm.joints, 1) if one.kind == "prismatic"]
    joint = quill if joint == 3 else joint
    key = "offset" if name == "torque_offset" else "level"
    added = AddedEffect(effect(name, joint), {key: Estimate(-39.2, 0.3, "N")})
    model: Any = SimpleNamespace(arm=arm)
    found = of_a_constant_pull(model, [added])
    assert bool(found) == told
    if told:
        (words,) = found
        assert words.startswith(f"joint {quill} lifts one weight at all postures: a counterweight")
        assert "a constant force of -39.20 ± 0.30 N" in words and "must supply as much in addition" in words
