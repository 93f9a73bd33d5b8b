"""URDF and SDFormat of an arm, in SI units, with the tags that Drake reads beside them."""

from __future__ import annotations

from xml.sax.saxutils import quoteattr

import numpy as np

from armloop import __version__
from armloop.export.expressible import Said, body_of
from armloop.robot.arm import Joint
from armloop.util.arrays import Array

UNITS = (
    "SI units: kg, m, rad, s, N, N*m. damping: N*m*s/rad (N*s/m). friction: the level of dry (Coulomb) friction in N*m "
    "(N), not a coefficient. rotor_inertia: the drive's, seen at the joint, kg*m^2 (kg)."
)
URDF_FEATURES = frozenset({"damping"})
SDF_FEATURES = frozenset({"damping", "spring"})


def urdf_text(said: Said) -> str:
    """The arm as URDF. Drake reads damping and its own tags for the rotors, and drops friction."""
    arm = said.arm
    lines = [
        '<?xml version="1.0"?>',
        f"<!-- {comment(arm.name)}, reconstructed by armloop {__version__}. {UNITS} -->",
        f'<robot name={quoteattr(arm.name)} xmlns:drake="http://drake.mit.edu">',
        '  <link name="world"/>',
        '  <link name="base_link"/>',
        '  <joint name="world_to_base" type="fixed"><parent link="world"/><child link="base_link"/></joint>',
    ]
    for i, joint in enumerate(arm.joints):
        mass, com, inertia = body_of(said.links[10 * i : 10 * i + 10])
        lines += [
            f'  <link name="link_{i + 1}">',
            "    <inertial>",
            f'      <origin xyz="{numbers(com)}" rpy="0 0 0"/>',
            f'      <mass value="{mass!r}"/>',
            f"      <inertia {_tensor(inertia)}/>",
            "    </inertial>",
            "  </link>",
        ]
        parent = "base_link" if i == 0 else f"link_{i}"
        xyz, rpy = _pose(arm.X_PF[i])
        kind = joint.kind
        if kind == "revolute" and not (np.isfinite(joint.lower) and np.isfinite(joint.upper)):
            kind = "continuous"
        lines += [
            f'  <joint name={quoteattr(joint.name)} type="{kind}">',
            f'    <parent link="{parent}"/><child link="link_{i + 1}"/>',
            f'    <origin xyz="{xyz}" rpy="{rpy}"/>',
            f'    <axis xyz="{numbers(arm.axis[i])}"/>',
            f"    <limit {_limits(joint)}/>",
            f'    <dynamics damping="{float(said.damping[i])!r}" friction="{float(said.dry[i])!r}"/>',
            "  </joint>",
        ]
    if not np.allclose(arm.X_tool, np.eye(4), atol=0):
        xyz, rpy = _pose(arm.X_tool)
        lines += [
            '  <link name="tool"/>',
            f'  <joint name="link_{arm.n}_to_tool" type="fixed"><parent link="link_{arm.n}"/><child link="tool"/>'
            f'<origin xyz="{xyz}" rpy="{rpy}"/></joint>',
        ]
    for i, joint in enumerate(arm.joints):
        lines += [
            f'  <transmission name="transmission_{i + 1}">',
            "    <type>transmission_interface/SimpleTransmission</type>",
            f"    <joint name={quoteattr(joint.name)}/>",
            f'    <actuator name="drive_{i + 1}">',
            f'      <drake:rotor_inertia value="{float(said.rotors[i])!r}"/>',
            '      <drake:gear_ratio value="1"/>',
            "    </actuator>",
            "  </transmission>",
        ]
    return "\n".join([*lines, "</robot>"]) + "\n"


def sdf_text(said: Said) -> str:
    """The arm as SDFormat. Drake reads damping, springs and its own tags for the rotors, and drops friction."""
    arm = said.arm
    lines = [
        '<?xml version="1.0"?>',
        f"<!-- {comment(arm.name)}, reconstructed by armloop {__version__}. {UNITS} -->",
        '<sdf version="1.9" xmlns:drake="http://drake.mit.edu">',
        f"<model name={quoteattr(arm.name)}>",
        '  <link name="base_link"/>',
        '  <joint name="world_to_base" type="fixed"><parent>world</parent><child>base_link</child></joint>',
    ]
    for i, joint in enumerate(arm.joints):
        mass, com, inertia = body_of(said.links[10 * i : 10 * i + 10])
        parent = "base_link" if i == 0 else f"link_{i}"
        xyz, rpy = _pose(arm.X_PF[i])
        ends = {
            "lower": joint.lower,
            "upper": joint.upper,
            "effort": joint.effort,
            "velocity": joint.velocity,
        }
        limits = "".join(
            f"<{key}>{float(value)!r}</{key}>" for key, value in ends.items() if np.isfinite(value)
        )
        springs = ""
        if said.stiffness[i]:
            springs = (
                f"<spring_stiffness>{float(said.stiffness[i])!r}</spring_stiffness>"
                f"<spring_reference>{float(said.rest[i])!r}</spring_reference>"
            )
        tensor = "".join(f"<{key}>{value!r}</{key}>" for key, value in _entries(inertia))
        lines += [
            f'  <link name="link_{i + 1}">',
            f'    <pose relative_to="{parent}">{xyz} {rpy}</pose>',
            f"    <inertial><pose>{numbers(com)} 0 0 0</pose>",
            f"      <mass>{mass!r}</mass><inertia>{tensor}</inertia></inertial>",
            "  </link>",
            f'  <joint name={quoteattr(joint.name)} type="{joint.kind}">',
            f"    <parent>{parent}</parent><child>link_{i + 1}</child>",
            f"    <axis><xyz>{numbers(arm.axis[i])}</xyz>",
            f"      <limit>{limits}</limit>",
            f"      <dynamics><damping>{float(said.damping[i])!r}</damping>"
            f"<friction>{float(said.dry[i])!r}</friction>{springs}</dynamics></axis>",
            f"    <drake:rotor_inertia>{float(said.rotors[i])!r}</drake:rotor_inertia>"
            "<drake:gear_ratio>1</drake:gear_ratio>",
            "  </joint>",
        ]
    if not np.allclose(arm.X_tool, np.eye(4), atol=0):
        xyz, rpy = _pose(arm.X_tool)
        lines.append(f'  <frame name="tool" attached_to="link_{arm.n}"><pose>{xyz} {rpy}</pose></frame>')
    return "\n".join([*lines, "</model>", "</sdf>"]) + "\n"


def roll_pitch_yaw(R: Array) -> Array:
    """(3,) angles with R = R_z(yaw) R_y(pitch) R_x(roll)."""
    pitch = np.arctan2(-R[2, 0], np.hypot(R[0, 0], R[1, 0]))
    if np.hypot(R[0, 0], R[1, 0]) < 1e-9:  # straight up or down, roll and yaw are one angle
        return np.array([np.arctan2(-R[1, 2], R[1, 1]), pitch, 0.0])
    return np.array([np.arctan2(R[2, 1], R[2, 2]), pitch, np.arctan2(R[1, 0], R[0, 0])])


def _pose(X: Array) -> tuple[str, str]:
    return numbers(X[:3, 3]), numbers(roll_pitch_yaw(X[:3, :3]))


def _limits(joint: Joint) -> str:
    ends = {"lower": joint.lower, "upper": joint.upper}
    found = [f'{key}="{float(value)!r}"' for key, value in ends.items() if np.isfinite(value)]
    # URDF demands both; a large number stands for none.
    found += [f'{key}="{min(float(getattr(joint, key)), 1e6)!r}"' for key in ("effort", "velocity")]
    return " ".join(found)


def _entries(inertia: Array) -> list[tuple[str, float]]:
    places = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
    return [(key, float(inertia[place])) for key, place in places.items()]


def _tensor(inertia: Array) -> str:
    return " ".join(f'{key}="{value!r}"' for key, value in _entries(inertia))


def numbers(values: Array) -> str:
    """Numbers of an attribute, to the last digit."""
    return " ".join(repr(float(x)) for x in values)


def comment(text: str) -> str:
    """Text that cannot end a comment."""
    return text.replace("--", "- -")
