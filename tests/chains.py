"""Chains of joints of any kinds and axes."""

from __future__ import annotations

from pathlib import Path

from armloop.robot.arm import Arm, load_arm

X, Y, Z = "1 0 0", "0 1 0", "0 0 1"
#: An arm of three turning joints on a level rail.
RAIL = [("prismatic", X), ("revolute", Z), ("revolute", Y), ("revolute", Y)]


def arm_of(tmp_path: Path, *joints: tuple[str, str]) -> Arm:
    """A chain of joints, by kind and axis, 0.3 m apart, whose links' centres lie beside their axes."""
    parts = ['<robot name="chain"><link name="base"/>']
    for k, (kind, axis) in enumerate(joints):
        parent = f"link_{k - 1}" if k else "base"
        parts.append(
            f'<joint name="j{k}" type="{kind}"><parent link="{parent}"/><child link="link_{k}"/>'
            f'<origin xyz="0 0 0.3"/><axis xyz="{axis}"/><limit lower="-1" upper="1" effort="9" velocity="9"/></joint>'
            f'<link name="link_{k}"><inertial><origin xyz="0.05 0.02 0.1"/><mass value="{4 - 0.5 * k}"/>'
            '<inertia ixx="0.02" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        )
    path = tmp_path / "chain.urdf"
    path.write_text("".join([*parts, "</robot>"]), encoding="utf-8")
    return load_arm(path)
