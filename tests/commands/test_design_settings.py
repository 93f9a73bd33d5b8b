"""The settings of a designed experiment: what is not given comes from the arm and the model."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from armloop.commands.excite import settings_for
from armloop.robot.arm import load_arm


def model(rmse: Any) -> Any:
    return SimpleNamespace(baseline={"rmse": rmse})


@pytest.mark.parametrize(
    ("given", "left", "noise"),
    [
        ((1.0, 2.0, 3.0), [0.4, 0.5, 0.6], (1.0, 2.0, 3.0)),
        (None, [0.4, 0.5, 0.6], (0.4, 0.5, 0.6)),
        (None, None, None),
    ],
)
def test_the_noise_is_what_the_model_leaves_unless_it_is_given(given: Any, left: Any, noise: Any) -> None:
    assert settings_for(load_arm("three_axis"), model(left), given, {"library": None}).noise == noise


def test_without_a_model_it_is_none() -> None:
    assert settings_for(load_arm("three_axis"), None, None, {"library": None}).noise is None
