"""What is looked at of a set of gains: where, how long, in which units, and which of it is the worst."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from armloop.drake.tuning import tuned_loop
from armloop.drake.tuning.loop_analysis import LoopMargins


def looked_at(
    bandwidths: list[float], monkeypatch: pytest.MonkeyPatch, **of: Any
) -> tuple[Any, dict[str, Any]]:
    """Of an arm with one joint that turns and one that slides, whose reference goes from 0 to 10 in ten seconds."""
    asked: dict[str, Any] = {"postures": [], "points": [], "steps": []}

    def margins(sampled: Any, gains: Any, points: int = 2000) -> list[LoopMargins]:
        asked["points"].append(points)
        return [
            LoopMargins(2.0, 0.0, 60.0 + j - sampled.q, b, 1.5 + sampled.q / 100)
            for j, b in enumerate(bandwidths)
        ]

    def sample(q: Any, period: float) -> Any:
        asked["postures"].append(q)
        return SimpleNamespace(
            q=q, loops=lambda gains, w: (gains, w), is_stable=lambda gains: q != of.get("unstable")
        )

    def step(sampled: Any, gains: Any, unit: np.ndarray, duration: float) -> Any:
        asked["unit"], asked["duration"] = unit, duration
        return np.arange(3.0), np.tile(unit, (3, 1))

    def simulated(plant: Any, gains: Any, q0: Any, unit: np.ndarray, duration: float, *, dry: bool) -> Any:
        asked["steps"].append((q0, dry, duration))
        return np.arange(3.0), np.tile(unit * (0.5 if dry else 0.9), (3, 1))

    def posture(arm: Any, friction: Any, q: Any, effects: Any) -> float:
        assert effects == ("rotors",)
        return float(q[0])

    monkeypatch.setattr(tuned_loop, "posture_model", posture)
    monkeypatch.setattr(tuned_loop, "SampledArm", SimpleNamespace(of=sample))
    monkeypatch.setattr(tuned_loop, "sampled_margins", margins)
    monkeypatch.setattr(tuned_loop, "cut_loop", lambda L, i: (i + 1) * L[1])
    monkeypatch.setattr(tuned_loop, "linear_step", step)
    monkeypatch.setattr(tuned_loop, "simulated_step", simulated)
    monkeypatch.setattr(tuned_loop, "replace", lambda scenario, **changes: changes)
    monkeypatch.setattr(tuned_loop, "run_tracking", lambda scenario, models: scenario)
    arm = SimpleNamespace(n=2, revolute=np.array([True, False]))
    scenario: Any = SimpleNamespace(
        plant=SimpleNamespace(
            arm=arm,
            config=SimpleNamespace(
                time_step=0.01, friction=None, with_rotors=lambda effects=(): ("rotors", *effects)
            ),
        ),
        reference=SimpleNamespace(
            duration=10.0,
            evaluate=lambda t: (np.repeat(np.atleast_1d(np.asarray(t, dtype=float))[:, None], 2, 1),) * 3,
        ),
    )
    gains: Any = "gains"
    return tuned_loop.evaluate_gains(scenario, gains), asked


def test_at_the_start_and_along_the_reference(monkeypatch: pytest.MonkeyPatch) -> None:
    found, asked = looked_at([50.0, 10.0], monkeypatch)
    assert_allclose(asked["postures"], [0.0, *range(10)])
    assert asked["points"] == [2000] + [500] * 10
    assert [m.phase_margin for m in found.margins] == [60.0, 61.0]
    assert_allclose(found.worst[0], [51.0, 52.0])
    assert_allclose(found.worst[1], [1.59, 1.59])
    assert found.stable and not looked_at([50.0, 10.0], monkeypatch, unstable=7.0)[0].stable
    assert found.tracking == {"gains": "gains", "controllers": ("pid", "exact"), "effects": ()}
    assert len(found.w) == 600 and found.w[[0, -1]] == pytest.approx([0.1, np.pi / 0.01])
    assert_allclose(found.loops, np.stack([found.w, 2 * found.w], axis=1))


def test_a_degree_and_a_millimetre(monkeypatch: pytest.MonkeyPatch) -> None:
    found, asked = looked_at([50.0, 10.0], monkeypatch)
    assert_allclose(asked["unit"], [np.deg2rad(1.0), 1e-3])
    assert_allclose(found.linear, 1.0)
    assert_allclose(found.smooth, 0.9)
    assert_allclose(found.dry, 0.5)
    assert_allclose(found.deviation(), 0.1)
    assert [dry for _, dry, _ in asked["steps"]] == [False, True]
    # the largest deviation of each joint, either way, at any time
    assert np.isnan(replace(found, stable=False).deviation()).all()
    apart = np.array([[0.1, 0.0], [0.3, -0.4], [0.2, 0.1]])
    assert_allclose(replace(found, smooth=found.linear - apart).deviation(), [0.3, 0.4])


@pytest.mark.parametrize(
    ("bandwidths", "duration"),
    [([50.0, 10.0], 2.5), ([50.0, 1.0], 5.0), ([900.0, 500.0], 0.3), ([17.0, 20.0], 1.47)],
)
def test_as_long_as_the_slowest_loop_takes(
    bandwidths: list[float], duration: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    _, asked = looked_at(bandwidths, monkeypatch)
    assert asked["duration"] == pytest.approx(duration)
    assert [seconds for *_, seconds in asked["steps"]] == [asked["duration"]] * 2
