"""What is said of a model that is no arm."""

from __future__ import annotations

from dataclasses import replace

from armloop.dynamics.physics import PhysicsChecks


def test_what_hardly_any_posture_shows_is_not_said_to_be_none() -> None:
    good = PhysicsChecks(0.1, (0.0,), 0.0, 0.0, (0.0,), (0.0,), (0.0,), None)
    (line,) = replace(good, least=-1e-4).faults()
    assert line.startswith("M(q) is not positive definite everywhere within the joint limits")
    (line,) = replace(good, least=-1e-4, negative=0.25).faults()
    assert "at 25.0% of the postures within the joint limits" in line
