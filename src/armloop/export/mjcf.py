"""MJCF of an arm for MuJoCo: armature, damping, frictionloss and springs at the joints."""

from __future__ import annotations

from armloop.export.expressible import Said
from armloop.export.robot_xml import described

FEATURES = frozenset({"damping", "dry", "spring", "gravity"})


def mjcf_text(said: Said) -> str:
    """The arm as MJCF, with a torque drive at each joint; the thin capsules are for the eye only."""
    return described(said, "arm.mjcf.xml")
